//! Positioning, scans and diagonals along the beams of a length reference.

use machine::MachineFile;
use machine::file::BeamEntry;

use super::super::instruments::Means;
use super::{Offer, SetUp, short};

/// Beams that are looked at.
const MOST_BEAMS: usize = 6;
/// Numbers of targets of a positioning run.
const TARGETS: [u32; 2] = [9, 21];
/// Feeds of scans, mm/min.
const STRAIGHT_FEEDS_MM_MIN: [f64; 2] = [1000.0, 4000.0];
/// Way of a beam at each end that a run leaves, as a share of it, and at most, mm.
const END_MARGIN: (f64, f64) = (0.12, 60.0);
/// How much of that margin the axis overruns its outer targets.
const OVERRUN: f64 = 0.6;

pub(super) fn offers(machine: &MachineFile) -> Vec<Offer> {
    let beams = machine.length_reference.iter();
    let beams = beams.flat_map(|length| &length.beams).take(MOST_BEAMS);
    beams.flat_map(along).collect()
}

fn along(beam: &BeamEntry) -> Vec<Offer> {
    let set_up = set_up(beam);
    let id = &beam.id;
    let Some(axis) = beam.axis() else {
        let title = format!("diagonal along beam {id}, 11 targets up and down");
        let step = format!(
            "{{do: diagonals, beams: [{id:?}], targets: 11, runs: 1, dwell_s: 1.0, \
             feed_mm_min: 3000.0, overrun_mm: 5.0}}"
        );
        return vec![Offer::new(title, &set_up, step)];
    };
    let ends = [beam.from_mm[axis.index()], beam.to_mm[axis.index()]];
    let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
    let margin_mm = (END_MARGIN.0 * (high - low)).min(END_MARGIN.1);
    let (from_mm, to_mm) = (low + margin_mm, high - margin_mm);
    let overrun_mm = OVERRUN * margin_mm;
    let run = |what: &str, targets: u32, rest: &str, feed: f64| {
        let spacing_mm = (to_mm - from_mm) / f64::from(targets - 1);
        format!(
            "{{do: {what}, axis: {axis}, from_mm: {from_mm:.1}, to_mm: {to_mm:.1}, spacing_mm: {spacing_mm:.1}, \
             runs: 1, {rest}feed_mm_min: {feed:.1}, overrun_mm: {overrun_mm:.1}, beam: {id:?}}}"
        )
    };
    let mut all = Vec::new();
    for targets in TARGETS {
        let title =
            format!("positioning {axis}, {targets} uneven targets up and down along beam {id}");
        let step = run("positioning", targets, "dwell_s: 1.0, ", 3000.0);
        all.push(Offer::new(title, &set_up, step));
    }
    for feed in STRAIGHT_FEEDS_MM_MIN {
        let title = format!(
            "scan {axis} F{} there and back along beam {id}",
            short(feed)
        );
        all.push(Offer::new(title, &set_up, run("scan", 20, "", feed)));
    }
    all
}

fn set_up(beam: &BeamEntry) -> SetUp {
    let point = |[x, y, z]: [f64; 3]| format!("X {x:.1}, Y {y:.1}, Z {z:.1} mm");
    SetUp {
        name: format!("beam {}", beam.id),
        means: Means::Laser,
        words: format!(
            "Put the laser up along beam `{}`, from {} to {}. Align the beam over the whole way, and set it to zero when the \
             program asks for it.",
            beam.id,
            point(beam.from_mm),
            point(beam.to_mm)
        ),
    }
}
