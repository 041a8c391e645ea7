//! Writes the moves of a trajectory and refuses those that leave the travel.

use std::fmt::Write as _;

use metrology::Axis;
use nalgebra::{Vector2, Vector3};

use super::Arrival;
use super::contour::Element;
use super::error::TrajectoryError;
use crate::cycle::program::{Number, TRAVEL_MARGIN_MM, Words};
use crate::file::{GridPlane, LinearAxisEntry, MachineFile};
use crate::program_frame::HEAD;

/// Rest before a count is set to zero, s.
const REST_BEFORE_ZERO_S: f64 = 1.0;
/// Largest arc in one block, so that beginning and end never coincide, rad.
const LARGEST_ARC_RAD: f64 = std::f64::consts::PI;

/// A program that grows move by move.
pub(super) struct Writer<'a> {
    file: &'a MachineFile,
    text: String,
}

impl<'a> Writer<'a> {
    /// Metric, absolute, no motion yet.
    pub(super) fn new(file: &'a MachineFile) -> Self {
        Self {
            file,
            text: format!("{HEAD}(rate: background)\n"),
        }
    }

    /// The program that comes to `zero_at`, mounts and zeroes as `arrival` says; `what` is `grid` or
    /// `length`.
    pub(super) fn setup(
        file: &'a MachineFile,
        arrival: Arrival,
        zero_at: &Vector3<f64>,
        name: &str,
        what: &str,
    ) -> Result<Option<String>, TrajectoryError> {
        let mut writer = Self::new(file);
        writer.check_travel("zero of the count", zero_at)?;
        match arrival {
            Arrival::Straight => return Ok(None),
            Arrival::Zero => writer.rapid(zero_at),
            Arrival::Return => writer.over_the_top(zero_at)?,
            Arrival::Mount => {
                writer.over_the_top(zero_at)?;
                writer.comment("mount", name);
            }
        }
        writer.dwell(REST_BEFORE_ZERO_S);
        writer.comment("zero", what);
        Ok(Some(writer.finish()))
    }

    /// Up to the top of Z, rotary axes to zero, across, down.
    pub(super) fn over_the_top(&mut self, point: &Vector3<f64>) -> Result<(), TrajectoryError> {
        let top_z_mm = linear(self.file, Axis::Z)?.travel_mm[1] - TRAVEL_MARGIN_MM;
        self.line(format_args!("G0 Z{}", Number(top_z_mm)));
        self.rotary_to_zero()?;
        self.line(format_args!("G0 X{} Y{}", Number(point.x), Number(point.y)));
        self.line(format_args!("G0 Z{}", Number(point.z)));
        Ok(())
    }

    fn rotary_to_zero(&mut self) -> Result<(), TrajectoryError> {
        let mut words = String::new();
        for axis in Axis::ROTARY {
            let Some(entry) = self.file.rotary_axis(axis) else {
                continue;
            };
            let [least, greatest] = entry.travel_deg;
            if !(least..=greatest).contains(&0.0) {
                return Err(TrajectoryError::RotaryZeroOutside {
                    axis,
                    least,
                    greatest,
                });
            }
            let _ = write!(words, " {axis}0"); // writing to a String cannot fail
        }
        if !words.is_empty() {
            self.line(format_args!("G0{words}"));
        }
        Ok(())
    }

    /// Straight at rapid speed.
    pub(super) fn rapid(&mut self, point: &Vector3<f64>) {
        self.line(format_args!("G0 {}", Words(point)));
    }

    /// Straight at `feed_mm_min`.
    pub(super) fn feed(&mut self, point: &Vector3<f64>, feed_mm_min: f64) {
        self.line(format_args!("G1 {} F{}", Words(point), Number(feed_mm_min)));
    }

    /// Chooses the plane of the arcs that follow.
    pub(super) fn plane(&mut self, plane: GridPlane) {
        self.line(format_args!(
            "{}",
            match plane {
                GridPlane::Xy => "G17",
                GridPlane::Yz => "G19",
                GridPlane::Zx => "G18",
            }
        ));
    }

