//! Backlash of a rotary axis: its table stays behind the motor after a reversal, by play or by a gear that yields to friction.
//!
//! # Model
//!
//! ```text
//!   c_t = c_m + d,   d held until the motor has taken up the play:  -w/2 <= d <= w/2    (1)
//!   E = s d times the lever of `volumetric::sensitivity`, (3) there                     (2)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | c_m, c_t | angle of the motor over its gear, of the table | rad |
//! | s | 1 where a positive angle turns the tool right-handed as seen from the workpiece, else -1 | 1 |
//! | w | `width_urad`: -B, B the reversal error of \[1\]; negative where an encoder at the table was told too large a play | µrad |
//!
//! # Holds when
//! The table stays where its drive leaves it: bearings that are clamped or have some friction, no weight that pulls at it.
//!
//! A run begins in the middle of the play.
//!
//! No wider form: a play is one number, and one that differs over the turn is not modelled.
//!
//! # Agreement
//! `val_a_gear_that_yields_to_a_dry_bearing`: 2 % of 14 µrad, against a spring and a friction that are stepped finely.
//!
//! # References
//! \[1\] ISO 230-2:2014, clause 3 (reversal error of a position).

use metrology::{Axis, ErrorComponent};

use super::backlash::held;
use super::{Effect, Kind, Moment, Parameter, Scene, Targets, lever};
use crate::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "rotary_backlash",
    title: "backlash of a rotary axis",
    targets: Targets::RotaryAxes,
    parameters: &[Parameter::amplitude("width_urad", 500.0, 10.0)],
    free: &[],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "readings at one position of the rotary axis that is come to from both sides",
    build: |target, values| {
        Box::new(RotaryBacklash {
            axis: target.axis(),
            width_rad: values[0] * 1e-6,
        })
    },
};

struct RotaryBacklash {
    axis: Axis,
    width_rad: f64,
}

impl Effect for RotaryBacklash {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let turn = ErrorComponent {
            direction: self.axis,
            of: self.axis,
            is_location: false,
        };
        let position = &scene.run.motion.position[self.axis];
        let behind = held(position, 0.5 * self.width_rad.abs()); // (1)
        let sign = self.width_rad.signum() * scene.kinematics.tool_sense(self.axis);
        lever::add(scene, turn, response, |tick| sign * behind[tick]);
    }
}
