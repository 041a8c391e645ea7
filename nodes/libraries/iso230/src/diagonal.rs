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

use super::extent::{greatest, range};
use super::positioning::budget::PositioningBudget;
use super::positioning::{self, PositioningResult, PositioningRuns};
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
    /// B_d, (2).
    pub reversal: ExpandedLength,
    /// (3); not a figure of the standard.
    pub spread: ExpandedLength,
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
        Ok(DiagonalResult {
            diagonal,
            positioning: positioning::evaluate(&runs.runs, budget)?,
        })
    };
    let diagonals: Vec<DiagonalResult> = SpaceDiagonal::ALL
        .into_iter()
        .map(one)
        .collect::<Result<_, _>>()?;
    let of = |figure: fn(&PositioningResult) -> ExpandedLength| {
        let figures = || diagonals.iter().map(|d| figure(&d.positioning));
        ExpandedLength {
            value_mm: greatest(figures().map(|f| f.value_mm)),
            expanded_uncertainty_mm: greatest(figures().map(|f| f.expanded_uncertainty_mm)),
        }
    };
    let systematic_error = of(|p| p.systematic_error);
    let points = diagonals.iter().flat_map(|d| &d.positioning.points);
    let means = points.flat_map(|p| [p.up.mean_mm, p.down.mean_mm]);
    Ok(DiagonalsResult {
        systematic_error,
        reversal: of(|p| p.reversal),
        spread: ExpandedLength {
            value_mm: range(means),
            // Two means of different diagonals: each with what E has for its own.
            expanded_uncertainty_mm: 2.0_f64.sqrt() * systematic_error.expanded_uncertainty_mm,
        },
        diagonals,
    })
}
