//! Shapes without a physics: what a residual can go with, channel by channel.
//!
//! # Model
//!
//! A family is a small basis over one covariate in one channel and direction, whitened, the floats out,
//! orthonormal: U = orth(P W B).
//!
//! | covariate | basis | parity in direction |
//! |---|---|---|
//! | `position_x` | Legendre 1 to 5 | even |
//! | `sense*log_distance_since_reversal_x` | sense times 1 and hats in log10 of mm | odd |
//! | `velocity_x` | v, v\|v\|, v3 | odd |
//! | `angle` | cos and sin of 2 to 6 times the angle | even |
//! | `sense*angle` | sense of rotation times cos and sin of 1 to 3 times the angle | odd |
//! | `time` | Legendre 1 to 4 in the session's time | even |
//! | `temperature_<id>` | T, T2 | even |
//! | `approach_angle` | harmonics 1 to 4 of the approach | even |
//! | `feed` | f, f2 of touches | even |
//! | `stylus` | one column a further stylus, alone and times cos and sin of the approach | even |

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::FRAC_PI_2;

use metrology::Axis;
use metrology::sample::Sense;
use nalgebra::{DMatrix, DVector};
use twin::simulate::plate_axes;
use twin::{Channel, Run};

use crate::noise::stack::Stack;
use crate::search::field::{self, Place};
use crate::search::nuisance::{orthonormal, plane_name};
use crate::search::rows::{Block, Row, count, position, time_s};

/// How a family behaves when the direction of motion turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parity {
    /// It keeps its sign: geometry, inertia, heat.
    Even,
    /// It turns its sign: friction, play, delay.
    Odd,
}

/// One family.
#[derive(Clone, Debug)]
pub struct Family {
    /// Its covariate.
    pub covariate: String,
    /// Its parity.
    pub parity: Parity,
    /// Its columns in the slot's basis.
    pub columns: std::ops::Range<usize>,
    /// The basis before whitening, over the slot's rows.
    pub plain: DMatrix<f64>,
}

/// One channel in one direction.
#[derive(Clone, Debug)]
pub struct Slot {
    /// Channel.
    pub channel: String,
    /// The same as a key.
    pub key: Channel,
    /// Direction of the error.
    pub direction: String,
    /// Places of its blocks.
    pub blocks: Vec<usize>,
    /// Its rows, places in the stack.
    pub rows: Vec<usize>,
    /// Its families.
    pub families: Vec<Family>,
    /// U of all of them, side by side.
    pub basis: DMatrix<f64>,
}

type Sample<'s> = (&'s Run, &'s Block, &'s Row, Place);
/// Covariate, parity and the basis as columns over the rows of the slot.
type Basis = (String, Parity, Vec<Vec<f64>>);

/// Families of every channel and direction of a stack.
pub fn families(stack: &Stack<'_>) -> Vec<Slot> {
    let mut groups = BTreeMap::<(String, String), Vec<usize>>::new();
    for (index, block) in stack.rows.blocks.iter().enumerate() {
        let direction = direction(&stack.session.runs[block.run], &block.channel);
        groups
            .entry((block.channel.to_string(), direction))
            .or_default()
            .push(index);
    }
    groups
        .into_iter()
        .map(|((channel, direction), blocks)| slot(stack, channel, direction, blocks))
        .collect()
}

/// Direction of the error that a channel reads.
fn direction(run: &Run, channel: &Channel) -> String {
    let plate = plate_axes(run.segment.plane);
    match channel {
        Channel::Motor(axis) | Channel::Scale(axis) | Channel::Length(axis) => axis.to_string(),
        Channel::GridU => plate.map_or_else(String::new, |axes| axes[0].to_string()),
        Channel::GridV => plate.map_or_else(String::new, |axes| axes[1].to_string()),
        Channel::Radial => format!("radial {}", plane_name(run.segment.plane)),
        Channel::Touch => "approach".to_owned(),
        Channel::Thermometer(_) => "temperature".to_owned(),
    }
}

