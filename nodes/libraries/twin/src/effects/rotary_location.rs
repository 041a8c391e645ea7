//! Location of a rotary axis: its line is displaced or tilted against where the machine file has it.
//!
//! # Model
//!
//! ```text
//!   E = e times the lever of `volumetric::sensitivity`, (4) there         (1)
//! ```
//!
//! For a table C displaced by e: E = (R(C) - 1) e, nothing at C = 0 and twice e after half a turn.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | e | `size_um_urad`: µm for X0C and the like, µrad for A0C and the like | µm, µrad |
//!
//! # Holds when
//! Angles are small. What changes while the axis turns is `rotary_motion`.
//!
//! No wider form: a location is one number for each direction, and what changes over a turn is `rotary_motion`.
//!
//! # Agreement
//! `val_a_table_that_turns_about_another_line`: against rotation matrices 1e-13 µm for 20 µm, 1e-4 µm for 20 µrad.
//!
//! # References
//! \[1\] ISO 230-7:2015, clause 3 (axis average line). \[2\] ISO 230-1:2012, clause 3 (position and orientation errors of
//! an axis of rotation).

use metrology::ErrorComponent;

use super::{Effect, Kind, Moment, Parameter, Scene, Targets, lever};
use crate::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "rotary_location",
    title: "location of a rotary axis",
    targets: Targets::RotaryLocations,
    parameters: &[Parameter::amplitude("size_um_urad", 200.0, 15.0)],
    free: &[],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "readings at two positions of the rotary axis or more",
    build: |target, values| {
        Box::new(RotaryLocation {
            component: target.component(),
            size: values[0] * lever::per_micro(target.component()),
        })
    },
};

struct RotaryLocation {
    component: ErrorComponent,
    /// mm or rad.
    size: f64,
}

impl Effect for RotaryLocation {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        lever::add(scene, self.component, response, |_| self.size); // (1)
    }
}
