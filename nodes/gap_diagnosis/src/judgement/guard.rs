//! Whether the session has the noise that its repeats show.
//!
//! # Model
//!
//! What the effects found leave, as white as the noise within a run makes it, less the biggest model without a
//! physics: every family of `families`, every smooth mode of every block, each with a size of its own, and lines over a
//! position (`periods`) that take three tenths of the rest or more.
//!
//! ```text
//!   s2 = median (z_i^2 / 0.4549  n / (n - k) + f_i) / (1 + f_i),   f_i = s_f^2 / s_w^2   (1)
//!   inflation = max(1, s2 + (c - 1) (s2 - 2 f / (1 + f))+),   c = (1 + rho) / (1 - rho)  (2)
//! ```
//!
//! of which only that counts that is sure where n rows, and nu of the repeats, tell of it:
//!
//! ```text
//!   z^2 -> z^2 exp(-sqrt(5.4 / (n - k) + 2 / nu))                                        (3)
//! ```
//!
//! with rho the autocorrelation at lag one, less its standard error, where it is above a quarter, s_w the noise of the row
//! at its run's pace and s_f a quarter of the simulator's own error of form, which may stay beside such a model. That is smooth: colour tells
//! of noise only where there is more than it, so that a machine whose repeats are exact is not blamed for it. What repeats leave alike at the same stations is structure, not noise: where
//! their mean product says so, it is taken from (1). Least squares spread a few rows that stand far off over all others:
//! where the median is less without such a model, that is the noise. The median keeps a few sharp places (reversals) from
//! passing for noise; products are clipped at three standard deviations.
//!
//! # Holds when
//! A channel has twenty rows more than its models have terms; others are not judged. Nor is one whose runs all repeat one test at
//! targets: the noise of its repeats is all that it has.
//!
//! # References
//! \[1\] P. J. Huber, E. M. Ronchetti, Robust Statistics, 2nd ed., Wiley 2009, 5.1 (scale by the median).

use std::collections::BTreeMap;

use nalgebra::DVector;
use twin::{Channel, Session};

use crate::config::GapConfig;
use crate::judgement::{Check, CheckId};
use crate::noise::Noise;
use crate::noise::form_error::{self, FormError};
use crate::noise::repeats;
use crate::noise::stack::Stack;
use crate::noise::whitener::Whitener;
use crate::report::figures::Note;
use crate::search::families::Slot;
use crate::search::field::{self, Smooth};
use crate::search::nuisance::orthonormal;
use crate::search::periods;
use crate::search::rows::{Block, count};

/// Mean product of repeats above which what is left is structure rather than noise.
const STRUCTURE: f64 = 0.15;
/// Median of the square of a normal number.
const MEDIAN_SQUARE: f64 = 0.454_936;
/// Relative variance of a variance that is found by the median of n squares, times n.
const OF_MEDIAN: f64 = 5.4;
/// Standard deviations by which worse noise must be sure.
const MIN_NOISE_DEVIATIONS: f64 = 1.0;
/// Share of the error of form that is not smooth: it stays beside the biggest model.
pub const ROUGH_FORM_SHARE: f64 = 0.25;
/// Rows beyond the terms of the models below which a channel is not judged.
const FEWEST: f64 = 20.0;

