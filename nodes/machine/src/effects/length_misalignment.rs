//! Misalignment: the beam of a length reference leans against the motion, and lengths come out too short.
//!
//! # Model
//!
//! A length reference is put up anew for every axis. With L the displacement along the axis it was put up for, from the
//! run's first position, and theta the angle between beam and motion:
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
//! and nobody measures with more. The interferometer measures along its own beam. That it is one axis' alone tells it from
//! `length_wavelength`, and that other instruments do not see it from a scale error of the axis. A set-up along a diagonal
//! is another one, and not modelled.
//!
//! # Agreement
//! `val_length_misalignment_of_a_returning_beam`: a beam traced through a corner cube, whose dot moves as in the examples of
//! the manual \[1\] (0.13 ppm and 0.3 ppm), to 1e-9 mm and to the manual's last digit.
//!
//! # References
//! \[1\] Hewlett-Packard, 5528A Laser Measurement System, User's Guide, section 6 (distance measurements: cosine error from
//! the motion of the returning beam).

use metrology::Axis;
use metrology::sample::TestKind;

use super::length_wavelength::way_mm;
use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::twin::{Channel, Response};

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "length_misalignment",
    title: "misalignment of the length reference",
    targets: Targets::LinearAxes,
    parameters: &[Parameter::size("cosine_um_per_m", 5.0, 0.5)],
    free: &[Parameter::amplitude("free_curve_um_per_m2", 100.0, 2.0)],
    moment: Moment::Mean,
    needs: "readings of the length reference at two places of the axis, and another instrument's or another axis'",
    build: |target, values| {
        Box::new(LengthMisalignment {
            axis: target.axis(),
            cosine_per_mm: values[0] * 1e-6,
            curve_per_mm2: values[1] * 1e-9,
        })
    },
};

struct LengthMisalignment {
    axis: Axis,
    cosine_per_mm: f64,
    curve_per_mm2: f64,
}

impl Effect for LengthMisalignment {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let own = Channel::Length(self.axis);
        let is_along = scene.run.segment.kind != TestKind::Diagonal
            && scene
                .run
                .readings
                .iter()
                .any(|reading| reading.channel == own);
        if !is_along {
            return;
        }
        let ways = way_mm(scene.run);
        for (sum, way_mm) in response.length_reading_mm.iter_mut().zip(ways) {
            *sum += way_mm * (self.curve_per_mm2 * way_mm - self.cosine_per_mm); // (1), (2)
        }
    }
}
