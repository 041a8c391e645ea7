//! Wavelength: an interferometer counts wavelengths of light in air that is not as it assumes.
//!
//! # Model
//!
//! Reading less displacement over the displacement L from the run's first position:
//!
//! ```text
//!   d = (n_true / n_assumed - 1) L = k L                                  (1)
//!   dn/dT = -(n - 1)/T = -0.927e-6 per K at 20 degC and 101.325 kPa       (2)
//! ```
//!
//! The wider form has air whose temperature is not compensated, by (2) with the shop's thermometer, and a k that
//! drifts (pressure).
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | k | `scale_ppm` | 1e-6 |
//! | `free_air_share` | share of the air's deviation from 20 °C that is not compensated | 1 |
//! | `free_rate_ppm_per_h` | drift of k | 1e-6/h |
//!
//! # Holds when
//! The dead path is short; air is dry, light red (633 nm). In length alone k is a scale error of the axis; another instrument, another axis or
//! a day of other weather tells them apart.
//!
//! # Agreement
//! `val_length_wavelength_ciddor_standard_air`: (2) against the dispersion formula of standard air brought to
//! 20 °C by the law of gases, to 1e-9 per K.
//!
//! # References
//! \[1\] P. E. Ciddor, Refractive index of air: new equations for the visible and near infrared, Appl. Opt. 35(9),
//! 1996, 1566-1573, eq. (1).

use metrology::Axis;
use nalgebra::Vector3;

use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::simulate::beam;
use crate::{Channel, Response, Run};
use machine::file::SensorPlace;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "length_wavelength",
    title: "wavelength of the length reference",
    targets: Targets::Machine,
    parameters: &[Parameter::amplitude("scale_ppm", 100.0, 2.0)],
    free: &[
        Parameter::amplitude("free_air_share", 2.0, 0.5),
        Parameter::amplitude("free_rate_ppm_per_h", 20.0, 0.5),
    ],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "readings of the length reference at two places",
    build: |_, values| {
        Box::new(LengthWavelength {
            scale: values[0] * 1e-6,
            air_share: values[1],
            rate_per_s: values[2] * 1e-6 / 3600.0,
        })
    },
};

/// (2).
const INDEX_PER_K: f64 = -0.927e-6;
const REFERENCE_DEGC: f64 = 20.0;

struct LengthWavelength {
    scale: f64,
    air_share: f64,
    rate_per_s: f64,
}

impl Effect for LengthWavelength {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let places = [SensorPlace::Ambient, SensorPlace::Bed];
        let air_k = scene.above_k(&places, REFERENCE_DEGC).unwrap_or_default();
        let uses_air = self.air_share.abs() > 0.0 && !air_k.is_empty();
        let way_mm = way_mm(scene.run);
        let times = &scene.run.motion.time_s;
        let sums = response.length_reading_mm.iter_mut().zip(times);
        for ((sum, at_s), way_mm) in sums.zip(way_mm) {
            let mut scale = self.scale + self.rate_per_s * at_s;
            if uses_air {
                scale += self.air_share * INDEX_PER_K * scene.history.at(&air_k, *at_s);
            }
            *sum += scale * way_mm; // (1)
        }
    }
}

/// Commanded displacement along the length reference's beam at each tick, from the first; empty where the run
/// has no readings of it.
pub(super) fn way_mm(run: &Run) -> Vec<f64> {
    let axis = run
        .readings
        .iter()
        .find_map(|reading| match reading.channel {
            Channel::Length(axis) => Some(axis),
            _ => None,
        });
    let Some(axis) = axis else {
        return vec![];
    };
    let direction = beam(run, axis);
    let at = |tick: usize| {
        let here = |k: usize| run.motion.position[Axis::LINEAR[k]].get(tick).copied();
        Vector3::from_fn(|k, _| here(k).unwrap_or(0.0)).dot(&direction)
    };
    (0..run.motion.len()).map(|tick| at(tick) - at(0)).collect()
}
