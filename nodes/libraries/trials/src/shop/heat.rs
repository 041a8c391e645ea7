//! Heat of a machine: lumped masses in small steps of time, and walls in layers.
//!
//! Heat goes into bearings and nut, flows into housing and column, and is lost to a room that has days, air conditioning
//! and a wander of its own. What grows is the mean of a wall whose face has the temperature of a mass, or the second of
//! two masses behind it. Neither answers like a lag of first order; `Lagged` finds the one that describes it best.

use std::f64::consts::TAU;

use rand::Rng;
use rand_pcg::Pcg64Mcg;

use super::dice::{log_uniform, normal};

/// Step of the integration, s.
const HEAT_STEP_S: f64 = 1.0;
/// Steps between kept temperatures.
pub const KEPT_EVERY: usize = 20;
/// Time between kept temperatures, s.
pub const KEPT_S: f64 = HEAT_STEP_S * KEPT_EVERY as f64;
/// Layers of a wall.
const LAYERS: usize = 10;
/// Masses: front and rear bearing, housing, column, bed, nut.
const MASSES: usize = 6;

/// What has a temperature.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Node {
    /// Front bearing of the spindle.
    Front,
    /// Its rear bearing.
    Rear,
    /// Column.
    Column,
    /// Bed.
    Bed,
    /// Nut of the logged axis.
    Nut,
    /// Air of the room.
    Room,
}

/// Heat over time: shares of full power of spindle and axis, from 0 to 1, in every step.
pub struct Load {
    /// Of the spindle.
    pub spindle: Vec<f64>,
    /// Of the axis.
    pub axis: Vec<f64>,
}

/// A course of temperatures, kept every [`KEPT_S`].
pub struct Course {
    masses: Vec<[f64; MASSES]>,
    room: Vec<f64>,
}

impl Course {
    /// Integrates a machine of drawn masses, which begins settled.
    pub fn of(random: &mut Pcg64Mcg, load: &Load) -> Self {
        let room = room(random, load.spindle.len());
        let capacity = [
            random.random_range(1500.0..5000.0),
            random.random_range(1500.0..5000.0),
            random.random_range(15e3..50e3),
            random.random_range(40e3..150e3),
            random.random_range(150e3..400e3),
            random.random_range(1000.0..5000.0),
        ];
        let to_housing: [f64; 2] = [
            random.random_range(3.0..12.0),
            random.random_range(3.0..12.0),
        ];
        let on: [f64; 2] = [
            random.random_range(2.0..12.0),
            random.random_range(5.0..25.0),
        ];
        let lost = [
            1.0,
            1.0,
            random.random_range(4.0..15.0),
            12.0,
            40.0,
            random.random_range(0.5..3.0),
        ];
        let watt: [f64; 3] = [
            random.random_range(40.0..180.0),
            random.random_range(40.0..180.0),
            random.random_range(10.0..50.0),
        ];
        let mut heat = [room[0]; MASSES];
        let mut course = Self {
            masses: vec![],
            room: vec![],
        };
        for (step, air) in room.iter().enumerate() {
            if step % KEPT_EVERY == 0 {
                course.masses.push(heat);
                course.room.push(*air);
            }
            let [front, rear, housing, column, bed, nut] = heat;
            let flows = [
                to_housing[0] * (front - housing),
                to_housing[1] * (rear - housing),
                on[0] * (housing - column),
                on[1] * (column - bed),
            ];
            let gains = [
                watt[0] * load.spindle[step] - flows[0],
                watt[1] * load.spindle[step] - flows[1],
                flows[0] + flows[1] - flows[2],
                flows[2] - flows[3],
                flows[3],
                watt[2] * load.axis[step] - 0.5 * (nut - bed),
            ];
            for k in 0..MASSES {
                heat[k] += HEAT_STEP_S * (gains[k] - lost[k] * (heat[k] - air)) / capacity[k];
            }
        }
        course
    }

    /// Temperatures of a node, every [`KEPT_S`].
    pub fn at(&self, node: Node) -> Vec<f64> {
        let of = |k: usize| self.masses.iter().map(|heat| heat[k]).collect();
        match node {
            Node::Front => of(0),
            Node::Rear => of(1),
            Node::Column => of(3),
            Node::Bed => of(4),
            Node::Nut => of(5),
            Node::Room => self.room.clone(),
        }
    }
}

/// Air of the room in every step.
fn room(random: &mut Pcg64Mcg, steps: usize) -> Vec<f64> {
    let (mean, day) = (
        random.random_range(18.0..24.0),
        random.random_range(0.2..1.5),
    );
    let begins = random.random_range(0.0..1.0);
    let swing = random.random_range(0.0..0.4);
    let swing_s = random.random_range(900.0..3600.0);
    let mut wander = 0.0;
    let of = |step: usize| {
        let at_s = step as f64 * HEAT_STEP_S;
        if step.is_multiple_of(60) {
            wander = 0.998 * wander + 0.02 * normal(random);
        }
        let cycle = (at_s / swing_s).fract();
        // Heating up is faster than cooling down.
        let tooth = if cycle < 0.3 {
            cycle / 0.3
        } else {
            (1.0 - cycle) / 0.7
        };
        mean + day * (TAU * (at_s / 86_400.0 + begins)).sin() + swing * (tooth - 0.5) + wander
    };
    (0..steps).map(of).collect()
}

