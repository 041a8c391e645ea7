//! The simulator's own error of form: what even the right effect leaves, alike in every repeat.
//!
//! # Model
//!
//! Repeats tell how runs differ. What they have alike beside the catalogue's forms they cannot tell from a cause:
//! every simulator has it, and no sample noise is so small that it could be named.
//!
//! ```text
//!   y = sim + J b + f + e,   f = B c + w,   c ~ N(0, Lambda(s, l)),  w ~ N(0, s^2/4)   (1)
//!   s^2 = s_0^2 + (share rms(J b))^2                                                  (2)
//! ```
//!
//! Where a signature jumps from one station to the next (a reversal), it is as wrong as the jump is high: such
//! a row i has besides, on its own,
//!
//! ```text
//!   f_i ~ N(0, e_i^2),   e_i = |J b_(i+1) - J b_(i-1)| / 2 - 2 m   where above s        (3)
//! ```
//!
//! with m the middle |J b_(i+1) - J b_i| of the block where 2 m itself is above s, else zero: targets that lie far apart
//! have a slope between them, and no jump.
//!
//! with B and Lambda of `field`, w from station to station, and the root mean square of (2) over the block: a
//! signature that is large is wrong by more. For touches B is one column for each feature, approach and feed.
//! R repeats of one condition share one f. They are whitened as though each had its own of R times the
//! variance: their mean then has the variance (1), however often a test is repeated.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | s_0 | `form_error_um` | µm; for an angle as at 100 mm |
//! | share | `form_error_share` | 1 |
//! | l | [`LENGTH_RAD`] | rad |
//!
//! # Holds when
//! s_0 is stated, not estimated: below it nothing is named.
//!
//! # References
//! \[1\] M. C. Kennedy, A. O'Hagan, J. R. Stat. Soc. B 63, 2001 (discrepancy of a model as a random field).

use std::collections::BTreeMap;

use nalgebra::DMatrix;
use twin::{Channel, Run, Session};

use crate::config::GapConfig;
use crate::noise::repeats::{self, Label};
use crate::noise::stack::Stack;
use crate::search::field::{Mode, Smooth};
use crate::search::rows::{Block, Rows, count};

/// Length of the field, as `field` has it: waves down to a twelfth of a turn.
const LENGTH_RAD: f64 = 0.2;
/// Arm at which an angle of a rotary axis is a length.
const ROTARY_ARM_MM: f64 = 100.0;

/// Error of form of the blocks of a stack.
#[derive(Clone, Debug, Default)]
pub struct FormError {
    base_mm: f64,
    /// What is beyond the base, by run and channel.
    beyond_mm: BTreeMap<(usize, Channel), f64>,
    /// Rows of a block at which a signature jumps, with (3).
    edges_mm: BTreeMap<(usize, Channel), Vec<(usize, f64)>>,
    /// Whether all that was read are positions at targets.
    is_of_targets: bool,
}

/// Most jumps of one block; the greatest are kept.
const MOST_EDGES: usize = 48;
/// Repeats that differ by less are the same reading, mm.
const SAME_VALUE_MM: f64 = 1e-7;

impl FormError {
    /// Before any effect was found.
    pub fn base(config: &GapConfig) -> Self {
        Self {
            base_mm: config.form_error_um * 1e-3,
            beyond_mm: BTreeMap::new(),
            edges_mm: BTreeMap::new(),
            is_of_targets: false,
        }
    }

    /// (2) and (3) for effects that were found and tell `found` of a stack, mm, beside those that the machine file has,
    /// which tell `listed`: these have the size that is theirs, but jump no more exactly.
    pub fn beside(stack: &Stack<'_>, listed: &[f64], found: &[f64], config: &GapConfig) -> Self {
        let floated = stack.floated(found.to_vec());
        let of = |block: &Block| {
            let squares: f64 = floated[block.range()].iter().map(|v| v * v).sum();
            let rms = (squares / count(block.rows.len())).sqrt();
            (
                (block.run, block.channel.clone()),
                config.form_error_share * rms,
            )
        };
        let mut form = Self {
            beyond_mm: stack.rows.blocks.iter().map(of).collect(),
            ..Self::base(config)
        };
        for block in &stack.rows.blocks {
            if block.channel != Channel::Touch {
                let rows = listed[block.range()].iter().zip(&found[block.range()]);
                let told: Vec<f64> = rows.map(|(listed, found)| listed + found).collect();
                let edges = edges(&told, form.of(block));
                let key = (block.run, block.channel.clone());
                form.edges_mm.insert(key, edges);
            }
        }
        form
    }

