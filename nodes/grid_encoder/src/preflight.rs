//! What a measuring programme will see, before anything is measured.
//!
//! # Model
//!
//! The equations of `identify` need positions, not readings: planned circles give the rank, which unknowns
//! are estimable, and their standard uncertainties for a stated noise of a station:
//!
//! ```text
//!   u_j = u_station √[ (X⁺X⁺ᵀ)_jj ]                                                     (1)
//! ```
//!
//! `choose` looks for the fewest recordings out of a list that make wanted components estimable.

mod choose;
mod placement;

pub use choose::{Choice, Search, choose, choose_beside};
pub use placement::{PlateRules, candidates};

use machine::Kinematics;
use metrology::sample::Sense;
use metrology::{Axis, PerAxis};
use nalgebra::{DMatrix, Vector3};

use crate::equations::{Equations, PointRows};
use crate::error::IdentifyError;
use crate::identify::{Disturbed, Identification, IdentifyOptions, Noise, identify};
use crate::recording::{GridPoint, Place, Recording, in_plane};

/// Stations that stand for a circle: more than its harmonics need, few enough to try many programmes.
pub(crate) const PLANNED_STATIONS: u32 = 36;

/// A planned circle as a recording whose readings are what a perfect machine gives.
#[must_use]
pub fn planned(number: u32, place: &Place, station_uncertainty_mm: f64) -> Recording {
    let stations = match place.stations {
        0 => PLANNED_STATIONS,
        n => n.min(PLANNED_STATIONS),
    };
    let points = (0..stations).map(|k| {
        let angle_rad = f64::from(k) * std::f64::consts::TAU / f64::from(stations);
        let positions = place.on_circle_mm(angle_rad);
        let tangent = place
            .on_circle_mm(angle_rad + std::f64::consts::FRAC_PI_2)
            .xyz()
            - place.centre_mm;
        let clockwise = place.sense == Sense::Clockwise;
        let along = if clockwise { -tangent } else { tangent };
        point(place, positions, &along, station_uncertainty_mm)
    });
    Recording {
        run: number,
        place: *place,
        points: points.collect(),
    }
}

/// A planned trajectory through `places_mm`, as a recording whose readings are what a perfect machine gives.
#[must_use]
pub fn planned_through(
    number: u32,
    place: &Place,
    places_mm: &[Vector3<f64>],
    station_uncertainty_mm: f64,
) -> Recording {
    let every = places_mm.len().div_ceil(PLANNED_STATIONS as usize).max(1);
    let points = (0..places_mm.len()).step_by(every).map(|k| {
        let ends = [
            k.checked_sub(1).unwrap_or(k),
            (k + 1).min(places_mm.len() - 1),
        ];
        // A place is approached in the direction of motion, the first one too.
        let along = if k == 0 {
            places_mm[ends[1]] - places_mm[k]
        } else {
            places_mm[k] - places_mm[ends[0]]
        };
        let mut positions = PerAxis::default();
        for axis in Axis::LINEAR {
            positions[axis] = places_mm[k][axis.index()];
        }
        point(place, positions, &along, station_uncertainty_mm)
    });
    Recording {
        run: number,
        place: *place,
        points: points.collect(),
    }
}

fn point(
    place: &Place,
    positions: PerAxis<f64>,
    along: &Vector3<f64>,
    station_uncertainty_mm: f64,
) -> GridPoint {
    let moving = place.stations == 0;
    GridPoint {
        positions,
        sense: along.map(|c| if c.abs() > 1e-9 { c.signum() } else { 0.0 }),
        velocity_mm_s: match along.try_normalize(1e-9) {
            Some(direction) if moving => direction * place.feed_mm_s,
            _ => Vector3::zeros(),
        },
        reading_mm: in_plane(place.plane, &positions.xyz()),
        standard_uncertainty_mm: [station_uncertainty_mm; 2],
        n_readings: 1,
    }
}

/// What a programme of circles will see; its covariance is (1), its values mean nothing.
///
/// # Errors
/// As [`identify`].
pub fn preflight(
    kinematics: &Kinematics,
    places: &[Place],
    options: &IdentifyOptions,
    station_uncertainty_mm: f64,
) -> Result<Identification, IdentifyError> {
    let numbered = (1..).zip(places);
    let recordings: Vec<Recording> = numbered
        .map(|(number, place)| planned(number, place, station_uncertainty_mm))
        .collect();
    preflight_of(kinematics, &recordings, options)
}

/// What planned recordings will see, as [`preflight`].
///
/// # Errors
/// As [`identify`].
pub fn preflight_of(
    kinematics: &Kinematics,
    recordings: &[Recording],
    options: &IdentifyOptions,
) -> Result<Identification, IdentifyError> {
    let options = IdentifyOptions {
        outlier_limit: f64::INFINITY,
        recording_noise: false,
        noise: Noise::AsStated,
        disturbed: Disturbed::Ignored,
        ..options.clone()
    };
    identify(kinematics, recordings, &options)
}

/// Sum of the outer products of the scaled rows of one planned recording, by column.
pub(crate) fn information(equations: &Equations, recording_idx: usize) -> DMatrix<f64> {
    let p = equations.unknowns.len();
    let mut gram = DMatrix::zeros(p, p);
    let mut rows = PointRows::default();
    for point in &equations.recordings[recording_idx].points {
        equations.fill(recording_idx, point, &mut rows);
        for (row, _, _) in rows.iter() {
            let filled: Vec<usize> = (0..p).filter(|j| row[*j].abs() > 0.0).collect();
            for &i in &filled {
                for &j in &filled {
                    gram[(i, j)] += row[i] * row[j];
                }
            }
        }
    }
    gram
}
