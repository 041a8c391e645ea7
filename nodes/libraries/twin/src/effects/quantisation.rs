//! Quantisation: readings are rounded to steps.
//!
//! # Model
//!
//! ```text
//!   variance = q2 / 12                                                    (1)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | q | `step_um`, beyond the resolution that the noise of repeats already shows | µm |
//!
//! # Holds when
//! Readings move over many steps, so that the rounding is spread evenly; a still reading is rounded to one
//! and the same step. Linear channels only.
//!
//! No wider form: a step is one number, and rounding is spread over it evenly.
//!
//! # Agreement
//! `val_quantisation_ramp`: a ramp over 1000 steps, rounded, scatters by (1) to 0.1 %.
//!
//! # References
//! \[1\] JCGM 100:2008 (GUM), F.2.2.1 (resolution of a digital indication: 0.29 of a step).

use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::{Channel, Instrument, Response};

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "quantisation",
    title: "resolution of an instrument",
    targets: Targets::Instruments(&[
        Instrument::Motor,
        Instrument::Scale,
        Instrument::Grid,
        Instrument::Radial,
        Instrument::Length,
        Instrument::Touch,
    ]),
    parameters: &[Parameter::size("step_um", 20.0, 1.0)],
    free: &[],
    moment: Moment::Variance,
    wanders: 0.0,
    needs: "readings of the instrument while axes move",
    build: |target, values| {
        Box::new(Quantisation {
            instrument: target.instrument(),
            step_mm: values[0] * 1e-3,
        })
    },
};

struct Quantisation {
    instrument: Instrument,
    step_mm: f64,
}

impl Effect for Quantisation {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let variance_mm2 = self.step_mm.powi(2) / 12.0; // (1)
        let rows = scene
            .run
            .readings
            .iter()
            .zip(&mut response.reading_variance);
        for (reading, sum) in rows {
            let is_linear = match reading.channel {
                Channel::Motor(axis) | Channel::Scale(axis) => axis.is_linear(),
                _ => true,
            };
            if is_linear && reading.channel.instrument() == self.instrument {
                *sum += variance_mm2;
            }
        }
    }
}
