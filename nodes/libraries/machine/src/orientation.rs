//! Rotary positions that point the probe along a given axis.
//!
//! For a chain in which C stands between the workpiece and A (table-table `[w C' A' .. b .. t]`,
//! head-head `[w .. b .. C A t]`, or C on the table and A in the head), the probe axis is, in the
//! workpiece frame,
//!
//! ```text
//!   d = Rz(c) Rx(a) ez = (sin a sin c, -sin a cos c, cos a)                     (1)
//!   a = s_A A,  c = s_C C,   s = +1 in a head, -1 on a table that turns right-handed itself
//!   a = atan2(+-h, dz),  c = atan2(+-dx, -+dy),   h = hypot(dx, dy)             (2)
//! ```
//!
//! so a table-table machine has d = (sin A sin C, sin A cos C, cos A) and C = atan2(dx, dy). Both
//! signs of (2) are solutions, each repeated every full turn; of those inside the travel the one
//! nearest to the present position is taken, and the other is given beside it.
//!
//! The arc tangent keeps what the arc cosine of dz loses: at a tilt of 1e-9 rad dz is 1 to the last
//! bit. At h = 0 the direction says nothing about C and the present C is kept, since (2) would turn
//! the sign of a zero into half a turn. Near it C moves 1/sin(a) times as fast as the direction.
//!
//! # Agreement
//! `eq2_inverts_the_kinematics_of_every_form`: below 1e-12 in each component of d.

use std::f64::consts::{PI, TAU};

use metrology::{Axis, PerAxis};
use nalgebra::Vector3;

use crate::chain::Chain;
use crate::error::OrientationError;
use crate::file::MachineFile;
use crate::kinematics::TableSense;

/// Below this sine of the tilt the direction says nothing about C: its share of the unit vector is
/// rounding.
const SINGULAR_SINE: f64 = 1e-12;
/// A vector shorter than this is no direction.
const LEAST_LENGTH: f64 = 1e-9;
/// Rounding allowed at the ends of the travel, rad.
const TRAVEL_ROUNDING_RAD: f64 = 1e-9;

/// Solves for A and C.
#[derive(Clone, Debug, PartialEq)]
pub struct Orientation {
    sense_a: f64,
    sense_c: f64,
    travel_a_rad: [f64; 2],
    travel_c_rad: [f64; 2],
}

/// Positions of A and C.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotaryPosition {
    /// Position of A, rad.
    pub a_rad: f64,
    /// Position of C, rad.
    pub c_rad: f64,
}

/// A solution for a probe axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pointing {
    /// Where to go.
    pub position: RotaryPosition,
    /// Both solutions of (2), that with `position` first.
    pub solutions: [Solution; 2],
    /// Sine of the tilt: C moves its inverse times as fast as the direction. Gate on it where C
    /// has to follow a moving direction.
    pub sine_of_tilt: f64,
    /// Whether the direction says nothing about C, so that the present C was kept.
    pub singular: bool,
}

/// One of the two solutions of (2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    /// The repetition nearest to the present position: of those inside the travel, where there is one.
    pub position: RotaryPosition,
    /// Whether it lies inside the travel.
    pub is_inside_travel: bool,
}

impl Orientation {
    /// From a machine file with A and C.
    ///
    /// # Errors
    /// Without A or C, with B, or where A stands between the workpiece and C.
    pub fn new(file: &MachineFile, table_sense: TableSense) -> Result<Self, OrientationError> {
        let chain: Chain = file
            .chain
            .parse()
            .map_err(|error| OrientationError::Chain { error })?;
        let order = || chain.workpiece_side().iter().chain(chain.tool_side());
        let rotary: Vec<Axis> = order().copied().filter(|axis| !axis.is_linear()).collect();
        if rotary != [Axis::C, Axis::A] {
            return Err(OrientationError::OtherForm {
                chain: chain.to_string(),
            });
        }
        let sense = |axis| {
            let on_table = chain.workpiece_side().contains(&axis);
            if on_table && table_sense == TableSense::Table {
                -1.0
            } else {
                1.0
            }
        };
        let travel_rad = |axis| {
            file.rotary_axis(axis)
                .map(|entry| entry.travel_deg.map(f64::to_radians))
                .ok_or(OrientationError::AxisMissing { axis })
        };
        Ok(Self {
            sense_a: sense(Axis::A),
            sense_c: sense(Axis::C),
            travel_a_rad: travel_rad(Axis::A)?,
            travel_c_rad: travel_rad(Axis::C)?,
        })
    }

