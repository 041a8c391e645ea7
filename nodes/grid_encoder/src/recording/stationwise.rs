//! A program that stops at each point: finds the stops in the commanded motion and averages the readings of each.
//!
//! A stop begins when the commanded velocity falls to zero and is used from `settle_s` later until the
//! command moves again: until then the servos still run in and the column still swings. Where the
//! trajectory is a circle or an arc, stops that do not lie on it (before the first point, after the last)
//! are left out. `station_mean` has the equations of mean and uncertainty.

use metrology::stamp::Span;

use super::GridPoint;
use super::collect::Pair;
use super::place::{Place, in_plane};
use super::station_mean::{StationMean, correlation_length, standard_uncertainty_mm, station_mean};

/// How much greater than the pooled variance a station's own must be to be used instead.
const OWN_VARIANCE: f64 = 4.0;

/// What makes a stop a station.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StationRules {
    /// Commanded speed below which the machine stands, mm/s.
    pub standstill_mm_s: f64,
    /// Time after the command stopped that is not used, s.
    pub settle_s: f64,
    /// Fewest readings of a station.
    pub least_readings: usize,
    /// Distance from the nominal circle up to which a command is on it, mm.
    pub on_circle_mm: f64,
    /// Resolution of the grid, mm.
    pub resolution_mm: f64,
}

impl StationRules {
    /// Whether the command is on the nominal circle, where there is one.
    pub(super) fn is_on(&self, pair: &Pair, place: &Place) -> bool {
        if !place.is_round() {
            return true;
        }
        let from_centre = pair.commanded.xyz() - place.centre_mm;
        let [u, v] = in_plane(place.plane, &from_centre);
        (u.hypot(v) - place.radius_mm).abs() <= self.on_circle_mm
    }
}

/// Stations of a recording, and the readings set aside as outliers.
#[must_use]
pub fn reduce_stationwise(
    pairs: &[Pair],
    place: &Place,
    rules: &StationRules,
) -> (Vec<GridPoint>, usize) {
    let stops: Vec<&[Pair]> = stops(pairs, rules)
        .into_iter()
        .filter(|stop| stop.len() >= rules.least_readings && rules.is_on(&stop[0], place))
        .collect();
    let means: Vec<[StationMean; 2]> = stops
        .iter()
        .filter_map(|stop| {
            let of = |idx: usize| -> Option<StationMean> {
                let readings: Vec<f64> = stop.iter().map(|pair| pair.reading_mm[idx]).collect();
                station_mean(&readings, rules.resolution_mm)
            };
            Some([of(0)?, of(1)?])
        })
        .collect();
    let noise = [0, 1].map(|idx| Noise::of(&means, idx));
    let points = stops.iter().zip(&means).map(|(stop, mean)| {
        let middle = &stop[stop.len() / 2];
        let u = |idx: usize| {
            let own = mean[idx].variance_mm2;
            let pooled = noise[idx].variance_mm2;
            let variance = if own > OWN_VARIANCE * pooled {
                own
            } else {
                pooled
            };
            standard_uncertainty_mm(variance, noise[idx].tau, mean[idx].n, rules.resolution_mm)
        };
        GridPoint {
            positions: mean_positions(stop),
            sense: middle.sense,
            velocity_mm_s: nalgebra::Vector3::zeros(),
            reading_mm: [mean[0].mean_mm, mean[1].mean_mm],
            standard_uncertainty_mm: [u(0), u(1)],
            n_readings: u32::try_from(mean[0].n.min(mean[1].n)).unwrap_or(u32::MAX),
        }
    });
    let outliers = means.iter().flatten().map(|mean| mean.n_outliers).sum();
    (points.collect(), outliers)
}

/// Noise of all stations of one coordinate together.
struct Noise {
    variance_mm2: f64,
    tau: f64,
}

impl Noise {
    fn of(means: &[[StationMean; 2]], idx: usize) -> Self {
        let freedom: f64 = means.iter().map(|m| (m[idx].n.max(1) - 1) as f64).sum();
        let squares: f64 = means
            .iter()
            .map(|m| m[idx].variance_mm2 * (m[idx].n.max(1) - 1) as f64)
            .sum();
        Self {
            variance_mm2: if freedom > 0.0 {
                squares / freedom
            } else {
                0.0
            },
            tau: correlation_length(means.iter().map(|m| m[idx].residuals_mm.as_slice())),
        }
    }
}

/// Readings of each stop, settled.
fn stops<'a>(pairs: &'a [Pair], rules: &StationRules) -> Vec<&'a [Pair]> {
    let settle = Span::from_secs_f64(rules.settle_s);
    pairs
        .chunk_by(|a, b| {
            a.is_standing(rules.standstill_mm_s) == b.is_standing(rules.standstill_mm_s)
        })
        .filter(|run| {
            run.first()
                .is_some_and(|pair| pair.is_standing(rules.standstill_mm_s))
        })
        .map(|run| {
            let begin = run[0].at;
            let settled = run.partition_point(|pair| pair.at - begin < settle);
            &run[settled..]
        })
        .filter(|run| !run.is_empty())
        .collect()
}

fn mean_positions(stop: &[Pair]) -> metrology::PerAxis<f64> {
    let n = stop.len() as f64;
    metrology::PerAxis::from_fn(|axis| {
        let first = stop[0].positions[axis];
        let above: f64 = stop.iter().map(|pair| pair.positions[axis] - first).sum();
        first + above / n
    })
}
