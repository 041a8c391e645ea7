//! What one recording is: where the axes stood and what the grid read there.
//!
//! A *pair* is one reading with the positions of the axes at its instant; a *point* is what a fit takes:
//! a station mean, a bin of a moving trace, or a single reading, with its standard uncertainty.
//! `collect` checks pairs as they come, `stationwise` reduces a program that stops at each point,
//! `moving` one that does not, `station_mean` is the robust mean both use.
//!
//! Positions are those of the motors, compensation included, unless told otherwise: the error of the
//! machine at the place where the motors are is what a geometric model tells. So following errors of the
//! servos, which are 2 mm at 2 m/min without feed-forward, are not taken for geometry, and a model
//! recorded with its predecessor switched on is a model of the machine and no correction of a model.
//! What is left of motion is nuisance in the fit: the time between the reading's stamp and the
//! positions', and the lost motion between motor and slide.

mod collect;
mod moving;
mod place;
mod station_mean;
mod stationwise;

pub use collect::{Collector, Pair};
pub use moving::reduce_moving;
pub(crate) use place::plane_of_turn;
pub use place::{Fixture, Place, in_plane, plane_axes};
pub(crate) use station_mean::median;
pub use station_mean::{StationMean, correlation_length, station_mean};
pub use stationwise::{StationRules, reduce_stationwise};

use metrology::PerAxis;
use nalgebra::Vector3;

/// One point of a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridPoint {
    /// Positions of the axes, mm and rad.
    pub positions: PerAxis<f64>,
    /// Sense in which each linear axis moved last: −1, 0 (not yet), 1.
    pub sense: Vector3<f64>,
    /// Velocity of the tool relative to the workpiece, mm/s; zero at a station.
    pub velocity_mm_s: Vector3<f64>,
    /// What the grid read along u and v, mm.
    pub reading_mm: [f64; 2],
    /// Standard uncertainty of the reading, mm.
    pub standard_uncertainty_mm: [f64; 2],
    /// Readings behind it.
    pub n_readings: u32,
}

/// A recording that can be fitted.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// Number of its run.
    pub run: u32,
    /// Where and how it was made.
    pub place: Place,
    /// Its points in the order of time.
    pub points: Vec<GridPoint>,
}
