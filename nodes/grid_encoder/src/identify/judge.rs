//! Whether what a fit leaves is noise, by repeats and by the order of the residuals.
//!
//! # Model
//!
//! ```text
//!   F = [S_lack/(K − rank)] / [S_pure/(N − K)]   over repeats of equal points             (1)
//!   r₁ = Σ r_i r_{i+1} / Σ r_i²,   z = r₁ √n                                              (2)
//!   var = (1 + r₁)/(1 − r₁) times that of independent residuals                           (3)
//! ```
//!
//! (1) needs a recording that was repeated. (2) needs nothing: what the model lacks is smooth along the
//! trajectory, so neighbours resemble each other. z is standard normal for noise, and a little below for few
//! points for each unknown.
//!
//! (3) is the sum of r₁^|k| over all distances k: what the plate or the form of the curves leaves is alike over many stations, and
//! so many of them count as one. It is taken where (2) is beyond chance. It knows nothing of what is alike in a whole recording, such as
//! a machine that warmed between two of them.
//!
//! # References
//! \[1\] NIST/SEMATECH e-Handbook of Statistical Methods, 4.4.4.6. \[2\] J. Durbin, G. S. Watson, Biometrika 37,
//! 409 (1950): (2) is 1 − d/2.

use metrology::fit::{chi_square_p, lack_of_fit};
use metrology::sample::{Sense, TestPlane};

use super::Noise;
use crate::equations::Equations;
use crate::recording::{Place, in_plane};

/// Points of repeats nearer than this are one level, mm.
const SAME_POINT_MM: f64 = 0.1;
/// Correlation that is too small to mind, however sure it is.
const MINDED_CORRELATION: f64 = 0.1;
/// z of (2) that chance exceeds once in 30,000.
const SURE: f64 = 4.0;
/// p of (1) that chance falls below once in 30,000.
const CHANCE: f64 = 3e-5;

/// Signs that the model lacks something.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judgement {
    /// p of (1); NaN without repeats.
    pub lack_of_fit_p: f64,
    /// Degrees of freedom of the pure error.
    pub pure_freedom: usize,
    /// r₁ of (2).
    pub correlation: f64,
    /// z of (2).
    pub correlation_z: f64,
    /// Probability of a greater χ² if the stated uncertainties are right.
    pub chi_square_p: f64,
}

impl Judgement {
    /// Whether the model lacks something: p of (1) below `p_limit`, or residuals that follow each other.
    #[must_use]
    pub fn lacks_something(&self, p_limit: f64) -> bool {
        self.lack_of_fit_p < p_limit || self.is_correlated()
    }

    /// Whether residuals are more than noise, beyond chance.
    pub(super) fn is_disturbed(&self) -> bool {
        self.is_correlated() || self.lack_of_fit_p < CHANCE
    }

    fn is_correlated(&self) -> bool {
        self.correlation_z > SURE && self.correlation > MINDED_CORRELATION
    }

    /// (3); 1 where residuals do not follow each other, or where the stated uncertainties are taken as right.
    #[must_use]
    pub fn variance_inflation(&self, noise: Noise) -> f64 {
        match noise {
            Noise::FromResiduals if self.is_correlated() => {
                (1.0 + self.correlation) / (1.0 - self.correlation)
            }
            _ => 1.0,
        }
    }

    pub(super) fn of(
        equations: &Equations,
        ratios: &[Vec<[f64; 2]>],
        weights: &[Vec<[f64; 2]>],
        rank: usize,
        chi_square: f64,
    ) -> Self {
        let levels = levels(equations);
        let (mut residuals, mut of_level, mut spread) = (Vec::new(), Vec::new(), Vec::new());
        for (recording, points) in ratios.iter().enumerate() {
            for (point, ratios) in points.iter().enumerate() {
                for (k, ratio) in ratios.iter().enumerate().filter(|(_, r)| r.is_finite()) {
                    residuals.push(*ratio);
                    of_level.push(2 * levels[recording][point] + k);
                    spread.push(1.0 / weights[recording][point][k].sqrt());
                }
            }
        }
        let pure = lack_of_fit(&residuals, &spread, &of_level, rank);
        let (correlation, n) = correlation(ratios, weights);
        Self {
            lack_of_fit_p: pure.p,
            pure_freedom: pure.pure_freedom,
            correlation,
            correlation_z: correlation * (n as f64).sqrt(),
            chi_square_p: chi_square_p(chi_square, residuals.len().saturating_sub(rank)),
        }
    }
}

/// Sums of (2).
#[derive(Clone, Copy, Default)]
struct Neighbours {
    products: f64,
    squares: f64,
    n: usize,
}

