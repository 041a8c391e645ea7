//! A machine of two axes in the time domain, from which the tests take their traces.
//!
//! Nothing here knows a regressor: servos are differential equations stepped by Euler's method, play
//! is an operator with memory, friction is LuGre's bristles, errors of screws and guides are functions
//! of where the table is, squareness is a frame whose axes are not perpendicular, and what is measured
//! is the length of a vector.

use std::f64::consts::TAU;

use iso230::breakdown::{
    CircularPlane, CircularRecording, CircularSample, CircularSense, ReferenceLength,
};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

/// Step of the simulation, s.
const STEP_S: f64 = 1e-4;
/// Samples a turn.
pub const SAMPLES: usize = 1200;
/// Turns before the recording begins, and beyond the full one.
const LEAD_TURNS: f64 = 0.4;
const OVERSHOOT_TURNS: f64 = 0.05;

/// Friction of one axis per unit of mass, and the servo that fights it.
#[derive(Clone, Copy, Debug)]
pub struct Friction {
    pub coulomb_mm_s2: f64,
    pub bristle_per_s2: f64,
}

/// Faults of one axis.
#[derive(Clone, Copy, Debug, Default)]
pub struct Axis {
    /// Time constant of the servo, s; 0: none.
    pub lag_s: f64,
    pub friction: Option<Friction>,
    /// Play at the middle, mm, and its change along the axis, mm/mm.
    pub play_mm: f64,
    pub play_slope: f64,
    /// Jump forward that the control adds at reversal, mm.
    pub compensation_mm: f64,
    pub scale: f64,
    /// Amplitude mm, period mm, phase at position 0 rad.
    pub screw: Option<(f64, f64, f64)>,
    /// Quadratic pitch error, 1/mm, from the centre.
    pub stretch_per_mm: f64,
    /// Bow of the guide, 1/mm, from the centre.
    pub bow_per_mm: f64,
    /// Sideways shift between moving back and forth, mm.
    pub lateral_mm: f64,
    /// Amplitude mm, frequency Hz.
    pub vibration: Option<(f64, f64)>,
}

/// Faults of the machine and of the measurement.
#[derive(Clone, Copy, Debug, Default)]
pub struct Machine {
    pub axes: [Axis; 2],
    /// Angle between the positive directions less 90°.
    pub squareness_rad: f64,
    pub drift_mm_s: f64,
    pub noise_mm: f64,
    pub setting_up_mm: [f64; 2],
    pub reference_mm: f64,
}

/// How a circle is driven.
#[derive(Clone, Copy, Debug)]
pub struct Drive {
    pub plane: CircularPlane,
    pub radius_mm: f64,
    pub feed_mm_s: f64,
    pub sense: CircularSense,
    pub reference: ReferenceLength,
    pub centre_mm: [f64; 2],
    pub zero_id: u32,
    pub seed: u64,
}

pub const EXACT: ReferenceLength = ReferenceLength::Calibrated {
    standard_uncertainty_mm: 0.0,
};

/// A circle in XY about (120, 80).
pub fn drive(radius_mm: f64, feed_mm_s: f64, sense: CircularSense) -> Drive {
    Drive {
        plane: CircularPlane::Xy,
        radius_mm,
        feed_mm_s,
        sense,
        reference: EXACT,
        centre_mm: [120.0, 80.0],
        zero_id: radius_mm as u32,
        seed: 1,
    }
}

/// Both senses, two feeds and two radii.
pub fn full_set() -> Vec<Drive> {
    use CircularSense::{Clockwise, CounterClockwise};
    let each = [(100.0, 50.0), (100.0, 20.0), (50.0, 20.0)];
    let both = |(r, f)| [CounterClockwise, Clockwise].map(|sense| drive(r, f, sense));
    each.into_iter().flat_map(both).collect()
}

