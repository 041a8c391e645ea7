//! How large a hidden effect is for the measurements of its trial.
//!
//! # Model
//!
//! The programme is run on the plant with and without the effect, the scatter being the same. The difference s of the
//! readings, run by run, meets the covariance of that scatter, which the generator has drawn itself:
//!
//! ```text
//!   D^2 = sum over set-ups of  S_ss - S_sN S_NN^-1 S_Ns,   S_ab = sum over runs of a' C^-1 b   (1)
//!   C = v I + V K,   v = sigma^2/m [(1 + phi)/(1 - phi) - 2 phi (1 - phi^m)/(m (1 - phi)^2)] + q^2   (2)
//!   K_ij = mean over wave lengths of sin(k d_ij) / (k d_ij),   k = 2 pi / length            (3)
//! ```
//!
//! The plant is not the same to the last digit either: loops chatter within a step of their encoders, differently once
//! anything has changed. That part c^2 of the difference is taken from neighbouring readings of one motion or one stop, added
//! to v, and its expectation, c^2/v for each row, taken from D^2. How an axis comes to rest differently from stop to stop
//! stays in s: some D of 1 that is no effect's.
//!
//! What the simulator itself is off by belongs to the noise as well, whatever is averaged: a smooth error of form along
//! the waves and a rough one from row to row, of which the n repeats of a test see the same draw:
//!
//! ```text
//!   V += n f^2,   v += n (f/2)^2                                                          (4)
//! ```
//!
//! A touch has f for its feature and feed instead, and where an axis stands all readings are one row: they have one error of
//! form, however long it stands. Only that is counted which the test is made of: a circle while the
//! command is on it at its feed, a position once the axis has stood for [`SETTLES_S`]. While an axis runs in, an effect of
//! the drive may be ten times what it is on the circle, and no evaluation looks there.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | sigma, phi, V | `Scatter`: white, memory, square of what runs differ by | mm, 1, mm² |
//! | q | `INSTRUMENT_MM` | mm |
//! | f | `FORM_MM` | mm |
//!
//! A row is the mean of m readings at one place; rows of one direction that are d_ij apart go together by (3), which is
//! what waves of every direction and of lengths from 80 to 800 mm make on average. Which waves a machine has nobody who
//! measures it can know. N holds what every set-up leaves open, once for all of its runs: zeros, the turn of the plate,
//! the place of a touched face. A delay turns the plate one way in one sense of rotation and the other way in the other,
//! so that its size is seen in both together and in neither alone. Motor encoders are left out: what they show is seen by the instruments too.

use std::collections::BTreeMap;

use metrology::sample::{ProbeTrigger, TestKind, TestSegment};
use metrology::stamp::{Host, Stamp};
use metrology::{Axis, PerAxis};
use nalgebra::{DMatrix, DVector, Vector3};

use crate::measurement::{Sample, plane_axes};
use crate::proportion::median;
use crate::scatter::Scatter;

use waves::Waves;

mod beside;
mod waves;

/// Rows that a run's readings are thinned to.
const ROWS: usize = 120;
/// What averaging of readings does not lower: short waves of instruments and slides, q, mm.
const INSTRUMENT_MM: f64 = 5e-5;
/// Repeatability of one touch, mm.
const TOUCH_MM: f64 = 3e-4;
/// Error of form that every simulator of a machine has, f, mm.
const FORM_MM: f64 = 2e-4;
/// Part of it that is rough.
const ROUGH: f64 = 0.5;
/// Least time between two states, s.
const LEAST_PERIOD_S: f64 = 1e-4;
/// An axis that moved by less than this since the reading before stands, mm.
const STANDS_MM: f64 = 1e-6;
/// How long it stands before its position counts, s.
const SETTLES_S: f64 = 0.3;
/// The command is on the circle when it is this close to it, mm.
const ON_CIRCLE_MM: f64 = 2e-3;
/// Share of the feed below which it is still running in.
const AT_FEED: f64 = 0.98;

