//! A measurement that nobody has made yet: what would be run, how long it takes, what it would be called.
//!
//! An experiment is one or more passes in one set-up. `library` lists those that a machine and its instruments
//! allow, `course` moves the axes as a pass would, so that the twin can be asked what it would show.

pub(crate) mod course;
pub(crate) mod library;

use metrology::Axis;
use metrology::sample::{Sense, TestPlane};
use twin::Instrument;

use crate::search::nuisance::plane_name;

/// One pass of an experiment.
#[derive(Clone, Debug, PartialEq)]
pub enum Pass {
    /// A full circle, read all round.
    Circle {
        /// What reads it: [`Instrument::Grid`] or [`Instrument::Radial`].
        instrument: Instrument,
        /// Plane.
        plane: TestPlane,
        /// Axis positions at its centre, mm.
        centre_mm: [f64; 3],
        /// Radius, mm.
        radius_mm: f64,
        /// Feed, mm/s.
        feed_mm_s: f64,
        /// Sense.
        sense: Sense,
    },
    /// A line there and back.
    Line {
        /// What reads it: [`Instrument::Grid`] or [`Instrument::Length`].
        instrument: Instrument,
        /// Plane of the plate, where a plate reads it.
        plane: TestPlane,
        /// The axis that moves most.
        axis: Axis,
        /// Axis positions at one end, mm.
        from_mm: [f64; 3],
        /// Axis positions at the other end, mm.
        to_mm: [f64; 3],
        /// Feed, mm/s.
        feed_mm_s: f64,
        /// Stops each way at which alone is read; zero: read while it moves.
        stops: u32,
        /// Time at each stop, s.
        dwell_s: f64,
    },
    /// Touches, one after another.
    Touches {
        /// The touches.
        touches: Vec<PlannedTouch>,
        /// Stylus in the machine file.
        stylus: String,
    },
    /// Standing still while it is read.
    Still {
        /// What reads it.
        instrument: Instrument,
        /// Plane of the plate, where a plate reads it.
        plane: TestPlane,
        /// Axis that a length reference looks along.
        axis: Axis,
        /// Where, mm.
        at_mm: [f64; 3],
        /// How long, s.
        seconds: f64,
    },
    /// One axis to and fro, nothing read: it warms, the others stay idle.
    Warm {
        /// The axis.
        axis: Axis,
        /// Where it turns, mm.
        between_mm: [f64; 2],
        /// Feed, mm/s.
        feed_mm_s: f64,
        /// How long, s.
        seconds: f64,
    },
    /// A run of the session once more.
    Again {
        /// Its place in the session.
        run: usize,
    },
}

/// A touch that nobody has made yet.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedTouch {
    /// What is touched.
    pub feature_id: String,
    /// Unit vector of the approach, of the tool relative to the workpiece.
    pub approach: [f64; 3],
    /// Axis positions at contact, mm.
    pub at_mm: [f64; 3],
    /// Feed along the approach, mm/s.
    pub feed_mm_s: f64,
}

/// Some passes in one set-up.
#[derive(Clone, Debug, PartialEq)]
pub struct Experiment {
    /// E.g. `circle XY R50 F3000 both senses`.
    pub title: String,
    /// The passes, in their order.
    pub passes: Vec<Pass>,
    /// Time that setting up takes, min.
    pub setup_min: f64,
}

/// `XY R50 F3000`.
pub(crate) fn circle_words(plane: TestPlane, radius_mm: f64, feed_mm_s: f64) -> String {
    format!(
        "{} R{} F{}",
        plane_name(plane),
        short(radius_mm),
        short(feed_mm_s * 60.0)
    )
}

/// A number without needless digits.
pub(crate) fn short(value: f64) -> String {
    if (value - value.round()).abs() < 0.05 {
        format!("{value:.0}")
    } else {
        format!("{value:.1}")
    }
}
