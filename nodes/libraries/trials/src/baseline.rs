//! Other methods of naming, judged beside the diagnosis on the same sessions.
//!
//! | method | names |
//! |---|---|
//! | `single_effect` | the one effect that explains most by itself (`ranking`), as a ballbar's report ranks them |
//! | `thresholded` | what stays after small effects are struck out again and again (`thresholded`) |
//! | `lasso` | what the lasso keeps at the penalty that BIC likes best (`lasso`) |
//! | `always_unknown` | nothing, and always says that something unknown is there |
//! | `oracle` | what is hidden |
//!
//! The first three see what the diagnosis sees, whitened by the same noise floor (`gap_diagnosis::regression`); they
//! differ from it in how they choose. The last two are the ends of the scale.

mod lasso;
mod ranking;
mod thresholded;

use std::collections::{BTreeMap, BTreeSet};

use gap_diagnosis::regression::Regression;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// A method that chooses among the catalogue's effects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// The effect of the greatest share of chi-square by itself.
    SingleEffect,
    /// Sequentially thresholded least squares.
    Thresholded,
    /// Lasso, its penalty by BIC.
    Lasso,
    /// Names nothing, flags always.
    AlwaysUnknown,
    /// Knows what is hidden.
    Oracle,
}

impl Method {
    /// Every method, in order.
    pub const ALL: [Self; 5] = [
        Self::SingleEffect,
        Self::Thresholded,
        Self::Lasso,
        Self::AlwaysUnknown,
        Self::Oracle,
    ];

    /// In words.
    #[must_use]
    pub const fn title(self) -> &'static str {
        [
            "single-effect ranking",
            "thresholded least squares",
            "lasso by BIC",
            "always unknown",
            "oracle",
        ][self as usize]
    }
}

/// What a method names: id and what it acts on.
pub type Names = BTreeSet<(String, String)>;

/// What the methods that look at data name.
#[must_use]
pub fn named(regression: &Regression) -> BTreeMap<Method, Names> {
    let names = |effects: BTreeSet<usize>| -> Names {
        let all = effects.into_iter();
        all.map(|k| regression.effects[k].clone()).collect()
    };
    BTreeMap::from([
        (Method::SingleEffect, names(ranking::chosen(regression))),
        (Method::Thresholded, names(thresholded::chosen(regression))),
        (Method::Lasso, names(lasso::chosen(regression))),
    ])
}

/// Least squares on some columns of a Gram matrix.
struct Fit {
    sizes: DVector<f64>,
    /// What it takes from chi-square.
    gain: f64,
}

/// Share of a column's square that is added to it, so that columns that span each other share a size.
const RIDGE: f64 = 1e-8;

fn fit(regression: &Regression, columns: &[usize]) -> Fit {
    let gram = regression.gram.select_rows(columns);
    let mut gram: DMatrix<f64> = gram.select_columns(columns);
    let along = regression.along.select_rows(columns);
    for k in 0..columns.len() {
        gram[(k, k)] *= 1.0 + RIDGE;
    }
    let sizes = gram.cholesky().map_or_else(
        || DVector::zeros(columns.len()),
        |factor| factor.solve(&along),
    );
    Fit {
        gain: sizes.dot(&along),
        sizes,
    }
}

/// The best form of each effect by itself: places among the candidates.
fn best_forms(regression: &Regression) -> Vec<usize> {
    let mut best = BTreeMap::<usize, (f64, usize)>::new();
    for (place, candidate) in regression.candidates.iter().enumerate() {
        let columns: Vec<usize> = candidate.columns.clone().collect();
        let gain = fit(regression, &columns).gain;
        let known = best.entry(candidate.effect).or_insert((gain, place));
        if gain > known.0 {
            *known = (gain, place);
        }
    }
    best.into_values().map(|(_, place)| place).collect()
}

#[cfg(test)]
mod tests {
    use gap_diagnosis::figures::Isolability;
    use gap_diagnosis::regression::Candidate;
    use rand::{Rng, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64Mcg;

    use super::*;

    /// Twelve effects of one column each over 400 rows, the first two nearly alike; some sizes are not zero.
    pub(super) fn made_up(seed: u64, sizes: &[(usize, f64)]) -> Regression {
        let (rows, effects) = (400, 12);
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let mut normal = || -> f64 { random.sample(StandardNormal) };
        let mut columns = DMatrix::from_fn(rows, effects, |_, _| normal() / 20.0);
        let alike = columns.column(0) * 0.9 + columns.column(1) * 0.436;
        columns.set_column(1, &alike);
        let mut z = DVector::from_fn(rows, |_, _| normal());
        for (effect, size) in sizes {
            z += columns.column(*effect) * *size;
        }
        Regression {
            effects: (0..effects)
                .map(|k| (format!("effect_{k}"), "X".to_owned()))
                .collect(),
            excited: vec![true; effects],
            candidates: (0..effects)
                .map(|effect| Candidate {
                    effect,
                    columns: effect..effect + 1,
                    parameters: 1,
                })
                .collect(),
            gram: columns.tr_mul(&columns),
            along: columns.tr_mul(&z),
            square: z.norm_squared(),
            freedom: 400.0,
            isolability: Isolability::default(),
        }
    }

    #[test]
    fn noise_alone_is_seldom_named_by_ranking_and_a_large_effect_always_by_all() {
        let mut falsely = 0;
        for seed in 0..50 {
            falsely += named(&made_up(seed, &[]))[&Method::SingleEffect].len();
            for (method, names) in named(&made_up(seed, &[(5, 60.0)])) {
                let wanted = ("effect_5".to_owned(), "X".to_owned());
                assert!(names.contains(&wanted), "{method:?} {names:?}");
            }
        }
        assert!(falsely <= 1, "{falsely}");
    }

    #[test]
    fn ranking_names_one_of_two_effects_and_least_squares_both() {
        let found = named(&made_up(3, &[(4, 50.0), (9, -40.0)]));
        let names = |method| -> Vec<&str> {
            found[&method]
                .iter()
                .map(|(effect, _)| effect.as_str())
                .collect()
        };
        assert_eq!(names(Method::SingleEffect), ["effect_4"]);
        assert_eq!(names(Method::Thresholded), ["effect_4", "effect_9"]);
        for effect in ["effect_4", "effect_9"] {
            assert!(names(Method::Lasso).contains(&effect));
        }
    }
}
