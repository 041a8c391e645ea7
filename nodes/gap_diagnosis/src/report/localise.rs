//! Where the gap lies: which channel goes with which covariate, and how likely noise would do so.
//!
//! # Model
//!
//! ```text
//!   T = |U'z|^2,   z_T = ((T/k)^(1/3) - (1 - 2/(9k))) / sqrt(2/(9k))      (1)
//!   p = (1 + #{draws: max z_T* >= z_T}) / (1 + draws)                     (2)
//!   S = sum over slots ((T_all - k_all)+ + (|z|^2 - T_all - (n - k_all))+)                (3)
//!   E = (T - k)+ / S = unique + shared,   unique = (T_all - T_others - k)+ / S            (4)
//! ```
//!
//! A slot is one channel in one direction, n its rows, T_all what its k_all columns tell together. S is what is beyond
//! noise: a slot that has less than its noise, as one has whose error of form is small, takes nothing from another's.
//!
//! A draw of (2) turns the sign of whole runs of z, and for families over time or temperature turns each block of a run round
//! in a circle as well: what goes slowly through a long run keeps its colour and loses its place. In a slot with fewer than ten runs, where turning them is no draw,
//! it draws U'z from noise of one
//! instead, scaled by the square root of nu / chi2_nu: the field between runs is known from nu coefficients of few
//! repeats only. The maximum is over all families, so that p holds however many are looked at.
//!
//! # References
//! \[1\] E. B. Wilson, M. M. Hilferty, PNAS 17, 1931. \[2\] P. H. Westfall, S. S. Young, Resampling-Based
//! Multiple Testing, Wiley 1993 (max-T).

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use rand::{Rng, SeedableRng};
use rand_distr::{ChiSquared, Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use twin::Channel;

use crate::config::GapConfig;
use crate::noise::Noise;
use crate::noise::normal::Normal;
use crate::noise::stack::Stack;
use crate::search::families::{Family, Slot};
use crate::search::rows::count;

/// Score of one family.
#[derive(Clone, Debug, PartialEq)]
pub struct Score {
    /// Its slot.
    pub slot: usize,
    /// Its place in the slot.
    pub family: usize,
    /// T of (1).
    pub square: f64,
    /// z_T.
    pub z: f64,
    /// (2).
    pub p_value: f64,
    /// Share that only this explains.
    pub unique: f64,
    /// Share that others explain as well.
    pub shared: f64,
}

/// Fewest runs whose signs are flipped.
pub const MIN_RUNS_TO_LOCALISE: usize = 10;

/// (1).
pub fn wilson_hilferty(square: f64, freedom: f64) -> f64 {
    let spread = 2.0 / (9.0 * freedom);
    ((square / freedom).max(0.0).cbrt() - (1.0 - spread)) / spread.sqrt()
}

/// Scores of all families on a whitened residual.
pub fn scores(
    stack: &Stack<'_>,
    slots: &[Slot],
    noise: &BTreeMap<Channel, Noise>,
    z: &DVector<f64>,
    config: &GapConfig,
) -> Vec<Score> {
    let along: Vec<DVector<f64>> = slots.iter().map(|slot| project(slot, z)).collect();
    let mut scores = Vec::new();
    for (slot, of) in slots.iter().enumerate() {
        for (family, entry) in of.families.iter().enumerate() {
            let square = squares(&along[slot], entry);
            scores.push(Score {
                slot,
                family,
                square,
                z: wilson_hilferty(square, count(entry.columns.len())),
                p_value: 1.0,
                unique: 0.0,
                shared: 0.0,
            });
        }
    }
    let (many, few): (Vec<&Slot>, Vec<&Slot>) = slots
        .iter()
        .partition(|slot| runs_of(stack, slot) >= MIN_RUNS_TO_LOCALISE);
    let greatest: Vec<f64> = flipped(stack, &many, z, config)
        .into_iter()
        .zip(parametric(&few, noise, config))
        .map(|(a, b)| a.max(b))
        .collect();
    for score in &mut scores {
        let above = greatest.iter().filter(|draw| **draw >= score.z).count();
        score.p_value = (1.0 + count(above)) / (1.0 + count(greatest.len()));
    }
    shares(slots, z, &along, &mut scores);
    scores.sort_by(|a, b| b.unique.total_cmp(&a.unique).then(b.z.total_cmp(&a.z)));
    scores
}

/// Runs that a slot has rows of.
fn runs_of(stack: &Stack<'_>, slot: &Slot) -> usize {
    let blocks = slot.blocks.iter().map(|index| &stack.rows.blocks[*index]);
    let mut runs: Vec<usize> = blocks.map(|block| block.run).collect();
    runs.sort_unstable();
    runs.dedup();
    runs.len()
}

fn project(slot: &Slot, z: &DVector<f64>) -> DVector<f64> {
    slot.basis.tr_mul(&rows_of(slot, z))
}

fn rows_of(slot: &Slot, z: &DVector<f64>) -> DVector<f64> {
    DVector::from_iterator(slot.rows.len(), slot.rows.iter().map(|place| z[*place]))
}

fn squares(along: &DVector<f64>, family: &Family) -> f64 {
    family.columns.clone().map(|k| along[k] * along[k]).sum()
}

fn most(slot: &Slot, along: &DVector<f64>) -> f64 {
    slot.families
        .iter()
        .map(|family| wilson_hilferty(squares(along, family), count(family.columns.len())))
        .fold(f64::NEG_INFINITY, f64::max)
}

/// Greatest score of each draw of flipped runs.
fn flipped(stack: &Stack<'_>, slots: &[&Slot], z: &DVector<f64>, config: &GapConfig) -> Vec<f64> {
    let parts: Vec<Vec<DVector<f64>>> = slots
        .iter()
        .map(|slot| by_run(stack, slot, &rows_of(slot, z)))
        .collect();
    let over_time: Vec<OverTime> = slots.iter().map(|slot| OverTime::new(slot)).collect();
    let mut random = Pcg64Mcg::seed_from_u64(config.seed);
    let mut turns = Pcg64Mcg::seed_from_u64(config.seed ^ 0x53);
    (0..config.significance_draws)
        .map(|_| {
            let signs: Vec<f64> = stack
                .runs
                .iter()
                .map(|_| if random.random() { 1.0 } else { -1.0 })
                .collect();
            let mut greatest = f64::NEG_INFINITY;
            for ((slot, parts), over_time) in slots.iter().zip(&parts).zip(&over_time) {
                let mut along = DVector::zeros(slot.basis.ncols());
                for (part, sign) in parts.iter().zip(&signs) {
                    along.axpy(*sign, part, 1.0);
                }
                over_time.turn(stack, slot, z, &signs, &mut turns, &mut along);
                greatest = greatest.max(most(slot, &along));
            }
            greatest
        })
        .collect()
}

/// Columns of the families of a slot that go with time.
struct OverTime {
    columns: Vec<usize>,
}

impl OverTime {
    fn new(slot: &Slot) -> Self {
        let families = slot.families.iter();
        let own = families.filter(|family| {
            family.covariate == "time" || family.covariate.starts_with("temperature_")
        });
        Self {
            columns: own.flat_map(|family| family.columns.clone()).collect(),
        }
    }

    /// U'z of these columns where each block of z is turned round by a draw and has the sign of its run.
    fn turn(
        &self,
        stack: &Stack<'_>,
        slot: &Slot,
        z: &DVector<f64>,
        signs: &[f64],
        random: &mut Pcg64Mcg,
        along: &mut DVector<f64>,
    ) {
        for &column in &self.columns {
            along[column] = 0.0;
        }
        let mut first = 0;
        for &index in &slot.blocks {
            let block = &stack.rows.blocks[index];
            let n = block.rows.len();
            let by = random.random_range(0..n.max(1));
            let run = stack.runs.iter().position(|run| *run == block.run);
            let sign = run.map_or(1.0, |run| signs[run]);
            let own_z = &z.as_slice()[block.range()];
            for &column in &self.columns {
                let own = slot.basis.column(column);
                along[column] += sign * turned(&own.as_slice()[first..first + n], own_z, by);
            }
            first += n;
        }
    }
}

/// Product of a column with rows that are turned round by so many places.
fn turned(column: &[f64], rows: &[f64], by: usize) -> f64 {
    let (head, tail) = rows.split_at(by.min(rows.len()));
    let turned = tail.iter().chain(head);
    column.iter().zip(turned).map(|(a, b)| a * b).sum()
}

/// U'z of each run alone.
fn by_run(stack: &Stack<'_>, slot: &Slot, z: &DVector<f64>) -> Vec<DVector<f64>> {
    let mut parts = vec![DVector::zeros(slot.basis.ncols()); stack.runs.len()];
    let mut first = 0;
    for &index in &slot.blocks {
        let block = &stack.rows.blocks[index];
        let n = block.rows.len();
        if let Some(run) = stack.runs.iter().position(|run| *run == block.run) {
            parts[run] += slot.basis.rows(first, n).tr_mul(&z.rows(first, n));
        }
        first += n;
    }
    parts
}

/// Greatest score of each draw of noise of one.
fn parametric(slots: &[&Slot], noise: &BTreeMap<Channel, Noise>, config: &GapConfig) -> Vec<f64> {
    let grams: Vec<DMatrix<f64>> = slots
        .iter()
        .map(|slot| slot.basis.tr_mul(&slot.basis))
        .collect();
    noise_maxima(slots, noise, &grams, config.significance_draws, config.seed)
}

/// Greatest score over families of draws with the given covariances of U'z.
pub fn noise_maxima(
    slots: &[&Slot],
    noise: &BTreeMap<Channel, Noise>,
    grams: &[DMatrix<f64>],
    draws: usize,
    seed: u64,
) -> Vec<f64> {
    let roots: Vec<DMatrix<f64>> = grams.iter().map(root).collect();
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    (0..draws)
        .map(|_| {
            let mut greatest = f64::NEG_INFINITY;
            for (slot, root) in slots.iter().zip(&roots) {
                let white =
                    DVector::from_fn(root.ncols(), |_, _| StandardNormal.sample(&mut random));
                let known = &noise[&slot.key].field_freedom.max(2.0);
                let doubt = (known / squared_normal(*known, &mut random)).sqrt();
                greatest = greatest.max(most(slot, &(root * white * doubt)));
            }
            greatest
        })
        .collect()
}

/// A draw of chi-square.
fn squared_normal(freedom: f64, random: &mut Pcg64Mcg) -> f64 {
    ChiSquared::new(freedom).map_or(freedom, |law| law.sample(random))
}

/// L with L L' = a covariance, directions without variance left out.
fn root(gram: &DMatrix<f64>) -> DMatrix<f64> {
    let n = gram.nrows();
    let mut lower = DMatrix::<f64>::zeros(n, n);
    for j in 0..n {
        let pivot = gram[(j, j)] - (0..j).map(|k| lower[(j, k)].powi(2)).sum::<f64>();
        if pivot <= 1e-9 {
            continue;
        }
        let pivot = pivot.sqrt();
        lower[(j, j)] = pivot;
        for i in j + 1..n {
            let sum: f64 = (0..j).map(|k| lower[(i, k)] * lower[(j, k)]).sum();
            lower[(i, j)] = (gram[(i, j)] - sum) / pivot;
        }
    }
    lower
}

/// (4) of the families that stand out.
fn shares(slots: &[Slot], z: &DVector<f64>, along: &[DVector<f64>], scores: &mut [Score]) {
    let told: Vec<Told> = slots
        .iter()
        .zip(along)
        .map(|(slot, along)| Told::new(&slot.basis, along))
        .collect();
    let beyond = told.iter().zip(slots).map(|(told, slot)| {
        let rows = rows_of(slot, z);
        told.beyond_noise(rows.norm_squared(), count(rows.len()))
    });
    let structured = beyond.sum::<f64>().max(1.0);
    for score in scores.iter_mut().filter(|score| score.z > 3.0) {
        let own = &slots[score.slot].families[score.family].columns;
        let [unique, whole] = told[score.slot].energies(own, score.square);
        score.unique = unique / structured;
        score.shared = (whole - unique) / structured;
    }
}

/// What all families of a slot tell together.
struct Told {
    normal: Normal,
    /// T_all.
    all: f64,
}

impl Told {
    fn new(basis: &DMatrix<f64>, along: &DVector<f64>) -> Self {
        let normal = Normal {
            gram: basis.tr_mul(basis),
            along: along.clone(),
        };
        let columns: Vec<usize> = (0..basis.ncols()).collect();
        let all = normal.solve(&columns).gain;
        Self { normal, all }
    }

    /// The slot's part of (3).
    fn beyond_noise(&self, square: f64, rows: f64) -> f64 {
        let columns = count(self.normal.along.len());
        let told = (self.all - columns).max(0.0);
        told + (square - self.all - (rows - columns).max(0.0)).max(0.0)
    }

    /// Numerators of (4) for some columns that tell `square`: alone, and at all.
    fn energies(&self, own: &std::ops::Range<usize>, square: f64) -> [f64; 2] {
        let others: Vec<usize> = (0..self.normal.along.len())
            .filter(|k| !own.contains(k))
            .collect();
        let k = count(own.len());
        let most = (self.all - count(self.normal.along.len())).max(0.0);
        let whole = (square - k).max(0.0).min(most);
        let lost = self.all - self.normal.solve(&others).gain;
        [(lost - k).max(0.0).min(whole), whole]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_that_is_turned_round_keeps_its_rows_and_loses_their_place() {
        let ramp = [-1.5, -0.5, 0.5, 1.5];
        assert!((turned(&ramp, &ramp, 0) - 5.0).abs() < 1e-12);
        // -1.5 * 0.5 - 0.5 * 1.5 - 0.5 * 1.5 - 1.5 * 0.5
        assert!((turned(&ramp, &ramp, 2) + 3.0).abs() < 1e-12);
        // What is alike in all of a run is the same wherever the run begins.
        assert!((turned(&ramp, &[2.0; 4], 3) - turned(&ramp, &[2.0; 4], 0)).abs() < 1e-12);
    }

    /// Four rows; two unit columns at 60 degrees to each other in the first two, and z along the first: it tells 100
    /// together, the second alone a quarter of it.
    #[test]
    fn eq4_what_two_families_share_is_counted_once_and_both_parts_make_the_whole() {
        let (sin, cos) = std::f64::consts::FRAC_PI_3.sin_cos();
        let basis = DMatrix::from_column_slice(4, 2, &[1.0, 0.0, 0.0, 0.0, cos, sin, 0.0, 0.0]);
        let z = DVector::from_column_slice(&[10.0, 0.0, 0.0, 0.0]);
        let told = Told::new(&basis, &basis.tr_mul(&z));
        assert!((told.all - 100.0).abs() < 1e-9);
        // 100 told by two columns; the two rows beside them have less than their noise and take nothing from it.
        assert!((told.beyond_noise(100.0, 4.0) - 98.0).abs() < 1e-9);
        let [unique, whole] = told.energies(&(0..1), 100.0);
        assert!((unique - 74.0).abs() < 1e-9, "{unique}");
        assert!((whole - 98.0).abs() < 1e-9, "{whole}");
        let [unique, whole] = told.energies(&(1..2), 25.0);
        assert!(unique.abs() < 1e-9 && (whole - 24.0).abs() < 1e-9);
        // A rest that no family tells is part of what is beyond noise.
        assert!((told.beyond_noise(150.0, 4.0) - 98.0 - 48.0).abs() < 1e-9);
    }
}
