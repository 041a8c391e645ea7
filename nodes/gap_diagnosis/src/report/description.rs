//! What a leftover looks like: what it goes with, its period, how it grows with feed, its time constant.
//!
//! # Model
//!
//! It goes with the first family (`families`), or with the line (`periods`) where that is worth more. Of the curve `f` so
//! found, each feed v has a size b_v of its own, set-ups floated, and the exponent is the slope of
//!
//! ```text
//!   y = sum_v b_v f_v,   ln b_v + ln rms(g_v)   over   ln v               (1)
//! ```
//!
//! weighted by what each feed tells; g is f for a family of the velocity or the feed themselves, and 1 for all others, which
//! do not grow with v. A time constant is that of the exponential which takes most of the leftover, set-ups floated.
//!
//! # Holds when
//! One curve makes most of what is left of a channel.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};

use crate::noise::normal::Normal;
use crate::noise::stack::Stack;
use crate::report::Description;
use crate::report::localise::Score;
use crate::search::families::{Family, Parity, Slot};
use crate::search::periods::{self, Line, Sought};
use crate::search::rows::{count, time_s};

/// Describes what is `left` (white) of a flagged session, which is `floated` before whitening, mm; `scores` are those of
/// its families, the first one first.
pub fn describe(
    stack: &Stack<'_>,
    slots: &[Slot],
    scores: &[Score],
    left: &DVector<f64>,
    floated: &[f64],
) -> Description {
    let Some(top) = scores.first() else {
        return Description::default();
    };
    let (slot, family) = (&slots[top.slot], &slots[top.slot].families[top.family]);
    let worth = periods::worth(top.square, count(family.columns.len()));
    let all: Vec<Line> = slots
        .iter()
        .filter_map(|slot| periods::strongest(stack, slot, left, Sought::All))
        .collect();
    let strongest = all.into_iter().max_by(|a, b| a.worth.total_cmp(&b.worth));
    if let Some(line) = strongest.filter(|line| line.worth > worth) {
        let told = line.fitted(stack, floated);
        let exponent = feed_exponent(stack, line.slot, floated, &told, false);
        return Description {
            covariate: line.covariate(),
            parity: line.parity().to_owned(),
            period: line.to_string(),
            feed_exponent: exponent,
            time_constant_s: None,
        };
    }
    let line =
        periods::strongest(stack, slot, left, Sought::All).filter(|line| line.worth > 0.5 * worth);
    let told = fitted(slot, family, floated);
    let grows = family.covariate.starts_with("velocity") || family.covariate == "feed";
    Description {
        covariate: family.covariate.clone(),
        parity: parity(slots, scores).to_owned(),
        period: line.map_or_else(String::new, |line| line.to_string()),
        feed_exponent: feed_exponent(stack, slot, floated, &told, grows),
        time_constant_s: (family.covariate == "time")
            .then(|| time_constant_s(stack, slot, floated))
            .flatten(),
    }
}

/// The parity whose families explain more beyond noise: of shares nothing can be said where the noise is taken with
/// caution, and two families of one parity may share all of it.
fn parity(slots: &[Slot], scores: &[Score]) -> &'static str {
    let best = |wanted: Parity| {
        let family = |score: &Score| &slots[score.slot].families[score.family];
        let own = scores.iter().filter(|score| family(score).parity == wanted);
        own.map(|score| score.square - count(family(score).columns.len()))
            .fold(0.0, f64::max)
    };
    let (odd, even) = (best(Parity::Odd), best(Parity::Even));
    if odd > 1.5 * even {
        "odd"
    } else if even > 1.5 * odd {
        "even"
    } else {
        ""
    }
}

/// A family's share of a stack, by plain least squares over the slot's rows.
pub fn fitted(slot: &Slot, family: &Family, floated: &[f64]) -> Vec<f64> {
    of_columns(&family.plain, &of_slot(slot, floated))
}

/// The share of some columns in what is to be told, by plain least squares.
pub fn of_columns(columns: &DMatrix<f64>, wanted: &DVector<f64>) -> Vec<f64> {
    let normal = Normal::new(columns, wanted);
    let sizes = normal
        .solve(&(0..columns.ncols()).collect::<Vec<_>>())
        .sizes;
    (columns * DVector::from_vec(sizes))
        .iter()
        .copied()
        .collect()
}

/// A slot's rows of a stack.
pub fn of_slot(slot: &Slot, stack: &[f64]) -> DVector<f64> {
    DVector::from_iterator(slot.rows.len(), slot.rows.iter().map(|place| stack[*place]))
}

