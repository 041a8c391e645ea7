//! How large a hidden effect is for the measurements of its trial.
//!
//! # Model
//!
//! The programme is run on the plant with and without the effect, the scatter being the same. The difference s of the
//! readings, run by run, meets the covariance of that scatter, which the generator has drawn itself:
//!
//! ```text
//!   D^2 = sum over runs of s' C^-1 s                                                      (1)
//!   C = v I + B V B',   v = sigma^2 (1 + phi) / ((1 - phi) m) + q^2                       (2)
//!   s' C^-1 s = (s's - b' (v V^-1 + B'B)^-1 b) / v,   b = B's                             (3)
//! ```
//!
//! The plant is not the same to the last digit either: loops chatter within a step of their encoders, differently once
//! anything has changed. That part c^2 of the difference is taken from neighbouring rows, added to v, and its
//! expectation, c^2/v for each row, taken from D^2.
//!
//! What the simulator itself is off by belongs to the noise as well, whatever is averaged: a smooth error of form along
//! the waves and a rough one from row to row, of which the n repeats of a test see the same draw:
//!
//! ```text
//!   V += n f^2 / K,   v += n (f/2)^2                                                      (4)
//! ```
//!
//! A touch has f for its feature and feed instead.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | sigma, phi, V | `Scatter` | mm, 1, mm² |
//! | q | `INSTRUMENT_MM` | mm |
//! | f | `FORM_MM` | mm |
//!
//! A row is the mean of m readings. B holds the waves of the smooth deviation, with their variance in V, and
//! what every set-up leaves open, with an infinite one: zeros, the turn of the plate, the place of a touched face. They
//! are left open in every run here, once for a set-up in the diagnosis, so that D is a little too small rather than too
//! large. Motor encoders are left out: what they show is seen by the instruments too.
//!
//! # Agreement
//! `eq3_equals_the_inverse_of_the_covariance`: 1e-9 relative, against the dense inverse.

use std::collections::BTreeMap;

use metrology::sample::{ProbeTrigger, TestKind, TestSegment};
use metrology::stamp::{Host, Stamp};
use metrology::{Axis, PerAxis};
use nalgebra::{DMatrix, DVector, Vector3};

use crate::measurement::{Sample, plane_axes};
use crate::proportion::median;
use crate::scatter::{Scatter, WAVES};

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

/// A reading less its command, with what it was made by.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Reading {
    deviation_mm: f64,
    /// 0, 1, 2 for X, Y, Z.
    direction: usize,
    place_mm: Vector3<f64>,
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
}

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
    stands: bool,
}

impl Deviations {
    /// Takes a sample of the session.
    pub(crate) fn take(&mut self, at: Stamp<Host>, sample: &Sample) {
        match sample {
            Sample::State(state) => {
                let way = (state.commanded.xyz() - self.commanded.xyz()).norm();
                self.stands = way < STANDS_MM;
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
            Sample::Grid(sample) => {
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
                        },
                    );
                }
            }
            Sample::Length(sample) if self.stands => {
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
                    },
                );
            }
            Sample::Trigger(trigger) => self.touch(trigger),
            Sample::Length(_) | Sample::Temperature(_) => {}
        }
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
        let squares = self.blocks.iter().map(|(key, with)| {
            let other = without.blocks.get(key);
            let repeats = repeats[&*with.condition];
            other.map_or(0.0, |other| {
                gain(with, other, scatter, shaking_mm2, repeats)
            })
        });
        squares.sum::<f64>().max(0.0).sqrt()
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

/// Gain of one block, (3), which a number of repeats share the error of form of.
fn gain(with: &Block, without: &Block, scatter: &Scatter, shaking_mm2: f64, repeats: f64) -> f64 {
    let both: Vec<(Reading, f64)> = with
        .readings
        .iter()
        .zip(&without.readings)
        .filter(|(a, b)| a.direction == b.direction)
        .map(|(a, b)| (*a, a.deviation_mm - b.deviation_mm))
        .collect();
    let (signature, columns, mean_of) = rows(&both, &with.floats, scatter);
    if signature.is_empty() {
        return 0.0;
    }
    let variance_mm2 = if with.is_touch {
        TOUCH_MM.powi(2) + TOUCHES_ALIKE * FORM_MM.powi(2)
    } else {
        let memory = (1.0 + scatter.ar) / (1.0 - scatter.ar);
        (scatter.white_mm.powi(2) * memory + shaking_mm2) / mean_of
            + INSTRUMENT_MM.powi(2)
            + repeats * (ROUGH * FORM_MM).powi(2)
    };
    let chatter_mm2 = if with.is_touch {
        0.0
    } else {
        chatter_mm2(&signature)
    };
    let all_mm2 = variance_mm2 + chatter_mm2;
    // (4): the place of a touched face floats, and the waves hardly vary over it.
    let form_mm2 = if with.is_touch {
        0.0
    } else {
        repeats * FORM_MM.powi(2) / WAVES as f64
    };
    let gain = quadratic_form(
        &signature,
        &columns,
        all_mm2,
        scatter.coefficient_variance_mm2() + form_mm2,
    );
    gain - signature.len() as f64 * chatter_mm2 / all_mm2
}

/// Touches of one face at one feed in a run (`programme`).
const TOUCHES_ALIKE: f64 = 2.0;
/// Middle square of a normal number of variance 1.
const MIDDLE_SQUARE: f64 = 0.454_936;

