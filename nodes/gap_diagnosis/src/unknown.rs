//! What no effect of the catalogue explains, and what it looks like.
//!
//! # Model
//!
//! The score of a leftover and the score that noise exceeds in one of a hundred sessions:
//!
//! ```text
//!   L = max(max_F z_F, max_c z_c)                                         (1)
//!   z_c = (|z_c|^2 / n_c - 1) / sqrt(2 / n_c + 2 / nu_c)                  (2)
//! ```
//!
//! over families F (`families`) and channels c, with n_c rows less floats and nu_c rows that the noise is known
//! from. Draws of (1) take the fitted effects out of the families' covariance as the fit does.

use std::collections::BTreeMap;

use machine::twin::Channel;
use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use crate::config::GapConfig;
use crate::families::{Family, Parity, Slot};
use crate::localise::{self, Score, noise_maxima};
use crate::noise::Noise;
use crate::normal::Normal;
use crate::report::{Description, Unknown};
use crate::rows::{count, position, time_s};
use crate::stack::Stack;

/// (1) of a leftover, and what it goes with.
pub struct Leftover {
    /// Score and threshold.
    pub score: f64,
    /// See [`Leftover::score`].
    pub threshold: f64,
    /// Scores of the families.
    pub families: Vec<Score>,
}

impl Leftover {
    /// Whether noise would hardly do so.
    pub fn flagged(&self) -> bool {
        self.score > self.threshold
    }
}

/// Draws of the threshold.
const DRAWS: usize = 999;

/// Scores a leftover from which the columns of `fitted` were taken.
pub fn leftover(
    stack: &Stack<'_>,
    slots: &[Slot],
    noise: &BTreeMap<Channel, Noise>,
    left: &DVector<f64>,
    fitted: &[DVector<f64>],
    config: &GapConfig,
) -> Leftover {
    let families = localise::scores(stack, slots, noise, left, config);
    let of_families = families.iter().map(|score| score.z).fold(0.0, f64::max);
    let (of_channels, channels) = channel_score(stack, noise, left);
    let grams = left_grams(slots, fitted);
    let all: Vec<&Slot> = slots.iter().collect();
    let mut maxima = noise_maxima(&all, noise, &grams, DRAWS, config.seed ^ 0x51);
    let mut random = Pcg64Mcg::seed_from_u64(config.seed ^ 0x52);
    for greatest in &mut maxima {
        for _ in 0..channels {
            let draw: f64 = StandardNormal.sample(&mut random);
            *greatest = greatest.max(draw);
        }
    }
    maxima.sort_by(f64::total_cmp);
    Leftover {
        score: of_families.max(of_channels),
        threshold: maxima[(maxima.len() * 99) / 100],
        families,
    }
}

/// Greatest (2), and the number of channels.
fn channel_score(
    stack: &Stack<'_>,
    noise: &BTreeMap<Channel, Noise>,
    left: &DVector<f64>,
) -> (f64, usize) {
    let share = stack.freedom() / count(stack.rows.len);
    let mut sums = BTreeMap::<&Channel, (f64, f64)>::new();
    for block in &stack.rows.blocks {
        let sum = sums.entry(&block.channel).or_default();
        sum.0 += left.rows(block.start, block.rows.len()).norm_squared();
        sum.1 += share * count(block.rows.len());
    }
    let score = |(channel, (square, n)): (&&Channel, &(f64, f64))| {
        let known = noise[*channel].freedom;
        (square / n - 1.0) / (2.0 / n + 2.0 / known.max(1.0)).sqrt()
    };
    (sums.iter().map(score).fold(0.0, f64::max), sums.len())
}

/// Covariance of U'z once some columns are fitted.
fn left_grams(slots: &[Slot], fitted: &[DVector<f64>]) -> Vec<DMatrix<f64>> {
    let plain = |slot: &Slot| slot.basis.tr_mul(&slot.basis);
    if fitted.is_empty() {
        return slots.iter().map(plain).collect();
    }
    let fitted = crate::nuisance::orthonormal(fitted[0].len(), fitted.iter().cloned());
    let of = |slot: &Slot| {
        let part = slot.basis.tr_mul(&fitted.select_rows(&slot.rows));
        plain(slot) - &part * part.transpose()
    };
    slots.iter().map(of).collect()
}

