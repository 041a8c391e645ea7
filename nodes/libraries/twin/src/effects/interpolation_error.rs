//! Interpolation error: an encoder divides its signal period unevenly (sub-divisional error, SDE).
//!
//! # Model
//!
//! ```text
//!   t = 2 pi u / P,   E = a sin t + b cos t + a2 sin 2t + b2 cos 2t       (1)
//!   x = e - E,   e = the error of a loop whose command is -E              (2)
//! ```
//!
//! u is where the encoder really is, E what it reads beyond that, x how far the axis moves off because its loop follows the
//! encoder. The encoder is the one that closes the loop (`position_feedback` of the machine file). A scale closes the
//! position loop alone, which is (2) without feed-forward: wholly at a stand, less the quicker the signal periods pass. A
//! motor's encoder closes the velocity loop as well, which is (2) with the command's velocity fed forward: as far as the
//! velocity loop follows.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | P | `period_um`, of the signal | µm |
//! | a, b | `sin_um`, `cos_um`: an offset of one of the two signals | µm |
//! | a2, b2 | `free_sin2_um`, `free_cos2_um`: unequal amplitudes, or a phase that is not 90 degrees | µm |
//!
//! # Holds when
//! Positions are known to a small part of P. Where more than thirty periods pass between two readings of the axes' positions,
//! a velocity loop and a loop that a scale closes are taken to follow none of them. What the filter of a measured velocity
//! (`filter_ms`) does to E is left out: 13 % of E for 0.25 ms at 150 periods a second. An encoder that closes no loop is
//! no part of this.
//!
//! # Agreement
//! `val_the_arctangent_of_two_unequal_signals`: 3 % of the error, for 2 % of offset and 3 % of inequality.
//! `val_a_loop_that_follows_a_scale_integrated_finely`: 4 % of the error, from rest to fifty periods a second.
//! `val_a_loop_on_thinned_ticks_integrated_finely`: 5 % of the error, with many periods between two recorded positions and through
//! thirty; 25 % where a motor's encoder turns round within 2 ms.
//!
//! # References
//! \[1\] P. L. M. Heydemann, Applied Optics 20(19), 1981, doi:10.1364/AO.20.003382 (errors of quadrature
//! signals).

use std::f64::consts::TAU;

use metrology::Axis;
use nalgebra::Complex;

use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::Response;
use crate::following::{Follower, Wave, within};
use machine::file::{AxisEntry, PositionFeedback};

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "interpolation_error",
    title: "interpolation error of an encoder",
    targets: Targets::LinearAxes,
    parameters: &[
        Parameter::amplitude("sin_um", 5.0, 0.1),
        Parameter::amplitude("cos_um", 5.0, 0.1),
        Parameter::shape(
            "period_um",
            [0.5, 2000.0],
            20.0,
            &[2.0, 4.0, 10.0, 16.0, 20.0, 40.0, 100.0],
        ),
    ],
    free: &[
        Parameter::amplitude("free_sin2_um", 5.0, 0.05),
        Parameter::amplitude("free_cos2_um", 5.0, 0.05),
    ],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "slow motion or stands that differ by parts of the signal period",
    build: |target, values| {
        Box::new(InterpolationError {
            axis: target.axis(),
            first_mm: [0, 1].map(|k| values[k] * 1e-3),
            rad_per_mm: TAU / (values[2] * 1e-3),
            second_mm: [3, 4].map(|k| values[k] * 1e-3),
        })
    },
};

/// What passes of a signal period between two ticks where the command may as well go evenly, rad.
const STEP_RAD: f64 = 0.4;

/// Above this, thirty periods, the loop follows nothing, rad.
const MOST_RAD: f64 = 192.0;

struct InterpolationError {
    axis: Axis,
    first_mm: [f64; 2],
    rad_per_mm: f64,
    second_mm: [f64; 2],
}

impl InterpolationError {
    /// (1).
    fn read_mm(&self, position_mm: f64) -> f64 {
        let (sin, cos) = (self.rad_per_mm * position_mm).sin_cos();
        self.first_mm[0] * sin
            + self.first_mm[1] * cos
            + self.second_mm[0] * 2.0 * sin * cos
            + self.second_mm[1] * (1.0 - 2.0 * sin * sin)
    }

