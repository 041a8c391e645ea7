//! The run that a diagnosis asks for, as steps of a plan.
//!
//! A report names it in words (`gap_diagnosis::experiment`); this reads the words as whoever stands at the machine would.
//! What this machine's instruments or its plan cannot do is not made.
//!
//! | words | steps |
//! |---|---|
//! | `circle XY R50 F3000 and F6000 both senses at middle` | circles on a plate of that plane |
//! | `line X F1000 and F4000 there and back on the XY plate`, `… along beam along_x` | lines, moving, both ways in one run |
//! | `positioning X F2000, 20 stops of 2 s each way …` | lines with stops |
//! | `steps of 0.4 mm along X with 2 s dwell, there and back on the XY plate` | the same over 8 mm |
//! | `the same touches at F60, F120 and F480` | touches of every face |
//! | `the session's 9 tests in reverse order` | each condition once, the last first |

use std::fmt::Write as _;

use machine::MachineFile;
use machine::file::GridPlacement;
use metrology::Axis;
use metrology::sample::TestPlane;

use crate::{Plan, Step};

/// Way of a beam at each end that a run leaves, mm.
const RUN_MARGIN_MM: f64 = 60.0;
/// Way before the first target and behind the last one, for reaching the feed and settling, mm.
const OVERRUN_MM: f64 = 40.0;
/// Share of a plate's radius that a line goes to.
const REACH: f64 = 0.9;
/// Stops of a line.
const LINE_STOPS: u32 = 20;
/// Rest at each, s.
const DWELL_S: f64 = 2.0;

/// The plan of a run, where this machine can do it; `done` is what was measured already.
#[must_use]
pub fn extra_run(machine: &MachineFile, done: &Plan, words: &str) -> Option<Plan> {
    let steps = steps(machine, done, words)?;
    let mut text = "title: a run that was asked for\nsteps:\n".to_owned();
    for step in &steps {
        let _ = writeln!(text, "  - {step}");
    }
    match steps.first() {
        None => Some(Plan {
            steps: reversed(done),
            ..done.clone()
        }),
        Some(_) => Plan::from_yaml(&text).ok(),
    }
}

/// The steps as text; none at all for the session's own in reverse.
fn steps(machine: &MachineFile, done: &Plan, words: &str) -> Option<Vec<String>> {
    let feeds = feeds_mm_min(words);
    if let Some(rest) = words.strip_prefix("circle ") {
        let mut parts = rest.split(' ');
        let placement = &placement(machine, parts.next()?, words)?.id;
        let radius_mm: f64 = parts.next()?.strip_prefix('R')?.parse().ok()?;
        let circle = |feed: &f64| {
            format!(
                "{{do: grid, placement: {placement}, trajectory: circle, radius_mm: {radius_mm:.1}, \
                 feed_mm_min: {feed:.1}, sense: both, on_the_fly: true}}"
            )
        };
        let is_whole = !words.contains("to and fro") && !feeds.is_empty();
        return is_whole.then(|| feeds.iter().map(circle).collect());
    }
    if words.starts_with("line ") || words.starts_with("positioning ") {
        let axis: Axis = words.split(' ').nth(1)?.parse().ok()?;
        let has_stops = words.starts_with("positioning ");
        let line = |feed: &f64| match words.split_once("along beam ") {
            Some((_, beam)) => along_beam(machine, axis, beam, *feed, has_stops),
            None => {
                let plate = placement_along(machine, axis, words)?;
                let reach_mm = REACH * machine.grid_encoder.as_ref()?.radius_mm;
                let length_mm = 2.0 * REACH * reach_mm;
                Some(on_plate(plate, axis, length_mm, *feed, has_stops))
            }
        };
        return feeds.iter().map(line).collect();
    }
    if let Some(rest) = words.strip_prefix("steps of 0.4 mm along ") {
        let axis: Axis = rest.split(' ').next()?.parse().ok()?;
        let plate = placement_along(machine, axis, words)?;
        return Some(vec![on_plate(plate, axis, 8.0, 500.0, true)]);
    }
    if words.starts_with("the same touches at ") {
        let list: Vec<String> = feeds.iter().map(|feed| format!("{feed:.1}")).collect();
        let touches = |step: &Step| match step {
            Step::Latency { feature, .. } => Some(format!(
                "{{do: latency, feature: {feature}, feeds_mm_min: [{}], repeats: 2}}",
                list.join(", ")
            )),
            _ => None,
        };
        let all: Vec<String> = done.steps.iter().filter_map(touches).collect();
        return (!all.is_empty() && !list.is_empty()).then_some(all);
    }
    words.ends_with("tests in reverse order").then(Vec::new)
}