/// (2) of every channel; `rest` is what the effects found leave of the stack, mm.
pub fn inflation(
    stack: &Stack<'_>,
    slots: &[Slot],
    noise: &BTreeMap<Channel, Noise>,
    rest: Vec<f64>,
    form: &FormError,
) -> BTreeMap<Channel, f64> {
    let (mut white, mut rest, terms) = rough(stack, slots, noise, rest);
    let mut sums = BTreeMap::<Channel, Vec<(&Block, f64)>>::new();
    for block in &stack.rows.blocks {
        let smooth = smooth(stack, noise, block, form);
        for row in white[block.range()]
            .iter_mut()
            .chain(&mut rest[block.range()])
        {
            *row /= (1.0 + smooth).sqrt();
        }
        let share = smooth / (1.0 + smooth);
        sums.entry(block.channel.clone())
            .or_default()
            .push((block, share));
    }
    let mut scales = BTreeMap::<Channel, [f64; 2]>::new();
    for (channel, blocks) in sums {
        let n = count(blocks.iter().map(|(block, _)| block.rows.len()).sum());
        let left = n - terms.get(&channel).copied().unwrap_or(0.0);
        if left <= FEWEST || is_all_repeated(stack, &channel) {
            continue;
        }
        let doubt = (OF_MEDIAN / left + 2.0 / noise[&channel].freedom.max(1.0)).sqrt();
        let sure = (-MIN_NOISE_DEVIATIONS * doubt).exp(); // (3)
        let [s2, without] = [
            middle_square(&blocks, &rest, n / left * sure),
            middle_square(&blocks, &white, sure),
        ];
        if without < s2 {
            for (block, _) in &blocks {
                rest[block.range()].copy_from_slice(&white[block.range()]);
            }
        }
        scales.insert(channel, [s2.min(without), middle(shares(&blocks))]);
    }
    let shared = shared_by_repeats(stack, &rest, &scales);
    let judged = |(channel, [s2, smooth]): (&Channel, &[f64; 2])| {
        let worse = match shared.get(channel) {
            Some(common) if *common > STRUCTURE.min(0.3 * (s2 - 1.0)).max(0.05) => s2 - common,
            _ => {
                let colour = of_neighbours(stack, &rest, channel, *s2);
                s2 + (colour - 1.0) * (s2 - 2.0 * smooth).max(0.0)
            }
        };
        (channel.clone(), worse.max(1.0)) // (2)
    };
    scales.iter().map(judged).collect()
}

/// Whether all runs of a channel repeat one test at targets: their differences have all of its noise, and what stays alike in all is
/// structure.
fn is_all_repeated(stack: &Stack<'_>, channel: &Channel) -> bool {
    let block = |place: &usize| &stack.rows.blocks[*place];
    let groups = repeats::groups(stack.session, &stack.rows);
    let mut own = { groups.iter() }.filter(|group| block(&group[0]).channel == *channel);
    let is_at_targets = |place: &usize| stack.session.runs[block(place).run].segment.stations > 0;
    let first = own.next();
    first.is_some_and(|group| group.len() > 1 && group.iter().all(is_at_targets))
        && own.next().is_none()
}

/// (1) of some blocks' rows.
fn middle_square(blocks: &[(&Block, f64)], rows: &[f64], size: f64) -> f64 {
    let squares = blocks.iter().flat_map(|(block, share)| {
        let squares = rows[block.range()]
            .iter()
            .map(|v| v * v / MEDIAN_SQUARE * size);
        squares.map(|square| square + *share)
    });
    middle(squares)
}

/// Part of the error of form in what each row may have.
fn shares<'b>(blocks: &'b [(&Block, f64)]) -> impl Iterator<Item = f64> + 'b {
    let rows = blocks
        .iter()
        .map(|(block, share)| (block.rows.len(), *share));
    rows.flat_map(|(rows, share)| std::iter::repeat_n(share, rows))
}