/// The report's part on what the named effects leave (`rest`, mm).
pub fn unknown(
    stack: &Stack<'_>,
    slots: &[Slot],
    leftover: &Leftover,
    flagged: bool,
    rest: &[f64],
) -> Unknown {
    let left = &stack.whitened(rest.to_vec());
    let floated = &stack.floated(rest.to_vec());
    let description = match leftover.families.first() {
        Some(top) if flagged => describe(stack, slots, &leftover.families, top, left, floated),
        _ => Description::default(),
    };
    Unknown {
        flagged,
        score: leftover.score,
        threshold: leftover.threshold,
        description,
    }
}

fn describe(
    stack: &Stack<'_>,
    slots: &[Slot],
    scores: &[Score],
    top: &Score,
    left: &DVector<f64>,
    floated: &[f64],
) -> Description {
    let slot = &slots[top.slot];
    let family = &slot.families[top.family];
    let told = fitted(slot, family, floated);
    Description {
        covariate: family.covariate.clone(),
        parity: parity(slots, scores).to_owned(),
        period: period(stack, slot, left),
        feed_exponent: feed_exponent(stack, slot, &told),
        time_constant_s: (family.covariate == "time")
            .then(|| time_constant_s(stack, slot, floated))
            .flatten(),
    }
}

/// The parity whose families explain more beyond noise: of shares nothing can be said where the noise is taken with
/// caution, and two families of one parity may share all of it.
fn parity(slots: &[Slot], scores: &[Score]) -> &'static str {
    let best = |wanted: Parity| {
        let family = |score: &Score| &slots[score.slot].families[score.family];
        let own = scores.iter().filter(|score| family(score).parity == wanted);
        own.map(|score| score.square - count(family(score).columns.len()))
            .fold(0.0, f64::max)
    };
    let (odd, even) = (best(Parity::Odd), best(Parity::Even));
    if odd > 1.5 * even {
        "odd"
    } else if even > 1.5 * odd {
        "even"
    } else {
        ""
    }
}

/// A family's share of a stack, by plain least squares over the slot's rows.
pub fn fitted(slot: &Slot, family: &Family, floated: &[f64]) -> Vec<f64> {
    let y = DVector::from_iterator(
        slot.rows.len(),
        slot.rows.iter().map(|place| floated[*place]),
    );
    let normal = Normal::new(&family.plain, &y);
    let sizes = normal
        .solve(&(0..family.plain.ncols()).collect::<Vec<_>>())
        .sizes;
    (&family.plain * DVector::from_vec(sizes))
        .iter()
        .copied()
        .collect()
}

/// Exponent of the growth of a share with feed, where there are two feeds.
fn feed_exponent(stack: &Stack<'_>, slot: &Slot, told: &[f64]) -> Option<f64> {
    let mut by_feed = BTreeMap::<u64, (f64, f64, f64)>::new();
    let mut first = 0;
    for index in &slot.blocks {
        let block = &stack.rows.blocks[*index];
        let feed = stack.session.runs[block.run].segment.feed_mm_s;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a label"
        )]
        let label = (feed.abs() * 100.0) as u64;
        let sum = by_feed.entry(label).or_insert((feed, 0.0, 0.0));
        sum.1 += told[first..first + block.rows.len()]
            .iter()
            .map(|v| v * v)
            .sum::<f64>();
        sum.2 += count(block.rows.len());
        first += block.rows.len();
    }
    let points: Vec<(f64, f64)> = by_feed
        .into_values()
        .filter(|(feed, square, _)| *feed > 0.0 && *square > 0.0)
        .map(|(feed, square, n)| (feed.ln(), 0.5 * (square / n).ln()))
        .collect();
    let n = count(points.len());
    let mean = |f: fn(&(f64, f64)) -> f64| points.iter().map(f).sum::<f64>() / n;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let square: f64 = points.iter().map(|p| (p.0 - x).powi(2)).sum();
    let slope = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum::<f64>() / square;
    (points.len() > 1 && square > 0.03).then_some(slope)
}

