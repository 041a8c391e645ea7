//! Homing shift: after a reference run the axis counts from another place.
//!
//! # Model
//!
//! ```text
//!   slide - motor = d for t > t_c, else 0                                 (1)
//! ```
//!
//! What the control believes is where its encoder counts; the slide is elsewhere by d.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | d | `shift_um` | µm |
//! | t_c | `at_min`, since the session began | min |
//!
//! # Holds when
//! The axis was homed once during the session, and the instrument was not set up anew with it.
//!
//! No wider form: a reference run sets a counter once, by one number.
//!
//! # Agreement
//! `val_two_reference_runs_on_a_polled_switch`: of counters that a control sets which asks its switch once a millisecond, to
//! 1e-9 mm. At 1.5 mm/s such runs differ by 0.61 µm (1 standard deviation).
//!
//! # References
//! \[1\] LinuxCNC documentation, Homing Configuration (switch, latch velocity, encoder index).
//! \[2\] JCGM 100:2008 (GUM), 4.3.7 (rectangular distribution).

use metrology::Axis;

use super::coolant::EVENT_GRID_MIN;
use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "homing_shift",
    title: "shift of the reference point",
    targets: Targets::LinearAxes,
    parameters: &[
        Parameter::amplitude("shift_um", 500.0, 3.0),
        Parameter::shape("at_min", [0.0, 1440.0], 20.0, EVENT_GRID_MIN),
    ],
    free: &[],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "measurements along the axis before and after a reference run, without a new set-up between them",
    build: |target, values| {
        Box::new(HomingShift {
            axis: target.axis(),
            shift_mm: values[0] * 1e-3,
            at_s: values[1] * 60.0,
        })
    },
};

struct HomingShift {
    axis: Axis,
    shift_mm: f64,
    at_s: f64,
}

impl Effect for HomingShift {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let times = &scene.run.motion.time_s;
        let first = times.partition_point(|t| *t <= self.at_s);
        if first < times.len() {
            for sum in response.drive[self.axis].iter_mut().skip(first) {
                *sum += self.shift_mm; // (1)
            }
        }
    }
}
