//! Programs that move the head of a grid encoder, a laser's reflector or a scale along a wanted path.
//!
//! A trajectory is RS-274 text and what its test segment says. Planar ones run over the plate of a grid
//! encoder in one of its placements; [`Shape`] names those of KGM measurements \[1\]. Spatial ones
//! stop at targets along one axis ([`positioning()`]), run through it ([`scan()`]) or stop along a
//! diagonal of the working space ([`diagonal()`]).
//!
//! # Model
//! A planar contour is a chain of straight lines and arcs in the plane's own coordinates (u, v),
//! which are right-handed about the plane's normal: (X, Y) for G17, (Y, Z) for G19, (Z, X) for G18.
//!
//! ```text
//!   axes at the contour's point c:  q = centre - t + (u, v)                              (1)
//!   run-in >= v^2/(2 b a) + v ln((1-k)/0.001)/Kv + 0.05 s v                               (2)
//!   v^2/R <= c a                                                                        (3)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | t | `tool_offset_mm`, from the point that the axes name to the one that is measured | mm |
//! | v | feed | mm/s |
//! | a | acceleration limit of the slower axis of the plane | mm/s² |
//! | Kv, k | position gain and velocity feed-forward of the axis that settles last | 1/s, 1 |
//! | b, c | shares of the acceleration that a control uses along and across a path, 0.4 and 0.5 | 1 |
//!
//! # Two ways of recording
//! *Stationwise*: the contour is cut into equal parts; at each cut the axes stop for a dwell, in which
//! readings are averaged. A closed contour has n cuts, an open one n - 1 parts between n. *On the
//! fly*: the contour is run through at its feed; before its beginning and after its end the path
//! goes on (along the circle, or straight on), long enough that acceleration and the settling of the
//! position loops stay outside. `(rate: full)` stands before the evaluated part and `(rate: background)`
//! after it.
//!
//! Either way every station is approached in the direction of motion, so that play lies at the same
//! side. Between trajectories on one plate the head never leaves the plate, since an incremental
//! encoder would lose its count.
//!
//! # Program comments
//! `(mount: NAME)` stands where a plate or beam is put in place, `(zero: grid)` and `(zero: length)`
//! where its count is set to zero with the axes at rest. A control without them ignores comments.
//!
//! # Holds when
//! The plate's plane is parallel to two axes; nothing stands between the top of Z and the start.
//!
//! # Agreement
//! `val_linuxcnc_goes_where_the_programs_say`: every end point that LinuxCNC's interpreter gives
//! lies within 1e-4 mm of its station.
//!
//! # References
//! \[1\] HEIDENHAIN KGM grid encoders: circular interpolation, free-form and step-response tests (from
//! memory). \[2\] ISO 230-2, clauses on target positions and test cycle (from memory). \[3\] ISO 230-6.

mod contour;
mod diagonal;
mod error;
mod linear;
mod planar;
mod shape;
mod writer;

use metrology::sample::{Sense, TestKind, TestPlane};
use nalgebra::Vector3;

pub use contour::{Contour, Element};
pub use diagonal::{Diagonal, diagonal};
pub use error::TrajectoryError;
pub use linear::{AxisRun, positioning, scan, uneven_targets_mm};
pub use planar::{PlanarOrder, planar};
pub use shape::Shape;

/// A program and what its test segment says of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    /// Program that puts the plate or beam up and sets its count to zero; to be run before and not part
    /// of the recording, since readings of the count before may still come in it.
    pub setup: Option<String>,
    /// RS-274 text, ends with M2.
    pub program: String,
    /// What a test segment around it is called.
    pub kind: TestKind,
    /// Plane; [`TestPlane::None`] for spatial ones.
    pub plane: TestPlane,
    /// Axis positions at the contour's centre, mm.
    pub centre_mm: Vector3<f64>,
    /// Nominal radius; zero where there is none, mm.
    pub radius_mm: f64,
    /// Programmed feed, mm/s.
    pub feed_mm_s: f64,
    /// Sense.
    pub sense: Sense,
    /// Number of stops; zero: recorded while moving.
    pub stations: u32,
    /// From the point that the axis positions name to the one that is measured, mm.
    pub tool_offset_mm: Vector3<f64>,
    /// Axis positions of the stops in order, or of the evaluated part's beginning and end, mm.
    pub stops_mm: Vec<Vector3<f64>>,
}

/// How a trajectory is recorded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// With stops.
    Stationwise {
        /// How many stops.
        stations: u32,
        /// How long each, s.
        dwell_s: f64,
    },
    /// Without a stop.
    OnTheFly,
}

/// How the head comes to the beginning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrival {
    /// Straight, from within reach of the plate or beam.
    Straight,
    /// Straight to the contour's centre or the beam's beginning, where the count is set to zero.
    Zero,
    /// Over the top of Z to the contour's centre or the beam's beginning, and zeroed.
    Return,
    /// The same, the plate or beam being put in place first.
    Mount,
}