/// Each condition once, the last first.
fn reversed(done: &Plan) -> Vec<Step> {
    let mut kept = Vec::<Step>::new();
    for step in done.steps.iter().rev() {
        if !kept.contains(step) {
            kept.push(step.clone());
        }
    }
    kept
}

/// Every number behind an F.
fn feeds_mm_min(words: &str) -> Vec<f64> {
    let parts = words.split([' ', ',']);
    let feeds = parts.filter_map(|part| part.strip_prefix('F')?.parse().ok());
    feeds.collect()
}

/// The placement that is named, or the first in a plane.
fn placement<'m>(machine: &'m MachineFile, plane: &str, words: &str) -> Option<&'m GridPlacement> {
    let all = &machine.grid_encoder.as_ref()?.placements;
    let named = |placement: &&GridPlacement| words.ends_with(&format!(" at {}", placement.id));
    let in_plane =
        |placement: &&GridPlacement| plane_words(TestPlane::from(placement.plane)) == plane;
    all.iter().find(named).or_else(|| all.iter().find(in_plane))
}

/// The placement of `… on the XY plate`, where it reads the axis.
fn placement_along<'m>(
    machine: &'m MachineFile,
    axis: Axis,
    words: &str,
) -> Option<&'m GridPlacement> {
    let (_, plate) = words.split_once(" on the ")?;
    let found = placement(machine, plate.split(' ').next()?, words)?;
    let [first, second, _] = found.plane.axes();
    [first, second].contains(&axis).then_some(found)
}

const fn plane_words(plane: TestPlane) -> &'static str {
    match plane {
        TestPlane::Xy => "XY",
        TestPlane::Yz => "YZ",
        TestPlane::Zx => "ZX",
        TestPlane::None => "",
    }
}

fn on_plate(
    placement: &GridPlacement,
    axis: Axis,
    length_mm: f64,
    feed_mm_min: f64,
    has_stops: bool,
) -> String {
    let [first, ..] = placement.plane.axes();
    // There and back in one run, whose ways have their zero in common: the tip of a spike is at the plate's centre.
    let half_mm = 0.5 * length_mm;
    let (angle_deg, offset_mm) = if first == axis {
        (0.0, [half_mm, 0.0])
    } else {
        (90.0, [0.0, half_mm])
    };
    let pace = if has_stops {
        format!("stations: {}, dwell_s: {DWELL_S:.1}", 2 * LINE_STOPS)
    } else {
        "on_the_fly: true".to_owned()
    };
    format!(
        "{{do: grid, placement: {}, trajectory: spike, angle_deg: {angle_deg:.1}, offset_mm: [{:.1}, {:.1}], \
         length_mm: {length_mm:.1}, feed_mm_min: {feed_mm_min:.1}, {pace}}}",
        placement.id, offset_mm[0], offset_mm[1]
    )
}

fn along_beam(
    machine: &MachineFile,
    axis: Axis,
    beam: &str,
    feed_mm_min: f64,
    has_stops: bool,
) -> Option<String> {
    let beams = &machine.length_reference.as_ref()?.beams;
    let beam = beams.iter().find(|own| own.id == beam)?;
    let (low, high) = (beam.from_mm[axis.index()], beam.to_mm[axis.index()]);
    let (from_mm, to_mm) = (low + RUN_MARGIN_MM, high - RUN_MARGIN_MM);
    let (what, rest) = if has_stops {
        ("positioning", format!("dwell_s: {DWELL_S:.1}, "))
    } else {
        ("scan", String::new())
    };
    let spacing_mm = (to_mm - from_mm) / f64::from(LINE_STOPS - 1);
    Some(format!(
        "{{do: {what}, axis: {axis}, from_mm: {from_mm:.1}, to_mm: {to_mm:.1}, \
         spacing_mm: {spacing_mm:.1}, runs: 1, {rest}feed_mm_min: {feed_mm_min:.1}, \
         overrun_mm: {OVERRUN_MM:.1}, beam: {}}}",
        beam.id
    ))
}
