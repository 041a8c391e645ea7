//! Misalignment: the beam of a length reference leans against the motion, and lengths come out too short.
//!
//! # Model
//!
//! With L the displacement from the run's first position and theta the angle between beam and motion:
//!
//! ```text
//!   d = L (cos theta - 1) = -(theta2 / 2) L                               (1)
//!   d += c L2                                                             (2)
//! ```
//!
//! (2) is the wider form: the motion itself is curved, so that the angle changes along it.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | theta2 / 2 | `cosine_um_per_m`; 0.5 µm/m for 1 mrad | µm/m |
//! | c | `free_curve_um_per_m2` | µm/m2 |
//!
//! # Holds when
//! The beam still meets the receiver at the end of the travel: at 3 mrad (4.5 µm/m) it is off by twice 3 mm in a metre,
//! and nobody measures with more. The interferometer measures along its own beam. Its sign and its change with each set-up are what tells it
//! from `length_wavelength` and from a scale error of the axis.
//!
//! # Agreement
//! `val_length_misalignment_projected`: 0.5, 1 and 3 mrad over 500 mm by the cosine itself, to 2e-9 mm.
//!
//! # References
//! \[1\] ISO 230-1:2012, 8 (linear positioning measurement: cosine error; from memory).

use super::length_wavelength::way_mm;
use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::twin::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "length_misalignment",
    title: "misalignment of the length reference",
    targets: Targets::Machine,
    parameters: &[Parameter::size("cosine_um_per_m", 5.0, 0.5)],
    free: &[Parameter::amplitude("free_curve_um_per_m2", 100.0, 2.0)],
    moment: Moment::Mean,
    needs: "readings of the length reference at two places, with two set-ups",
    build: |_, values| {
        Box::new(LengthMisalignment {
            cosine_per_mm: values[0] * 1e-6,
            curve_per_mm2: values[1] * 1e-9,
        })
    },
};

struct LengthMisalignment {
    cosine_per_mm: f64,
    curve_per_mm2: f64,
}

impl Effect for LengthMisalignment {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let ways = way_mm(scene.run);
        for (sum, way_mm) in response.length_reading_mm.iter_mut().zip(ways) {
            *sum += way_mm * (self.curve_per_mm2 * way_mm - self.cosine_per_mm); // (1), (2)
        }
    }
}