    /// One element of a contour about `centre` (axis positions), equation (1).
    pub(super) fn element(
        &mut self,
        element: &Element,
        plane: GridPlane,
        centre: &Vector3<f64>,
        feed_mm_min: f64,
    ) {
        let Element::Arc {
            centre_mm,
            swept_rad,
            ..
        } = element
        else {
            self.feed(&place(plane, centre, &element.point_mm(1.0)), feed_mm_min);
            return;
        };
        let pieces = (swept_rad.abs() / LARGEST_ARC_RAD).ceil().max(1.0);
        let code = if *swept_rad > 0.0 { "G3" } else { "G2" };
        let mut piece = 0.0;
        while piece < pieces {
            let from = rounded(&place(plane, centre, &element.point_mm(piece / pieces)));
            let to = place(plane, centre, &element.point_mm((piece + 1.0) / pieces));
            let middle = place(plane, centre, centre_mm);
            let [first, second, _] = plane.axes();
            let offset = |axis: Axis| Number(middle[axis.index()] - from[axis.index()]);
            self.line(format_args!(
                "{code} {} {}{} {}{} F{}",
                Words(&to),
                offset_letter(first),
                offset(first),
                offset_letter(second),
                offset(second),
                Number(feed_mm_min)
            ));
            piece += 1.0;
        }
    }

    /// An exact stop for a while.
    pub(super) fn dwell(&mut self, dwell_s: f64) {
        self.line(format_args!("G4 P{}", Number(dwell_s)));
    }

    /// A comment that a control may understand.
    pub(super) fn comment(&mut self, key: &str, value: &str) {
        self.line(format_args!("({key}: {value})"));
    }

    /// Ends the program.
    pub(super) fn finish(mut self) -> String {
        self.line(format_args!("M2"));
        self.text
    }

    pub(super) fn check_travel(
        &self,
        place: &'static str,
        point: &Vector3<f64>,
    ) -> Result<(), TrajectoryError> {
        for axis in Axis::LINEAR {
            let [least, greatest] = linear(self.file, axis)?.travel_mm;
            let position_mm = point[axis.index()];
            if !(least..=greatest).contains(&position_mm) {
                return Err(TrajectoryError::OutsideTravel {
                    place,
                    axis,
                    position_mm,
                    least,
                    greatest,
                });
            }
        }
        Ok(())
    }

    fn line(&mut self, words: std::fmt::Arguments<'_>) {
        let _ = writeln!(self.text, "{words}"); // writing to a String cannot fail
    }
}

/// Axis positions of a contour's point, equation (1).
pub(super) fn place(
    plane: GridPlane,
    centre: &Vector3<f64>,
    point_mm: &Vector2<f64>,
) -> Vector3<f64> {
    let [first, second, _] = plane.axes();
    let mut at = *centre;
    at[first.index()] += point_mm.x;
    at[second.index()] += point_mm.y;
    at
}

/// As the words of the block before have left it, so that I J K are exact from there.
fn rounded(point: &Vector3<f64>) -> Vector3<f64> {
    point.map(|value| (value * 1e5).round() / 1e5)
}

fn offset_letter(axis: Axis) -> char {
    match axis {
        Axis::X => 'I',
        Axis::Y => 'J',
        _ => 'K',
    }
}

/// Entry of a linear axis.
pub(super) fn linear(file: &MachineFile, axis: Axis) -> Result<&LinearAxisEntry, TrajectoryError> {
    file.linear(axis)
        .ok_or(TrajectoryError::AxisMissing { axis })
}

/// Refuses a feed above the limit of an axis that `direction` moves.
pub(super) fn check_feed(
    file: &MachineFile,
    direction: &Vector3<f64>,
    feed_mm_min: f64,
) -> Result<(), TrajectoryError> {
    super::shape::positive("feed_mm_min", feed_mm_min)?;
    for axis in Axis::LINEAR {
        let limit_mm_min = linear(file, axis)?.feed_limit_mm_min;
        if feed_mm_min * direction[axis.index()].abs() > limit_mm_min {
            return Err(TrajectoryError::FeedAboveLimit {
                feed_mm_min,
                axis,
                limit_mm_min,
            });
        }
    }
    Ok(())
}

/// Length after which a feed is reached and the loops have settled, equation (2), mm.
pub(super) fn run_in_mm(
    file: &MachineFile,
    axes: &[Axis],
    feed_mm_min: f64,
) -> Result<f64, TrajectoryError> {
    const SHARE: f64 = 0.4;
    const UNSETTLED: f64 = 1e-3;
    const MARGIN_S: f64 = 0.05;
    let feed_mm_s = feed_mm_min / 60.0;
    let (mut ramp_mm, mut settling_s) = (0.0_f64, 0.0_f64);
    for &axis in axes {
        let entry = linear(file, axis)?;
        ramp_mm = ramp_mm.max(feed_mm_s.powi(2) / (2.0 * SHARE * entry.acceleration_limit_mm_s2));
        let missing = (1.0 - entry.velocity_feedforward) / UNSETTLED;
        settling_s = settling_s.max(missing.max(1.0).ln() / entry.position_gain_per_s);
    }
    Ok(ramp_mm + feed_mm_s * (settling_s + MARGIN_S))
}