/// A reading less its command, with what it was made by.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Reading {
    deviation_mm: f64,
    /// 0, 1, 2 for X, Y, Z.
    direction: usize,
    place_mm: Vector3<f64>,
    /// Since when the axes stood; none while they move.
    stands_since: Option<Stamp<Host>>,
}

/// What repeats of a test have in common.
type Condition = String;

/// What a row is floated by besides the waves.
#[derive(Clone, Debug, PartialEq)]
enum Floats {
    /// An offset of each direction and a turn about the third one.
    Plate([usize; 2]),
    /// An offset.
    Zero,
}

/// Readings of one instrument in one run.
#[derive(Clone, Debug, PartialEq)]
struct Block {
    floats: Floats,
    readings: Vec<Reading>,
    is_touch: bool,
    condition: Condition,
    set_up: SetUp,
}

/// What shares floats.
type SetUp = String;

/// Which block: run, then what is touched.
type Key = (u32, String);

/// Deviations of a session, without its scatter's part where two are subtracted.
#[derive(Clone, Debug, Default)]
pub(crate) struct Deviations {
    blocks: BTreeMap<Key, Block>,
    segment: Option<TestSegment>,
    commanded: PerAxis<f64>,
    commanded_at: Stamp<Host>,
    velocity_mm_s: Vector3<f64>,
    stands_since: Option<Stamp<Host>>,
}

impl Deviations {
    /// Takes a sample of the session.
    pub(crate) fn take(&mut self, at: Stamp<Host>, sample: &Sample) {
        match sample {
            Sample::State(state) => {
                let way = (state.commanded.xyz() - self.commanded.xyz()).norm();
                self.stands_since =
                    (way < STANDS_MM).then(|| self.stands_since.unwrap_or(state.received_at));
                let since_s = (state.received_at - self.commanded_at).as_secs_f64();
                let moved = state.commanded.xyz() - self.commanded.xyz();
                self.velocity_mm_s = moved / since_s.max(LEAST_PERIOD_S);
                self.commanded_at = state.received_at;
                self.commanded = state.commanded;
            }
            Sample::Segment(segment) => {
                let is_test = segment.begin && segment.kind != TestKind::Production;
                self.segment = is_test.then(|| segment.clone());
            }
            Sample::Grid(sample) if self.is_on_circle() => {
                let axes = plane_axes(sample.plane);
                // A reading is compared with the command at its stamp, which may be late.
                let late_s = (sample.at - at).as_secs_f64();
                let here_mm = self.commanded.xyz() + self.velocity_mm_s * late_s;
                let readings = [sample.u_mm, sample.v_mm].into_iter().zip(axes);
                for (read_mm, direction) in readings {
                    self.push(
                        "",
                        Floats::Plate(axes),
                        false,
                        Reading {
                            deviation_mm: read_mm - here_mm[direction],
                            direction,
                            place_mm: here_mm,
                            stands_since: self.stands_since,
                        },
                    );
                }
            }
            Sample::Length(sample) if self.has_settled(at) => {
                let here_mm = self.commanded.xyz();
                let direction = sample.axis.index();
                self.push(
                    sample.axis.letter(),
                    Floats::Zero,
                    false,
                    Reading {
                        deviation_mm: sample.displacement_mm - here_mm[direction],
                        direction,
                        place_mm: here_mm,
                        stands_since: self.stands_since,
                    },
                );
            }
            Sample::Trigger(trigger) => self.touch(trigger),
            Sample::Grid(_) | Sample::Length(_) | Sample::Temperature(_) => {}
        }
    }

    fn has_settled(&self, at: Stamp<Host>) -> bool {
        self.stands_since
            .is_some_and(|since| (at - since).as_secs_f64() >= SETTLES_S)
    }

