//! Power spectra of evenly sampled readings, by runs.

use std::f64::consts::TAU;
use std::sync::Arc;

use rustfft::num_complex::Complex64;
use rustfft::{Fft, FftPlanner};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use crate::search::rows::count;

/// Values that the level below or above a line is the median of, at most and at least.
const NEIGHBOURS: usize = 12;
const FEWEST_NEIGHBOURS: usize = 6;
/// Values next to a line that its window smears it over.
const SMEARED: usize = 3;
/// First value that is looked at: set-up, slope and slow noise are below.
const FIRST: usize = 2;
/// Degrees of freedom of the level for each segment: half of those of the values that it is the median of, as a Hann window ties
/// neighbours to each other.
const OF_LEVEL: f64 = 6.0;

/// Takes the spectra of pieces of one length.
pub(super) struct Window {
    transform: Arc<dyn Fft<f64>>,
    weights: Vec<f64>,
    /// Factor from squares of the transform to the mean square that a frequency has.
    scale: f64,
}

impl Window {
    pub(super) fn new(length: usize) -> Self {
        let turn = TAU / count(length);
        let weights = (0..length).map(|k| 0.5 - 0.5 * (turn * count(k)).cos());
        let weights: Vec<f64> = weights.collect();
        let squares: f64 = weights.iter().map(|w| w * w).sum();
        Self {
            transform: FftPlanner::new().plan_fft_forward(length),
            scale: 2.0 / (count(length) * squares),
            weights,
        }
    }

    pub(super) fn length(&self) -> usize {
        self.weights.len()
    }

    /// Mean square by frequency of the whole segments of some pieces, and their number; none of pieces that are all too short.
    pub(super) fn mean_squares(&self, pieces: &[Vec<f64>]) -> Option<Spectrum> {
        let mut power = vec![0.0; self.length() / 2];
        let mut segments = 0_usize;
        for segment in pieces
            .iter()
            .flat_map(|piece| piece.chunks_exact(self.length()))
        {
            for (sum, square) in power.iter_mut().zip(self.squares(segment)) {
                *sum += square * self.scale;
            }
            segments += 1;
        }
        power.iter_mut().for_each(|p| *p /= count(segments.max(1)));
        (segments > 0).then_some(Spectrum {
            power,
            segments: count(segments),
        })
    }

    /// Squares of the transform of a segment without its line of least squares.
    fn squares(&self, segment: &[f64]) -> Vec<f64> {
        let n = count(segment.len());
        let middle = (n - 1.0) / 2.0;
        let mean = segment.iter().sum::<f64>() / n;
        let along = |(k, value): (usize, &f64)| (count(k) - middle) * value;
        let spread = n * (n * n - 1.0) / 12.0;
        let slope = segment.iter().enumerate().map(along).sum::<f64>() / spread;
        let weighted = segment.iter().zip(&self.weights).enumerate();
        let mut values: Vec<Complex64> = weighted
            .map(|(k, (value, w))| {
                let straight = mean + slope * (count(k) - middle);
                Complex64::new(w * (value - straight), 0.0)
            })
            .collect();
        self.transform.process(&mut values);
        values.truncate(segment.len() / 2);
        values.iter().map(Complex64::norm_sqr).collect()
    }
}

/// A power spectrum that is the mean of some segments.
#[derive(Clone, Debug)]
pub(super) struct Spectrum {
    /// By frequency, from zero.
    pub(super) power: Vec<f64>,
    /// Number of segments, or what it is worth.
    pub(super) segments: f64,
}

impl Spectrum {
    /// The mean of the spectra of runs, each over its own median.
    pub(super) fn mean(runs: &[&Self]) -> Self {
        let n = count(runs.len().max(1));
        let length = runs.first().map_or(0, |run| run.power.len());
        let mut power = vec![0.0; length];
        for run in runs {
            let own = median(&mut run.power.iter().copied().skip(FIRST).collect::<Vec<_>>());
            for (sum, p) in power.iter_mut().zip(&run.power) {
                *sum += p / own.max(f64::MIN_POSITIVE) / n;
            }
        }
        let inverse: f64 = runs.iter().map(|run| 1.0 / run.segments).sum();
        Self {
            power,
            segments: n * n / inverse,
        }
    }

    /// The level about a frequency without its line: the greater of what is below it and above it, so that no slope is a line.
    pub(super) fn level(&self, place: usize) -> Option<f64> {
        let below =
            FIRST.max(place.saturating_sub(SMEARED + NEIGHBOURS))..place.saturating_sub(SMEARED);
        let length = self.power.len();
        let above =
            (place + SMEARED + 1).min(length)..(place + SMEARED + 1 + NEIGHBOURS).min(length);
        let of = |range: std::ops::Range<usize>| {
            let values = self.power.get(range)?;
            (values.len() >= FEWEST_NEIGHBOURS).then(|| median(&mut values.to_vec()))
        };
        let level = of(below)?.max(of(above).unwrap_or(0.0));
        // From the median of a mean of squares to its mean (Wilson and Hilferty).
        Some(level / (1.0 - 1.0 / (9.0 * self.segments)).powi(3))
    }

    /// How often the level, and the chance of so much in noise at one frequency.
    pub(super) fn ratio(&self, place: usize) -> Option<(f64, f64)> {
        let ratio = self.power.get(place)? / self.level(place)?;
        let law = FisherSnedecor::new(2.0 * self.segments, OF_LEVEL * self.segments).ok()?;
        ratio.is_finite().then(|| (ratio, law.sf(ratio)))
    }

    /// Places of the values that stand out about a line's greatest one.
    pub(super) fn about(&self, place: usize) -> std::ops::RangeInclusive<usize> {
        let level = self.level(place).unwrap_or(f64::INFINITY);
        let stands_out = |k: &usize| self.power.get(*k).is_some_and(|p| *p > 2.0 * level);
        let above = (place + 1..=place + NEIGHBOURS)
            .take_while(stands_out)
            .last();
        let least = place.saturating_sub(NEIGHBOURS);
        let below = (least..place).rev().take_while(stands_out).last();
        below.unwrap_or(place)..=above.unwrap_or(place)
    }
}

pub(super) fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