    /// -E from a position on, the phase t going on by so many rad/s.
    fn waves(&self, from_mm: f64, per_s: f64) -> [Wave; 2] {
        let phase = Complex::cis(self.rad_per_mm * from_mm);
        let wave = |[of_sin, of_cos]: [f64; 2], at: Complex<f64>, per_s| Wave {
            at: at * Complex::new(-of_cos, of_sin),
            per_s,
        };
        [
            wave(self.first_mm, phase, per_s),
            wave(self.second_mm, phase * phase, 2.0 * per_s),
        ]
    }
}

/// A loop whose command is an error that is read.
struct Misled {
    follower: Follower,
    command_mm: f64,
}

impl Misled {
    /// The command goes evenly to another place.
    fn to(&mut self, command_mm: f64, step_s: f64) {
        let velocity = (command_mm - self.command_mm) / step_s;
        self.follower.advance(velocity, 0.0, step_s);
        self.command_mm = command_mm;
    }

    /// The command goes to another place on waves, from where it is; those of no size are none.
    fn by_waves(&mut self, waves: &[Wave; 2], command_mm: f64, step_s: f64) {
        let has_size = |wave: &Wave| wave.at.norm_sqr() > 0.0;
        let of_size = match waves.each_ref().map(has_size) {
            [true, true] => &waves[..],
            [true, false] => &waves[..1],
            [false, _] => &waves[1..],
        };
        let begin_mm: f64 = of_size.iter().map(|wave| wave.at.re).sum();
        let beside_mm = self.command_mm - begin_mm;
        self.follower.advance_by_waves(of_size, beside_mm, step_s);
        self.command_mm = command_mm;
    }

    /// How far the axis is off.
    fn off_mm(&self) -> f64 {
        self.command_mm + self.follower.error() // (2)
    }
}

impl Effect for InterpolationError {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let Some(entry) = scene.machine.axes.get(&self.axis) else {
            return;
        };
        let motion = &scene.run.motion;
        let (commanded, axis) = (&motion.position[self.axis], self.axis);
        let Some(first) = commanded.first() else {
            return;
        };
        let (by_scale, is_rigid) = match entry {
            AxisEntry::Linear(a) => {
                let by_scale = a.position_feedback == PositionFeedback::Scale;
                (by_scale, !by_scale && a.velocity_loop.is_none())
            }
            AxisEntry::Rotary(_) => return,
        };
        let mut nominal = Follower::new(entry, motion, axis);
        let mut before_mm = first + nominal.error();
        let mut read_mm = self.read_mm(before_mm);
        let mut misled = Misled {
            follower: Follower::at_rest(entry, if by_scale { 0.0 } else { 1.0 }),
            command_mm: -read_mm,
        };
        let readings = if by_scale {
            &mut response.scale_reading[axis]
        } else {
            &mut response.motor_reading[axis]
        };
        let sums = response.servo[axis].iter_mut().zip(readings.iter_mut());
        for ((tick, position), (servo, reading)) in commanded.iter().enumerate().zip(sums) {
            if tick > 0 {
                let step_s = motion.time_s[tick] - motion.time_s[tick - 1];
                let (begin, change) = within(motion, axis, tick, step_s);
                nominal.advance(begin, change, step_s);
                let way_mm = position + nominal.error() - before_mm;
                let turned_rad = (way_mm * self.rad_per_mm).abs();
                read_mm = self.read_mm(before_mm + way_mm);
                let to_mm = -read_mm;
                // An ideal velocity loop follows its encoder at any speed.
                if is_rigid || turned_rad <= STEP_RAD {
                    misled.to(to_mm, step_s);
                } else if turned_rad > MOST_RAD {
                    misled.to(0.0, step_s);
                } else {
                    let per_s = way_mm * self.rad_per_mm / step_s;
                    misled.by_waves(&self.waves(before_mm, per_s), to_mm, step_s);
                }
                before_mm += way_mm;
            }
            *servo += misled.off_mm();
            *reading += read_mm;
        }
    }
}