fn middle(values: impl Iterator<Item = f64>) -> f64 {
    let mut all: Vec<f64> = values.collect();
    let middle = all.len() / 2;
    *all.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Checks that the noise of the repeats is the session's: the middle channel's. A channel whose noise is worse gets a note. Logs
/// without repeats have the noise of neighbouring rows. Anything beyond it is an error of the effects, not noise.
pub fn judge(
    inflation: &BTreeMap<Channel, f64>,
    config: &GapConfig,
    has_repeats: bool,
    notes: &mut Vec<Note>,
) -> Check {
    if !has_repeats {
        return Check::new(CheckId::NoiseFloor, true).not_tried();
    }
    let mut all: Vec<f64> = inflation.values().copied().collect();
    all.sort_by(f64::total_cmp);
    let middle = all.get(all.len() / 2).copied();
    let is_reproduced = middle.is_none_or(|middle| middle <= config.most_inflation);
    for channel in inflation.keys() {
        if let Some(inflation) = excess(channel, inflation, config) {
            notes.push(Note::NotReproduced {
                channel: channel.to_string(),
                inflation,
                withdraws: !is_reproduced,
            });
        }
    }
    let check = Check::new(CheckId::NoiseFloor, is_reproduced);
    match middle {
        Some(middle) => check.with(middle, config.most_inflation),
        None => check.not_tried(),
    }
}

/// Whether a channel's noise is that of the repeats.
pub fn reproduces(
    channel: &Channel,
    inflation: &BTreeMap<Channel, f64>,
    config: &GapConfig,
) -> bool {
    excess(channel, inflation, config).is_none()
}

/// By how much a channel's noise is worse than that of the repeats, if it is. Two directions of one grid encoder have the
/// same noise, and two that say the same are surer than one: of both together, the geometric mean counts.
fn excess(
    channel: &Channel,
    inflation: &BTreeMap<Channel, f64>,
    config: &GapConfig,
) -> Option<f64> {
    let of = |channel: &Channel| inflation.get(channel).copied();
    let own = of(channel).filter(|ratio| *ratio > config.most_inflation);
    let is_grid = matches!(channel, Channel::GridU | Channel::GridV);
    let both = of(&Channel::GridU).zip(of(&Channel::GridV));
    let joint = both.filter(|_| is_grid).map(|(u, v)| (u * v).sqrt());
    own.or(joint.filter(|ratio| *ratio > config.most_inflation_of_two))
}

/// f of (1).
fn smooth(
    stack: &Stack<'_>,
    noise: &BTreeMap<Channel, Noise>,
    block: &Block,
    form: &FormError,
) -> f64 {
    let within = noise[&block.channel].within(&stack.session.runs[block.run], block);
    (ROUGH_FORM_SHARE * form.of(block)).powi(2) / within.variances[0]
}

/// What the effects leave, and what is left beside the biggest model as well, with its terms by channel.
fn rough(
    stack: &Stack<'_>,
    slots: &[Slot],
    noise: &BTreeMap<Channel, Noise>,
    mut rest: Vec<f64>,
) -> (Vec<f64>, Vec<f64>, BTreeMap<Channel, f64>) {
    let still = Smooth::default();
    let within = Whitener::new(
        stack.session,
        &stack.rows,
        |block| {
            let run = &stack.session.runs[block.run];
            (noise[&block.channel].within(run, block), &still)
        },
        &FormError::default(),
    );
    within.apply(&mut rest);
    let white = rest.clone();
    let mut terms = BTreeMap::<Channel, f64>::new();
    for block in &stack.rows.blocks {
        let run = &stack.session.runs[block.run];
        let (_, modes) = field::modes(run, block);
        let touches = form_error::touch_columns(run, block, &BTreeMap::new());
        let touches: Vec<Vec<f64>> = touches.into_iter().map(|(column, _)| column).collect();
        let modes = form_error::beside(modes, &touches);
        let rows: Vec<usize> = block.range().collect();
        let filter = noise[&block.channel].within(run, block);
        let columns = modes.column_iter().map(|column| {
            let mut column = column.into_owned();
            filter.filter(column.as_mut_slice());
            column
        });
        let used = take_out(&mut rest, &rows, columns);
        *terms.entry(block.channel.clone()).or_default() += used;
    }
    for slot in slots {
        let plain = slot.families.iter().flat_map(|family| {
            let columns = family.plain.column_iter();
            columns
                .map(|column| column.into_owned())
                .collect::<Vec<_>>()
        });
        let columns = plain.map(|column| {
            let mut whole = vec![0.0; stack.rows.len];
            for (place, value) in slot.rows.iter().zip(column.iter()) {
                whole[*place] = *value;
            }
            within.apply(&mut whole);
            DVector::from_iterator(slot.rows.len(), slot.rows.iter().map(|place| whole[*place]))
        });
        let used = take_out(&mut rest, &slot.rows, columns);
        *terms.entry(slot.key.clone()).or_default() += used;
        *terms.entry(slot.key.clone()).or_default() +=
            take_out_lines(stack, slot, &within, &mut rest);
    }
    (white, rest, terms)
}

/// Most lines of one channel and direction.
const LINES: usize = 3;
/// Share of what is left that a line takes which is no noise.
const OF_LINE: f64 = 0.3;

/// Takes lines over a position that are most of what is left out of it; how many terms they have.
fn take_out_lines(stack: &Stack<'_>, slot: &Slot, within: &Whitener, rest: &mut [f64]) -> f64 {
    let mut terms = 0.0;
    for _ in 0..LINES {
        let left = DVector::from_column_slice(rest);
        let Some(line) = periods::strongest(stack, slot, &left, periods::Sought::Positions) else {
            break;
        };
        let square: f64 = slot.rows.iter().map(|place| left[*place].powi(2)).sum();
        if line.power < OF_LINE * square {
            break;
        }
        let columns = line.waves(stack).map(|wave| {
            let mut whole = vec![0.0; stack.rows.len];
            for (place, value) in slot.rows.iter().zip(wave) {
                whole[*place] = value;
            }
            within.apply(&mut whole);
            DVector::from_iterator(slot.rows.len(), slot.rows.iter().map(|place| whole[*place]))
        });
        // And one for the period.
        terms += 1.0 + take_out(rest, &slot.rows, columns.into_iter());
    }
    terms
}

/// Takes some columns over some rows out of the rest; how many there were.
fn take_out(rest: &mut [f64], rows: &[usize], columns: impl Iterator<Item = DVector<f64>>) -> f64 {
    let basis = orthonormal(rows.len(), columns);
    let part = DVector::from_iterator(rows.len(), rows.iter().map(|place| rest[*place]));
    let told = &basis * basis.tr_mul(&part);
    for (place, told) in rows.iter().zip(told.iter()) {
        rest[*place] -= told;
    }
    count(basis.ncols())
}

fn clipped(value: f64, s2: f64) -> f64 {
    let most = 3.0 * s2.sqrt();
    value.clamp(-most, most)
}

/// What correlation of neighbours adds to the variance of their means.
fn of_neighbours(stack: &Stack<'_>, rest: &[f64], channel: &Channel, s2: f64) -> f64 {
    let blocks = stack.rows.blocks.iter().filter(|b| b.channel == *channel);
    colour(
        blocks.flat_map(|block| rest[block.range()].windows(2)),
        |value| clipped(value, s2),
    )
}

/// c of (2), of pairs of neighbours.
fn colour<'p>(pairs: impl Iterator<Item = &'p [f64]>, clipped: impl Fn(f64) -> f64) -> f64 {
    let (mut product, mut square, mut n) = (0.0, 0.0, 0.0);
    for pair in pairs {
        let (one, other) = (clipped(pair[0]), clipped(pair[1]));
        product += one * other;
        square += f64::midpoint(one * one, other * other);
        n += 1.0;
    }
    let rho = product / f64::max(square, f64::MIN_POSITIVE) - 1.0 / f64::max(n, 1.0).sqrt();
    if rho > 0.25 {
        (1.0 + rho) / (1.0 - rho).max(0.05)
    } else {
        1.0
    }
}

