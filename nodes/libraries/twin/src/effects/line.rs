//! The straight lines that curves over a travel must not be.
//!
//! A positioning error's curve and a straightness are what is left beside a line over the travel: its slope is
//! another matter (a scale, a squareness). Where only a part of the travel was read, a curve may be a line there:
//!
//! ```text
//!   E = s x,   x the share of the half travel                             (1)
//! ```

use metrology::{Axis, ErrorComponent};

use super::form::Travel;
use super::{Effect, Kind, Scene, Target, lever};
use crate::Response;

/// s of (1), mm.
const SLOPE_MM: f64 = 1e-3;

/// Line (1) in the direction of a kind of curve; none for what is no curve beside a line.
#[must_use]
pub fn line(kind: &Kind, target: &Target) -> Option<Box<dyn Effect>> {
    match kind.id {
        "pitch_error" => Some(Box::new(Along(target.axis()))),
        "straightness" => Some(Box::new(Across(target.component()))),
        _ => None,
    }
}

struct Along(Axis);

impl Effect for Along {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let travel = Travel::of(scene, self.0);
        let position = &scene.run.motion.position[self.0];
        for (sum, here) in response.drive[self.0].iter_mut().zip(position) {
            *sum += SLOPE_MM * travel.share(*here); // (1)
        }
    }
}

struct Across(ErrorComponent);

impl Effect for Across {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let travel = Travel::of(scene, self.0.of);
        let position = &scene.run.motion.position[self.0.of];
        lever::add(scene, self.0, response, |tick| {
            SLOPE_MM * travel.share(position[tick]) // (1)
        });
    }
}
