//! Part programs of a designed programme: axes and spindle that warm, circles for a ballbar. All in machine coordinates, and
//! each lifts Z before it moves anything else.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use anyhow::Result;
use fake_cnc::rs274::{self, Envelope};
use gap_diagnosis::design::Bar;
use machine::MachineFile;
use machine::file::AxisEntry;
use machine::program_frame::HEAD;
use metrology::sample::TestPlane;
use metrology::{Axis, PerAxis};

/// Share of the travel of Z below its top at which everything else moves.
const CLEAR: f64 = 0.05;
/// Share of the travel that a warming axis leaves at each end.
const WARMING_MARGIN: f64 = 0.1;
/// Share of its greatest feed at which an axis warms.
const WARM: f64 = 0.5;
/// Share of its greatest speed at which the spindle warms.
const SPIN: f64 = 0.6;
/// Feed to the start of a circle, mm/min.
const APPROACH_MM_MIN: f64 = 1000.0;

/// Lifts Z, where the machine has one.
fn lift(machine: &MachineFile) -> String {
    machine.linear(Axis::Z).map_or_else(String::new, |entry| {
        let [low, high] = entry.travel_mm;
        format!("G0 Z{:.3}\n", high - CLEAR * (high - low))
    })
}

/// One axis to and fro; none where the axis is not linear.
pub fn warm(machine: &MachineFile, axis: Axis) -> Option<String> {
    let entry = machine.linear(axis)?;
    let [low, high] = entry.travel_mm;
    let margin_mm = WARMING_MARGIN * (high - low);
    let feed_mm_min = WARM * entry.feed_limit_mm_min;
    let (low, high) = (low + margin_mm, high - margin_mm);
    Some(format!(
        "{HEAD}{}G1 {axis}{low:.3} F{feed_mm_min:.1}\nG1 {axis}{high:.3}\nG1 {axis}{low:.3}\nG1 {axis}{high:.3}\nM2\n",
        lift(machine)
    ))
}

/// The spindle alone, for half a minute; none where its greatest speed is not known.
pub fn spin(machine: &MachineFile) -> Option<String> {
    let speed_rpm = SPIN * machine.spindle?.max_speed_rpm;
    Some(format!(
        "{HEAD}{}S{speed_rpm:.0} M3\nG4 P30\nM5\nM2\n",
        lift(machine)
    ))
}

/// Two turns in each sense for a ballbar; none for a plane without axes.
pub fn circles(machine: &MachineFile, bar: &Bar) -> Option<String> {
    let (code, first, centre) = match bar.plane {
        TestPlane::Xy => ("G17", Axis::X, ("I", "J")),
        TestPlane::Zx => ("G18", Axis::Z, ("K", "I")),
        TestPlane::Yz => ("G19", Axis::Y, ("J", "K")),
        TestPlane::None => return None,
    };
    let mut start_mm = bar.centre_mm;
    start_mm[first.index()] += bar.radius_mm;
    let [x, y, z] = start_mm;
    let mut text = format!(
        "{HEAD}{}G0 X{x:.3} Y{y:.3}\nG1 Z{z:.3} F{APPROACH_MM_MIN:.1}\n{code}\n",
        lift(machine)
    );
    let radius_mm = bar.radius_mm;
    let feed_mm_min = 60.0 * bar.feed_mm_s;
    for arc in ["G3", "G3", "G2", "G2"] {
        let _ = writeln!(
            text,
            "{arc} X{x:.3} Y{y:.3} Z{z:.3} {}{:.3} {}0.000 F{feed_mm_min:.1}",
            centre.0, -radius_mm, centre.1
        );
    }
    text.push_str("G17\nM2\n");
    Some(text)
}

/// Reads a program as the fake machine's control does, with the axes at zero.
///
/// # Errors
/// The first word that this machine could not execute, with its place.
pub fn check(machine: &MachineFile, text: &str) -> Result<()> {
    let limits = |axis: Axis| match machine.axes.get(&axis) {
        Some(AxisEntry::Linear(entry)) => (entry.travel_mm, entry.feed_limit_mm_min / 60.0),
        Some(AxisEntry::Rotary(entry)) => (
            entry.travel_deg.map(f64::to_radians),
            entry.feed_limit_deg_min / 360.0 * TAU / 60.0,
        ),
        None => ([0.0; 2], 0.0),
    };
    let envelope = Envelope {
        axes: machine.axis_set(),
        travel: PerAxis::from_fn(|axis| limits(axis).0),
        speed: PerAxis::from_fn(|axis| limits(axis).1),
        spindle_limit_rpm: machine.spindle.map(|spindle| spindle.max_speed_rpm),
        tool_lengths_mm: vec![],
    };
    let _ = rs274::read(text, &envelope, &PerAxis::default())?;
    Ok(())
}
