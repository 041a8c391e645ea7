//! How far simulator and machine are apart, against what noise alone would give.
//!
//! # Model
//!
//! The residual with its set-ups floated (plain least squares, Q), over rows i of a channel:
//!
//! ```text
//!   rms2 = mean (P r)_i^2                                                 (1)
//!   floor2 = s2 (1 - q / n) + sum_m var_m |P b_m|^2 / n                   (2)
//! ```
//!
//! with s the noise within a run, b_m the modes of the smooth field between runs and var_m their variances.

use std::collections::{BTreeMap, BTreeSet};

use twin::Channel;

use crate::noise::Noise;
use crate::noise::stack::Stack;
use crate::report::{ChannelGap, Gap};
use crate::search::field::{self, Mode};
use crate::search::rows::{Block, count};

/// Sums over some rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Size {
    squares: f64,
    magnitudes: Vec<f64>,
    floor: [f64; 2],
}

impl Size {
    /// Root mean square, µm.
    pub fn rms_um(&self) -> f64 {
        1e3 * (self.squares / count(self.magnitudes.len().max(1))).sqrt()
    }

    /// 95 % of the rows are within it, µm.
    pub fn p95_um(&self) -> f64 {
        let mut sorted = self.magnitudes.clone();
        sorted.sort_by(f64::total_cmp);
        let place = (sorted.len() * 95).div_ceil(100).saturating_sub(1);
        1e3 * sorted.get(place).copied().unwrap_or(0.0)
    }

    /// (2), µm.
    pub fn floor_um(&self) -> f64 {
        1e3 * ((self.floor[0] + self.floor[1]) / count(self.magnitudes.len().max(1))).sqrt()
    }

    /// Sum of squares, mm².
    pub const fn squares(&self) -> f64 {
        self.squares
    }

    /// What (2) says of it, within runs and between them, mm².
    pub const fn floor_squares(&self) -> [f64; 2] {
        self.floor
    }

    /// Adds the rows of another.
    pub fn join(&mut self, other: &Self) {
        self.squares += other.squares;
        for (own, other) in self.floor.iter_mut().zip(other.floor) {
            *own += other;
        }
        self.magnitudes.extend(&other.magnitudes);
    }
}

/// Size of a floated residual in each block of a stack that belongs to one of `runs`; nothing for the others.
pub fn by_block(
    stack: &Stack<'_>,
    noise: &BTreeMap<Channel, Noise>,
    floated: &[f64],
    runs: &[usize],
) -> Vec<Size> {
    let share = stack.freedom() / count(stack.rows.len.max(1));
    let of_block = |block: &Block| {
        if !runs.contains(&block.run) {
            return Size::default();
        }
        let rows = &floated[block.range()];
        Size {
            squares: rows.iter().map(|r| r * r).sum(),
            magnitudes: rows.iter().map(|r| r.abs()).collect(),
            floor: floor_squares(stack, block, &noise[&block.channel], share),
        }
    };
    stack.rows.blocks.iter().map(of_block).collect()
}

/// Both terms of (2) times n.
fn floor_squares(stack: &Stack<'_>, block: &Block, noise: &Noise, share: f64) -> [f64; 2] {
    let run = &stack.session.runs[block.run];
    let (kinds, columns) = field::modes(run, block);
    let within = noise.within(run, block).variances[0] * share * count(block.rows.len());
    let between = kinds
        .iter()
        .zip(columns.column_iter())
        .map(|(kind, column)| {
            let variance = noise.between.of(*kind).powi(2);
            if matches!(kind, Mode::Place(k) if *k > 2) {
                return variance * column.norm_squared();
            }
            let mut whole = vec![0.0; stack.rows.len];
            whole[block.range()].copy_from_slice(column.as_slice());
            variance * stack.floated(whole).iter().map(|v| v * v).sum::<f64>()
        });
    [within, between.sum::<f64>()]
}

/// All blocks of one channel, or of all, together.
pub fn together<'s>(sizes: impl Iterator<Item = &'s Size>) -> Size {
    sizes.fold(Size::default(), |mut sum, size| {
        sum.join(size);
        sum
    })
}

/// The report's table of a stack.
pub fn table(stack: &Stack<'_>, sizes: &[Size], above_floor: bool) -> Gap {
    let whole = together(sizes.iter());
    let channels: BTreeSet<&Channel> = stack
        .rows
        .blocks
        .iter()
        .map(|block| &block.channel)
        .collect();
    let of_channel = |channel: &Channel| {
        let own = stack.rows.blocks.iter().zip(sizes);
        let size = together(
            own.filter(|(b, _)| b.channel == *channel)
                .map(|(_, size)| size),
        );
        ChannelGap {
            channel: channel.to_string(),
            rms_um: size.rms_um(),
            p95_um: size.p95_um(),
            floor_um: size.floor_um(),
            above_floor: above_floor && size.rms_um() > 1.2 * size.floor_um(),
        }
    };
    Gap {
        rms_um: whole.rms_um(),
        p95_um: whole.p95_um(),
        floor_um: whole.floor_um(),
        above_floor,
        per_channel: channels.into_iter().map(of_channel).collect(),
    }
}
