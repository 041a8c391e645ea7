//! Whether a shape without a physics does better than an effect in its place.
//!
//! # Model
//!
//! A member g of the best set is taken out and each family F of `families` put in its place, all other members
//! refitted beside it:
//!
//! ```text
//!   worth(g) = gain_g - q_g ln n - 2 ln K                                 (1)
//!   worth(F) = gain_F - q_F ln n - 2 ln (families)                        (2)
//! ```
//!
//! An effect is in one form in all channels and conditions, a family has as many free numbers as columns and pays
//! for each. Where a family is worth more by twice the logarithm of [`ODDS`], the effect only looks like what is
//! there, and the family is its description.
//!
//! # Holds when
//! The catalogue's form, or its wide form, is that of the machine; else the right effect is shown as a surrogate.

use nalgebra::{DMatrix, DVector};

use crate::judgement::{Check, CheckId};
use crate::noise::normal::Normal;
use crate::search::families::Slot;
use crate::search::nuisance::orthonormal;
use crate::search::rows::count;

/// Odds from which a family is preferred.
const ODDS: f64 = 20.0;

/// What a member costs, (1).
#[derive(Clone, Copy, Debug)]
pub struct Cost {
    /// q_g.
    pub price: usize,
    /// ln n.
    pub log_rows: f64,
    /// ln K.
    pub log_instances: f64,
}

/// Whether no family is worth more than a member; `left` is what all members leave, `part` the member's own
/// signature, `others` the derivatives of the other members.
pub fn check(
    slots: &[Slot],
    left: &DVector<f64>,
    part: &DVector<f64>,
    others: &[DVector<f64>],
    member: Cost,
) -> Check {
    let basis = orthonormal(left.len(), others.iter().cloned());
    let beside =
        |column: DVector<f64>| -> DVector<f64> { &column - &basis * basis.tr_mul(&column) };
    let rest = beside(left + part);
    let gain = rest.norm_squared() - beside(left.clone()).norm_squared();
    let families: usize = slots.iter().map(|slot| slot.families.len()).sum();
    let choice = 2.0 * count(families.max(2)).ln();
    let own = gain - count(member.price) * member.log_rows - 2.0 * member.log_instances;
    let worths = slots.iter().flat_map(|slot| {
        slot.families.iter().map(|family| {
            let whole = |column: usize| {
                let mut whole = DVector::zeros(rest.len());
                for (row, place) in slot.rows.iter().enumerate() {
                    whole[*place] = slot.basis[(row, column)];
                }
                beside(whole)
            };
            let columns: Vec<DVector<f64>> = family.columns.clone().map(whole).collect();
            let all: Vec<usize> = (0..columns.len()).collect();
            let gain = Normal::new(&DMatrix::from_columns(&columns), &rest)
                .solve(&all)
                .gain;
            gain - count(all.len()) * member.log_rows - choice
        })
    });
    let limit = 2.0 * ODDS.ln();
    let best = worths.fold(f64::NEG_INFINITY, f64::max);
    Check::new(CheckId::BeatsShapes, best <= own + limit).with(best - own, limit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::families::{Family, Parity};
    use twin::Channel;

    fn slot(rows: usize, columns: &[DVector<f64>]) -> Slot {
        let basis = orthonormal(rows, columns.iter().cloned());
        Slot {
            channel: "grid.u".to_owned(),
            key: Channel::GridU,
            direction: "X".to_owned(),
            blocks: vec![],
            rows: (0..rows).collect(),
            families: vec![Family {
                covariate: "position_x".to_owned(),
                parity: Parity::Even,
                columns: 0..basis.ncols(),
                plain: basis.clone(),
            }],
            basis,
        }
    }

    #[test]
    fn a_family_wins_where_the_effect_holds_half_of_it_and_loses_where_it_holds_all() {
        let rows = 400;
        let at = |row: usize| row as f64 / 200.0 - 1.0;
        let line = DVector::from_fn(rows, |row, _| at(row));
        let bend = DVector::from_fn(rows, |row, _| at(row).powi(3) - 0.6 * at(row));
        let slots = [slot(rows, &[line.clone(), bend.clone()])];
        let cost = Cost {
            price: 1,
            log_rows: 400_f64.ln(),
            log_instances: 40_f64.ln(),
        };
        let [line, bend] = [line, bend].map(|v| &v * (10.0 / v.norm()));
        let nothing = DVector::zeros(rows);
        let is_beaten = |left: &DVector<f64>, part: &DVector<f64>, others: &[DVector<f64>]| {
            check(&slots, left, part, others, cost).has_failed()
        };
        assert!(is_beaten(&bend, &line, &[]));
        assert!(!is_beaten(&nothing, &line, &[]));
        // What another member explains is no merit of the family.
        assert!(!is_beaten(&bend, &line, std::slice::from_ref(&bend)));
    }
}