impl Neighbours {
    /// Of one recording, both coordinates; outliers are weighed down.
    fn of(ratios: &[[f64; 2]], weights: &[[f64; 2]]) -> Self {
        let mut sums = Self::default();
        for k in 0..2 {
            let values = || {
                let both = ratios.iter().zip(weights).map(|(r, w)| r[k] * w[k].sqrt());
                both.filter(|r| r.is_finite())
            };
            sums.products += values()
                .zip(values().skip(1))
                .map(|(a, b)| a * b)
                .sum::<f64>();
            sums.squares += values().map(|r| r * r).sum::<f64>();
            sums.n += values().count();
        }
        sums
    }

    fn and(self, other: Self) -> Self {
        Self {
            products: self.products + other.products,
            squares: self.squares + other.squares,
            n: self.n + other.n,
        }
    }

    /// r₁.
    fn correlation(self) -> f64 {
        if self.squares > 0.0 {
            self.products / self.squares
        } else {
            0.0
        }
    }

    /// (3), 1 where (2) may be chance.
    fn inflation(self) -> f64 {
        let r = self.correlation();
        if r * (self.n as f64).sqrt() > SURE && r > MINDED_CORRELATION {
            (1.0 + r) / (1.0 - r)
        } else {
            1.0
        }
    }
}

/// (2) over all recordings and both coordinates.
fn correlation(ratios: &[Vec<[f64; 2]>], weights: &[Vec<[f64; 2]>]) -> (f64, usize) {
    let each = ratios
        .iter()
        .zip(weights)
        .map(|(r, w)| Neighbours::of(r, w));
    let all = each.fold(Neighbours::default(), Neighbours::and);
    (all.correlation(), all.n)
}

/// (3) of each recording by itself.
pub(super) fn alike_by_recording(ratios: &[Vec<[f64; 2]>], weights: &[Vec<[f64; 2]>]) -> Vec<f64> {
    let each = ratios
        .iter()
        .zip(weights)
        .map(|(r, w)| Neighbours::of(r, w));
    each.map(Neighbours::inflation).collect()
}

/// (3) of those recordings together in which it was not sure of each by itself.
pub(super) fn pooled_inflation(
    ratios: &[Vec<[f64; 2]>],
    weights: &[Vec<[f64; 2]>],
    alike: &[f64],
) -> f64 {
    let unsure = ratios
        .iter()
        .zip(weights)
        .zip(alike)
        .filter(|(_, alike)| **alike <= 1.0);
    let each = unsure.map(|((r, w), _)| Neighbours::of(r, w));
    each.fold(Neighbours::default(), Neighbours::and)
        .inflation()
}

/// Points of one place, each with the number of its level.
type Level = Vec<(usize, [f64; 2])>;

/// Number of the level of each point; repeats of a point share one.
fn levels(equations: &Equations) -> Vec<Vec<usize>> {
    let mut known: Vec<(usize, Level)> = Vec::new();
    let mut next = 0;
    let recordings = equations.recordings;
    let numbered = recordings.iter().enumerate().map(|(idx, recording)| {
        let alike =
            |(first, _): &(usize, Level)| are_repeats(&recordings[*first].place, &recording.place);
        let group = known.iter().position(alike).unwrap_or_else(|| {
            known.push((idx, Vec::new()));
            known.len() - 1
        });
        let places = &mut known[group].1;
        let n_known = places.len();
        let level = |point: &crate::recording::GridPoint| {
            let at = in_plane(recording.place.plane, &point.positions.xyz());
            let near =
                |(_, q): &&(usize, [f64; 2])| (q[0] - at[0]).hypot(q[1] - at[1]) < SAME_POINT_MM;
            if let Some((level, _)) = places[..n_known].iter().find(near) {
                return *level;
            }
            places.push((next, at));
            next += 1;
            next - 1
        };
        recording.points.iter().map(level).collect()
    });
    numbered.collect()
}

fn are_repeats(a: &Place, b: &Place) -> bool {
    let key = |p: &Place| -> (TestPlane, Sense, bool) { (p.plane, p.sense, p.stations > 0) };
    key(a) == key(b)
        && a.kind == b.kind
        && (a.centre_mm - b.centre_mm).norm() < SAME_POINT_MM
        && (a.radius_mm - b.radius_mm).abs() < SAME_POINT_MM
        && (a.feed_mm_s - b.feed_mm_s).abs() <= 1e-3 * a.feed_mm_s
        && (a.tool_offset_mm - b.tool_offset_mm).norm() < SAME_POINT_MM
}
