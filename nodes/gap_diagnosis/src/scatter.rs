//! Effects that move no mean and only scatter readings: jitter, vibration of random phase, stick-slip.
//!
//! # Model
//!
//! What the effects of the mean leave, squared, against the variance that the twin gives each row:
//!
//! ```text
//!   E z_i2 = g_c + e_c / m_i + sum_k b_k h_ik,   b = (amplitude / greatest)2        (1)
//!   h_t = sum_j c_j2 v_(t-j),   z = sum_j c_j y_(t-j) the whitener's filter          (2)
//!   score = h'(z2 / f - 1) / sqrt(k h'h),   k the variance of z2 / f                  (3)
//!   D^2 = 2/k_1 sum_i (z_i2/f_i - z_i2/g_i + ln f_i/g_i),   k_1 that of z2 / g, at least 2   (4)
//! ```
//!
//! | symbol | here |
//! |---|---|
//! | m_i | readings of row i: white noise of readings is smaller in a mean of more |
//! | g_c, e_c | free for each channel (g of a path for each run): how noisy an instrument is belongs to the floor |
//! | f | what g and e alone make of z2; h is over it as well. In (4) what all but one effect make of it, g what all do |
//! | v | variance of the row's mean, readings scattering independently |
//!
//! The search, its price and its rules are those of the mean (`selection`, `confirm`, `confidence`); one more is
//! that the effect must beat a scatter of its own for every run. The size is from (1) by iterated weights
//! 1 / (2 (E z2)2), its interval the greater of model and clusters of runs. (4) is by how much the effect makes what was read
//! more likely, as D^2 of an effect of the mean is; the score (3) is short of it where the variance changes manifold.
//!
//! # Holds when
//! Effects that scatter a channel evenly are part of its noise floor, so that they are listed as not shown.
//!
//! # References
//! \[1\] L. G. Godfrey, J. Econometrics 8, 1978 (score test of a variance that goes with covariates). \[2\] P. McCullagh,
//! J. A. Nelder, Generalized linear models, 2nd ed., Chapman & Hall 1989, chapter 10 (scaled deviance of a variance's model).

use std::collections::BTreeMap;

use machine::effects::{Effect, Kind, Moment, Parameter, Role};
use machine::file::EffectEntry;
use machine::twin::Channel;
use nalgebra::{DMatrix, DVector};

use crate::cause::Scope;
use crate::field;
use crate::normal::Normal;
use crate::nuisance::orthonormal;
use crate::report::{Cause, Status};
use crate::rows::{Block, Row, count};
use crate::rule::Rule;
use crate::selection::{Limits, Search};
use crate::signature::{Form, Instance, Library};

mod judge;

use judge::Judge;

/// Effects of scatter that were found.
pub struct Scattered {
    /// As the report has them.
    pub causes: Vec<Cause>,
    /// What is named, as a machine file lists it.
    pub entries: Vec<EffectEntry>,
    /// Standard deviation of each row with them, in units of the floor.
    pub spread: DVector<f64>,
    /// Kinds of which an instance could have been seen.
    pub seen: Vec<&'static str>,
}

impl Scattered {
    /// Whether anything was found that all rules let be named, alone or as one of a set.
    pub fn is_named(&self) -> bool {
        self.causes
            .iter()
            .any(|cause| cause.status != Status::Surrogate)
    }

    /// Takes the names away.
    pub fn withdraw(&mut self) {
        self.entries.clear();
        for cause in &mut self.causes {
            cause.status = Status::Surrogate;
        }
    }
}

/// Squares beyond this many times the middle square of their block count as this.
const MOST_SQUARE: f64 = 12.0;
/// Middle of chi-square of one.
const MIDDLE: f64 = 0.455;
/// An effect that would stay below this D at its greatest size is not shown.
const LEAST_D: f64 = 6.0;

/// What the search is made on.
struct Squares {
    /// z2, outliers pulled in.
    squares: DVector<f64>,
    /// Columns of g and e in (1).
    levels: DMatrix<f64>,
    /// What the levels alone make of each square.
    floor: DVector<f64>,
    /// Levels over the floor, orthonormal.
    basis: DMatrix<f64>,
    /// Root of k.
    unit: f64,
    /// Squares over the floor, beside the levels, over the unit.
    y: DVector<f64>,
}

