//! Displacement tests along the four space diagonals of a machine's volume (ISO 230-6).
//!
//! # Model
//!
//! Each diagonal is a positioning test of ISO 230-2 along a line on which X, Y and Z move together:
//!
//! ```text
//!   E, R, B, M, A of each diagonal     by ISO 230-2 of the displacement along it      (1)
//!   E_d = max of the four E,   B_d = max of the four B                                (2)
//!   spread = max x̄ − min x̄ over all diagonals and directions                          (3)
//! ```
//!
//! E_d (diagonal systematic deviation) and B_d (diagonal reversal value) are the figures the
//! standard names. (3) is derived, not of the standard: it keeps what the diagonals differ by, and
//! needs deviations that are zero at the same corner's end of each.
//!
//! E_d and B_d have the standard uncertainty of the diagonal that has them, equations (2) and (6) of
//! [`super::positioning::budget`]. Over a diagonal most of it is limits, of temperatures and
//! coefficients for E_d, of slow drift for B_d, and 2 u of limits holds more than 2 u of a normal distribution. Their U
//! is therefore k u, with k of their sum, (7) of [`super::budget`], 1.65 to 2. Of two means on different diagonals, l₁ and l₂ from
//! their zeros, one device and one machine have read both. The certificate states (U₀ + U₁ l)² = U₀² + 2 U₀ U₁ l + (U₁ l)² of
//! each length. The last is the error that grows as the length, the scale's: common to both, it counts for l₁ − l₂. The two
//! others and the alignment are new on each diagonal:
//!
//! ```text
//!   spread:  u² = u_C² + u_T²(l₁ − l₂) + u_R²(l₁) + u_R²(l₂) + 2 (2/n) u_V²                           (4)
//!            k² u_C² = 2 U₀² + 2 U₀ U₁ (l₁ + l₂) + [U₁ (l₁ − l₂)]²
//!            k² u_C² = [U₀ + U₁ |l₁ − l₂|]² on one diagonal, where u_R is that of l₁ − l₂ and drift counts once
//! ```
//!
//! with u_T of temperatures and coefficients of expansion, u_R of the alignment, u_V of the drift of one reading.
//!
//! ```text
//!   L_i = x̄ of both directions at the last target less that at the first,  lengths = max L_i − min L_i   (5)
//!   lengths: u² = u_C² + u_T²(l₁ − l₂) + u_R²(l₁) + u_R²(l₂) + 2 (1/n) u_V²                            (6)
//! ```
//!
//! (5) is what squareness makes of the diagonals, without the reversal; each L_i is of two means of 2n readings.
//!
//! Squareness makes diagonals unequal: an angle φ between X and Y alone changes P-P by about
//! +φ X Y/L and N-P by −φ X Y/L, with L the diagonal's length. A scale error makes all of them long
//! or short alike. The figures do not tell other errors apart.
//!
//! # Holds when
//! The beam lies along the diagonal and each point is reached by all axes at once.
//!
//! # Agreement
//! Closed form: `val_iso230_6_squareness_by_exact_geometry`, E_d and spread to 2e-7 mm over 877 mm,
//! which is the second order that φ X Y/L leaves out. No published example was at hand.
//!
//! # References
//! \[1\] ISO 230-6:2002; names from the literature, the text was not at hand.

use serde::{Deserialize, Serialize};

use super::budget::{combined, coverage_factor};
use super::expanded::COVERAGE_FACTOR;
use super::positioning::budget::PositioningBudget;
use super::positioning::{self, PointResult, PositioningResult, PositioningRuns};
use super::{ExpandedLength, Iso230Error};

/// A space diagonal by the sense of X, Y and Z while it is run upwards: positive or negative.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub enum SpaceDiagonal {
    /// All positive.
    Ppp,
    /// X negative.
    Npp,
    /// Y negative.
    Pnp,
    /// Z negative; run the other way this is NNP.
    Ppn,
}

impl SpaceDiagonal {
    /// The four.
    pub const ALL: [Self; 4] = [Self::Ppp, Self::Npp, Self::Pnp, Self::Ppn];

    /// Its three letters.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ppp => "PPP",
            Self::Npp => "NPP",
            Self::Pnp => "PNP",
            Self::Ppn => "PPN",
        }
    }
}

