//! Noise within a run at the pace of the run: a row of a quick circle is the mean of fewer readings than one of a slow.
//!
//! # Model
//!
//! Noise goes with time, rows go with the way. A row that lasts T is the mean over T of a white noise of density N and
//! of a noise with memory, whose correlation falls by e in tau:
//!
//! ```text
//!   var   = N/T + s^2 2/a^2 (a - 1 + exp(-a)),   a = T/tau                (1)
//!   cov_k = s^2 ((1 - exp(-a))/a)^2 exp(-(k - 1) a),   k rows apart       (2)
//! ```
//!
//! N, s and tau are fitted to the autocovariances that repeats have at their own pace and to the variance of a single
//! reading. At a pace that was repeated the repeats' own autoregression stands; at another one that of (1) and (2).
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | N | `white_mm2_s` | mm² s |
//! | s², tau | `memory_mm2`, `memory_s` | mm², s |
//! | T | `row_s` | s |
//!
//! # Holds when
//! Readings follow one another evenly. Runs that are measured at their stops have no pace: theirs is the noise of all.
//!
//! # References
//! \[1\] G. E. P. Box, G. M. Jenkins, G. C. Reinsel, Time Series Analysis, 4th ed., Wiley 2008, 3.2 (autoregression).

use metrology::sample::TestKind;
use twin::{Channel, Run};

use crate::noise::whitener::Autoregression;
use crate::search::rows::{Block, count, time_s};

/// Two paces that differ by less are one.
pub const SAME_PACE: f64 = 0.05;
/// Order of the autoregression at a pace that was not repeated.
const ORDER: usize = 3;
/// Relative uncertainty of the variance of a single reading, which effects within a row enlarge.
const OF_READING: f64 = 0.2;
/// What memory must gain in chi-square to be taken: its two numbers beyond noise.
const MIN_GAIN_OF_MEMORY: f64 = 6.0;

/// How long a row of a block lasts, s; none where it has no pace.
pub fn row_s(run: &Run, block: &Block) -> Option<f64> {
    let segment = &run.segment;
    let at_stops = matches!(segment.kind, TestKind::Positioning | TestKind::Diagonal);
    let has_no_path = matches!(block.channel, Channel::Touch | Channel::Thermometer(_));
    if at_stops || segment.stations > 0 || has_no_path || block.rows.len() < 8 {
        return None;
    }
    let (first, last) = (block.rows.first()?, block.rows.last()?);
    let lasts_s = time_s(run, last) - time_s(run, first);
    (lasts_s > 0.0).then(|| lasts_s / count(block.rows.len() - 1))
}

/// What repeats of one pace show.
#[derive(Clone, Debug, PartialEq)]
pub struct Repeated {
    /// Duration of a row, s.
    pub row_s: f64,
    /// Time between two readings, s.
    pub reading_s: f64,
    /// Autocovariances of rows of lag 0, 1, .., mm2.
    pub autocovariances: Vec<f64>,
    /// Variance of the readings of a row about their mean, mm2.
    pub within_row: f64,
    /// Independent rows that they are known from.
    pub freedom: f64,
    /// Their autoregression.
    pub noise: Autoregression,
}

/// Noise of a channel at every pace.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pace {
    repeated: Vec<(f64, Autoregression)>,
    in_time: Option<InTime>,
}

/// Noise in time.
#[derive(Clone, Copy, Debug, PartialEq)]
struct InTime {
    white_mm2_s: f64,
    memory_mm2: f64,
    memory_s: f64,
}

impl Pace {
    /// From what was repeated.
    pub fn new(repeated: &[Repeated]) -> Self {
        Self {
            in_time: InTime::fitted(repeated),
            repeated: repeated
                .iter()
                .map(|one| (one.row_s, one.noise.clone()))
                .collect(),
        }
    }

    /// The same with another variance.
    pub fn scaled(&self, ratio: f64) -> Self {
        let mut scaled = self.clone();
        for (_, noise) in &mut scaled.repeated {
            *noise = noise.scaled(ratio);
        }
        if let Some(in_time) = &mut scaled.in_time {
            in_time.white_mm2_s *= ratio;
            in_time.memory_mm2 *= ratio;
        }
        scaled
    }

