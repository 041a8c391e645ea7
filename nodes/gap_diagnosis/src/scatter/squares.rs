//! Squares of what readings scatter by, and what their floor makes of them.
//!
//! # Model
//!
//! A row of a path is the mean of m readings that may go with each other in any way (a vibration of 93 Hz hardly
//! moves the mean of 100 ms, a slow one moves all of them alike). Their mean square does not depend on that:
//!
//! ```text
//!   s = (r2 + (m - 1)/m w) / s_c                                          (1)
//!   h = (1/m sum_k v_k) / s_c                                             (2)
//!   k = 1/H sum_h |sum_t e^(-2 pi i h t / n) (s_t / f_t - 1)|2 / n        (3)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | r | the row's deviation without the smooth modes of its block | mm |
//! | w | variance of the readings within the row, about the line through its neighbours | mm2 |
//! | v_k | variance of a reading by the twin | mm2 |
//! | s_c | the channel's middle of r2 + (m - 1)/m w | mm2 |
//! | k | of a path by its waves of order 13 to 40, which are shorter than those of a signature; at least 2 / m | |
//!
//! A touch is one reading: z2 of the whitened row, with
//!
//! ```text
//!   h_t = sum_j c_j2 v_(t-j),   z = sum_j c_j y_(t-j) the whitener's filter          (4)
//! ```
//!
//! `Squares::of_rows` is z2 of all rows, with g and e/m as a floor: what scatter does to the rows that the search for
//! effects of the mean is made on.
//!
//! # References
//! \[1\] D. R. Brillinger, Time Series, SIAM 2001, 5.6 (the variance of a mean by the periodogram beside it).

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};
use twin::Channel;
use twin::effects::Effect;

use super::levels::{Levels, levels, means, positive};
use crate::judgement::cause::Scope;
use crate::search::field;
use crate::search::nuisance::orthonormal;
use crate::search::rows::{Block, Row, count};

/// Squares beyond this many times what is usual about them count as this.
const MOST_SQUARE: f64 = 12.0;
/// Rows to both sides of a row of a path that say what is usual there, and of a turn that say nothing: what no two
/// reversals have in common with a formula is no scatter, though it is sharper than a row.
const BESIDE: usize = 10;
/// k of rows that say nothing.
const UNTOLD: f64 = 1e18;
/// Middle of chi-square of one.
const MIDDLE: f64 = 0.455;
/// Least level in (1) of `scatter`, in middles.
const LEAST_LEVEL: f64 = 0.1;
/// Waves of (3).
const WAVES: std::ops::RangeInclusive<usize> = field::HARMONICS + 1..=40;
/// How often the weights of a fit are taken anew.
const WEIGHT_ROUNDS: usize = 8;
/// Least k of touches: a square of a normal deviation has 2.
const LEAST_OF_TOUCHES: f64 = 1.0;

/// What of the readings is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    /// All.
    Whole,
    /// w of (1) alone, which no smooth deviation of the rows moves, whatever it is; touches have none.
    Within,
}

/// What the search is made on.
pub(super) struct Squares {
    part: Part,
    /// s, outliers pulled in.
    squares: DVector<f64>,
    /// s_c by channel; none where rows are whitened.
    scales: BTreeMap<Channel, f64>,
    /// g of each row.
    levels: Levels,
    /// Columns of e.
    shared: Vec<DVector<f64>>,
    /// What is expected of each square, at first by the levels alone, times the root of k.
    floor: DVector<f64>,
    /// Root of k.
    unit: DVector<f64>,
    /// Squares over the floor, beside the levels.
    pub(super) y: DVector<f64>,
}

/// Sizes of (1) of `scatter`, and what they make of the squares.
pub(super) struct Sized {
    /// Sizes of the columns beside the levels.
    pub(super) sizes: Vec<f64>,
    /// E s.
    pub(super) level: DVector<f64>,
}