/// The readings of one diagonal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DiagonalRuns {
    /// Which one.
    pub diagonal: SpaceDiagonal,
    /// Its runs; positions are distances along the diagonal.
    pub runs: PositioningRuns,
}

/// One diagonal, evaluated.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DiagonalResult {
    /// Which one.
    pub diagonal: SpaceDiagonal,
    /// (1).
    pub positioning: PositioningResult,
}

/// The four diagonals.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DiagonalsResult {
    /// Each, in the order of [`SpaceDiagonal::ALL`].
    pub diagonals: Vec<DiagonalResult>,
    /// E_d, (2).
    pub systematic_error: ExpandedLength,
    /// k of U of E_d.
    pub systematic_error_coverage_factor: f64,
    /// B_d, (2).
    pub reversal: ExpandedLength,
    /// k of U of B_d.
    pub reversal_coverage_factor: f64,
    /// (3); not a figure of the standard.
    pub spread: ExpandedLength,
    /// (5); not a figure of the standard.
    pub lengths: ExpandedLength,
}

impl DiagonalResult {
    /// L of (5): by how much the diagonal is too long, mm; NaN without a target.
    #[must_use]
    pub fn too_long_mm(&self) -> f64 {
        let points = &self.positioning.points;
        let mean = |point: Option<&PointResult>| {
            point.map_or(f64::NAN, |p| f64::midpoint(p.up.mean_mm, p.down.mean_mm))
        };
        mean(points.last()) - mean(points.first())
    }
}

/// Evaluates the four diagonals, given in any order.
///
/// # Errors
/// A diagonal that is missing or given twice, and what [`positioning::evaluate`] refuses.
pub fn evaluate(
    diagonals: &[DiagonalRuns],
    budget: &PositioningBudget,
) -> Result<DiagonalsResult, Iso230Error> {
    let one = |diagonal: SpaceDiagonal| {
        let given: Vec<_> = diagonals
            .iter()
            .filter(|d| d.diagonal == diagonal)
            .collect();
        let [runs] = given[..] else {
            return Err(Iso230Error::Diagonals {
                diagonal: diagonal.name(),
                n: given.len(),
            });
        };
        let positioning = positioning::evaluate(&runs.runs, budget)?;
        let means = means(runs, &positioning);
        Ok((
            means,
            DiagonalResult {
                diagonal,
                positioning,
            },
        ))
    };
    let found: Vec<(Vec<Mean>, DiagonalResult)> = SpaceDiagonal::ALL
        .into_iter()
        .map(one)
        .collect::<Result<_, Iso230Error>>()?;
    let (means, diagonals): (Vec<_>, Vec<_>) = found.into_iter().unzip();
    let (systematic_error, systematic_error_coverage_factor) = greatest(
        &diagonals,
        budget,
        |p| p.systematic_error,
        factor_of_systematic,
    );
    let (reversal, reversal_coverage_factor) =
        greatest(&diagonals, budget, |p| p.reversal, factor_of_reversal);
    let (ends, means) = (means.iter().filter_map(|of| of.last()), means.concat());
    let lengths: Vec<Mean> = { ends.zip(&diagonals) }
        .map(|(end, of)| Mean {
            mean_mm: of.too_long_mm(),
            ..*end
        })
        .collect();
    Ok(DiagonalsResult {
        systematic_error,
        systematic_error_coverage_factor,
        reversal,
        reversal_coverage_factor,
        spread: range(&means, budget, 2.0),
        lengths: range(&lengths, budget, 1.0),
        diagonals,
    })
}

/// The greatest figure of the diagonals with U and k of the diagonal that has it.
fn greatest(
    diagonals: &[DiagonalResult],
    budget: &PositioningBudget,
    figure: fn(&PositioningResult) -> ExpandedLength,
    factor: fn(&PositioningResult, &PositioningBudget) -> f64,
) -> (ExpandedLength, f64) {
    let by_value = |a: &&DiagonalResult, b: &&DiagonalResult| {
        let [a, b] = [a, b].map(|one| figure(&one.positioning).value_mm);
        a.total_cmp(&b)
    };
    let Some(one) = diagonals.iter().max_by(by_value) else {
        return (ExpandedLength::new(0.0, 0.0), COVERAGE_FACTOR);
    };
    let (found, k) = (figure(&one.positioning), factor(&one.positioning, budget));
    let figure = ExpandedLength {
        expanded_uncertainty_mm: k * found.standard_uncertainty_mm(),
        ..found
    };
    (figure, k)
}