    /// Whether the command is on the circle of the test at its feed; every other test counts throughout.
    fn is_on_circle(&self) -> bool {
        let Some(segment) = &self.segment else {
            return false;
        };
        if segment.kind != TestKind::Circle {
            return true;
        }
        let [u, v] = plane_axes(segment.plane);
        let from_centre = self.commanded.xyz() - segment.centre_mm;
        let off_mm = from_centre[u].hypot(from_centre[v]) - segment.radius_mm;
        let speed_mm_s = self.velocity_mm_s[u].hypot(self.velocity_mm_s[v]);
        off_mm.abs() <= ON_CIRCLE_MM && speed_mm_s >= AT_FEED * segment.feed_mm_s
    }

    /// A touch: where the axes were latched, along the approach.
    fn touch(&mut self, trigger: &ProbeTrigger) {
        let size = |axis: &Axis| trigger.approach[axis.index()].abs();
        let along = Axis::LINEAR
            .into_iter()
            .max_by(|a, b| size(a).total_cmp(&size(b)));
        let place_mm = trigger.latched.xyz();
        let reading = Reading {
            deviation_mm: place_mm.dot(&trigger.approach),
            direction: along.map_or(0, Axis::index),
            place_mm,
            stands_since: None,
        };
        self.push(&trigger.feature_id, Floats::Zero, true, reading);
    }

    fn push(&mut self, what: &str, floats: Floats, is_touch: bool, reading: Reading) {
        let Some(segment) = &self.segment else {
            return;
        };
        let block = self
            .blocks
            .entry((segment.run, what.to_owned()))
            .or_insert_with(|| Block {
                floats,
                readings: vec![],
                is_touch,
                condition: condition(segment, what),
                set_up: format!(
                    "{} {} {:?} {what}",
                    segment.setup_id, segment.zero_id, segment.plane
                ),
            });
        block.readings.push(reading);
    }

    /// D of what is in `self` and not in `without`, equation (1); a reading also has the variance of the tool's shaking,
    /// which turns often within a row.
    pub(crate) fn d_against(&self, without: &Self, scatter: &Scatter, shaking_mm2: f64) -> f64 {
        let mut repeats = BTreeMap::<&str, f64>::new();
        for block in self.blocks.values() {
            *repeats.entry(&block.condition).or_default() += 1.0;
        }
        let waves = Waves::default();
        let mut by_set_up = BTreeMap::<&str, Gain>::new();
        for (key, with) in &self.blocks {
            let Some(other) = without.blocks.get(key) else {
                continue;
            };
            let repeats = repeats[&*with.condition];
            let Some(gain) = gain(with, other, scatter, shaking_mm2, repeats, &waves) else {
                continue;
            };
            let sum = by_set_up.entry(&with.set_up).or_insert_with(|| Gain {
                products: DMatrix::zeros(gain.products.nrows(), gain.products.ncols()),
                of_chatter: 0.0,
            });
            sum.products += gain.products;
            sum.of_chatter += gain.of_chatter;
        }
        let square: f64 = by_set_up.values().map(Gain::square).sum();
        square.max(0.0).sqrt()
    }
}

/// Products (3) of the signature and the floats, and what chatter adds to the first.
struct Gain {
    products: DMatrix<f64>,
    of_chatter: f64,
}

impl Gain {
    /// One set-up's part of (1).
    fn square(&self) -> f64 {
        let n = self.products.nrows();
        let mut floats = self.products.view((1, 1), (n - 1, n - 1)).into_owned();
        let most = floats.diagonal().max();
        for k in 0..n - 1 {
            // Keeps a float that no row has from being divided by.
            floats[(k, k)] += 1e-12 * most + f64::MIN_POSITIVE;
        }
        let along = self.products.view((1, 0), (n - 1, 1)).into_owned();
        let floated = floats
            .cholesky()
            .map_or(0.0, |factor| along.dot(&factor.solve(&along)));
        (self.products[(0, 0)] - floated).max(0.0) - self.of_chatter
    }
}