/// Dominant period in position or time, where its line stands out of the leftover.
fn period(stack: &Stack<'_>, slot: &Slot, left: &DVector<f64>) -> String {
    let mut best = (0.0, String::new());
    let candidates = (0..160).map(|k| 0.5 * 1.035_f64.powi(k));
    let periods: Vec<f64> = candidates.collect();
    let samples: Vec<_> = slot
        .blocks
        .iter()
        .flat_map(|index| {
            let block = &stack.rows.blocks[*index];
            let run = &stack.session.runs[block.run];
            block
                .rows
                .iter()
                .zip(block.range())
                .map(move |(row, place)| (run, row, place))
        })
        .collect();
    let axes = stack.twin.machine().axis_set();
    for axis in axes.iter().filter(|axis| axis.is_linear()) {
        let at: Vec<f64> = samples
            .iter()
            .map(|(run, row, _)| position(run, row, axis))
            .collect();
        line(
            &periods,
            &at,
            &samples,
            left,
            &format!("mm of {axis}"),
            &mut best,
        );
    }
    let at: Vec<f64> = samples
        .iter()
        .map(|(run, row, _)| time_s(run, row))
        .collect();
    let seconds: Vec<f64> = periods.iter().map(|p| p * 0.04).collect();
    line(&seconds, &at, &samples, left, "s", &mut best);
    best.1
}

type Place<'s> = (&'s machine::twin::Run, &'s crate::rows::Row, usize);

/// Strongest line over some periods, kept where it beats the best.
fn line(
    periods: &[f64],
    at: &[f64],
    samples: &[Place<'_>],
    left: &DVector<f64>,
    unit: &str,
    best: &mut (f64, String),
) {
    let extent = at.iter().copied().fold(f64::NEG_INFINITY, f64::max)
        - at.iter().copied().fold(f64::INFINITY, f64::min);
    for period in periods.iter().filter(|period| 3.0 * **period < extent) {
        let turn = std::f64::consts::TAU / period;
        let (mut c, mut s) = (0.0, 0.0);
        for (at, (.., place)) in at.iter().zip(samples) {
            let (sin, cos) = (at * turn).sin_cos();
            c += left[*place] * cos;
            s += left[*place] * sin;
        }
        let power = (c * c + s * s) / (0.5 * count(at.len()).max(1.0));
        if power > best.0.max(60.0) {
            *best = (power, format!("{period:.3} {unit}"));
        }
    }
}

/// Time constant of an exponential rise through the session.
fn time_constant_s(stack: &Stack<'_>, slot: &Slot, floated: &[f64]) -> Option<f64> {
    let mut times = Vec::new();
    for index in &slot.blocks {
        let block = &stack.rows.blocks[*index];
        let run = &stack.session.runs[block.run];
        times.extend(block.rows.iter().map(|row| time_s(run, row)));
    }
    let last = times.iter().copied().fold(0.0, f64::max);
    let y = DVector::from_iterator(
        slot.rows.len(),
        slot.rows.iter().map(|place| floated[*place]),
    );
    let gain = |tau: f64| {
        let columns = DMatrix::from_fn(times.len(), 2, |row, k| {
            if k == 0 {
                1.0
            } else {
                (-times[row] / tau).exp()
            }
        });
        Normal::new(&columns, &y).solve(&[0, 1]).gain
    };
    let candidates: Vec<f64> = (0..40).map(|k| last * 0.01 * 1.17_f64.powi(k)).collect();
    candidates
        .into_iter()
        .max_by(|a, b| gain(*a).total_cmp(&gain(*b)))
}