impl Squares {
    /// (1) and, of touches, z2; what `part` leaves out has no say.
    pub(super) fn of_readings(scope: &Scope<'_, '_>, left: &DVector<f64>, part: Part) -> Self {
        let stack = scope.stack;
        let (mut squares, of_paths) = match part {
            Part::Whole => {
                let told = DVector::from_vec(stack.unfiltered(left));
                (rough(scope, left, true), rough(scope, &told, false))
            }
            Part::Within => (left.map(|_| 1.0), left.map(|_| 0.0)),
        };
        for block in stack.rows.blocks.iter().filter(|block| !is_touch(block)) {
            for (place, row) in block.range().zip(&block.rows) {
                let m = count(row.readings.len());
                let within = stack.within[place].unwrap_or(0.0);
                squares[place] = of_paths[place] + within * (m - 1.0) / m;
            }
        }
        let mut scales = BTreeMap::<Channel, Vec<f64>>::new();
        for block in stack.rows.blocks.iter().filter(|block| !is_touch(block)) {
            let own = scales.entry(block.channel.clone()).or_default();
            own.extend(block.range().map(|place| squares[place]));
        }
        let scales: BTreeMap<Channel, f64> = scales
            .into_iter()
            .map(|(channel, own)| (channel, middle(own).max(f64::MIN_POSITIVE)))
            .collect();
        for block in &stack.rows.blocks {
            if let Some(scale) = scales.get(&block.channel) {
                squares
                    .rows_mut(block.start, block.rows.len())
                    .unscale_mut(*scale);
            }
        }
        Self::new(scope, part, squares, scales)
    }

    /// z2 of all rows.
    pub(super) fn of_rows(scope: &Scope<'_, '_>, left: &DVector<f64>) -> Self {
        let squares = rough(scope, left, true);
        let mut found = Self::new(scope, Part::Whole, squares, BTreeMap::new());
        found.shared = means(scope);
        found
    }

    fn new(
        scope: &Scope<'_, '_>,
        part: Part,
        mut squares: DVector<f64>,
        scales: BTreeMap<Channel, f64>,
    ) -> Self {
        for block in &scope.stack.rows.blocks {
            let own: Vec<f64> = squares
                .rows(block.start, block.rows.len())
                .iter()
                .copied()
                .collect();
            let is_path = scales.contains_key(&block.channel);
            for (row, place) in block.range().enumerate() {
                squares[place] = own[row].min(MOST_SQUARE * usual(&own, row, is_path));
            }
        }
        let rows = squares.len();
        let mut found = Self {
            part,
            squares,
            levels: levels(scope, &scales),
            shared: vec![],
            scales,
            floor: DVector::from_element(rows, 1.0),
            unit: DVector::from_element(rows, std::f64::consts::SQRT_2),
            y: DVector::zeros(rows),
        };
        let level = found.fit(&[]).level;
        found.weigh_by(scope, &level);
        found
    }

    /// Sets what is expected of the squares.
    pub(super) fn weigh_by(&mut self, scope: &Scope<'_, '_>, level: &DVector<f64>) {
        self.unit = self.dispersion(scope, level).map(f64::sqrt);
        self.floor = level.component_mul(&self.unit);
        self.y = self.column(&self.squares);
    }

    /// Something of the rows over the floor, beside the levels.
    pub(super) fn column(&self, of_rows: &DVector<f64>) -> DVector<f64> {
        self.levels
            .beside(of_rows.component_div(&self.floor), &self.floor)
    }

