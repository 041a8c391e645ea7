//! Misalignment: the beam of a length reference leans against the motion, and lengths come out too short.
//!
//! # Model
//!
//! A length reference is put up anew for every axis, as well as lets its beam meet the receiver over the whole way L_b
//! that the machine file has for it: what strays there by s leans by theta = s / L_b, more on a short axis. With L the
//! displacement along the axis from the run's first position:
//!
//! ```text
//!   d = L (cos theta - 1) = -L s2 / (2 L_b2)                              (1)
//!   d += c L2                                                             (2)
//! ```
//!
//! (2) is the wider form: the motion itself is curved, so that the angle changes along it.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | s2 | `stray_mm2`; 1 mm over a metre is 1 mrad, 0.5 µm/m | mm2 |
//! | L_b | length of the beam along the axis, without one the travel, of the machine file | mm |
//! | c | `free_curve_um_per_m2` | µm/m2 |
//!
//! # Holds when
//! The beam still meets the receiver at the end of the way, 3 mm off at most: 4.5 µm/m over a metre, 50 µm/m over 300 mm.
//! The interferometer measures along its own beam. That it is one axis' alone tells it from
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
use nalgebra::Vector3;

use super::length_wavelength::way_mm;
use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::{Channel, Response};
use machine::file::MachineFile;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "length_misalignment",
    title: "misalignment of the length reference",
    targets: Targets::LinearAxes,
    parameters: &[Parameter::size("stray_mm2", 9.0, 1.0)],
    free: &[Parameter::amplitude("free_curve_um_per_m2", 100.0, 2.0)],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "readings of the length reference at two places of the axis, and another instrument's or another axis'",
    build: |target, values| {
        Box::new(LengthMisalignment {
            axis: target.axis(),
            stray_mm2: values[0],
            curve_per_mm2: values[1] * 1e-9,
        })
    },
};

/// A beam is along an axis where the cosine between them is more than this.
const LEAST_COSINE: f64 = 0.99;
/// Way of an axis that the machine file does not have.
const STATED_MM: f64 = 1000.0;

struct LengthMisalignment {
    axis: Axis,
    stray_mm2: f64,
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
        let cosine_per_mm = 0.5 * self.stray_mm2 / way_of_beam_mm(scene.machine, self.axis).powi(2);
        let ways = way_mm(scene.run);
        for (sum, way_mm) in response.length_reading_mm.iter_mut().zip(ways) {
            *sum += way_mm * (self.curve_per_mm2 * way_mm - cosine_per_mm); // (1), (2)
        }
    }
}

/// Length of the beam along an axis, without one its travel.
fn way_of_beam_mm(machine: &MachineFile, axis: Axis) -> f64 {
    let beams = machine
        .length_reference
        .iter()
        .flat_map(|length| &length.beams);
    let along = beams.filter(|beam| beam.direction()[axis.index()].abs() > LEAST_COSINE);
    let ways = along.map(|beam| (Vector3::from(beam.to_mm) - Vector3::from(beam.from_mm)).norm());
    let travel = machine
        .linear(axis)
        .map_or(STATED_MM, |entry| entry.travel_mm[1] - entry.travel_mm[0]);
    ways.reduce(f64::max).unwrap_or(travel)
}