/// Slope of (1), where there are two feeds.
fn feed_exponent(
    stack: &Stack<'_>,
    slot: &Slot,
    floated: &[f64],
    told: &[f64],
    grows: bool,
) -> Option<f64> {
    // The feed, its rows and its part of the curve.
    let mut by_feed = BTreeMap::<u64, (f64, f64, Vec<f64>)>::new();
    let mut first = 0;
    for index in &slot.blocks {
        let block = &stack.rows.blocks[*index];
        let feed_mm_s = stack.session.runs[block.run].segment.feed_mm_s.abs();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a label"
        )]
        let label = (feed_mm_s * 100.0) as u64;
        let (feed, rows, part) = by_feed
            .entry(label)
            .or_insert_with(|| (0.0, 0.0, vec![0.0; stack.rows.len]));
        *feed = feed_mm_s;
        *rows += count(block.rows.len());
        part[block.range()].copy_from_slice(&told[first..first + block.rows.len()]);
        first += block.rows.len();
    }
    by_feed.retain(|_, (feed, ..)| *feed > 0.0);
    if by_feed.len() < 2 {
        return None;
    }
    let square = |part: &[f64]| part.iter().map(|f| f * f).sum::<f64>();
    let of_feed = |part: &Vec<f64>| of_slot(slot, &stack.floated(part.clone()));
    let columns: Vec<_> = by_feed.values().map(|(.., part)| of_feed(part)).collect();
    let normal = Normal::new(&DMatrix::from_columns(&columns), &of_slot(slot, floated));
    let sizes = normal.solve(&(0..columns.len()).collect::<Vec<_>>()).sizes;
    let points = by_feed.values().zip(sizes).filter(|(_, size)| *size > 0.0);
    let points = points.map(|((feed, rows, part), size)| {
        let own = if grows { square(part) / rows } else { 1.0 };
        let weight = size * size * square(part);
        (feed.ln(), size.ln() + 0.5 * own.ln(), weight) // (1)
    });
    slope(&points.collect::<Vec<_>>())
}

/// Least spread of ln v, as a variance: feeds of 1 to 1.3.
const LEAST_SPREAD: f64 = 0.015;

/// Slope of a straight line through points (x, y, weight) that are not all at one place.
fn slope(points: &[(f64, f64, f64)]) -> Option<f64> {
    let all: f64 = points.iter().map(|p| p.2).sum();
    let mean =
        |f: fn(&(f64, f64, f64)) -> f64| points.iter().map(|p| p.2 * f(p)).sum::<f64>() / all;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let products = points.iter().map(|p| p.2 * (p.0 - x) * (p.1 - y));
    let square: f64 = points.iter().map(|p| p.2 * (p.0 - x).powi(2)).sum();
    let spread = |p: &(f64, f64, f64)| (p.0 - x).powi(2);
    let plain = points.iter().map(spread).sum::<f64>() / count(points.len().max(1));
    (plain > LEAST_SPREAD).then(|| products.sum::<f64>() / square)
}

/// Candidates of a time constant, the least as a share of the session's length, and the ratio of neighbours.
const CANDIDATES: (i32, f64, f64) = (60, 0.01, 1.1);

/// Time constant of an exponential rise through the session.
fn time_constant_s(stack: &Stack<'_>, slot: &Slot, floated: &[f64]) -> Option<f64> {
    let mut times_s = Vec::new();
    for index in &slot.blocks {
        let block = &stack.rows.blocks[*index];
        let run = &stack.session.runs[block.run];
        times_s.extend(block.rows.iter().map(|row| time_s(run, row)));
    }
    let first_s = times_s.iter().copied().fold(f64::INFINITY, f64::min);
    let last_s = times_s.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let wanted = of_slot(slot, floated);
    let gain = |constant_s: f64| {
        let mut column = vec![0.0; stack.rows.len];
        for (place, time_s) in slot.rows.iter().zip(&times_s) {
            column[*place] = (-(time_s - first_s) / constant_s).exp();
        }
        let column = of_slot(slot, &stack.floated(column));
        let columns = DMatrix::from_columns(&[column]);
        Normal::new(&columns, &wanted).solve(&[0]).gain
    };
    let (candidates, least, ratio) = CANDIDATES;
    (0..candidates)
        .map(|k| (last_s - first_s) * least * ratio.powi(k))
        .map(|constant_s| (constant_s, gain(constant_s)))
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(constant_s, _)| constant_s)
}
