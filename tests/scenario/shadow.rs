//! The plant of a scenario taken along the recorded motion of its motors, so that it is as warm as the machine was.
//!
//! A bag holds nothing of the truth. But what rubs and what the drives push follows from how the motors moved, and that is recorded: a
//! plant of the same file, whose drives follow the recorded positions, has the same heat in its screws and castings.
//! A clone of it, put to rest, then tells what the geometry was at that time.

use fake_cnc::Plant;
use metrology::PerAxis;
use metrology::sample::AxisState;
use metrology::stamp::{Host, Span, Stamp};
use nalgebra::Vector3;

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
    /// Of the commands: the last one, and its speed, mm and mm/s.
    commanded: [PerAxis<f64>; 2],
}

impl Shadow {
    /// At rest where the record begins.
    pub fn new(mut plant: Plant, first: &AxisState) -> Self {
        plant.settle_at(&first.motor);
        Self {
            plant,
            at: first.received_at,
            motor: first.motor,
            commanded: [first.commanded, PerAxis::default()],
        }
    }

    /// Takes the plant along to the next recorded state.
    pub fn follow(&mut self, state: &AxisState) {
        let (from, whole_s) = (self.motor, (state.received_at - self.at).as_secs_f64());
        let period_s = PERIOD.as_secs_f64();
        let steps = (whole_s / period_s).round();
        let speed = |now: PerAxis<f64>, before: PerAxis<f64>| {
            PerAxis::from_fn(|axis| (now[axis] - before[axis]) / whole_s)
        };
        let (speed_mm_s, [command, command_mm_s]) = (speed(state.motor, from), self.commanded);
        // The commands' acceleration: without it the loops swing beyond a stop, and friction keeps them there. The motors' own would
        // shake with the steps of their encoders, and heat the drives.
        let towards_mm_s = speed(state.commanded, command);
        let gain_mm_s2 = speed(towards_mm_s, command_mm_s);
        for k in 1..=steps as u64 {
            let share = k as f64 / steps;
            let feedback = self.plant.feedback();
            let demand = PerAxis::from_fn(|axis| {
                let wanted = from[axis] + share * (state.motor[axis] - from[axis]);
                let towards = speed_mm_s[axis] + POSITION_PER_S * (wanted - feedback.motor[axis]);
                gain_mm_s2[axis] + VELOCITY_PER_S * (towards - feedback.velocity[axis])
            });
            self.plant.step(&demand, 0.0, PERIOD);
        }
        if steps > 0.0 {
            self.at = state.received_at;
            self.motor = state.motor;
            self.commanded = [state.commanded, towards_mm_s];
        }
    }

    /// Recorded positions of the motors less its own, mm: at rest what friction keeps its loops short by, some 11 µm.
    pub fn short_mm(&self) -> Vector3<f64> {
        self.motor.xyz() - self.plant.feedback().motor.xyz()
    }

    /// How far its motors are from the recorded ones at most, mm.
    pub fn apart_mm(&self) -> f64 {
        self.short_mm().amax()
    }

    /// The plant as it is now.
    pub fn plant(&self) -> Plant {
        self.plant.clone()
    }
}