/// Variance of a row that its neighbours do not share, mm2, from second differences (six times it): slopes have none,
/// and steps of a signature are too few to matter.
fn chatter_mm2(signature: &DVector<f64>) -> f64 {
    let squares = signature
        .as_slice()
        .windows(3)
        .map(|rows| (rows[0] - 2.0 * rows[1] + rows[2]).powi(2));
    median(squares.collect()).map_or(0.0, |middle| middle / (6.0 * MIDDLE_SQUARE))
}

/// Rows, their columns of B (waves first), and the readings that make a row.
fn rows(
    both: &[(Reading, f64)],
    floats: &Floats,
    scatter: &Scatter,
) -> (DVector<f64>, DMatrix<f64>, f64) {
    let directions: Vec<usize> = match floats {
        Floats::Plate(axes) => axes.to_vec(),
        Floats::Zero => both.first().map(|(r, _)| r.direction).into_iter().collect(),
    };
    let waves = 2 * WAVES * directions.len();
    let own = match floats {
        Floats::Plate(_) => 3,
        Floats::Zero => 1,
    };
    let per_direction = both.len() / directions.len().max(1);
    let mean_of = (per_direction / ROWS).max(1);
    let mut values = Vec::new();
    let mut lines = Vec::<DVector<f64>>::new();
    for (place, direction) in directions.iter().enumerate() {
        let along: Vec<&(Reading, f64)> = both
            .iter()
            .filter(|(r, _)| r.direction == *direction)
            .collect();
        for part in along.chunks(mean_of) {
            let count = part.len() as f64;
            values.push(part.iter().map(|(_, value)| value).sum::<f64>() / count);
            let mut line = DVector::zeros(waves + own);
            for (reading, _) in part {
                let wave = scatter.waves(&reading.place_mm);
                for (k, value) in wave.iter().enumerate() {
                    line[2 * WAVES * place + k] += value / count;
                }
                if let Floats::Plate([u, v]) = floats {
                    let (x, y) = (reading.place_mm[*u], reading.place_mm[*v]);
                    line[waves + 2] += if place == 0 { -y } else { x } / count;
                }
            }
            line[waves + place] = 1.0;
            lines.push(line);
        }
    }
    let columns = DMatrix::from_fn(lines.len(), waves + own, |row, column| lines[row][column]);
    (DVector::from_vec(values), columns, mean_of as f64)
}

/// (3), with the last columns of infinite variance: those beyond the waves.
fn quadratic_form(
    signature: &DVector<f64>,
    columns: &DMatrix<f64>,
    variance_mm2: f64,
    wave_variance_mm2: f64,
) -> f64 {
    let mut inner = columns.tr_mul(columns);
    let waves = columns.ncols() / (2 * WAVES) * 2 * WAVES;
    for k in 0..columns.ncols() {
        if k < waves {
            inner[(k, k)] += variance_mm2 / wave_variance_mm2.max(f64::MIN_POSITIVE);
        } else {
            // Enough to keep a float that no row has from being divided by.
            inner[(k, k)] += 1e-9;
        }
    }
    let b = columns.tr_mul(signature);
    let explained = inner
        .cholesky()
        .map_or(0.0, |factor| b.dot(&factor.solve(&b)));
    ((signature.norm_squared() - explained) / variance_mm2).max(0.0)
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64Mcg;

    use super::*;

    #[test]
    fn eq3_equals_the_inverse_of_the_covariance() {
        let (n, waves) = (30, 2 * WAVES);
        let columns = DMatrix::from_fn(n, waves + 1, |row, column| {
            if column == waves {
                1.0
            } else {
                (0.37 * (row * (column + 1)) as f64).sin()
            }
        });
        let signature = DVector::from_fn(n, |row, _| if row < 11 { 2e-3 } else { -1e-3 });
        let (white, wave, open) = (4e-8, 9e-8, 1.0);
        let mut covariance = DMatrix::identity(n, n) * white;
        for column in 0..=waves {
            let size = if column == waves { open } else { wave };
            let own = columns.column(column);
            covariance += own * own.transpose() * size;
        }
        let dense = signature.dot(&(covariance.try_inverse().unwrap() * &signature));
        let fast = quadratic_form(&signature, &columns, white, wave);
        assert!((fast / dense - 1.0).abs() < 1e-5, "{fast} {dense}");
    }

    #[test]
    fn rows_that_differ_from_their_neighbours_are_chatter_and_a_step_is_not() {
        let step = DVector::from_fn(100, |row, _| {
            let slope = row as f64 * 1e-5;
            if row < 37 { slope } else { slope + 3e-3 }
        });
        assert!(chatter_mm2(&step).abs() < 1e-18);
        let mut rng = Pcg64Mcg::seed_from_u64(7);
        let spread = DVector::from_fn(20_000, |_, _| {
            let normal: f64 = rng.sample(StandardNormal);
            0.3 * normal
        });
        let ratio = chatter_mm2(&spread) / 0.09;
        assert!((0.95..1.05).contains(&ratio), "{ratio}");
    }

    #[test]
    fn what_a_set_up_leaves_open_has_no_size() {
        let n = 20;
        let columns = DMatrix::from_fn(n, 2 * WAVES + 1, |row, column| {
            if column == 2 * WAVES {
                1.0
            } else {
                (0.2 * (row + column) as f64).cos()
            }
        });
        let offset = DVector::from_element(n, 5e-3);
        assert!(quadratic_form(&offset, &columns, 1e-8, 1e-8) < 1e-3);
    }
}
