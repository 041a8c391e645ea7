//! What an axis can have along its travel, as readings of 1 µm at the stops of a positioning run.
//!
//! Lead errors are random waves, dents and steps. Lost motion splits evenly on both senses; where the nut is worn it
//! varies by a curve of the same kind. A cyclic error has two harmonics of a period that need not be the lead,
//! and an amplitude that changes along the screw. A drift relaxes by a stretched exponential.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, SymmetricEigen};
use rand::Rng;
use rand_pcg::Pcg64Mcg;

use super::dice::{log_uniform, sign};
use super::positioning::Stop;
use super::shape::Shape;

/// Least part of a wave that slower ones may not imitate.
const MIN_SHARE_LEFT: f64 = 0.5;
/// Part of a wave that a slower one may imitate.
const MAX_SHARE_ALIASED: f64 = 0.75;
/// Periods that targets have to span.
const MIN_PERIODS: f64 = 2.0;
/// Targets that a period needs.
const MIN_PLACES_OF_A_PERIOD: usize = 12;

/// A kind of hidden effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Lead error of any form, without a slope.
    Lead,
    /// Slope.
    Scale,
    /// Lost motion, the same everywhere.
    LostMotion,
    /// Lost motion that varies.
    WornNut,
    /// Periodic error of the screw.
    Cyclic,
    /// Drift of the whole.
    Drift,
}

impl Kind {
    /// In words.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Lead => "lead error",
            Self::Scale => "scale",
            Self::LostMotion => "lost motion",
            Self::WornNut => "lost motion that varies",
            Self::Cyclic => "cyclic error",
            Self::Drift => "drift",
        }
    }

    /// Its id in the catalogue.
    pub const fn id(self) -> &'static str {
        match self {
            Self::Lead => "pitch_error",
            Self::Scale => "scale_error",
            Self::LostMotion | Self::WornNut => "backlash",
            Self::Cyclic => "cyclic_error",
            Self::Drift => "ambient_drift",
        }
    }

    /// Least and greatest size, and the unit.
    pub const fn sizes(self) -> ([f64; 2], &'static str) {
        match self {
            Self::Lead => ([0.5, 100.0], "µm"),
            Self::Scale => ([2.0, 150.0], "µm/m"),
            Self::LostMotion | Self::WornNut => ([0.3, 40.0], "µm"),
            Self::Cyclic => ([0.2, 8.0], "µm"),
            Self::Drift => ([0.5, 25.0], "µm"),
        }
    }
}

/// Readings of an effect of size 1, at each stop.
pub fn readings(random: &mut Pcg64Mcg, kind: Kind, stops: &[Stop], period_mm: f64) -> Vec<f64> {
    let ends = |of: fn(&Stop) -> f64| {
        let all = stops.iter().map(of);
        all.fold([f64::MAX, f64::MIN], |[low, high], value| {
            [low.min(value), high.max(value)]
        })
    };
    let ([low, high], [began, ended]) = (ends(|s| s.place_mm), ends(|s| s.time_s));
    let course: Vec<f64> = { stops.iter() }
        .map(|stop| (stop.place_mm - low) / (high - low))
        .collect();
    let mut targets: Vec<f64> = stops.iter().map(|stop| stop.place_mm).collect();
    targets.sort_by(f64::total_cmp);
    targets.dedup_by(|next, kept| *next - *kept < 1e-6 * (high - low) + 0.01);
    let side = |stop: &Stop| if stop.is_up { -0.5 } else { 0.5 };
    match kind {
        Kind::Lead => {
            // Waves of a turn or two of the screw are its cyclic error.
            let turns = (high - low) / period_mm;
            Shape::draw(random, targets.len().min(1 + (2.0 * turns) as usize)).bent(&course)
        }
        Kind::Scale => stops.iter().map(|stop| 1e-3 * stop.place_mm).collect(),
        Kind::LostMotion => stops.iter().map(side).collect(),
        Kind::WornNut => {
            let share = random.random_range(0.2..0.7);
            let along = Shape::draw(random, targets.len().min(13)).about_one(&course, share);
            stops
                .iter()
                .zip(along)
                .map(|(stop, width)| side(stop) * width)
                .collect()
        }
        Kind::Cyclic => {
            let (phase, second) = (random.random_range(0.0..TAU), random.random_range(0.0..0.4));
            let grows = sign(random) * random.random_range(0.0..0.25);
            let of = |(stop, u): (&Stop, &f64)| {
                let turn = TAU * stop.place_mm / period_mm + phase;
                (1.0 + grows * (2.0 * u - 1.0)) * (turn.sin() + second * (2.0 * turn + 1.0).sin())
            };
            stops.iter().zip(&course).map(of).collect()
        }
        Kind::Drift => {
            let relaxes_s = log_uniform(random, [0.15, 3.0]) * (ended - began).max(1.0);
            let power = random.random_range(0.7..1.3);
            let risen = |at_s: f64| 1.0 - (-(((at_s - began) / relaxes_s).powf(power))).exp();
            let of = |stop: &Stop| risen(stop.time_s) / risen(ended);
            stops.iter().map(of).collect()
        }
    }
}