/// One axis while it moves.
struct State {
    servo_mm: f64,
    command_mm: f64,
    speed_mm_s: f64,
    integral_mm: f64,
    bristle_mm: f64,
    table_mm: f64,
    direction: f64,
}

impl State {
    fn at(position_mm: f64, speed_mm_s: f64) -> Self {
        Self {
            servo_mm: position_mm,
            command_mm: position_mm,
            speed_mm_s,
            integral_mm: 0.0,
            bristle_mm: 0.0,
            table_mm: position_mm,
            direction: speed_mm_s.signum(),
        }
    }

    fn step(&mut self, axis: &Axis, command_mm: f64, command_mm_s: f64, centre_mm: f64) {
        match axis.friction {
            Some(friction) => self.pushed(friction, command_mm_s),
            None if axis.lag_s > 0.0 => {
                // The command of the step before: Euler's explicit method.
                self.servo_mm += STEP_S * (self.command_mm - self.servo_mm) / axis.lag_s;
            }
            None => self.servo_mm = command_mm,
        }
        self.command_mm = command_mm;
        let screw_mm = self.servo_mm + 0.5 * axis.compensation_mm * command_mm_s.signum();
        let half_mm = 0.5 * (axis.play_mm + axis.play_slope * (screw_mm - centre_mm));
        let before_mm = self.table_mm;
        self.table_mm = self.table_mm.clamp(screw_mm - half_mm, screw_mm + half_mm);
        let moved_mm = self.table_mm - before_mm;
        if moved_mm.abs() > 0.0 {
            self.direction = moved_mm.signum();
        }
    }

    /// Cascade of position and velocity loops with feed-forward, against LuGre friction.
    fn pushed(&mut self, friction: Friction, command_mm_s: f64) {
        const POSITION_GAIN_PER_S: f64 = 60.0;
        const VELOCITY_GAIN_PER_S: f64 = 300.0;
        const INTEGRAL_S: f64 = 0.015;
        // The bristles are stiff: ten steps of them in one of the servo.
        const FINE: u32 = 10;
        let fine_s = STEP_S / f64::from(FINE);
        let wanted_mm_s = command_mm_s + POSITION_GAIN_PER_S * (self.command_mm - self.servo_mm);
        for _ in 0..FINE {
            let error_mm_s = wanted_mm_s - self.speed_mm_s;
            self.integral_mm += fine_s * error_mm_s;
            let push = VELOCITY_GAIN_PER_S * (error_mm_s + self.integral_mm / INTEGRAL_S);
            let yielding = self.speed_mm_s.abs() * friction.bristle_per_s2 / friction.coulomb_mm_s2;
            let bristle_mm_s = self.speed_mm_s - yielding * self.bristle_mm;
            self.bristle_mm += fine_s * bristle_mm_s;
            let resistance = friction.bristle_per_s2 * self.bristle_mm;
            self.speed_mm_s += fine_s * (push - resistance);
            self.servo_mm += fine_s * self.speed_mm_s;
        }
    }
}

impl Machine {
    /// Drives and measures one circle.
    pub fn measure(&self, drive: &Drive) -> CircularRecording {
        self.measure_densely(drive, SAMPLES)
    }