    /// (2), of touches and whitened rows (4): what an effect adds to each square.
    pub(super) fn spread(&self, scope: &Scope<'_, '_>, effect: &dyn Effect) -> DVector<f64> {
        let stack = scope.stack;
        let mut spread = vec![0.0; stack.rows.len];
        for &run in &stack.runs {
            let run_of = &stack.session.runs[run];
            let of_readings = stack.twin.variance(stack.session, run_of, &[effect]);
            for block in stack.rows.blocks.iter().filter(|block| block.run == run) {
                let sum = |row: &Row| -> f64 { row.readings.iter().map(|k| of_readings[*k]).sum() };
                let m = |row: &Row| count(row.readings.len());
                let rows = block.rows.iter();
                let own: Vec<f64> = match self.scales.get(&block.channel) {
                    Some(scale) => {
                        let share = |m: f64| match self.part {
                            Part::Whole => 1.0,
                            Part::Within => (m - 1.0) / m,
                        };
                        rows.map(|row| share(m(row)) * sum(row) / m(row) / scale)
                            .collect()
                    }
                    None if self.part == Part::Within => rows.map(|_| 0.0).collect(),
                    None => {
                        let of_rows: Vec<f64> = rows.map(|row| sum(row) / m(row).powi(2)).collect();
                        passed(scope, block, &of_rows)
                    }
                };
                spread[block.range()].copy_from_slice(&own);
            }
        }
        DVector::from_vec(spread)
    }

    /// (1) of `scatter` with some columns beside the levels, by iterated weights.
    pub(super) fn fit(&self, columns: &[&DVector<f64>]) -> Sized {
        let all: Vec<&DVector<f64>> = self.shared.iter().chain(columns.iter().copied()).collect();
        let mut level = DVector::from_element(self.squares.len(), 1.0);
        let mut sizes = vec![];
        for _ in 0..WEIGHT_ROUNDS {
            let scatter = level.component_mul(&self.unit);
            let over =
                |rows: &DVector<f64>| self.levels.beside(rows.component_div(&scatter), &scatter);
            let weighted: Vec<DVector<f64>> = all.iter().map(|column| over(column)).collect();
            sizes = positive(&weighted, &over(&self.squares));
            let told = all
                .iter()
                .zip(&sizes)
                .fold(DVector::zeros(self.squares.len()), |sum, (column, size)| {
                    sum + *column * *size
                });
            let rest = &self.squares - &told;
            let weighted = rest.component_div(&scatter);
            let floor = &weighted - self.levels.beside(weighted.clone(), &scatter);
            level = (told + floor.component_mul(&scatter)).map(|v| v.max(LEAST_LEVEL));
        }
        Sized {
            sizes: sizes.split_off(self.shared.len()),
            level,
        }
    }

    /// Standard uncertainties of the sizes of a fit.
    pub(super) fn doubts(
        &self,
        scope: &Scope<'_, '_>,
        columns: &[&DVector<f64>],
        sized: &Sized,
    ) -> Vec<f64> {
        let scatter = sized.level.component_mul(&self.unit);
        let over = |rows: &DVector<f64>| self.levels.beside(rows.component_div(&scatter), &scatter);
        let weighted: Vec<DVector<f64>> = columns.iter().map(|column| over(column)).collect();
        let Some(design) = (!weighted.is_empty()).then(|| DMatrix::from_columns(&weighted)) else {
            return vec![];
        };
        let left = over(&self.squares) - &design * DVector::from_vec(sized.sizes.clone());
        crate::search::refit::standard_uncertainties(scope.stack, &design, &left)
    }

    /// (3) of `scatter`, of what is expected without an effect and with it.
    pub(super) fn distance(
        &self,
        scope: &Scope<'_, '_>,
        without: &DVector<f64>,
        with: &DVector<f64>,
    ) -> f64 {
        let k = self.dispersion(scope, with);
        let surprise = |place: usize| {
            let (square, f, g) = (self.squares[place], without[place], with[place]);
            (square / f - square / g + (f / g).ln()) * 2.0 / k[place]
        };
        let sum: f64 = (0..k.len()).map(surprise).sum();
        sum.max(0.0).sqrt()
    }