    /// Noise of rows that last so long; none where repeats tell nothing of it.
    pub fn at(&self, row_s: f64) -> Option<Autoregression> {
        let apart = |known: f64| (known / row_s).ln().abs();
        let nearest = self
            .repeated
            .iter()
            .min_by(|a, b| apart(a.0).total_cmp(&apart(b.0)))?;
        if apart(nearest.0) < SAME_PACE {
            return Some(nearest.1.clone());
        }
        let in_time = self.in_time?;
        let lags: Vec<f64> = (0..=ORDER)
            .map(|lag| in_time.covariance(row_s, lag))
            .collect();
        (lags[0] > 0.0).then(|| Autoregression::levinson(&lags))
    }
}

/// (1), (2) for a memory of variance one.
fn of_memory(row_s: f64, memory_s: f64, lag: usize) -> f64 {
    let a = row_s / memory_s;
    let left = (-a).exp();
    if lag == 0 {
        return if a < 1e-4 {
            1.0 - a / 3.0
        } else {
            2.0 * (a - 1.0 + left) / (a * a)
        };
    }
    let mean = if a < 1e-9 { 1.0 } else { -(-a).exp_m1() / a };
    mean * mean * (-(count(lag) - 1.0) * a).exp()
}

impl InTime {
    /// Of rows that last so long, this many apart.
    fn covariance(&self, row_s: f64, lag: usize) -> f64 {
        let white = if lag == 0 {
            self.white_mm2_s / row_s
        } else {
            0.0
        };
        white + self.memory_mm2 * of_memory(row_s, self.memory_s, lag)
    }

    /// By weighted least squares with both variances positive, the memory over a grid.
    fn fitted(repeated: &[Repeated]) -> Option<Self> {
        let seen: Vec<Seen> = repeated.iter().flat_map(Seen::of).collect();
        let shortest_s = repeated
            .iter()
            .map(|one| one.reading_s)
            .reduce(f64::min)
            .filter(|s| *s > 0.0)?;
        let white = Self {
            white_mm2_s: least(&seen, |one| one.of_white(), |_| 0.0)[0],
            memory_mm2: 0.0,
            memory_s: shortest_s,
        };
        let misfit = |one: &Self| -> f64 {
            let of = |seen: &Seen| {
                ((seen.value - one.covariance(seen.row_s, seen.lag)) / seen.uncertainty).powi(2)
            };
            seen.iter().map(of).sum()
        };
        let with_memory = (0..24).map(|k| {
            let memory_s = shortest_s * 1.35_f64.powi(k);
            let of_memory = |one: &Seen| of_memory(one.row_s, memory_s, one.lag);
            let [white_mm2_s, memory_mm2] = least(&seen, |one| one.of_white(), of_memory);
            Self {
                white_mm2_s,
                memory_mm2,
                memory_s,
            }
        });
        let best = with_memory.min_by(|a, b| misfit(a).total_cmp(&misfit(b)))?;
        Some(if misfit(&best) + MIN_GAIN_OF_MEMORY < misfit(&white) {
            best
        } else {
            white
        })
    }
}

/// One number that the fit is made to.
struct Seen {
    row_s: f64,
    lag: usize,
    value: f64,
    uncertainty: f64,
}

impl Seen {
    fn of(repeated: &Repeated) -> Vec<Self> {
        let variance = repeated.autocovariances.first().copied().unwrap_or(0.0);
        let unit = variance / repeated.freedom.max(1.0).sqrt();
        let of_rows = repeated.autocovariances.iter().enumerate();
        let mut seen: Vec<Self> = of_rows
            .map(|(lag, value)| Self {
                row_s: repeated.row_s,
                lag,
                value: *value,
                uncertainty: if lag == 0 {
                    unit * 2.0_f64.sqrt()
                } else {
                    unit
                },
            })
            .collect();
        if repeated.reading_s < 0.7 * repeated.row_s {
            let value = variance + repeated.within_row;
            seen.push(Self {
                row_s: repeated.reading_s,
                lag: 0,
                value,
                uncertainty: OF_READING * value,
            });
        }
        seen.retain(|one| one.uncertainty > 0.0);
        seen
    }

    fn of_white(&self) -> f64 {
        if self.lag == 0 { 1.0 / self.row_s } else { 0.0 }
    }
}