    /// The same of a recording of which all, or not all, are positions at targets.
    pub fn at_targets(&self, is_of_targets: bool) -> Self {
        Self {
            is_of_targets,
            ..self.clone()
        }
    }

    /// Whether all that was read are positions at targets: repeats then have the same rows, and what they differ by has no error
    /// of form.
    pub const fn is_of_targets(&self) -> bool {
        self.is_of_targets
    }

    /// Rows of a block at which a signature jumps, with (3).
    pub fn edges(&self, block: &Block) -> &[(usize, f64)] {
        let key = (block.run, block.channel.clone());
        self.edges_mm.get(&key).map_or(&[], |edges| edges)
    }

    /// s of a block (rad for a rotary axis, none for a thermometer).
    pub fn of(&self, block: &Block) -> f64 {
        let base = match &block.channel {
            Channel::Thermometer(_) => 0.0,
            Channel::Motor(axis) | Channel::Scale(axis) if !axis.is_linear() => {
                self.base_mm / ROTARY_ARM_MM
            }
            _ => self.base_mm,
        };
        let key = (block.run, block.channel.clone());
        base.hypot(self.beyond_mm.get(&key).copied().unwrap_or(0.0))
    }
}

/// (3) of the rows of a block.
fn edges(told: &[f64], least_mm: f64) -> Vec<(usize, f64)> {
    let mut steps: Vec<f64> = told.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
    steps.sort_by(f64::total_cmp);
    let middle_mm = steps.get(steps.len() / 2).copied().unwrap_or(0.0);
    let slope_mm = if 2.0 * middle_mm > least_mm {
        2.0 * middle_mm
    } else {
        0.0
    };
    let jump = |row: usize| {
        let (before, after) = (row.saturating_sub(1), (row + 1).min(told.len() - 1));
        let height_mm = 0.5 * (told[after] - told[before]).abs();
        (row, height_mm - slope_mm)
    };
    let mut edges: Vec<(usize, f64)> = (0..told.len())
        .map(jump)
        .filter(|(_, height)| *height > least_mm)
        .collect();
    edges.sort_by(|a, b| b.1.total_cmp(&a.1));
    edges.truncate(MOST_EDGES);
    edges
}

/// Part of the error of form that is rough, from station to station.
pub const ROUGH_STATION_SHARE: f64 = 0.5;

/// Standard deviations of the modes of a field of size `s`.
pub fn smooth(s: f64) -> Smooth {
    Smooth {
        place_mm: s,
        length_rad: LENGTH_RAD,
        offset_mm: s,
        drift_mm: 0.0,
    }
}

/// Standard deviation of a mode that varies from run to run and is off in form.
pub fn joined(between: &Smooth, form: &Smooth, mode: Mode) -> f64 {
    between.of(mode).hypot(form.of(mode))
}

/// How many blocks of a stack share each block's error of form.
pub fn sharing(session: &Session, rows: &Rows) -> Vec<f64> {
    let mut sharing = vec![1.0; rows.blocks.len()];
    for group in repeats::groups(session, rows) {
        for block in &group {
            sharing[*block] = count(group.len());
        }
    }
    sharing
}

/// Groups of repeats with the same rows.
pub fn alike(session: &Session, rows: &Rows) -> Vec<Vec<usize>> {
    let is_alike = |group: &Vec<usize>| {
        let blocks: Vec<&Block> = group.iter().map(|block| &rows.blocks[*block]).collect();
        let shared = repeats::shared(session, &blocks);
        let mut each = blocks.iter().zip(&shared);
        let all =
            |(block, own): (&&Block, &Vec<usize>)| own.iter().copied().eq(0..block.rows.len());
        group.len() > 1 && each.all(all)
    };
    let groups = repeats::groups(session, rows).into_iter();
    groups.filter(is_alike).collect()
}

