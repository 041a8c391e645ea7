//! The plant of a scenario taken along the recorded motion of its motors, so that it is as warm as the machine was.
//!
//! A bag holds nothing of the truth. But what rubs and what the drives push follows from how the motors moved, and that is recorded: a
//! plant of the same file, whose drives follow the recorded positions, has the same heat in its screws and castings.
//! A clone of it, put to rest, then tells what the geometry was at that time.

use fake_cnc::Plant;
use metrology::sample::AxisState;
use metrology::stamp::{Host, Span, Stamp};
use metrology::{Axis, PerAxis};

/// Step of the drives.
const PERIOD: Span = Span::from_nanos(1_000_000);
/// Of the loop that makes the drives follow: position, 1/s.
const POSITION_PER_S: f64 = 60.0;
/// Velocity, 1/s.
const VELOCITY_PER_S: f64 = 300.0;

/// A plant and how far it has been taken.
pub struct Shadow {
    plant: Plant,
    at: Stamp<Host>,
    motor: PerAxis<f64>,
}

impl Shadow {
    /// At rest where the record begins.
    pub fn new(mut plant: Plant, first: &AxisState) -> Self {
        plant.settle_at(&first.motor);
        Self {
            plant,
            at: first.received_at,
            motor: first.motor,
        }
    }

    /// Takes the plant along to the next recorded state.
    pub fn follow(&mut self, state: &AxisState) {
        let (from, whole_s) = (self.motor, (state.received_at - self.at).as_secs_f64());
        let period_s = PERIOD.as_secs_f64();
        let steps = (whole_s / period_s).round();
        for k in 1..=steps as u64 {
            let share = k as f64 / steps;
            let feedback = self.plant.feedback();
            let demand = PerAxis::from_fn(|axis| {
                let wanted = from[axis] + share * (state.motor[axis] - from[axis]);
                let speed = (state.motor[axis] - from[axis]) / whole_s;
                let towards = speed + POSITION_PER_S * (wanted - feedback.motor[axis]);
                VELOCITY_PER_S * (towards - feedback.velocity[axis])
            });
            self.plant.step(&demand, 0.0, PERIOD);
        }
        if steps > 0.0 {
            self.at = state.received_at;
            self.motor = state.motor;
        }
    }

    /// How far its motors are from the recorded ones at most, mm.
    pub fn apart_mm(&self) -> f64 {
        let motor = self.plant.feedback().motor;
        let apart = Axis::LINEAR.map(|axis| (motor[axis] - self.motor[axis]).abs());
        apart.into_iter().fold(0.0, f64::max)
    }

    /// The plant as it is now.
    pub fn plant(&self) -> Plant {
        self.plant.clone()
    }
}
