//! Periods that the readings themselves tell.
//!
//! # Model
//!
//! Of an effect that repeats n times over a lead of its axis, n is tried at a few numbers. What repeats at another one
//! (a bearing, a belt, a scale) would need hundreds of them, for a travel holds a hundred periods; the power of the
//! whitened rows along the axis tells which:
//!
//! ```text
//!   P(n) = 2 |sum_i z_i exp(2 pi i n x_i / lead)|^2 / rows                (1)
//! ```
//!
//! z is white, so that P has mean 2, and noise makes more than [`LEAST_POWER`] at one of the few hundred n that are tried with
//! a chance of some 1e-4 (exp(-15) each). The line is a form like any other, which pays for its choice by one parameter more.
//!
//! # References
//! \[1\] J. D. Scargle, Astrophys. J. 263, 1982 (the periodogram of places that are not evenly spaced).

use std::f64::consts::TAU;
use std::ops::RangeInclusive;

use machine::MachineFile;
use metrology::Axis;
use twin::effects::{Role, Target};

use crate::noise::stack::Stack;
use crate::search::families::Slot;
use crate::search::rows::{count, position};
use crate::search::signature::{Library, shapes};

/// Periods over a lead among which lines are sought.
const RANGE: RangeInclusive<f64> = 0.6..=1.6;
/// Share of a line's width between two numbers that are tried.
const LINE_STEP: f64 = 0.3;
/// Power of a line.
const LEAST_POWER: f64 = 30.0;

/// Adds a form at the strongest line of every axis to each effect that has a frequency.
pub fn add(stack: &Stack<'_>, slots: &[Slot], signatures: &mut Library) {
    for instance in 0..signatures.instances.len() {
        let own = &signatures.instances[instance];
        let parameters = own.kind.parameters.iter();
        let is_frequency = |role: Role| matches!(role, Role::Frequency { .. });
        let Some(place) = parameters.clone().position(|p| is_frequency(p.role)) else {
            continue;
        };
        let (Target::Axis(axis), Some(width)) =
            (&own.target, width(stack.twin.machine(), &own.target))
        else {
            continue;
        };
        let is_tried = |n: f64| {
            let grid = own.kind.parameters[place].role.grid().unwrap_or(&[]);
            grid.iter()
                .any(|known| (known - n).abs() < LINE_STEP * width)
        };
        let Some(n) = line(stack, slots, *axis, width).filter(|n| !is_tried(*n)) else {
            continue;
        };
        let Some(mut values) = shapes(own.kind).into_iter().next() else {
            continue;
        };
        values[place] = n;
        if let Some(form) = signatures.add(stack, instance, values, false) {
            signatures.forms[form].price += 1;
        }
    }
}

/// What n may be off by before two ends of the travel of an axis are a period apart.
pub fn width(machine: &MachineFile, target: &Target) -> Option<f64> {
    let Target::Axis(axis) = target else {
        return None;
    };
    let linear = machine.linear(*axis)?;
    Some(linear.lead_mm / (linear.travel_mm[1] - linear.travel_mm[0]))
}

/// The n of the strongest line (1) along an axis, where it stands out of noise.
fn line(stack: &Stack<'_>, slots: &[Slot], axis: Axis, width: f64) -> Option<f64> {
    let lead_mm = stack.twin.machine().linear(axis)?.lead_mm;
    let own = slots.iter().filter(|slot| slot.direction == axis.letter());
    let mut rows = Vec::new();
    for index in own.flat_map(|slot| &slot.blocks) {
        let block = &stack.rows.blocks[*index];
        let run = &stack.session.runs[block.run];
        let places = block.rows.iter().map(|row| position(run, row, axis));
        let whitened = block.range().map(|place| stack.z[place]);
        rows.extend(places.zip(whitened));
    }
    strongest(&rows, lead_mm, width)
}

fn strongest(rows: &[(f64, f64)], lead_mm: f64, width: f64) -> Option<f64> {
    let power = |n: f64| {
        let (mut c, mut s) = (0.0, 0.0);
        for (at, z) in rows {
            let (sin, cos) = (TAU * n * at / lead_mm).sin_cos();
            c += z * cos;
            s += z * sin;
        }
        2.0 * (c * c + s * s) / count(rows.len().max(1))
    };
    let tried = std::iter::successors(Some(*RANGE.start()), |n| Some(n + LINE_STEP * width));
    let all = tried.take_while(|n| RANGE.contains(n));
    let best = all
        .map(|n| (power(n), n))
        .max_by(|a, b| a.0.total_cmp(&b.0));
    best.filter(|(power, _)| *power > LEAST_POWER)
        .map(|(_, n)| n)
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64Mcg;

    use super::*;

    /// 500 places over 600 mm.
    fn found(amplitude: f64, n: f64) -> Option<f64> {
        let mut random = Pcg64Mcg::seed_from_u64(9);
        let rows: Vec<(f64, f64)> = (0..500)
            .map(|_| {
                let at: f64 = random.random_range(-300.0..300.0);
                let noise: f64 = random.sample(StandardNormal);
                (at, noise + amplitude * (TAU * n * at / 10.0 + 0.7).sin())
            })
            .collect();
        strongest(&rows, 10.0, 10.0 / 600.0)
    }

    #[test]
    fn eq1_finds_a_period_between_the_numbers_that_are_tried_and_none_in_noise() {
        for n in [0.71, 1.0873, 1.137, 1.52] {
            let line = found(0.6, n).unwrap();
            assert!((line - n).abs() < 0.25 * 10.0 / 600.0, "{n}: {line}");
        }
        assert_eq!(found(0.0, 1.1), None);
    }
}