/// Whether targets tell a wave of a period from slower curves, by the Gram matrix of both.
pub fn resolves(targets_mm: &[f64], period_mm: f64) -> bool {
    let [Some(low), Some(high)] = [targets_mm.first(), targets_mm.last()] else {
        return false;
    };
    let (n, length) = (targets_mm.len(), high - low);
    if n < MIN_PLACES_OF_A_PERIOD || length < MIN_PERIODS * period_mm {
        return false;
    }
    let wave = |cycles: f64| -> [Vec<f64>; 2] {
        let turn = |place: &f64| TAU * cycles * (place - low) / length;
        [
            targets_mm.iter().map(|place| turn(place).cos()).collect(),
            targets_mm.iter().map(|place| turn(place).sin()).collect(),
        ]
    };
    let own = length / period_mm;
    let mut slower = vec![vec![1.0; n], targets_mm.to_vec()];
    // A lead error has no waves of one or two turns.
    let most = (n as f64 / 4.0).min(0.5 * own);
    let mut cycles = 0.5;
    while cycles < most {
        slower.extend(wave(cycles));
        cycles += 0.5;
    }
    if slower.len() + 4 > n || share_left(&wave(own), &slower) < MIN_SHARE_LEFT {
        return false;
    }
    let mut other = 0.25;
    while other < own - 1.0 {
        let [cos, sin] = wave(other);
        let with = [vec![1.0; n], cos, sin];
        if share_left(&wave(own), &with) < 1.0 - MAX_SHARE_ALIASED {
            return false;
        }
        other += 0.25;
    }
    true
}

/// Least share of the square that combinations of two columns keep with others taken out.
fn share_left(own: &[Vec<f64>; 2], others: &[Vec<f64>]) -> f64 {
    let n = own[0].len();
    let matrix = |columns: &[Vec<f64>]| DMatrix::from_fn(n, columns.len(), |k, j| columns[j][k]);
    let whole = matrix(own);
    let basis = matrix(others).svd(true, false);
    let most = basis.singular_values.max();
    let mut left = whole.clone();
    if let Some(u) = &basis.u {
        for (k, size) in basis.singular_values.iter().enumerate() {
            if *size > 1e-9 * most {
                let column = u.column(k);
                left -= column * (column.transpose() * &whole);
            }
        }
    }
    let half = SymmetricEigen::new(whole.tr_mul(&whole));
    let inverse = half
        .eigenvalues
        .map(|value| if value > 1e-9 { value.powf(-0.5) } else { 0.0 });
    let root =
        &half.eigenvectors * DMatrix::from_diagonal(&inverse) * half.eigenvectors.transpose();
    SymmetricEigen::new(&root * left.tr_mul(&left) * &root)
        .eigenvalues
        .min()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn even(n: usize, spacing_mm: f64) -> Vec<f64> {
        (0..n).map(|k| spacing_mm * k as f64).collect()
    }

    #[test]
    fn a_period_is_resolved_by_close_targets_over_several_turns_alone() {
        assert!(resolves(&even(41, 1.3), 10.0));
        assert!(
            !resolves(&even(41, 15.0), 10.0),
            "every wave is a longer one as well"
        );
        assert!(!resolves(&even(11, 2.0), 10.0), "too few");
        assert!(!resolves(&even(31, 0.2), 10.0), "less than a turn");
    }
}