/// The step of an instrument that rounds repeats to the same values in more than half of the rows, mm; zero where all are the same.
/// What it rounds off is then common to them, as an error of form is, and no noise of their mean.
pub fn rounding_step_mm(stack: &Stack<'_>) -> Option<f64> {
    let mut spreads_mm = vec![];
    for group in alike(stack.session, &stack.rows) {
        let ranges: Vec<_> = { group.iter() }
            .map(|block| stack.rows.blocks[*block].range())
            .collect();
        for k in 0..ranges[0].len() {
            let values = ranges.iter().map(|range| stack.raw[range.start + k]);
            let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
                (low.min(v), high.max(v))
            });
            spreads_mm.push(high - low);
        }
    }
    let apart = spreads_mm.iter().filter(|spread| **spread >= SAME_VALUE_MM);
    let step_mm = apart.clone().copied().fold(f64::INFINITY, f64::min);
    let is_rounded = 2 * apart.count() < spreads_mm.len();
    is_rounded.then_some(if step_mm.is_finite() { step_mm } else { 0.0 })
}

/// In how many blocks of a stack each touch is repeated.
pub fn touched(session: &Session, rows: &Rows) -> BTreeMap<Label, f64> {
    let mut all = BTreeMap::new();
    for block in &rows.blocks {
        for label in labels(&session.runs[block.run], block).into_keys() {
            *all.entry(label).or_insert(0.0) += 1.0;
        }
    }
    all
}

/// Rows of a block of touches, by what was touched; none for other channels.
pub fn labels(run: &Run, block: &Block) -> BTreeMap<Label, Vec<usize>> {
    let mut all = BTreeMap::<Label, Vec<usize>>::new();
    if block.channel == Channel::Touch {
        for (index, row) in block.rows.iter().enumerate() {
            if let Some(touch) = row.touch.and_then(|touch| run.touches.get(touch)) {
                all.entry(repeats::label(touch)).or_default().push(index);
            }
        }
    }
    all
}

/// The columns of B for a block of touches, each with its number of repeats.
pub fn touch_columns(
    run: &Run,
    block: &Block,
    touched: &BTreeMap<Label, f64>,
) -> Vec<(Vec<f64>, f64)> {
    let column = |(label, rows): (Label, Vec<usize>)| {
        let mut column = vec![0.0; block.rows.len()];
        for row in rows {
            column[row] = 1.0;
        }
        (column, touched.get(&label).copied().unwrap_or(1.0))
    };
    labels(run, block).into_iter().map(column).collect()
}

/// Columns beside each other.
pub fn beside(columns: DMatrix<f64>, more: &[Vec<f64>]) -> DMatrix<f64> {
    let first = columns.ncols();
    let mut all = columns.resize_horizontally(first + more.len(), 0.0);
    for (k, column) in more.iter().enumerate() {
        all.column_mut(first + k).copy_from_slice(column);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq3_a_slope_between_distant_targets_is_no_jump_and_a_step_is_one() {
        // Nine targets to and nine fro, 1.1 um apart: the known lead error of a screw.
        let slope: Vec<f64> = (0..18)
            .map(|k: usize| 1.1e-3 * count(k.min(17 - k)))
            .collect();
        assert_eq!(edges(&slope, 2e-4), vec![]);
        let step: Vec<f64> = (0..200)
            .map(|k| 1e-5 * count(k) + if k < 90 { 0.0 } else { 4e-3 })
            .collect();
        let found = edges(&step, 2e-4);
        let mut rows: Vec<usize> = found.iter().map(|(row, _)| *row).collect();
        rows.sort_unstable();
        assert_eq!(rows, vec![89, 90]);
        let wanted_mm = 0.5 * (4e-3 + 2e-5);
        assert!(
            found
                .iter()
                .all(|(_, height)| (height - wanted_mm).abs() < 1e-9)
        );
    }
}
