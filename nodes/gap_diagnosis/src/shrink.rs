//! How far the gap shrinks on runs that were held out, once the named effects are simulated.
//!
//! # Model
//!
//! All runs are simulated anew with and without the named effects, and the held-out ones are judged. Only set-ups
//! float; a float that fitted runs share with held-out ones is one float (a block that stays on the table stays
//! where it was), so that growth since the fitted runs is not taken for a new place of the block:
//!
//! What share of the gap is closed, with its interval, is taken in `closed`.

pub(crate) mod apart;
pub(crate) mod closed;
pub(crate) mod gap;
pub(crate) mod share_interval;
pub(crate) mod split;

use std::collections::BTreeMap;

use crate::config::GapConfig;
use crate::noise::Noise;
use crate::noise::stack::Stack;
use crate::report::figures::over_session::over_session;
use crate::report::figures::{Abscissa, Apart, HeldOut, Trace};
use crate::report::{BeforeAfter, LeftOut, Shrink};
use crate::search::field::{self, Place};
use crate::search::rows::{Block, count, position, time_s};
use crate::shrink::apart::{apart, chosen, remembered};
use crate::shrink::gap::Size;
use crate::shrink::split::{Split, title};
use twin::Channel;
use twin::effects::Effect;

/// One named effect.
pub struct Named<'e> {
    /// Its id.
    pub effect: String,
    /// What it acts on.
    pub axis: String,
    /// The effect with the values found.
    pub simulated: &'e dyn Effect,
}

/// The report's part and the figures.
pub struct Shrunk {
    /// Report.
    pub shrink: Shrink,
    /// One entry a held-out run.
    pub held_out: Vec<HeldOut>,
    /// Traces of the runs that were judged.
    pub traces: Vec<Trace>,
    /// What each of several effects closes by itself.
    pub apart: Vec<Apart>,
}

impl Shrunk {
    /// Rms of the held-out runs with all that is named over what it is without each; none where nothing was held out.
    pub fn held_out_ratios(&self) -> Vec<f64> {
        let after = self.shrink.rms_um.after;
        let out = self.shrink.leave_one_out.iter();
        let ratio = |out: &LeftOut| after.map_or(1.0, |after| after / out.rms_um_without);
        // Of runs that show nothing at all both are nothing.
        out.map(|out| {
            Some(ratio(out))
                .filter(|ratio| ratio.is_finite())
                .unwrap_or(1.0)
        })
        .collect()
    }
}

/// Most runs and channels of which a trace is given.
const MOST_TRACES: usize = 40;

/// Judges the held-out runs of a stack of all runs, or all where none was held out.
pub fn shrink(
    stack: &Stack<'_>,
    noise: &BTreeMap<Channel, Noise>,
    split: &Split,
    named: &[Named<'_>],
    has_gap: bool,
    config: &GapConfig,
) -> Shrunk {
    let before = stack.floated(stack.raw.clone());
    let after = with_effects(stack, named.iter());
    let judged = split.judged();
    let size = |floated: &[f64]| gap::by_block(stack, noise, floated, judged);
    let sizes = [size(&before), size(&after)];
    let [whole, left] = [0, 1].map(|k| gap::together(sizes[k].iter()));
    let is_judged = !split.held_out.is_empty();
    let value = |number: f64| is_judged.then_some(number);
    let every = (1_u32 << named.len()) - 1;
    let known = [(0, whole.rms_um()), (every, left.rms_um())];
    let rms_um = remembered(known, |set| {
        let floated = with_effects(stack, chosen(named, set));
        gap::together(size(&floated).iter()).rms_um()
    });
    let leave_one_out = (0..named.len()).filter(|_| is_judged);
    let leave_one_out = leave_one_out.map(|out| LeftOut {
        effect: named[out].effect.clone(),
        axis: named[out].axis.clone(),
        rms_um_without: rms_um(every ^ (1 << out)),
    });
    let number = |run: &usize| stack.session.runs[*run].segment.run;
    let shrink = Shrink {
        fit_runs: split.fit.iter().map(number).collect(),
        held_out_runs: split.held_out.iter().map(number).collect(),
        rms_um: BeforeAfter {
            before: value(whole.rms_um()),
            after: value(left.rms_um()),
        },
        p95_um: BeforeAfter {
            before: value(whole.p95_um()),
            after: value(left.p95_um()),
        },
        gap_closed: (is_judged && has_gap)
            .then(|| closed::closed(stack, noise, judged, &sizes, config))
            .flatten(),
        leave_one_out: leave_one_out.collect(),
    };
    Shrunk {
        shrink,
        held_out: by_run(stack, if is_judged { judged } else { &[] }, &sizes),
        traces: traces(stack, noise, judged, &before, &after),
        apart: if is_judged && named.len() > 1 {
            apart(named, &rms_um)
        } else {
            vec![]
        },
    }
}

fn with_effects<'n, 'e: 'n>(
    stack: &Stack<'_>,
    named: impl Iterator<Item = &'n Named<'e>>,
) -> Vec<f64> {
    let effects: Vec<&dyn Effect> = named.map(|named| named.simulated).collect();
    let told = stack.simulate(&effects);
    stack.floated(
        stack
            .raw
            .iter()
            .zip(told)
            .map(|(raw, told)| raw - told)
            .collect(),
    )
}