/// Two amounts, neither below zero, that fit best.
fn least(seen: &[Seen], first: impl Fn(&Seen) -> f64, second: impl Fn(&Seen) -> f64) -> [f64; 2] {
    let sum = |of: &dyn Fn(&Seen) -> f64| -> f64 {
        seen.iter()
            .map(|one| of(one) / one.uncertainty.powi(2))
            .sum()
    };
    let aa = sum(&|one| first(one).powi(2));
    let ab = sum(&|one| first(one) * second(one));
    let bb = sum(&|one| second(one).powi(2));
    let ay = sum(&|one| first(one) * one.value);
    let by = sum(&|one| second(one) * one.value);
    let alone = |square: f64, along: f64| {
        if square > 0.0 {
            (along / square).max(0.0)
        } else {
            0.0
        }
    };
    let determinant = aa * bb - ab * ab;
    if determinant > 1e-12 * aa * bb && bb > 0.0 {
        let both = [
            (bb * ay - ab * by) / determinant,
            (aa * by - ab * ay) / determinant,
        ];
        if both.iter().all(|amount| *amount >= 0.0) {
            return both;
        }
    }
    let (a, b) = (alone(aa, ay), alone(bb, by));
    let gain = |amount: f64, along: f64, square: f64| amount * (2.0 * along - amount * square);
    if gain(a, ay, aa) >= gain(b, by, bb) {
        [a, 0.0]
    } else {
        [0.0, b]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64Mcg;

    const READING_S: f64 = 0.004;

    /// Means over `m` readings of an autoregression of first order beside white noise, and what they show.
    fn repeated(m: usize, rows: usize, phi: f64, white: f64, seed: u64) -> Repeated {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let mut draw = || -> f64 { StandardNormal.sample(&mut random) };
        let mut memory = 0.0;
        let (mut means, mut within) = (vec![], 0.0);
        for _ in 0..rows {
            let readings: Vec<f64> = (0..m)
                .map(|_| {
                    memory = phi * memory + (1.0 - phi * phi).sqrt() * draw();
                    memory + white * draw()
                })
                .collect();
            let mean = readings.iter().sum::<f64>() / count(m);
            within += readings.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count(m);
            means.push(mean);
        }
        let lag = |k: usize| {
            let products = means.windows(k + 1).map(|w| w[0] * w[k]);
            products.sum::<f64>() / count(rows)
        };
        let autocovariances: Vec<f64> = (0..4).map(lag).collect();
        Repeated {
            row_s: count(m) * READING_S,
            reading_s: READING_S,
            noise: Autoregression::levinson(&autocovariances),
            autocovariances,
            within_row: within / count(rows),
            freedom: count(rows),
        }
    }

    #[test]
    fn eq1_a_row_of_a_quick_run_is_as_noisy_as_the_mean_of_its_few_readings() {
        for (phi, white, seed) in [(0.0, 0.0, 1), (0.6, 0.0, 2), (0.9, 0.3, 3), (0.85, 1.0, 4)] {
            let pace = Pace::new(&[repeated(12, 4000, phi, white, seed)]);
            for m in [2, 5] {
                let wanted = repeated(m, 40_000, phi, white, seed + 10).autocovariances[0];
                let told = pace.at(count(m) * READING_S).expect("a pace").variances[0];
                let ratio = told / wanted;
                assert!((0.8..1.3).contains(&ratio), "{phi} {white} {m}: {ratio}");
            }
        }
    }

    #[test]
    fn at_the_pace_of_the_repeats_their_own_noise_stands_and_it_scales() {
        let one = repeated(10, 2000, 0.7, 0.2, 5);
        let pace = Pace::new(std::slice::from_ref(&one));
        assert_eq!(pace.at(one.row_s * 1.01), Some(one.noise.clone()));
        let twice = pace.scaled(2.0).at(one.row_s).expect("a pace");
        assert!((twice.variances[0] / one.noise.variances[0] - 2.0).abs() < 1e-12);
        assert_eq!(Pace::default().at(0.1), None);
    }

    #[test]
    fn eq2_neighbours_of_short_rows_have_what_memory_leaves() {
        let pace = Pace::new(&[repeated(12, 4000, 0.9, 0.0, 6)]);
        let short = pace.at(4.0 * READING_S).expect("a pace");
        let wanted = repeated(4, 40_000, 0.9, 0.0, 7);
        let rho = wanted.autocovariances[1] / wanted.autocovariances[0];
        let told = short.coefficients[1][0];
        assert!((told - rho).abs() < 0.1, "{told} {rho}");
    }
}
