//! D of one signature beside others.
//!
//! ```text
//!   D^2(s beside r) = G_ss - G_sr G_rr^-1 G_rs,   2 G_ab = D^2(a + b) - D^2(a) - D^2(b)       (5)
//! ```
//!
//! D is that of (1) in `size`, floats taken out. What of s remains below D 3 nobody could tell from noise.

use nalgebra::DMatrix;

use super::{Block, Deviations};
use crate::scatter::Scatter;

/// Share of its square below which a direction counts as taken out.
const TAKEN_OUT_OF_GRAM: f64 = 1e-6;

impl Deviations {
    /// The readings of `without` with the signatures of `self` and of another one.
    fn plus(&self, without: &Self, other: &Self) -> Self {
        let of = |(key, own): (&super::Key, &Block)| {
            let (Some(bare), Some(other)) = (without.blocks.get(key), other.blocks.get(key)) else {
                return (key.clone(), own.clone());
            };
            let mut sum = own.clone();
            let both = bare.readings.iter().zip(&other.readings);
            for (reading, (bare, other)) in sum.readings.iter_mut().zip(both) {
                if bare.direction == other.direction {
                    reading.deviation_mm += other.deviation_mm - bare.deviation_mm;
                }
            }
            (key.clone(), sum)
        };
        Self {
            blocks: self.blocks.iter().map(of).collect(),
            ..Self::default()
        }
    }

    /// (5): D of what is in `self` and not in `without`, beside what is in others.
    pub(crate) fn d_beside(
        &self,
        without: &Self,
        others: &[&Self],
        scatter: &Scatter,
        shaking_mm2: f64,
    ) -> f64 {
        let square = |with: &Self| with.d_against(without, scatter, shaking_mm2).powi(2);
        let all: Vec<&Self> = others.iter().copied().chain([self]).collect();
        let own: Vec<f64> = all.iter().map(|with| square(with)).collect();
        let n = all.len();
        let mut gram = DMatrix::zeros(n, n);
        for a in 0..n {
            gram[(a, a)] = own[a];
            for b in 0..a {
                let both = square(&all[a].plus(without, all[b]));
                gram[(a, b)] = 0.5 * (both - own[a] - own[b]);
                gram[(b, a)] = gram[(a, b)];
            }
        }
        left_of_last(gram).sqrt()
    }
}

/// Square of the last direction of a Gram matrix with all others taken out.
fn left_of_last(mut gram: DMatrix<f64>) -> f64 {
    let before = gram.clone();
    let last = gram.nrows() - 1;
    for k in 0..last {
        let own = gram[(k, k)];
        if own <= TAKEN_OUT_OF_GRAM * before[(k, k)] || own <= 0.0 {
            continue;
        }
        let (column, row) = (gram.column(k).clone_owned(), gram.row(k).clone_owned());
        gram -= column * row / own;
    }
    gram[(last, last)].max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq5_of_three_directions_is_what_least_squares_leaves() {
        // s = (3, 4, 12); beside (1, 0, 0) and (1, 1, 0) the third is left alone.
        let vectors = [[1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [3.0, 4.0, 12.0_f64]];
        let dot = |a: usize, b: usize| (0..3).map(|k| vectors[a][k] * vectors[b][k]).sum();
        let left = left_of_last(DMatrix::from_fn(3, 3, dot));
        assert!((left - 144.0).abs() < 1e-9, "{left}");
        let alike = left_of_last(DMatrix::from_fn(2, 2, |_, _| 7.0));
        assert!(alike.abs() < 1e-9, "{alike}");
    }
}
