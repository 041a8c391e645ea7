//! What is determined although its members are not: the shortest sums of coefficients that the recordings see.
//!
//! # Model
//!
//! With N the rows of the null space that belong to the coefficients that are seen only together:
//!
//! ```text
//!   kᵀβ is estimable and touches no nuisance  ⇔  kᵀ N = 0                                     (1)
//!   K = N Nᵀ = I − X⁺X:   a set of coefficients T has such a k  ⇔  K_TT is singular            (2)
//!   number of independent k = members − rank N                                               (3)
//! ```
//!
//! A k whose support holds no smaller one is a circuit of the rows of N. Circuits of two, three and four
//! members are found by trying all; taking the shortest first gives the sparsest basis, since circuits of
//! rows are a matroid's. What four members cannot say is completed by sums over a basis of rows.
//!
//! # References
//! \[1\] J. Oxley, Matroid Theory, 2nd ed., Oxford 2011, 1.1 (circuits), 1.8 (greedy).

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use crate::spectrum::Visibility;

/// Share of a weight below which it is rounding.
const NO_WEIGHT: f64 = 1e-5;
/// Greatest least eigenvalue of K_TT, to its trace, that counts as singular.
const SINGULAR: f64 = 1e-9;
/// Greatest number of subsets of one size that are tried in one group.
const TRIED: usize = 60_000;

/// A sum of coefficients, each in mm at the edge of its span.
#[derive(Clone, Debug, PartialEq)]
pub struct Support {
    /// (column, weight); the first weight is 1.
    pub weights: Vec<(usize, f64)>,
}

/// Sparse basis of what is estimable among the first `n_coefficients` columns beyond single ones.
#[must_use]
pub fn estimable_supports(
    projector: &DMatrix<f64>,
    visibility: &[Visibility],
    n_coefficients: usize,
) -> Vec<Support> {
    let is_mixed = |j: &usize| visibility.get(*j) == Some(&Visibility::Mixed);
    let mixed: Vec<usize> = (0..n_coefficients).filter(is_mixed).collect();
    let null = DMatrix::from_fn(mixed.len(), mixed.len(), |i, j| {
        f64::from(u8::from(i == j)) - projector[(mixed[i], mixed[j])]
    });
    let mut supports = Vec::new();
    for group in groups(&null) {
        let k = DMatrix::from_fn(group.len(), group.len(), |i, j| null[(group[i], group[j])]);
        let column = |idx: usize| mixed[group[idx]];
        for k in group_supports(&k) {
            let weights = k.into_iter().map(|(idx, weight)| (column(idx), weight));
            supports.push(Support {
                weights: weights.collect(),
            });
        }
    }
    supports
}

/// Members that are linked by non-zero entries.
fn groups(k: &DMatrix<f64>) -> Vec<Vec<usize>> {
    let n = k.nrows();
    let mut group_of: Vec<usize> = (0..n).collect();
    for i in 0..n {
        for j in 0..i {
            let (a, b) = (group_of[i], group_of[j]);
            if a != b && k[(i, j)].abs() > NO_WEIGHT * NO_WEIGHT {
                for group in &mut group_of {
                    if *group == a {
                        *group = b;
                    }
                }
            }
        }
    }
    let members = |group| (0..n).filter(|i| group_of[*i] == group).collect::<Vec<_>>();
    (0..n).map(members).filter(|m| !m.is_empty()).collect()
}

fn group_supports(k: &DMatrix<f64>) -> Vec<Vec<(usize, f64)>> {
    let n = k.nrows();
    let eigen = SymmetricEigen::new(k.clone());
    let greatest = eigen.eigenvalues.max();
    let wanted = eigen
        .eigenvalues
        .iter()
        .filter(|e| **e <= SINGULAR * greatest.max(SINGULAR))
        .count(); // (3)
    let mut found = Found {
        directions: Vec::new(),
        supports: Vec::new(),
        wanted,
        n,
    };
    for size in 2..=4_usize.min(n) {
        if found.is_whole() || subsets(n, size) > TRIED {
            break;
        }
        let mut members: Vec<usize> = (0..size).collect();
        loop {
            if let Some(weights) = circuit(k, &members) {
                found.offer(&weights);
            }
            if found.is_whole() || !next_subset(&mut members, n) {
                break;
            }
        }
    }
    if !found.is_whole() {
        for weights in basis_sums(k, n - wanted) {
            found.offer(&weights);
        }
    }
    found.supports
}

fn subsets(n: usize, size: usize) -> usize {
    (0..size).fold(1_usize, |count, k| count.saturating_mul(n - k) / (k + 1))
}

pub(crate) fn next_subset(members: &mut [usize], n: usize) -> bool {
    let size = members.len();
    let Some(place) = (0..size).rev().find(|&k| members[k] < n - size + k) else {
        return false;
    };
    members[place] += 1;
    for k in place + 1..size {
        members[k] = members[k - 1] + 1;
    }
    true
}

/// (2): the weights if every member is needed.
fn circuit(k: &DMatrix<f64>, members: &[usize]) -> Option<Vec<(usize, f64)>> {
    let size = members.len();
    let part = DMatrix::from_fn(size, size, |i, j| k[(members[i], members[j])]);
    let trace = part.trace();
    let eigen = SymmetricEigen::new(part);
    let least = eigen.eigenvalues.imin();
    if eigen.eigenvalues[least] > SINGULAR * trace {
        return None;
    }
    let vector = eigen.eigenvectors.column(least);
    let needed = vector.iter().all(|w| w.abs() > NO_WEIGHT);
    let first = vector[0];
    needed.then(|| {
        members
            .iter()
            .zip(vector.iter())
            .map(|(m, w)| (*m, w / first))
            .collect()
    })
}