/// Mean product of the same station in two repeats.
fn shared_by_repeats(
    stack: &Stack<'_>,
    rest: &[f64],
    scales: &BTreeMap<Channel, [f64; 2]>,
) -> BTreeMap<Channel, f64> {
    let mut sums = BTreeMap::<Channel, [f64; 2]>::new();
    let blocks = &stack.rows.blocks;
    for group in repeats::groups(stack.session, &stack.rows) {
        for pair in group.windows(2) {
            let (one, other) = (&blocks[pair[0]], &blocks[pair[1]]);
            let Some([s2, _]) = scales.get(&one.channel) else {
                continue;
            };
            let sum = sums.entry(one.channel.clone()).or_default();
            for (here, there) in shared_rows(stack.session, one, other) {
                sum[0] += clipped(rest[here], *s2) * clipped(rest[there], *s2);
                sum[1] += 1.0;
            }
        }
    }
    sums.into_iter()
        .filter(|(_, [_, n])| *n > 0.0)
        .map(|(channel, [product, n])| (channel, product / n))
        .collect()
}

/// Places in the stack of the rows that two blocks both have.
fn shared_rows(session: &Session, one: &Block, other: &Block) -> Vec<(usize, usize)> {
    let shared = repeats::shared(session, &[one, other]);
    let (here, there) = (shared[0].iter(), shared[1].iter());
    here.zip(there)
        .map(|(a, b)| (one.start + a, other.start + b))
        .collect()
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64Mcg;

    use super::*;

    #[test]
    fn one_channel_with_worse_noise_is_said_and_only_a_middle_one_withdraws_names() {
        let config = GapConfig::default();
        let judged = |ratios: [f64; 3]| {
            let channels = [Channel::GridU, Channel::GridV, Channel::Touch];
            let inflation = channels.into_iter().zip(ratios).collect();
            let mut notes = vec![];
            let is_reproduced = !judge(&inflation, &config, true, &mut notes).has_failed();
            let words: Vec<String> = notes.iter().map(ToString::to_string).collect();
            (is_reproduced, words.join("; "))
        };
        let (is_reproduced, words) = judged([1.0, 4.0, 1.0]);
        assert!(
            is_reproduced && words.contains("count for so much less"),
            "{words}"
        );
        let (is_reproduced, words) = judged([3.0, 4.0, 1.0]);
        assert!(
            !is_reproduced && words.contains("nothing is named"),
            "{words}"
        );
        assert_eq!(judged([1.0; 3]), (true, String::new()));
        // The quieter direction is told by what was judged: both together.
        let (_, words) = judged([1.0, 1.69, 1.0]);
        for ratio in ["1.69", "1.30"] {
            assert!(words.contains(ratio), "{words}");
        }
        assert!(!words.contains("1.00"), "{words}");
    }

    #[test]
    fn two_directions_of_one_grid_say_together_what_neither_says_alone() {
        let config = GapConfig::default();
        let says = |u: f64, v: f64, touch: f64| {
            let channels = [Channel::GridU, Channel::GridV, Channel::Touch];
            let inflation = channels.iter().cloned().zip([u, v, touch]).collect();
            channels.map(|channel| reproduces(&channel, &inflation, &config))
        };
        assert_eq!(says(1.1, 1.12, 1.12), [false, false, true]);
        assert_eq!(says(1.0, 1.08, 1.0), [true; 3]);
        assert_eq!(says(1.0, 1.0, 1.3), [true, true, false]);
        let alone = BTreeMap::from([(Channel::GridU, 1.15)]);
        assert!(reproduces(&Channel::GridU, &alone, &config));
    }

    #[test]
    fn fifty_readings_of_white_noise_have_no_colour_and_those_of_a_walk_have() {
        let mut random = Pcg64Mcg::seed_from_u64(7);
        let mut coloured = [0, 0];
        for _ in 0..1000 {
            let white: [f64; 50] = std::array::from_fn(|_| random.sample(StandardNormal));
            let mut walk = white;
            for i in 1..50 {
                walk[i] += 0.9 * walk[i - 1];
            }
            for (rows, count) in [&white, &walk].into_iter().zip(&mut coloured) {
                *count += usize::from(colour(rows.windows(2), |value| value) > 1.0);
            }
        }
        assert!(coloured[0] < 10 && coloured[1] > 950, "{coloured:?}");
    }
}