/// What a run has in common with its repeats.
fn condition(segment: &TestSegment, what: &str) -> Condition {
    format!(
        "{:?} {:?} {:?} {:.1} {:.1} {:.1} {:.1} {:.2} {what}",
        segment.kind,
        segment.plane,
        segment.sense,
        segment.centre_mm.x,
        segment.centre_mm.y,
        segment.centre_mm.z,
        segment.radius_mm,
        segment.feed_mm_s
    )
}

/// Gain of one block, which a number of repeats share the error of form of; none where it has no rows.
fn gain(
    with: &Block,
    without: &Block,
    scatter: &Scatter,
    shaking_mm2: f64,
    repeats: f64,
    waves: &Waves,
) -> Option<Gain> {
    let both: Vec<(Reading, f64)> = with
        .readings
        .iter()
        .zip(&without.readings)
        .filter(|(a, b)| a.direction == b.direction)
        .map(|(a, b)| (*a, a.deviation_mm - b.deviation_mm))
        .collect();
    let rows = Rows::of(&both, &with.floats);
    if rows.signature.is_empty() {
        return None;
    }
    let row_mm2 = INSTRUMENT_MM.powi(2) + repeats * (ROUGH * FORM_MM).powi(2);
    // Of each row: everything, and what of it is chatter.
    let variances_mm2 = rows.mean_of.map(|readings| {
        if with.is_touch {
            return (TOUCH_VARIANCE_MM2, 0.0);
        }
        let chatter_mm2 = rows.chatter_mm2 / readings;
        let reading_mm2 =
            shaking_mm2 / readings + of_mean_mm2(scatter.white_mm, scatter.ar, readings);
        (reading_mm2 + row_mm2 + chatter_mm2, chatter_mm2)
    });
    // (4): the place of a touched face floats, and what is smooth hardly varies over it.
    let form_mm2 = if with.is_touch {
        0.0
    } else {
        repeats * FORM_MM.powi(2)
    };
    let smooth_mm2 = scatter.between_runs_mm.powi(2) + form_mm2;
    Some(Gain {
        products: rows.products(&variances_mm2.map(|(all, _)| all), smooth_mm2, waves),
        of_chatter: variances_mm2.iter().map(|(all, of)| of / all).sum(),
    })
}

/// First term of v in (2).
fn of_mean_mm2(white_mm: f64, ar: f64, readings: f64) -> f64 {
    let left = 1.0 - ar;
    let ends = 2.0 * ar * (1.0 - ar.powf(readings)) / (readings * left * left);
    white_mm.powi(2) / readings * ((1.0 + ar) / left - ends)
}

/// Touches of one face at one feed in a run (`programme`).
const TOUCHES_ALIKE: f64 = 2.0;
/// Variance of a touch, mm².
pub(crate) const TOUCH_VARIANCE_MM2: f64 = TOUCH_MM * TOUCH_MM + TOUCHES_ALIKE * FORM_MM * FORM_MM;
/// Middle square of a normal number of variance 1.
const MIDDLE_SQUARE: f64 = 0.454_936;

/// Variance of a mean that its neighbours do not share, mm2, from second differences (six times it) within motions or stops:
/// slopes have none, and steps of a signature while the axes move are too few to matter.
fn chatter_mm2<'m>(parts: impl Iterator<Item = &'m Vec<f64>>) -> f64 {
    let squares = parts.flat_map(|part| part.windows(3));
    let squares = squares.map(|rows| (rows[0] - 2.0 * rows[1] + rows[2]).powi(2));
    median(squares.collect()).map_or(0.0, |middle| middle / (6.0 * MIDDLE_SQUARE))
}

/// The rows of a block.
struct Rows {
    signature: DVector<f64>,
    /// Columns of N.
    floats: DMatrix<f64>,
    places_mm: Vec<Vector3<f64>>,
    /// Rows of each direction.
    directions: Vec<std::ops::Range<usize>>,
    /// Readings of each row.
    mean_of: DVector<f64>,
    /// Variance of one reading that its neighbours do not share, mm².
    chatter_mm2: f64,
}

