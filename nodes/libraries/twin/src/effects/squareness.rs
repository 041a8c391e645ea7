//! Squareness: two axes do not stand at a right angle to each other.
//!
//! # Model
//!
//! The second axis of the pair is turned as a whole, by the location error EC0Y for XY, EB0Z for XZ, EA0Z
//! for YZ, right-handed about the third direction:
//!
//! ```text
//!   XY: E_x = -a y      XZ: E_x = +a z      YZ: E_y = -a z                (1)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | a | `angle_urad` (µm per m) | µrad |
//!
//! # Holds when
//! Both axes are straight: what bends is `straightness`.
//!
//! No wider form: an angle between two lines is one number. What bends is `straightness`, what changes with the arm
//! `angular_error`.
//!
//! # Agreement
//! `val_axes_turned_by_rotation_matrices`: the second order, 7e-5 µm. `val_a_circle_becomes_an_ellipse_at_45_degrees`.
//!
//! # References
//! \[1\] ISO 230-1:2012, clause 3 (squareness error between axes of linear motion).

use metrology::{Axis, ErrorComponent};

use super::{Effect, Kind, Moment, Parameter, Scene, Target, Targets, lever};
use crate::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "squareness",
    title: "squareness",
    targets: Targets::LinearPairs,
    parameters: &[Parameter::amplitude("angle_urad", 500.0, 15.0)],
    free: &[],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "readings across one of the axes over the travel of the other",
    build: |target, values| Box::new(Squareness::new(&target, values)),
};

struct Squareness {
    component: ErrorComponent,
    angle_rad: f64,
}

impl Squareness {
    fn new(target: &Target, values: &[f64]) -> Self {
        let [y_to_x, z_to_x, z_to_y] = ErrorComponent::SQUARENESS;
        let component = match target.pair() {
            (Axis::X, Axis::Y) => y_to_x,
            (Axis::X, _) => z_to_x,
            _ => z_to_y,
        };
        Self {
            component,
            angle_rad: values[0] * 1e-6,
        }
    }
}

impl Effect for Squareness {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        lever::add(scene, self.component, response, |_| self.angle_rad); // (1)
    }
}