/// Searches for effects of scatter in what the effects of the mean leave.
pub fn find(scope: &Scope<'_, '_>, kinds: &[&'static Kind], left: &DVector<f64>) -> Scattered {
    let stack = scope.stack;
    let squares = Squares::new(scope, left);
    let variances = kinds.iter().filter(|kind| kind.moment == Moment::Variance);
    let instances = Instance::all(stack.twin.machine(), variances);
    let signatures = squares.signatures(scope, instances);
    let normal = signatures.normal(&squares.y);
    let seen = signatures
        .forms
        .iter()
        .map(|form| signatures.instances[form.instance].kind.id)
        .collect();
    let mut search = Search::new(
        &signatures,
        &normal,
        squares.y.norm_squared(),
        stack.freedom(),
    );
    let set = search.run(Limits {
        beam: scope.config.beam,
        most_effects: 3,
        swaps: scope.config.applies(Rule::SwapSearch),
    });
    search.alternatives(&set, 6);
    let mut found = Scattered {
        causes: vec![],
        entries: vec![],
        spread: DVector::from_element(stack.rows.len, 1.0),
        seen,
    };
    if !set.is_empty() {
        let judge = Judge {
            scope,
            squares: &squares,
            signatures: &signatures,
            normal: &normal,
            visited: &search.visited,
        };
        judge.judge(&set, &mut found);
    }
    found
}

impl Squares {
    fn new(scope: &Scope<'_, '_>, left: &DVector<f64>) -> Self {
        let stack = scope.stack;
        let mut squares = rough(scope, left);
        for block in &stack.rows.blocks {
            let mut own: Vec<f64> = squares
                .rows(block.start, block.rows.len())
                .iter()
                .copied()
                .collect();
            let middle = own.len() / 2;
            own.select_nth_unstable_by(middle, f64::total_cmp);
            let most = MOST_SQUARE * (own[middle] / MIDDLE).max(1.0);
            for place in block.range() {
                squares[place] = squares[place].min(most);
            }
        }
        let levels = levels(scope);
        let floor = floor(&levels, &squares);
        let mut over = levels.clone();
        for mut column in over.column_iter_mut() {
            column.component_div_assign(&floor);
        }
        let basis = orthonormal(over.nrows(), over.column_iter().map(|c| c.into_owned()));
        let own = squares.component_div(&floor);
        let beside = &own - &basis * basis.tr_mul(&own);
        let freedom = (stack.freedom() - count(basis.ncols())).max(1.0);
        let unit = (beside.norm_squared() / freedom).max(1.0).sqrt();
        let y = beside / unit;
        Self {
            squares,
            levels,
            floor,
            basis,
            unit,
            y,
        }
    }

    /// (2) beside the levels, over the unit.
    fn column(&self, spread: Vec<f64>) -> DVector<f64> {
        let column = DVector::from_vec(spread).component_div(&self.floor);
        (&column - &self.basis * self.basis.tr_mul(&column)) / self.unit
    }

    fn signatures(&self, scope: &Scope<'_, '_>, instances: Vec<Instance>) -> Library {
        let mut signatures = Library {
            excited: vec![false; instances.len()],
            instances,
            forms: vec![],
            columns: vec![],
        };
        for instance in 0..signatures.instances.len() {
            let kind = signatures.instances[instance].kind;
            for values in crate::signature::shapes(kind) {
                for wide in [false, true] {
                    if !wide || !kind.free.is_empty() {
                        self.add(scope, &mut signatures, instance, &values, wide);
                    }
                }
            }
        }
        signatures
    }

    fn add(
        &self,
        scope: &Scope<'_, '_>,
        signatures: &mut Library,
        instance: usize,
        values: &[f64],
        wide: bool,
    ) {
        let kind = signatures.instances[instance].kind;
        let shown = if wide {
            usize::MAX
        } else {
            kind.parameters.len()
        };
        let (mut amplitudes, mut columns) = (vec![], vec![]);
        for (place, parameter) in parameters(kind).take(shown).enumerate() {
            if parameter.role != Role::Amplitude {
                continue;
            }
            let mut on = values.to_vec();
            on[place] = parameter.high;
            let column = self.column(spread(scope, &*signatures.instances[instance].effect(&on)));
            if column.norm().is_finite() && column.norm() > LEAST_D {
                amplitudes.push(place);
                columns.push(column);
            }
        }
        if columns.is_empty() {
            return;
        }
        signatures.excited[instance] = true;
        let choices = kind
            .shapes()
            .filter(|p| p.role.grid().is_some_and(|grid| grid.len() > 1));
        let first = signatures.columns.len();
        signatures.forms.push(Form {
            instance,
            values: values.to_vec(),
            price: amplitudes.len() + choices.count(),
            columns: (first..first + columns.len()).collect(),
            amplitudes,
            wide,
        });
        signatures.columns.extend(columns);
    }
}

/// E z2 by the levels alone, by iterated weights.
fn floor(levels: &DMatrix<f64>, squares: &DVector<f64>) -> DVector<f64> {
    let all: Vec<usize> = (0..levels.ncols()).collect();
    let mut floor = DVector::from_element(squares.len(), 1.0);
    for _ in 0..6 {
        let (weighted, right) = weigh(levels, squares, &floor);
        let sizes = Normal::new(&weighted, &right).solve(&all).sizes;
        floor = (levels * DVector::from_vec(sizes)).map(|level| level.max(0.1));
    }
    floor
}

fn parameters(kind: &'static Kind) -> impl Iterator<Item = &'static Parameter> {
    kind.parameters.iter().chain(kind.free)
}

/// z2 without the smooth modes of each block: what runs differ by smoothly is no scatter, though it would look like
/// some for its neighbours go together. Each square is over the share that the modes leave of it.
fn rough(scope: &Scope<'_, '_>, left: &DVector<f64>) -> DVector<f64> {
    let stack = scope.stack;
    let mut squares = left.map(|z| z * z);
    for block in &stack.rows.blocks {
        let run = &stack.session.runs[block.run];
        let filter = scope.noise[&block.channel].within(run, block);
        let (_, mut modes) = field::modes(run, block);
        for mut column in modes.column_iter_mut() {
            filter.filter(column.as_mut_slice());
        }
        if block.rows.len() < 3 * modes.ncols() {
            continue;
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

/// Columns of g and e of (1), as the whitener passes them on. A path is thinned to stations, so that its rows are
/// as noisy as its feed makes them: g is free for each of its runs. Touches have one g for all.
fn levels(scope: &Scope<'_, '_>) -> DMatrix<f64> {
    let rows = scope.stack.rows.len;
    let mut columns = BTreeMap::<(&Channel, Option<usize>), Vec<f64>>::new();
    for block in &scope.stack.rows.blocks {
        let even: Vec<f64> = block.rows.iter().map(|_| 1.0).collect();
        let of_readings: Vec<f64> = block
            .rows
            .iter()
            .map(|row| 1.0 / count(row.readings.len()))
            .collect();
        let own = if block.channel == Channel::Touch {
            0
        } else {
            block.run
        };
        for (key, variances) in [(Some(own), even), (None, of_readings)] {
            let column = columns
                .entry((&block.channel, key))
                .or_insert_with(|| vec![0.0; rows]);
            column[block.range()].copy_from_slice(&passed(scope, block, &variances));
        }
    }
    let unit = |column: Vec<f64>| {
        let column = DVector::from_vec(column);
        let size = column.norm() / count(rows).sqrt();
        column / size.max(f64::MIN_POSITIVE)
    };
    DMatrix::from_columns(&columns.into_values().map(unit).collect::<Vec<_>>())
}

/// (2) of the rows of a block.
fn passed(scope: &Scope<'_, '_>, block: &Block, variances: &[f64]) -> Vec<f64> {
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

/// (2): what an effect adds to the variance of each whitened row.
fn spread(scope: &Scope<'_, '_>, effect: &dyn Effect) -> Vec<f64> {
    let stack = scope.stack;
    let mut spread = vec![0.0; stack.rows.len];
    for &run in &stack.runs {
        let of_readings = stack
            .twin
            .variance(stack.session, &stack.session.runs[run], &[effect]);
        for block in stack.rows.blocks.iter().filter(|block| block.run == run) {
            let of_row = |row: &Row| {
                let sum: f64 = row.readings.iter().map(|k| of_readings[*k]).sum();
                sum / count(row.readings.len()).powi(2)
            };
            let rows: Vec<f64> = block.rows.iter().map(of_row).collect();
            spread[block.range()].copy_from_slice(&passed(scope, block, &rows));
        }
    }
    spread
}

/// Sizes b of (1) with their standard uncertainties, and E z2.
struct Fit {
    sizes: Vec<f64>,
    doubts: Vec<f64>,
    level: DVector<f64>,
}

fn weigh(
    design: &DMatrix<f64>,
    squares: &DVector<f64>,
    level: &DVector<f64>,
) -> (DMatrix<f64>, DVector<f64>) {
    let root = level.map(|level| 1.0 / (std::f64::consts::SQRT_2 * level));
    let mut weighted = design.clone();
    for mut column in weighted.column_iter_mut() {
        column.component_mul_assign(&root);
    }
    (weighted, squares.component_mul(&root))
}
