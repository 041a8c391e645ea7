//! Touches: faces of blocks at three feeds, all faces at once and later, artefacts, poses of the rotary axes.

use machine::MachineFile;
use machine::file::{ArtefactEntry, AxisEntry};

use super::super::instruments::Means;
use super::{Offer, SetUp, short};

/// Faces of blocks that are looked at.
const MOST_FACES: usize = 9;
/// Artefacts that are looked at.
const MOST_ARTEFACTS: usize = 6;
/// Spheres that are touched at several poses.
const MOST_SPHERES: usize = 2;
/// Feeds of touches over the usual one.
const FEEDS: [f64; 3] = [0.5, 1.0, 4.0];
/// Time until everything is touched once more, min.
const LATER_MIN: f64 = 10.0;

pub(super) fn set_up() -> SetUp {
    SetUp {
        name: "probe".to_owned(),
        means: Means::Probe,
        words: "Put the touch probe into the spindle, with the stylus that the machine file has mounted, and leave it there for all \
                touches. Blocks and artefacts stand where the machine file has them."
            .to_owned(),
    }
}

pub(super) fn offers(machine: &MachineFile) -> Vec<Offer> {
    let set_up = set_up();
    let mut all = Vec::new();
    let usual = machine.probe.feed_mm_min;
    let feeds = FEEDS.map(|share| format!("{:.1}", share * usual));
    let faces = machine.blocks.iter();
    let faces = faces.flat_map(|block| ["x", "y", "z"].map(|face| format!("{}.{face}", block.id)));
    for face in faces.take(MOST_FACES) {
        let words = FEEDS.map(|share| short(share * usual));
        let title = format!(
            "touches of {face} at F{}, F{} and F{}",
            words[0], words[1], words[2]
        );
        let step = format!(
            "{{do: latency, feature: {face:?}, feeds_mm_min: [{}], repeats: 2}}",
            feeds.join(", ")
        );
        all.push(Offer::new(title, &set_up, step));
    }
    if !machine.blocks.is_empty() {
        all.push(Offer::new(
            "touches of all faces of the blocks".to_owned(),
            &set_up,
            "{do: blocks}".to_owned(),
        ));
        let mut later = Offer::new(
            format!(
                "all faces of the blocks, and again {} min later",
                short(LATER_MIN)
            ),
            &set_up,
            "{do: blocks}".to_owned(),
        );
        later
            .steps
            .push(format!("{{do: wait, seconds: {:.1}}}", 60.0 * LATER_MIN));
        later.steps.push("{do: blocks}".to_owned());
        later.most_repeats = 1;
        all.push(later);
    }
    for artefact in machine.artefacts.iter().take(MOST_ARTEFACTS) {
        let (id, points) = match artefact {
            ArtefactEntry::Plane { id, .. } => (id, 3),
            ArtefactEntry::Sphere { id, .. }
            | ArtefactEntry::Bore { id, .. }
            | ArtefactEntry::Boss { id, .. } => (id, 12),
        };
        let title = format!("touches of {id}");
        let step = format!("{{do: artefact, id: {id:?}, points: {points}}}");
        all.push(Offer::new(title, &set_up, step));
    }
    all.extend(rotary(machine, &set_up));
    all
}

fn rotary(machine: &MachineFile, set_up: &SetUp) -> Vec<Offer> {
    let turns = |entry: &AxisEntry| matches!(entry, AxisEntry::Rotary(_));
    if !machine.axes.values().any(turns) {
        return vec![];
    }
    let spheres = machine
        .artefacts
        .iter()
        .filter_map(|artefact| match artefact {
            ArtefactEntry::Sphere { id, .. } => Some(id),
            _ => None,
        });
    let offer = |id: &String| {
        Offer::new(
            format!("sphere {id} at 8 poses of the rotary axes"),
            set_up,
            format!("{{do: rotary, sphere: {id:?}, planned: 8, points: 6}}"),
        )
    };
    spheres.take(MOST_SPHERES).map(offer).collect()
}