    /// Positions of A and C that point the probe along `axis` (from the ball to the spindle,
    /// workpiece frame, any length), nearest to `present`.
    ///
    /// # Errors
    /// When `axis` is no direction or no solution lies inside the travel.
    pub fn solve(
        &self,
        axis: &Vector3<f64>,
        present: RotaryPosition,
    ) -> Result<Pointing, OrientationError> {
        if !(axis.iter().all(|c| c.is_finite())
            && present.a_rad.is_finite()
            && present.c_rad.is_finite())
        {
            return Err(OrientationError::NotFinite);
        }
        let length = axis.norm();
        if length < LEAST_LENGTH || !length.is_finite() {
            return Err(OrientationError::NoDirection { length });
        }
        let d = axis / length;
        let sine_of_tilt = d.x.hypot(d.y);
        let singular = sine_of_tilt < SINGULAR_SINE;
        let tilt_rad = if singular {
            if d.z > 0.0 { 0.0 } else { PI }
        } else {
            sine_of_tilt.atan2(d.z) // (2)
        };
        let mut solutions = [(tilt_rad, d.x.atan2(-d.y)), (-tilt_rad, (-d.x).atan2(d.y))]
            .map(|(a, c)| self.solution(a, (!singular).then_some(c), present));
        let from_present = |solution: &Solution| distance_rad(&solution.position, &present);
        solutions.sort_by(|p, q| {
            let inside_first = q.is_inside_travel.cmp(&p.is_inside_travel);
            inside_first.then(from_present(p).total_cmp(&from_present(q)))
        });
        if !solutions[0].is_inside_travel {
            return Err(OrientationError::OutsideTravel {
                a_deg: (self.sense_a * tilt_rad).to_degrees(),
                travel_a_deg: self.travel_a_rad.map(f64::to_degrees),
                travel_c_deg: self.travel_c_rad.map(f64::to_degrees),
            });
        }
        Ok(Pointing {
            position: solutions[0].position,
            solutions,
            sine_of_tilt,
            singular,
        })
    }

    /// Unit vector from the ball to the spindle in the workpiece frame, equation (1).
    #[must_use]
    pub fn probe_axis(&self, position: RotaryPosition) -> Vector3<f64> {
        let (sin_a, cos_a) = (self.sense_a * position.a_rad).sin_cos();
        let (sin_c, cos_c) = (self.sense_c * position.c_rad).sin_cos();
        Vector3::new(sin_a * sin_c, -sin_a * cos_c, cos_a)
    }

    /// One solution of (2); `c_rad` is `None` where C is free.
    fn solution(&self, a_rad: f64, c_rad: Option<f64>, present: RotaryPosition) -> Solution {
        let inside = self.inside_travel(a_rad, c_rad, present).into_iter();
        let nearest =
            inside.min_by(|p, q| distance_rad(p, &present).total_cmp(&distance_rad(q, &present)));
        let turned = |angle_rad: f64, near_rad: f64| {
            angle_rad + ((near_rad - angle_rad) / TAU).round() * TAU
        };
        Solution {
            is_inside_travel: nearest.is_some(),
            position: nearest.unwrap_or_else(|| RotaryPosition {
                a_rad: turned(self.sense_a * a_rad, present.a_rad),
                c_rad: c_rad.map_or(present.c_rad, |c| turned(self.sense_c * c, present.c_rad)),
            }),
        }
    }

    /// All repetitions of one solution inside the travel; `c_rad` is `None` where C is free.
    fn inside_travel(
        &self,
        a_rad: f64,
        c_rad: Option<f64>,
        present: RotaryPosition,
    ) -> Vec<RotaryPosition> {
        let tilts = full_turns(self.sense_a * a_rad, self.travel_a_rad);
        let turns = match c_rad {
            Some(c_rad) => full_turns(self.sense_c * c_rad, self.travel_c_rad),
            None if contains(self.travel_c_rad, present.c_rad) => vec![present.c_rad],
            None => Vec::new(),
        };
        let pairs = tilts.iter().flat_map(|&a_rad| {
            turns
                .iter()
                .map(move |&c_rad| RotaryPosition { a_rad, c_rad })
        });
        pairs.collect()
    }
}

impl RotaryPosition {
    /// A and C of a pose.
    #[must_use]
    pub fn of(positions: &PerAxis<f64>) -> Self {
        Self {
            a_rad: positions[Axis::A],
            c_rad: positions[Axis::C],
        }
    }
}

fn contains([least, greatest]: [f64; 2], angle_rad: f64) -> bool {
    angle_rad >= least - TRAVEL_ROUNDING_RAD && angle_rad <= greatest + TRAVEL_ROUNDING_RAD
}

/// Every `angle + 2 pi k` inside the travel.
fn full_turns(angle_rad: f64, travel_rad: [f64; 2]) -> Vec<f64> {
    let first = ((travel_rad[0] - TRAVEL_ROUNDING_RAD - angle_rad) / TAU).ceil();
    let mut turns = Vec::new();
    let mut turned_rad = angle_rad + first * TAU;
    while contains(travel_rad, turned_rad) {
        turns.push(turned_rad);
        turned_rad += TAU;
    }
    turns
}

fn distance_rad(p: &RotaryPosition, q: &RotaryPosition) -> f64 {
    (p.a_rad - q.a_rad).abs() + (p.c_rad - q.c_rad).abs()
}