fn slot(stack: &Stack<'_>, channel: String, direction: String, blocks: Vec<usize>) -> Slot {
    let mut samples = Vec::<Sample<'_>>::new();
    for &index in &blocks {
        let block = &stack.rows.blocks[index];
        let run = &stack.session.runs[block.run];
        let places = field::places(run, block);
        samples.extend(
            block
                .rows
                .iter()
                .zip(places)
                .map(|(row, place)| (run, block, row, place)),
        );
    }
    let rows: Vec<usize> = blocks
        .iter()
        .flat_map(|index| stack.rows.blocks[*index].range())
        .collect();
    let mut families = Vec::new();
    let mut columns = Vec::<DVector<f64>>::new();
    for (covariate, parity, basis) in bases(stack, &samples) {
        let white = basis.iter().map(|column| {
            let mut whole = vec![0.0; stack.rows.len];
            for (place, value) in rows.iter().zip(column) {
                whole[*place] = *value;
            }
            let white = stack.whitened(whole);
            DVector::from_iterator(rows.len(), rows.iter().map(|place| white[*place]))
        });
        let white: Vec<DVector<f64>> = white.filter(|column| column.norm() > 1e-6).collect();
        let own = orthonormal(rows.len(), white.into_iter());
        if own.ncols() == 0 || own.ncols() >= rows.len() {
            continue;
        }
        let first = columns.len();
        columns.extend(own.column_iter().map(|column| column.into_owned()));
        families.push(Family {
            covariate,
            parity,
            columns: first..columns.len(),
            plain: DMatrix::from_fn(rows.len(), basis.len(), |row, k| basis[k][row]),
        });
    }
    let basis = if columns.is_empty() {
        DMatrix::zeros(rows.len(), 0)
    } else {
        DMatrix::from_columns(&columns)
    };
    Slot {
        key: stack.rows.blocks[blocks[0]].channel.clone(),
        channel,
        direction,
        blocks,
        rows,
        families,
        basis,
    }
}

fn bases(stack: &Stack<'_>, samples: &[Sample<'_>]) -> Vec<Basis> {
    let mut all = Vec::new();
    for axis in stack.twin.machine().axis_set().iter() {
        all.extend(of_axis(samples, axis));
    }
    all.extend(of_angle(samples));
    let time: Vec<f64> = samples
        .iter()
        .map(|(run, _, row, _)| time_s(run, row))
        .collect();
    all.extend(legendre("time".to_owned(), &time, 4, 60.0));
    for (id, series) in &stack.session.history.temperature_degc {
        let at: Vec<f64> = time
            .iter()
            .map(|t| stack.session.history.at(series, *t))
            .collect();
        if at.iter().all(|t| t.is_finite()) {
            all.extend(legendre(format!("temperature_{id}"), &at, 2, 0.3));
        }
    }
    all.extend(of_touch(samples));
    all
}

/// Legendre polynomials over a covariate that moves by more than `least`.
fn legendre(name: String, at: &[f64], degree: usize, least: f64) -> Option<Basis> {
    let low = at.iter().copied().fold(f64::INFINITY, f64::min);
    let high = at.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if high - low <= least {
        return None;
    }
    let polynomial = |degree: usize, x: f64| {
        let (mut before, mut now) = (1.0, x);
        for k in 1..degree {
            let n = count(k);
            (before, now) = (now, ((2.0 * n + 1.0) * x * now - n * before) / (n + 1.0));
        }
        now
    };
    let scaled = |x: &f64| (x - low) / (high - low) * 2.0 - 1.0;
    let column = |k: usize| at.iter().map(|x| polynomial(k, scaled(x))).collect();
    Some((name, Parity::Even, (1..=degree).map(column).collect()))
}