impl Rows {
    fn of(both: &[(Reading, f64)], floats: &Floats) -> Self {
        let directions: Vec<usize> = match floats {
            Floats::Plate(axes) => axes.to_vec(),
            Floats::Zero => both.first().map(|(r, _)| r.direction).into_iter().collect(),
        };
        let per_direction = both.len() / directions.len().max(1);
        let least = (per_direction / ROWS).max(1);
        let (mut values, mut places_mm, mut mean_of) = (Vec::new(), Vec::new(), Vec::new());
        let (mut ranges, mut parts) = (Vec::new(), Vec::new());
        for direction in &directions {
            let first = values.len();
            let along = both.iter().filter(|(r, _)| r.direction == *direction);
            let along: Vec<(Reading, f64)> = along.copied().collect();
            let stretches = along.chunk_by(|a, b| a.0.stands_since == b.0.stands_since);
            parts.extend(stretches.map(|part| part.chunks(least).map(mean).collect()));
            for row in rows_of(&along, least) {
                let places = row.iter().map(|(reading, _)| reading.place_mm);
                places_mm.push(places.sum::<Vector3<f64>>() / row.len() as f64);
                mean_of.push(row.len() as f64);
                values.push(mean(row));
            }
            ranges.push(first..values.len());
        }
        let mut columns = DMatrix::zeros(values.len(), ranges.len() + 1);
        for (place, range) in ranges.iter().enumerate() {
            for row in range.clone() {
                columns[(row, place)] = 1.0;
                if let Floats::Plate([u, v]) = floats {
                    let (x, y) = (places_mm[row][*u], places_mm[row][*v]);
                    columns[(row, ranges.len())] = if place == 0 { -y } else { x };
                }
            }
        }
        Self {
            signature: DVector::from_vec(values),
            floats: columns,
            places_mm,
            directions: ranges,
            mean_of: DVector::from_vec(mean_of),
            chatter_mm2: chatter_mm2(parts.iter()) * least as f64,
        }
    }

    /// a' C^-1 b of the signature and the floats, with (2).
    fn products(
        &self,
        variances_mm2: &DVector<f64>,
        smooth_mm2: f64,
        waves: &Waves,
    ) -> DMatrix<f64> {
        let mut sides = self.floats.clone().insert_column(0, 0.0);
        sides.set_column(0, &self.signature);
        let count = sides.ncols();
        let mut sum = DMatrix::zeros(count, count);
        for range in &self.directions {
            let n = range.len();
            // The factor reads the lower half only.
            let mut covariance = DMatrix::zeros(n, n);
            for j in 0..n {
                covariance[(j, j)] = variances_mm2[range.start + j] + smooth_mm2;
                for i in j + 1..n {
                    let (a, b) = (range.start + i, range.start + j);
                    let apart_mm = (self.places_mm[a] - self.places_mm[b]).norm();
                    covariance[(i, j)] = smooth_mm2 * waves.alike(apart_mm);
                }
            }
            let own = sides.rows(range.start, n).into_owned();
            if let Some(factor) = covariance.cholesky() {
                sum += own.tr_mul(&factor.solve(&own));
            }
        }
        sum
    }
}

/// Readings that make a row each: at least so many, and all that an axis gave where it stood.
fn rows_of(along: &[(Reading, f64)], least: usize) -> Vec<&[(Reading, f64)]> {
    let since = |k: usize| along[k].0.stands_since;
    let moves = |k: usize| since(k).is_none() || since(k) != since(k - 1);
    let (mut rows, mut first) = (Vec::new(), 0);
    for k in 1..along.len() {
        if k - first >= least && moves(k) {
            rows.push(&along[first..k]);
            first = k;
        }
    }
    if first < along.len() {
        rows.push(&along[first..]);
    }
    rows
}