    /// Drives and measures one circle with so many samples a turn.
    pub fn measure_densely(&self, drive: &Drive, samples: usize) -> CircularRecording {
        let sense = drive.sense.sign();
        let omega = sense * drive.feed_mm_s / drive.radius_mm;
        let turn_s = TAU / omega.abs();
        let start_rad = 0.3 - omega * LEAD_TURNS * turn_s;
        let command = |t: f64| {
            let (sin, cos) = (start_rad + omega * t).sin_cos();
            let (r, v) = (drive.radius_mm, drive.radius_mm * omega);
            let at = [drive.centre_mm[0] + r * cos, drive.centre_mm[1] + r * sin];
            (at, [-v * sin, v * cos])
        };
        let (at, speed) = command(0.0);
        let mut states = [0, 1].map(|a| State::at(at[a], speed[a]));
        let steps = (turn_s * (LEAD_TURNS + 1.0 + OVERSHOOT_TURNS) / STEP_S) as usize;
        let lead = (turn_s * LEAD_TURNS / STEP_S) as usize;
        let every = ((turn_s / STEP_S) as usize / samples).max(1);
        let mut rng = Pcg64Mcg::seed_from_u64(drive.seed);
        let mut samples = Vec::new();
        for step in 1..steps {
            let time_s = step as f64 * STEP_S;
            let (at, speed) = command(time_s);
            for a in [0, 1] {
                states[a].step(&self.axes[a], at[a], speed[a], drive.centre_mm[a]);
            }
            if step >= lead && (step - lead).is_multiple_of(every) {
                let recorded_s = time_s - lead as f64 * STEP_S;
                let noise: f64 = StandardNormal.sample(&mut rng);
                samples.push(self.sample(drive, &states, recorded_s, noise));
            }
        }
        CircularRecording {
            plane: drive.plane,
            centre_mm: drive.centre_mm,
            radius_mm: drive.radius_mm,
            feed_mm_s: drive.feed_mm_s,
            sense: drive.sense,
            setup_id: 1,
            zero_id: drive.zero_id,
            reference: drive.reference,
            samples,
        }
    }

    fn sample(
        &self,
        drive: &Drive,
        states: &[State; 2],
        time_s: f64,
        noise: f64,
    ) -> CircularSample {
        let mut along = [0.0; 2];
        let mut across = [0.0; 2];
        for a in [0, 1] {
            let (axis, table_mm) = (&self.axes[a], states[a].table_mm);
            let local_mm = table_mm - drive.centre_mm[a];
            let screw = axis.screw.map_or(0.0, |(amplitude, period, phase)| {
                amplitude * (TAU * table_mm / period + phase).sin()
            });
            let shake = axis.vibration.map_or(0.0, |(amplitude, hz)| {
                amplitude * (TAU * hz * time_s + 0.7).sin()
            });
            along[a] = local_mm * (1.0 + axis.scale)
                + axis.stretch_per_mm * local_mm.powi(2)
                + screw
                + shake;
            // The first axis goes towards the second one's plus while it moves back, the second one
            // towards the first one's plus while it moves forth: counter-clockwise is outside.
            let side = if a == 0 { -1.0 } else { 1.0 };
            across[a] = axis.bow_per_mm * local_mm.powi(2)
                + side * 0.5 * axis.lateral_mm * states[a].direction;
        }
        let (sin, cos) = self.squareness_rad.sin_cos();
        let [x, y] = [along[0] + across[1], along[1] + across[0]];
        let point_mm = [
            x - y * sin + self.setting_up_mm[0],
            y * cos + self.setting_up_mm[1],
        ];
        let mut sample = CircularSample::from_point(point_mm, drive.radius_mm, time_s);
        sample.radial_deviation_mm +=
            self.reference_mm + self.drift_mm_s * time_s + self.noise_mm * noise;
        sample
    }

    /// Drives several circles, each with noise of its own.
    pub fn measure_all(&self, drives: &[Drive]) -> Vec<CircularRecording> {
        let numbered = drives.iter().zip(1..);
        numbered
            .map(|(drive, seed)| {
                self.measure(&Drive {
                    seed: drive.seed * 1000 + seed,
                    ..*drive
                })
            })
            .collect()
    }
}

/// A machine with 0.1 µm noise, set up 3 µm off, and no fault.
pub fn faultless() -> Machine {
    Machine {
        noise_mm: 1e-4,
        setting_up_mm: [0.002, -0.002],
        ..Machine::default()
    }
}

/// A faultless machine but for one axis.
pub fn with_axis(at: usize, axis: Axis) -> Machine {
    let mut machine = faultless();
    machine.axes[at] = axis;
    machine
}