fn of_axis(samples: &[Sample<'_>], axis: Axis) -> Vec<Basis> {
    let mut all = Vec::new();
    let letter = axis.letter().to_lowercase();
    let at: Vec<f64> = samples
        .iter()
        .map(|(run, _, row, _)| position(run, row, axis))
        .collect();
    let least = if axis.is_linear() { 1.0 } else { 0.01 };
    let Some(positions) = legendre(format!("position_{letter}"), &at, 5, least) else {
        return all;
    };
    all.push(positions);
    let of_tick = |series: fn(&Run, Axis, usize) -> f64| -> Vec<f64> {
        let at =
            |(run, _, row, _): &Sample<'_>| row.tick.map_or(0.0, |tick| series(run, axis, tick));
        samples.iter().map(at).collect()
    };
    let sense = of_tick(|run, axis, tick| f64::from(run.motion.sense[axis][tick]));
    let way = of_tick(|run, axis, tick| run.motion.since_reversal[axis][tick]);
    let mut hats = vec![sense.clone()];
    for centre in [-1.0, -0.5, 0.0, 0.5, 1.0] {
        let hat = |way: &f64| (1.0 - (way.max(1e-9).log10() - centre).abs() / 0.5).max(0.0);
        hats.push(sense.iter().zip(&way).map(|(s, w)| s * hat(w)).collect());
    }
    if sense.iter().any(|s| *s > 0.0) && sense.iter().any(|s| *s < 0.0) {
        let name = format!("sense*log_distance_since_reversal_{letter}");
        all.push((name, Parity::Odd, hats));
    }
    let velocity = of_tick(|run, axis, tick| run.motion.velocity[axis][tick]);
    let most = velocity.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    if most > 0.0 && samples.iter().all(|(_, _, row, _)| row.touch.is_none()) {
        let power = |f: fn(f64) -> f64| velocity.iter().map(|v| f(v / most)).collect();
        let columns = vec![power(|v| v), power(|v| v * v.abs()), power(|v| v * v * v)];
        all.push((format!("velocity_{letter}"), Parity::Odd, columns));
    }
    all
}

fn of_angle(samples: &[Sample<'_>]) -> Vec<Basis> {
    if !samples
        .iter()
        .any(|(.., place)| matches!(place, Place::Circle(_)))
    {
        return vec![];
    }
    let wave = |k: usize, turn: f64, signed: bool| -> Vec<f64> {
        let value = |(run, _, _, place): &Sample<'_>| {
            let sense = match run.segment.sense {
                Sense::Clockwise => -1.0,
                Sense::CounterClockwise => 1.0,
                Sense::None => 0.0,
            };
            match place {
                Place::Circle(angle) => {
                    (angle * count(k) - turn).cos() * if signed { sense } else { 1.0 }
                }
                Place::Line(_) | Place::None => 0.0,
            }
        };
        samples.iter().map(value).collect()
    };
    let waves = |range: std::ops::RangeInclusive<usize>, signed: bool| -> Vec<Vec<f64>> {
        range
            .flat_map(|k| [wave(k, 0.0, signed), wave(k, FRAC_PI_2, signed)])
            .collect()
    };
    vec![
        ("angle".to_owned(), Parity::Even, waves(2..=6, false)),
        ("sense*angle".to_owned(), Parity::Odd, waves(1..=3, true)),
    ]
}

fn of_touch(samples: &[Sample<'_>]) -> Vec<Basis> {
    let touch =
        |(run, _, row, _): &Sample<'_>| row.touch.and_then(|touch| run.touches.get(touch)).cloned();
    let touches: Vec<_> = samples.iter().filter_map(touch).collect();
    if touches.len() != samples.len() || touches.is_empty() {
        return vec![];
    }
    let angle = |k: usize, turn: f64| -> Vec<f64> {
        let wave = |t: &twin::Touch| (t.approach.y.atan2(t.approach.x) * count(k) - turn).cos();
        touches.iter().map(wave).collect()
    };
    let waves = (1..=4)
        .flat_map(|k| [angle(k, 0.0), angle(k, FRAC_PI_2)])
        .collect();
    let feeds: Vec<f64> = touches.iter().map(|touch| touch.feed_mm_s).collect();
    let mut all = vec![("approach_angle".to_owned(), Parity::Even, waves)];
    all.extend(legendre("feed".to_owned(), &feeds, 2, 0.05));
    let styli: Vec<(&str, f64)> = samples
        .iter()
        .zip(&touches)
        .map(|((run, ..), t)| (&*run.segment.stylus, t.approach.y.atan2(t.approach.x)))
        .collect();
    all.extend(of_stylus(&styli));
    all
}

/// What each further stylus has of its own, alone and with the approach (rad).
fn of_stylus(touches: &[(&str, f64)]) -> Option<Basis> {
    let styli: BTreeSet<&str> = touches.iter().map(|(stylus, _)| *stylus).collect();
    let shapes: [fn(f64) -> f64; 3] = [|_| 1.0, f64::cos, f64::sin];
    let column = |own: &str, shape: fn(f64) -> f64| {
        let value = |(stylus, approach): &(&str, f64)| f64::from(*stylus == own) * shape(*approach);
        touches.iter().map(value).collect()
    };
    let columns: Vec<Vec<f64>> = styli
        .iter()
        .skip(1)
        .flat_map(|own| shapes.map(|shape| column(own, shape)))
        .collect();
    (!columns.is_empty()).then(|| ("stylus".to_owned(), Parity::Even, columns))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_stylus_has_columns_of_its_own() {
        assert!(of_stylus(&[("50", 0.0), ("50", 1.0)]).is_none());
        let (name, parity, columns) = of_stylus(&[("50", 0.0), ("80", 0.0), ("80", 1.0)]).unwrap();
        assert_eq!((&*name, parity, columns.len()), ("stylus", Parity::Even, 3));
        assert_eq!(columns[0], [0.0, 1.0, 1.0]);
        assert_eq!(columns[1], [0.0, 1.0, 1.0_f64.cos()]);
        assert_eq!(columns[2], [0.0, 0.0, 1.0_f64.sin()]);
    }
}
