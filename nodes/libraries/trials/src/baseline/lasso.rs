//! The lasso over every form of every effect, by coordinate descent on the Gram matrix.
//!
//! # Model
//!
//! With columns of unit length, R = their Gram matrix and r = R's right side,
//!
//! ```text
//!   min over beta of |z - J beta|^2 / 2 + lambda |beta|_1                 (1)
//!   beta_k <- soft(r_k - sum_(j != k) R_kj beta_j, lambda)                (2)
//!   BIC(lambda) = |z - J beta|^2 + (beta_k != 0) ln n                     (3)
//! ```
//!
//! (2) runs through all columns until none moves, lambda falls from the value at which nothing is kept by equal
//! ratios, and the least (3) names. The number of columns kept is the lasso's number of parameters \[2\].
//!
//! # Agreement
//! `eq2_meets_the_conditions_of_a_minimum`: |gradient| is lambda where a size is not zero and below it elsewhere, to
//! 1e-6 of lambda.
//!
//! # References
//! \[1\] J. Friedman, T. Hastie, R. Tibshirani, J. Stat. Softw. 33 (2010) 1 (coordinate descent; from memory).
//! \[2\] H. Zou, T. Hastie, R. Tibshirani, Ann. Stat. 35 (2007) 2173 (from memory).

use std::collections::BTreeSet;

use gap_diagnosis::regression::Regression;
use nalgebra::{DMatrix, DVector};

/// Penalties that are tried.
const PENALTIES: usize = 40;
/// Least penalty as a share of the greatest.
const LEAST: f64 = 1e-3;
/// Change of a size, in standard deviations, below which it stands.
const STILL: f64 = 1e-7;
/// Most rounds at one penalty.
const PENALTY_ROUNDS: usize = 5000;
/// Columns kept beyond which smaller penalties are not worth trying.
const MOST_KEPT: usize = 60;

pub(super) fn chosen(regression: &Regression) -> BTreeSet<usize> {
    let lengths = regression.gram.diagonal().map(f64::sqrt);
    let n = lengths.len();
    let gram = DMatrix::from_fn(n, n, |i, k| {
        regression.gram[(i, k)] / (lengths[i] * lengths[k])
    });
    let along = regression.along.component_div(&lengths);
    let greatest = along.iter().fold(0.0_f64, |most, r| most.max(r.abs()));
    let mut sizes = DVector::zeros(n);
    let mut gradient = along.clone();
    let mut best = (regression.square, BTreeSet::new());
    for step in 1..=PENALTIES {
        let penalty = greatest * LEAST.powf(step as f64 / PENALTIES as f64);
        descend(&gram, &mut gradient, &mut sizes, penalty);
        let kept: BTreeSet<usize> = (0..n).filter(|k| sizes[*k] != 0.0).collect();
        // z'z - 2 b'beta + beta'G beta, where G beta is b less the gradient.
        let left = regression.square - sizes.dot(&along) - sizes.dot(&gradient);
        let score = left + kept.len() as f64 * regression.freedom.ln();
        if score < best.0 {
            best = (score, kept.clone());
        }
        if kept.len() > MOST_KEPT {
            break;
        }
    }
    let own = |column: &usize| {
        let of =
            |candidate: &&gap_diagnosis::regression::Candidate| candidate.columns.contains(column);
        regression
            .candidates
            .iter()
            .find(of)
            .map(|candidate| candidate.effect)
    };
    best.1.iter().filter_map(own).collect()
}

/// (2) until nothing moves; `gradient` is r - R beta before and after.
fn descend(
    gram: &DMatrix<f64>,
    gradient: &mut DVector<f64>,
    sizes: &mut DVector<f64>,
    penalty: f64,
) {
    for _ in 0..PENALTY_ROUNDS {
        let mut most = 0.0_f64;
        for k in 0..sizes.len() {
            let pull = gradient[k] + sizes[k];
            let soft = (pull.abs() - penalty).max(0.0).copysign(pull);
            let change = soft - sizes[k];
            if change != 0.0 {
                sizes[k] = soft;
                gradient.axpy(-change, &gram.column(k), 1.0);
                most = most.max(change.abs());
            }
        }
        if most < STILL {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::made_up;
    use super::*;

    #[test]
    fn eq2_meets_the_conditions_of_a_minimum() {
        let regression = made_up(8, &[(0, 20.0), (6, 9.0)]);
        let lengths = regression.gram.diagonal().map(f64::sqrt);
        let gram = DMatrix::from_fn(12, 12, |i, k| {
            regression.gram[(i, k)] / (lengths[i] * lengths[k])
        });
        let along = regression.along.component_div(&lengths);
        let mut sizes = DVector::zeros(12);
        let mut gradient = along.clone();
        let penalty = 2.5;
        descend(&gram, &mut gradient, &mut sizes, penalty);
        let fresh = &along - &gram * &sizes;
        assert!(sizes.iter().filter(|size| **size != 0.0).count() >= 2);
        for k in 0..12 {
            if sizes[k] == 0.0 {
                assert!(fresh[k].abs() <= penalty * (1.0 + 1e-6), "{k}");
            } else {
                let wanted = penalty.copysign(sizes[k]);
                assert!((fresh[k] - wanted).abs() < 1e-6 * penalty, "{k}");
            }
        }
    }
}