/// Every row of N that is not in a basis of `rank` rows, as a sum over the basis.
fn basis_sums(k: &DMatrix<f64>, rank: usize) -> Vec<Vec<(usize, f64)>> {
    let n = k.nrows();
    let mut left = k.clone();
    let mut basis: Vec<usize> = Vec::new();
    for _ in 0..rank {
        let Some(pivot) = (0..n)
            .filter(|i| !basis.contains(i))
            .max_by(|a, b| left[(*a, *a)].total_cmp(&left[(*b, *b)]))
        else {
            break;
        };
        let diagonal = left[(pivot, pivot)];
        if diagonal <= 0.0 {
            break;
        }
        let column = left.column(pivot).clone_owned();
        left -= &column * column.transpose() / diagonal;
        basis.push(pivot);
    }
    let inner = DMatrix::from_fn(basis.len(), basis.len(), |i, j| k[(basis[i], basis[j])]);
    let Some(cholesky) = inner.cholesky() else {
        return Vec::new();
    };
    let mut sums: Vec<Vec<(usize, f64)>> = (0..n)
        .filter(|i| !basis.contains(i))
        .map(|i| {
            let right = DVector::from_fn(basis.len(), |b, _| k[(basis[b], i)]);
            let share = cholesky.solve(&right);
            let members = basis.iter().zip(share.iter()).map(|(b, s)| (*b, -s));
            let mut weights: Vec<_> = std::iter::once((i, 1.0)).chain(members).collect();
            weights.retain(|(_, w)| w.abs() > NO_WEIGHT);
            weights.sort_by_key(|(idx, _)| *idx);
            let first = weights.first().map_or(1.0, |(_, w)| *w);
            weights.iter().map(|(idx, w)| (*idx, w / first)).collect()
        })
        .collect();
    sums.sort_by_key(Vec::len);
    sums
}

/// Supports so far, and an orthonormal basis of what they span.
struct Found {
    directions: Vec<DVector<f64>>,
    supports: Vec<Vec<(usize, f64)>>,
    wanted: usize,
    n: usize,
}

impl Found {
    fn is_whole(&self) -> bool {
        self.supports.len() >= self.wanted
    }

    /// Takes a support that says something new.
    fn offer(&mut self, weights: &[(usize, f64)]) {
        let mut direction = DVector::zeros(self.n);
        for (idx, weight) in weights {
            direction[*idx] = *weight;
        }
        direction.normalize_mut();
        for known in &self.directions {
            let share = known.dot(&direction);
            direction.axpy(-share, known, 1.0);
        }
        let new = direction.norm();
        if new > 1e-4 && !self.is_whole() {
            self.directions.push(direction / new);
            self.supports.push(weights.to_vec());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::Spectrum;

    fn supports_of(rows: &[&[f64]], n_coefficients: usize) -> Vec<Vec<(usize, f64)>> {
        let p = rows[0].len();
        let mut square = DMatrix::zeros(p.max(rows.len()), p);
        for (i, row) in rows.iter().enumerate() {
            for (j, entry) in row.iter().enumerate() {
                square[(i, j)] = *entry;
            }
        }
        let spectrum = Spectrum::of(&square, rows.len(), 1e-9).unwrap();
        let supports = estimable_supports(
            &spectrum.projector(),
            &spectrum.visibility(),
            n_coefficients,
        );
        supports.into_iter().map(|s| s.weights).collect()
    }

    fn check(found: &[Vec<(usize, f64)>], expected: &[&[(usize, f64)]]) {
        assert_eq!(found.len(), expected.len(), "{found:?}");
        for (found, expected) in found.iter().zip(expected) {
            assert_eq!(found.len(), expected.len(), "{found:?}");
            for (found, expected) in found.iter().zip(*expected) {
                assert_eq!(found.0, expected.0);
                assert!((found.1 - expected.1).abs() < 1e-9, "{found:?}");
            }
        }
    }

    #[test]
    fn eq2_pairs_are_found_before_longer_sums() {
        let found = supports_of(&[&[1.0, -1.0, 0.0, 0.0], &[0.0, 0.0, 2.0, 1.0]], 4);
        check(&found, &[&[(0, 1.0), (1, -1.0)], &[(2, 1.0), (3, 0.5)]]);
    }

    #[test]
    fn eq2_three_that_share_two_numbers_give_two_pairs_or_sums() {
        let found = supports_of(&[&[1.0, 1.0, 0.0], &[0.0, 1.0, 1.0]], 3);
        check(&found, &[&[(0, 1.0), (1, 1.0)], &[(0, 1.0), (2, -1.0)]]);
    }

    #[test]
    fn eq1_a_sum_that_needs_a_nuisance_is_not_printed() {
        let found = supports_of(&[&[1.0, 0.0, 1.0, 0.0], &[0.0, 1.0, 0.0, 1.0]], 2);
        assert!(found.is_empty(), "{found:?}");
    }

    #[test]
    fn eq3_sums_of_six_members_are_completed_from_a_basis() {
        let found = supports_of(&[&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]], 6);
        check(
            &found,
            &[&[(0, 1.0), (1, 2.0), (2, 3.0), (3, 4.0), (4, 5.0), (5, 6.0)]],
        );
    }
}