fn mean(row: &[(Reading, f64)]) -> f64 {
    row.iter().map(|(_, value)| value).sum::<f64>() / row.len() as f64
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64Mcg;

    use super::*;

    #[test]
    fn eq1_a_float_that_turns_round_between_two_runs_is_no_float() {
        let gain = |runs: &[f64]| {
            let each = runs.iter().map(|run| {
                let reading = |k: u32| {
                    let place = f64::from(k) * 4.0;
                    let reading = Reading {
                        deviation_mm: 0.0,
                        direction: 0,
                        place_mm: Vector3::new(place, 0.0, 0.0),
                        stands_since: None,
                    };
                    (reading, run * 1e-3)
                };
                let both: Vec<_> = (0..40).map(reading).collect();
                let rows = Rows::of(&both, &Floats::Zero);
                rows.products(&rows.mean_of.map(|_| 1e-8), 0.0, &Waves::default())
            });
            let products = each.fold(DMatrix::zeros(3, 3), |sum, part| sum + part);
            let gain = Gain {
                products: products.remove_row(2).remove_column(2),
                of_chatter: 0.0,
            };
            gain.square()
        };
        assert!(gain(&[1.0, 1.0]) < 1e-3);
        let apart = gain(&[1.0, -1.0]);
        assert!((apart / (80.0 * 1e-6 / 1e-8) - 1.0).abs() < 1e-6, "{apart}");
    }

    #[test]
    fn an_axis_that_stands_gives_one_row_a_stop_and_one_that_moves_rows_of_some_readings() {
        let at = |place: f64, stop: Option<u32>| Reading {
            deviation_mm: 0.0,
            direction: 0,
            place_mm: Vector3::new(place, 0.0, 0.0),
            stands_since: stop.map(|stop| Stamp::from_nanos(i64::from(stop))),
        };
        // The last target is come to twice, once from either side.
        let there = |k: u32| f64::from((k / 27).min(17 - k / 27));
        let stops: Vec<_> = (0..486)
            .map(|k| (at(there(k), Some(k / 27)), 1e-3))
            .collect();
        let rows = Rows::of(&stops, &Floats::Zero);
        assert_eq!(rows.signature.len(), 18);
        assert!(
            rows.mean_of
                .iter()
                .take(17)
                .all(|readings| (readings - 27.0).abs() < 1e-9)
        );
        let way: Vec<_> = (0..480).map(|k| (at(f64::from(k), None), 1e-3)).collect();
        assert_eq!(Rows::of(&way, &Floats::Zero).signature.len(), 120);
    }

    #[test]
    fn means_that_differ_from_their_neighbours_are_chatter_and_a_step_is_not() {
        let row = |row: u32| f64::from(row) * 1e-5 + if row < 37 { 0.0 } else { 3e-3 };
        let step: Vec<f64> = (0..100).map(row).collect();
        assert!(chatter_mm2([&step].into_iter()).abs() < 1e-18);
        // A staircase of stops with a few means each.
        let stairs: Vec<Vec<f64>> = step.iter().map(|value| vec![*value; 4]).collect();
        assert!(chatter_mm2(stairs.iter()).abs() < 1e-18);
        let mut rng = Pcg64Mcg::seed_from_u64(7);
        let draw = || 0.3 * rng.sample::<f64, _>(StandardNormal);
        let spread: Vec<f64> = std::iter::repeat_with(draw).take(20_000).collect();
        let ratio = chatter_mm2([&spread].into_iter()) / 0.09;
        assert!((0.95..1.05).contains(&ratio), "{ratio}");
    }

    #[test]
    fn eq2_the_mean_of_readings_with_memory_is_the_sum_of_their_covariances() {
        for (ar, readings) in [(0.0_f64, 9), (0.45, 27), (0.9, 9), (0.9, 27)] {
            let pairs =
                (0..readings).flat_map(|i: i32| (0..readings).map(move |k| ar.powi((i - k).abs())));
            let wanted = pairs.sum::<f64>() / f64::from(readings * readings);
            let found = of_mean_mm2(1.0, ar, f64::from(readings));
            assert!(
                (found / wanted - 1.0).abs() < 1e-12,
                "{ar} {readings}: {found} {wanted}"
            );
        }
    }
}