/// What is behind a face: a wall in layers, or two masses in a row.
#[derive(Clone, Copy, Debug)]
pub enum Behind {
    /// A wall whose far side is insulated: time that heat takes through it, s.
    Wall(f64),
    /// Time constants of two masses, s.
    TwoMasses(f64, f64),
}

impl Behind {
    /// Draws one whose answer is late by `lag_s` on average.
    pub fn draw(random: &mut Pcg64Mcg, lag_s: f64) -> Self {
        // The mean of a wall of diffusion time T is late by T/3.
        let share = random.random_range(0.5..0.9);
        if random.random() {
            Self::Wall(3.0 * lag_s)
        } else {
            Self::TwoMasses(share * lag_s, (1.0 - share) * lag_s)
        }
    }

    /// The mean temperature behind a face, every [`KEPT_S`]; settled at the beginning.
    pub fn mean(self, face: &[f64]) -> Vec<f64> {
        let mut layers = [face.first().copied().unwrap_or_default(); LAYERS];
        // Explicit steps are stable up to half of the time that a layer takes.
        let fastest_s = match self {
            Self::Wall(time_s) => 0.4 * time_s / (LAYERS * LAYERS) as f64,
            Self::TwoMasses(a, b) => 0.2 * a.min(b),
        };
        let steps = (KEPT_S / fastest_s).ceil().max(1.0);
        let mut found = vec![];
        for value in face {
            found.push(match self {
                Self::Wall(_) => layers.iter().sum::<f64>() / LAYERS as f64,
                Self::TwoMasses(..) => layers[1],
            });
            for _ in 0..steps as usize {
                self.step(&mut layers, *value, KEPT_S / steps);
            }
        }
        found
    }

    fn step(self, layers: &mut [f64; LAYERS], face: f64, step_s: f64) {
        match self {
            Self::Wall(time_s) => {
                let share = step_s * (LAYERS * LAYERS) as f64 / time_s;
                let before = *layers;
                for k in 0..LAYERS {
                    // The face lies half a layer before the first.
                    let from = if k == 0 {
                        2.0 * (face - before[0])
                    } else {
                        before[k - 1] - before[k]
                    };
                    let on = before.get(k + 1).map_or(0.0, |next| next - before[k]);
                    layers[k] += share * (from + on);
                }
            }
            Self::TwoMasses(first_s, second_s) => {
                let first = layers[0];
                layers[0] += step_s / first_s * (face - first);
                layers[1] += step_s / second_s * (first - layers[1]);
            }
        }
    }
}

/// A lag of first order, settled at the beginning, every [`KEPT_S`].
pub fn lagged(face: &[f64], lag_s: f64) -> Vec<f64> {
    let keeps = if lag_s > 0.0 {
        (-KEPT_S / lag_s).exp()
    } else {
        0.0
    };
    let mut behind = face.first().copied().unwrap_or_default();
    let mut before = behind;
    let of = |value: &f64| {
        let between = if lag_s > 0.0 {
            0.5 * (before + value)
        } else {
            *value
        };
        behind = keeps * behind + (1.0 - keeps) * between;
        before = *value;
        behind
    };
    face.iter().map(of).collect()
}

/// A load of blocks of drawn power with pauses.
pub fn blocks(random: &mut Pcg64Mcg, steps: usize, block_s: [f64; 2]) -> Vec<f64> {
    let mut load = vec![];
    while load.len() < steps {
        let length = log_uniform(random, block_s) as usize + 1;
        let is_pause = random.random::<f64>() < 0.25;
        let power = if is_pause {
            0.0
        } else {
            random.random_range(0.4..1.0)
        };
        load.extend(std::iter::repeat_n(power, length));
    }
    load.truncate(steps);
    load
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn what_lies_behind_a_face_is_late_by_the_drawn_time_on_average() {
        let mut random = Pcg64Mcg::seed_from_u64(4);
        for _ in 0..6 {
            let mut face = vec![1.0; 4000];
            face[0] = 0.0;
            let mean = Behind::draw(&mut random, 1800.0).mean(&face);
            let late_s: f64 = mean.iter().map(|value| KEPT_S * (1.0 - value)).sum();
            assert!((late_s / 1800.0 - 1.0).abs() < 0.05, "{late_s}");
        }
    }

    #[test]
    fn a_machine_without_a_load_stays_near_its_room() {
        let load = Load {
            spindle: vec![0.0; 7200],
            axis: vec![0.0; 7200],
        };
        let course = Course::of(&mut Pcg64Mcg::seed_from_u64(2), &load);
        for node in [Node::Front, Node::Column, Node::Bed, Node::Nut] {
            let own = course.at(node);
            let off = own.iter().zip(&course.room).map(|(a, b)| (a - b).abs());
            assert!(off.fold(0.0, f64::max) < 3.0, "{node:?}");
        }
    }
}