/// k of E of one diagonal, of the parts over the distance of its extremes.
fn factor_of_systematic(found: &PositioningResult, budget: &PositioningBudget) -> f64 {
    let parts = budget.over(found.extremes_apart_mm(), found.contributions.length_mm);
    let drift_mm = (2.0 / found.n_runs as f64).sqrt() * parts.drift_mm;
    coverage_factor(
        parts.device_mm.hypot(drift_mm),
        &[
            parts.alignment_mm,
            parts.machine_temperature_mm,
            parts.machine_expansion_mm,
            parts.device_temperature_mm,
            parts.device_expansion_mm,
        ],
    )
}

/// k of B of one diagonal: slow drift is a limit, unrest is normal; 2 where all drift counts as new at every reading.
fn factor_of_reversal(found: &PositioningResult, budget: &PositioningBudget) -> f64 {
    let (n, drift_mm) = (found.n_runs as f64, found.contributions.drift_mm);
    let (slow_mm, new_mm) = (2.0 * drift_mm / n, (2.0 / n).sqrt());
    match budget.environmental_unrest_mm.map(|w| new_mm * w) {
        Some(unrest_mm) if slow_mm.hypot(unrest_mm) < new_mm * drift_mm => {
            coverage_factor(unrest_mm, &[slow_mm])
        }
        _ => COVERAGE_FACTOR,
    }
}

/// A mean deviation, or the length, of a diagonal.
#[derive(Clone, Copy)]
struct Mean {
    diagonal: SpaceDiagonal,
    /// From the zero of the device, mm.
    length_mm: f64,
    mean_mm: f64,
    /// Length over which the beam was aligned, mm.
    span_mm: f64,
    n_runs: usize,
}

/// All means of one diagonal.
fn means(of: &DiagonalRuns, found: &PositioningResult) -> Vec<Mean> {
    let runs = &of.runs;
    let sides = |p: &PointResult| {
        [p.up, p.down].map(|side| Mean {
            diagonal: of.diagonal,
            length_mm: p.target_mm - runs.zero_mm,
            mean_mm: side.mean_mm,
            span_mm: runs.span_mm(),
            n_runs: found.n_runs,
        })
    };
    found.points.iter().flat_map(sides).collect()
}

/// (3) and (4) with `drifts` = 2, (5) and (6) with 1: of each mean (drifts/n) u_V² of drift. There is a mean at least.
fn range(means: &[Mean], budget: &PositioningBudget, drifts: f64) -> ExpandedLength {
    let by_mean = |a: &&Mean, b: &&Mean| a.mean_mm.total_cmp(&b.mean_mm);
    let (Some(high), Some(low)) = (means.iter().max_by(by_mean), means.iter().min_by(by_mean))
    else {
        return ExpandedLength::new(0.0, 0.0);
    };
    let apart = budget.over((high.length_mm - low.length_mm).abs(), high.span_mm);
    let drift_mm = |m: &Mean| (drifts / m.n_runs as f64).sqrt() * apart.drift_mm;
    let value_mm = high.mean_mm - low.mean_mm;
    if high.diagonal == low.diagonal {
        return ExpandedLength::new(value_mm, apart.length_part_mm().hypot(drift_mm(high)));
    }
    let constant_mm = budget.device.standard_mm(0.0);
    let scale_mm = |length_mm: f64| budget.device.standard_mm(length_mm) - constant_mm;
    // New on each diagonal: U₀² + 2 U₀ U₁ l.
    let own = |m: &Mean| {
        let steps2 = 2.0 * constant_mm * scale_mm(m.length_mm);
        (constant_mm * constant_mm + steps2).sqrt()
    };
    let aligned = |m: &Mean| budget.over(m.length_mm, m.span_mm).alignment_mm;
    let u_mm = combined(&[
        own(high),
        own(low),
        scale_mm(apart.length_mm),
        apart.machine_temperature_mm,
        apart.machine_expansion_mm,
        apart.device_temperature_mm,
        apart.device_expansion_mm,
        aligned(high),
        aligned(low),
        drift_mm(high),
        drift_mm(low),
    ]);
    ExpandedLength::new(value_mm, u_mm)
}