fn by_run(stack: &Stack<'_>, judged: &[usize], sizes: &[Vec<Size>; 2]) -> Vec<HeldOut> {
    let of_run = |run: &usize| {
        let of = |sizes: &[Size]| {
            let own = stack
                .rows
                .blocks
                .iter()
                .zip(sizes)
                .filter(|(block, _)| block.run == *run);
            gap::together(own.map(|(_, size)| size))
        };
        let (before, after) = (of(&sizes[0]), of(&sizes[1]));
        let segment = &stack.session.runs[*run].segment;
        HeldOut {
            run: segment.run,
            title: title(segment),
            before_um: before.rms_um(),
            after_um: after.rms_um(),
            floor_um: before.floor_um(),
        }
    };
    judged.iter().map(of_run).collect()
}

fn traces(
    stack: &Stack<'_>,
    noise: &BTreeMap<Channel, Noise>,
    judged: &[usize],
    before: &[f64],
    after: &[f64],
) -> Vec<Trace> {
    let um = |rows: &[f64]| rows.iter().map(|mm| mm * 1e3).collect();
    let trace = |block: &Block| {
        let segment = &stack.session.runs[block.run].segment;
        let (abscissa, at) = abscissa(stack, block);
        Trace {
            run: segment.run,
            channel: block.channel.to_string(),
            title: title(segment),
            abscissa,
            at,
            before_um: um(&before[block.range()]),
            after_um: um(&after[block.range()]),
            floor_um: 1e3 * noise[&block.channel].total_mm(),
        }
    };
    let own = stack.rows.blocks.iter();
    let own = own.filter(|block| judged.contains(&block.run));
    let mut all: Vec<Trace> = own.take(MOST_TRACES).map(trace).collect();
    if let Some(noise) = noise.get(&Channel::Touch) {
        all.extend(over_session(stack, before, after, 1e3 * noise.total_mm()));
    }
    all
}

fn abscissa(stack: &Stack<'_>, block: &Block) -> (Abscissa, Vec<f64>) {
    let run = &stack.session.runs[block.run];
    let places = field::places(run, block);
    if block.channel == Channel::Touch {
        return (Abscissa::Touch, (0..block.rows.len()).map(count).collect());
    }
    let angle = |place: &Place| match place {
        Place::Circle(angle) | Place::Line(angle) => *angle,
        Place::None => 0.0,
    };
    match (places.first(), field::leading_axis(run, block)) {
        (Some(Place::Circle(_)), _) => (Abscissa::Angle, places.iter().map(angle).collect()),
        (Some(Place::Line(_)), Some((axis, ..))) => {
            let at = block.rows.iter().map(|row| position(run, row, axis));
            (Abscissa::Position, at.collect())
        }
        _ => {
            let first = block.rows.first().map_or(0.0, |row| time_s(run, row));
            let at = block.rows.iter().map(|row| time_s(run, row) - first);
            (Abscissa::Time, at.collect())
        }
    }
}
