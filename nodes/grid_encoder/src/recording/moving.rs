//! A program that does not stop: each reading is a point, or the mean of a bin of the trace.
//!
//! Bins are of equal time. Within a bin of n readings the trace is bent by less than the error of its
//! chord, R(δφ)²/24 of both reading and position, and that is common to both: their difference, which the
//! fit uses, keeps nothing of it. Standard uncertainty is that of the difference reading − position within
//! bins, pooled over the recording: what changes slowly along the trace is geometry and stays.

use nalgebra::Vector3;

use super::GridPoint;
use super::collect::Pair;
use super::place::{Place, in_plane};
use super::station_mean::station_mean;
use super::stationwise::StationRules;
use metrology::PerAxis;

/// Points of a trace, at most `n_bins`, and the readings set aside as outliers; zero bins: every reading.
///
/// Of circles and arcs, the ways to their begin and from their end are left out.
#[must_use]
pub fn reduce_moving(
    pairs: &[Pair],
    place: &Place,
    n_bins: usize,
    rules: &StationRules,
) -> (Vec<GridPoint>, usize) {
    let resolution_mm = rules.resolution_mm;
    let moving: Vec<&Pair> = pairs
        .iter()
        .filter(|pair| !pair.is_standing(rules.standstill_mm_s) && rules.is_on(pair, place))
        .collect();
    let size = if n_bins == 0 {
        1
    } else {
        moving.len().div_ceil(n_bins).max(1)
    };
    let noise_mm = noise_mm(&moving, place, resolution_mm);
    let mut outliers = 0;
    let points = moving
        .chunks(size)
        .filter_map(|bin| {
            let (point, aside) = point(bin, place, &noise_mm, resolution_mm)?;
            outliers += aside;
            Some(point)
        })
        .collect();
    (points, outliers)
}

fn deviation_mm(pair: &Pair, place: &Place) -> [f64; 2] {
    let at = in_plane(place.plane, &pair.positions.xyz());
    [pair.reading_mm[0] - at[0], pair.reading_mm[1] - at[1]]
}

/// Standard deviation of one reading from its neighbours: second differences, so that a smooth trace adds nothing.
fn noise_mm(pairs: &[&Pair], place: &Place, resolution_mm: f64) -> [f64; 2] {
    let floor = resolution_mm / 12_f64.sqrt();
    [0, 1].map(|idx| {
        let d: Vec<f64> = pairs.iter().map(|p| deviation_mm(p, place)[idx]).collect();
        let second: Vec<f64> = d
            .windows(3)
            .map(|w| (w[0] - 2.0 * w[1] + w[2]).abs())
            .collect();
        let middle = super::station_mean::median(&second).unwrap_or(0.0);
        // The variance of x - 2y + z is 6 of one; the median of |.| of a normal is 0.6745 of its deviation.
        (middle / 0.6745 / 6_f64.sqrt()).max(floor)
    })
}

fn point(
    bin: &[&Pair],
    place: &Place,
    noise_mm: &[f64; 2],
    resolution_mm: f64,
) -> Option<(GridPoint, usize)> {
    let n = bin.len() as f64;
    let middle = bin.get(bin.len() / 2)?;
    let positions =
        PerAxis::from_fn(|axis| bin.iter().map(|pair| pair.positions[axis]).sum::<f64>() / n);
    let mut velocity_mm_s = Vector3::zeros();
    for pair in bin {
        velocity_mm_s += pair.velocity_mm_s / n;
    }
    let mut reading_mm = [0.0; 2];
    let mut standard_uncertainty_mm = [0.0; 2];
    let (mut least, mut outliers) = (bin.len(), 0);
    let at = in_plane(place.plane, &positions.xyz());
    for idx in 0..2 {
        let deviations: Vec<f64> = bin.iter().map(|p| deviation_mm(p, place)[idx]).collect();
        let mean = station_mean(&deviations, noise_mm[idx].max(resolution_mm))?;
        reading_mm[idx] = at[idx] + mean.mean_mm;
        standard_uncertainty_mm[idx] = noise_mm[idx] / (mean.n as f64).sqrt();
        least = least.min(mean.n);
        outliers += mean.n_outliers;
    }
    let point = GridPoint {
        positions,
        sense: middle.sense,
        velocity_mm_s,
        reading_mm,
        standard_uncertainty_mm,
        n_readings: u32::try_from(least).unwrap_or(u32::MAX),
    };
    Some((point, outliers))
}
