//! Curves of any form: random waves, dents and steps.

use std::f64::consts::TAU;

use rand::Rng;
use rand_pcg::Pcg64Mcg;

use super::dice::{log_uniform, normal, sign};

/// Waves of a curve.
const WAVES_OF_SHAPE: usize = 10;
/// Share of curves with dents, and with a step.
const DENTED: f64 = 0.4;
const STEPPED: f64 = 0.25;

/// A curve over a course from 0 to 1.
#[derive(Clone, Debug, Default)]
pub struct Shape {
    /// Cycles, size, phase.
    waves: Vec<[f64; 3]>,
    /// Place, half width, depth.
    dents: Vec<[f64; 3]>,
    /// Place, half width, height.
    steps: Vec<[f64; 3]>,
}

impl Shape {
    /// Draws a curve that `places` evenly spread targets can show: no wave of less than four spacings.
    pub fn draw(random: &mut Pcg64Mcg, places: usize) -> Self {
        let most = ((places.max(5) - 1) as f64 / 4.0).max(1.2);
        let mut shape = Self::default();
        for _ in 0..WAVES_OF_SHAPE {
            let cycles = random.random_range(0.3..most);
            let size = normal(random) / cycles.powf(0.8);
            shape
                .waves
                .push([cycles, size, random.random_range(0.0..TAU)]);
        }
        let width = |random: &mut Pcg64Mcg| log_uniform(random, [0.25 / most, 0.2]);
        if random.random::<f64>() < DENTED {
            for _ in 0..random.random_range(1..3) {
                let half = width(random);
                let place = random.random();
                shape.dents.push([place, half, 1.5 * normal(random)]);
            }
        }
        if random.random::<f64>() < STEPPED {
            let half = 0.3 * width(random);
            let place = random.random_range(0.15..0.85);
            shape.steps.push([place, half, sign(random)]);
        }
        shape
    }

    fn at(&self, u: f64) -> f64 {
        let wave = |[cycles, size, phase]: &[f64; 3]| size * (TAU * cycles * u + phase).sin();
        let dent = |[place, half, depth]: &[f64; 3]| {
            let off = ((u - place) / half).abs();
            // A bump of finite reach.
            if off < 1.0 {
                depth * (1.0 - off * off * off).powi(3)
            } else {
                0.0
            }
        };
        let step = |[place, half, height]: &[f64; 3]| height * ((u - place) / half).tanh();
        self.waves.iter().map(wave).sum::<f64>()
            + self.dents.iter().map(dent).sum::<f64>()
            + self.steps.iter().map(step).sum::<f64>()
    }

    /// Its values with mean and slope taken out, the largest 1; evenly 0 where nothing is left.
    pub fn bent(&self, course: &[f64]) -> Vec<f64> {
        let values: Vec<f64> = course.iter().map(|u| self.at(*u)).collect();
        scaled(&without_line(course, &values))
    }

    /// Its values between 1 - `share` and 1 + `share`.
    pub fn about_one(&self, course: &[f64], share: f64) -> Vec<f64> {
        let values: Vec<f64> = course.iter().map(|u| self.at(*u)).collect();
        let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
        let off: Vec<f64> = values.iter().map(|value| value - mean).collect();
        scaled(&off)
            .iter()
            .map(|value| 1.0 + share * value)
            .collect()
    }
}

fn scaled(values: &[f64]) -> Vec<f64> {
    let most = values
        .iter()
        .fold(0.0_f64, |most, value| most.max(value.abs()));
    let of = |value: &f64| if most > 1e-9 { value / most } else { 0.0 };
    values.iter().map(of).collect()
}

fn without_line(course: &[f64], values: &[f64]) -> Vec<f64> {
    let n = course.len().max(1) as f64;
    let mean = |all: &[f64]| all.iter().sum::<f64>() / n;
    let (u0, v0) = (mean(course), mean(values));
    let both = course.iter().zip(values);
    let across: f64 = both.map(|(u, v)| (u - u0) * (v - v0)).sum();
    let square: f64 = course.iter().map(|u| (u - u0).powi(2)).sum();
    let slope = if square > 0.0 { across / square } else { 0.0 };
    let both = course.iter().zip(values);
    both.map(|(u, v)| v - v0 - slope * (u - u0)).collect()
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn a_bent_curve_has_no_slope_and_reaches_one() {
        let course: Vec<f64> = (0..17).map(|k| f64::from(k) / 16.0).collect();
        for seed in 0..50 {
            let mut random = Pcg64Mcg::seed_from_u64(seed);
            let bent = Shape::draw(&mut random, 17).bent(&course);
            let slope: f64 = course.iter().zip(&bent).map(|(u, v)| (u - 0.5) * v).sum();
            let most = bent
                .iter()
                .fold(0.0_f64, |most, value| most.max(value.abs()));
            assert!(slope.abs() < 1e-12 && (most - 1.0).abs() < 1e-12);
        }
    }
}
