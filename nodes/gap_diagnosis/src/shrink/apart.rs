//! What each of several effects does for the shrink: what is left with it alone, and its share of what all of them close.
//!
//! # Model
//!
//! ```text
//!   v(S) = rms2(no effect) - rms2(effects of S)                           (1)
//!   phi_g = sum over S without g of |S|! (n - |S| - 1)! / n! (v(S + g) - v(S)),   share = phi_g / v(all)   (2)
//! ```
//!
//! over held-out runs, every S simulated anew. With one effect taken out, v(all) - v(all - g), what two effects close alike is
//! nobody's; with one alone, v(g), it is both's; (2) halves it. It is left out for more than [`MAX_EFFECTS_IN_SUBSETS`] effects, and where
//! all of them close nothing.
//!
//! # References
//! \[1\] L. S. Shapley, in Contributions to the Theory of Games II, Princeton 1953.

use std::cell::RefCell;
use std::collections::BTreeMap;

use crate::report::figures::Apart;
use crate::search::rows::count;
use crate::shrink::Named;

/// Most effects whose subsets are all simulated.
pub const MAX_EFFECTS_IN_SUBSETS: usize = 6;

/// The effects whose bits are set.
pub fn chosen<'n, 'e>(
    named: &'n [Named<'e>],
    set: u32,
) -> impl Iterator<Item = &'n Named<'e>> + use<'n, 'e> {
    let all = named.iter().enumerate();
    all.filter(move |(place, _)| set >> place & 1 == 1)
        .map(|(_, named)| named)
}

/// A function of subsets that is asked once for each and knows some already.
pub fn remembered<const N: usize>(
    known: [(u32, f64); N],
    of: impl Fn(u32) -> f64,
) -> impl Fn(u32) -> f64 {
    let known = RefCell::new(BTreeMap::from(known));
    move |set| {
        let found = known.borrow().get(&set).copied();
        found.unwrap_or_else(|| {
            let found = of(set);
            known.borrow_mut().insert(set, found);
            found
        })
    }
}

/// Each named effect apart; `rms_um` simulates the effects whose bits are set.
pub fn apart(named: &[Named<'_>], rms_um: &dyn Fn(u32) -> f64) -> Vec<Apart> {
    let n = named.len();
    let squares: Option<Vec<f64>> = (n <= MAX_EFFECTS_IN_SUBSETS)
        .then(|| (0..1_u32 << n).map(|set| rms_um(set).powi(2)).collect());
    let shares = squares.as_ref().and_then(|squares| shares(n, squares));
    let one = |(place, named): (usize, &Named<'_>)| {
        let alone = 1_usize << place;
        Apart {
            effect: named.effect.clone(),
            axis: named.axis.clone(),
            rms_um_alone: squares
                .as_ref()
                .map_or_else(|| rms_um(1 << place), |squares| squares[alone].sqrt()),
            share: shares.as_ref().map(|shares| shares[place]),
        }
    };
    named.iter().enumerate().map(one).collect()
}

/// (2) of the mean squares that each subset leaves.
fn shares(n: usize, squares: &[f64]) -> Option<Vec<f64>> {
    let all = squares.len() - 1;
    let closed = squares[0] - squares[all];
    if n == 0 || closed <= 0.0 {
        return None;
    }
    let factorial = |k: usize| (1..=k).map(count).product::<f64>();
    let weight = |set: usize| {
        let size = set.count_ones() as usize;
        factorial(size) * factorial(n - size - 1) / factorial(n)
    };
    let share = |place: usize| {
        let own = 1 << place;
        let others = (0..squares.len()).filter(|set| set & own == 0);
        let sum: f64 = others
            .map(|set| weight(set) * (squares[set] - squares[set | own]))
            .sum();
        sum / closed
    };
    Some((0..n).map(share).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq2_effects_that_have_nothing_in_common_share_as_they_close() {
        // 10 in all, of which the first closes 6 and the second 3, whatever the other does.
        let found = shares(2, &[10.0, 4.0, 7.0, 1.0]).unwrap();
        assert!((found[0] - 6.0 / 9.0).abs() < 1e-12 && (found[1] - 3.0 / 9.0).abs() < 1e-12);
    }

    /// A, B and C; the gloves game of textbooks: A holds a left glove, B and C a right one each, a pair is worth 1. The
    /// value is 2/3, 1/6, 1/6.
    #[test]
    fn val_shapley_of_the_glove_game() {
        let worth = |set: u32| f64::from(set & 1 == 1 && set & 6 != 0);
        let squares: Vec<f64> = (0..8).map(|set| 1.0 - worth(set)).collect();
        let found = shares(3, &squares).unwrap();
        for (found, known) in found.iter().zip([2.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0]) {
            assert!((found - known).abs() < 1e-12, "{found} {known}");
        }
    }

    #[test]
    fn where_nothing_is_closed_nothing_is_shared() {
        assert!(shares(1, &[1.0, 1.5]).is_none() && shares(0, &[1.0]).is_none());
    }
}