    /// How surprising what was read is where this is expected of it; only differences say something.
    pub(super) fn surprise(&self, level: &DVector<f64>) -> f64 {
        let of_row = |place: usize| {
            let expected = level[place];
            (self.squares[place] / expected + expected.ln()) / self.unit[place].powi(2)
        };
        (0..level.len()).map(of_row).sum()
    }

    /// k of each row, by what is expected of the squares.
    fn dispersion(&self, scope: &Scope<'_, '_>, level: &DVector<f64>) -> DVector<f64> {
        let stack = scope.stack;
        let off = self.squares.component_div(level).map(|ratio| ratio - 1.0);
        let blocks = &stack.rows.blocks;
        let is_whole = |block: &&Block| !self.scales.contains_key(&block.channel);
        let whole = blocks.iter().filter(is_whole).flat_map(Block::range);
        let (sum, n) = whole.fold((0.0, 0.0), |(sum, n), place| {
            (sum + off[place].powi(2), n + 1.0)
        });
        let mut k =
            DVector::from_element(off.len(), (sum / f64::max(n, 1.0)).max(LEAST_OF_TOUCHES));
        for block in blocks.iter().filter(|block| !is_whole(block)) {
            let (_, modes) = field::modes(&stack.session.runs[block.run], block);
            let readings: usize = block.rows.iter().map(|row| row.readings.len()).sum();
            let least = 2.0 * count(block.rows.len()) / count(readings);
            let rest = beside(off.rows(block.start, block.rows.len()).into_owned(), &modes);
            k.rows_mut(block.start, block.rows.len())
                .fill(of_waves(&rest).max(least));
            for row in beside_turns(&block.rows) {
                k[block.start + row] = UNTOLD;
            }
        }
        k
    }
}

/// Rows next to where an axis turns, or sets out at an end of the run.
fn beside_turns(rows: &[Row]) -> Vec<usize> {
    let turns = |row: &usize| rows[row - 1].station.1 != rows[*row].station.1;
    let inner = (1..rows.len()).filter(turns);
    let of_turn = |row: usize| row.saturating_sub(BESIDE)..(row + BESIDE).min(rows.len());
    inner.chain([0, rows.len()]).flat_map(of_turn).collect()
}

pub(super) fn is_touch(block: &Block) -> bool {
    block.channel == Channel::Touch
}

fn middle(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    values.select_nth_unstable_by(middle, f64::total_cmp);
    values[middle]
}

/// What a square usually is: of a path the middle one about it, for it may scatter in one part and not in another; else that of
/// normal deviations with the middle of the block, at least 1.
fn usual(own: &[f64], row: usize, is_path: bool) -> f64 {
    if is_path {
        let about = row.saturating_sub(BESIDE)..(row + BESIDE + 1).min(own.len());
        middle(own[about].to_vec())
    } else {
        (middle(own.to_vec()) / MIDDLE).max(1.0)
    }
}

/// What some columns leave, where there are rows enough for them.
fn beside(rows: DVector<f64>, columns: &DMatrix<f64>) -> DVector<f64> {
    if rows.len() < 3 * columns.ncols() {
        return rows;
    }
    let basis = orthonormal(rows.len(), columns.column_iter().map(|c| c.into_owned()));
    &rows - &basis * basis.tr_mul(&rows)
}

/// (3) of a block; of one that is too short for its waves the plain variance.
fn of_waves(rest: &DVector<f64>) -> f64 {
    let n = rest.len();
    let plain = rest.norm_squared() / count(n);
    let waves = (*WAVES.start()..=(*WAVES.end()).min(n / 2)).map(|wave| {
        let turn = TAU * count(wave) / count(n);
        let along = rest.iter().enumerate().map(|(t, value)| {
            let (sin, cos) = (turn * count(t)).sin_cos();
            [value * cos, value * sin]
        });
        let [real, imaginary] =
            along.fold([0.0; 2], |sum, part| [sum[0] + part[0], sum[1] + part[1]]);
        (real * real + imaginary * imaginary) / count(n)
    });
    let waves: Vec<f64> = waves.collect();
    if waves.len() < 8 {
        return plain;
    }
    waves.iter().sum::<f64>() / count(waves.len())
}

/// Squares of rows without the smooth modes of each block: what runs differ by smoothly is no scatter, though it would look like
/// some for its neighbours go together. Each square is over the share that the modes leave of it.
fn rough(scope: &Scope<'_, '_>, left: &DVector<f64>, is_whitened: bool) -> DVector<f64> {
    let stack = scope.stack;
    let mut squares = left.map(|z| z * z);
    for block in &stack.rows.blocks {
        let run = &stack.session.runs[block.run];
        let (_, mut modes) = field::modes(run, block);
        if block.rows.len() < 3 * modes.ncols() {
            continue;
        }
        if is_whitened {
            let filter = scope.noise[&block.channel].within(run, block);
            for mut column in modes.column_iter_mut() {
                filter.filter(column.as_mut_slice());
            }
        }
        let basis = orthonormal(
            block.rows.len(),
            modes.column_iter().map(|c| c.into_owned()),
        );
        let own = left.rows(block.start, block.rows.len());
        let rest = own - &basis * basis.tr_mul(&own);
        for (row, place) in block.range().enumerate() {
            let kept = 1.0 - basis.row(row).norm_squared();
            squares[place] = rest[row].powi(2) / kept.max(0.1);
        }
    }
    squares
}

/// (4) of the rows of a block.
pub(super) fn passed(scope: &Scope<'_, '_>, block: &Block, variances: &[f64]) -> Vec<f64> {
    let run = &scope.stack.session.runs[block.run];
    let filter = scope.noise[&block.channel].within(run, block);
    let of_row = |t: usize| {
        let used = filter.order().min(t);
        let before = filter.coefficients[used].iter().enumerate();
        let told: f64 = before
            .map(|(j, phi)| phi * phi * variances[t - 1 - j])
            .sum();
        (variances[t] + told) / filter.variances[used]
    };
    (0..variances.len()).map(of_row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(turns: &[u32]) -> Vec<Row> {
        let row = |(k, turn): (usize, &u32)| Row {
            station: (u32::try_from(k).expect("few"), *turn),
            tick: None,
            touch: None,
            readings: vec![k],
        };
        turns.iter().enumerate().map(row).collect()
    }

    #[test]
    fn rows_beside_a_turn_and_at_both_ends_say_nothing() {
        let turns: Vec<u32> = (0..100).map(|k| u32::from(k >= 50)).collect();
        let mut untold = beside_turns(&rows(&turns));
        untold.sort_unstable();
        let expected: Vec<usize> = (0..10).chain(40..60).chain(90..100).collect();
        assert_eq!(untold, expected);
    }

    #[test]
    fn eq3_of_white_noise_is_its_variance_and_of_what_goes_together_more() {
        let mut state = 5_u64;
        let mut draw = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            f64::from(u32::try_from(state >> 33).expect("31 bits")) / f64::from(1_u32 << 31) - 0.5
        };
        let white = DVector::from_fn(4000, |_, _| draw());
        let k = 12.0 * of_waves(&white);
        assert!((0.6..1.5).contains(&k), "{k}");
        let together = DVector::from_fn(4000, |row, _| white[row / 8 * 8]);
        // Eight alike: eight times the variance of a mean.
        let ratio = of_waves(&together) / of_waves(&white);
        assert!(ratio > 4.0, "{ratio}");
    }

    #[test]
    fn one_square_that_stands_off_is_not_usual_and_a_stretch_of_them_is() {
        let mut own = vec![1.0; 100];
        own[50] = 400.0;
        assert!((usual(&own, 50, true) - 1.0).abs() < 1e-12);
        own[40..80].fill(400.0);
        assert!((usual(&own, 60, true) - 400.0).abs() < 1e-12);
    }
}
