//! Scale error: an axis moves too far, or not far enough, in proportion to its position.
//!
//! # Model
//!
//! ```text
//!   E = s u + c (T - 20 degC) u                                           (1)
//! ```
//!
//! T is the thermometer at the axis' nut, else of the bed, of the column, of the air; the second term is the
//! wider form and is zero where the machine has none of them, or where it has not been read yet.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | s | `scale_um_per_m` | µm/m |
//! | c | `free_expansion_um_per_m_k` | µm/(m K) |
//! | u | position, from the machine's zero | mm |
//!
//! # Holds when
//! The error is between motor and slide. Expansion with a time constant of its own is another effect.
//!
//! # Agreement
//! `val_steel_off_the_reference_temperature_of_iso_1`: 34.5 µm for 300 mm of steel at 30 degC.
//!
//! # References
//! \[1\] ISO 230-2:2014, clause 3 (positioning deviations). \[2\] ISO 1:2022 (reference temperature of 20 °C).

use metrology::Axis;

use super::{Effect, Kind, Moment, Parameter, Scene, Target, Targets};
use crate::Response;
use machine::file::SensorPlace;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "scale_error",
    title: "scale error",
    targets: Targets::LinearAxes,
    parameters: &[Parameter::amplitude("scale_um_per_m", 10_000.0, 15.0)],
    free: &[Parameter::amplitude("free_expansion_um_per_m_k", 30.0, 5.0)],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "positions over the axis' travel",
    build: |target, values| Box::new(ScaleError::new(&target, values)),
};

struct ScaleError {
    axis: Axis,
    scale: f64,
    expansion_per_k: f64,
}

impl ScaleError {
    fn new(target: &Target, values: &[f64]) -> Self {
        Self {
            axis: target.axis(),
            scale: values[0] * 1e-6,
            expansion_per_k: values[1] * 1e-6,
        }
    }
}

impl Effect for ScaleError {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let motion = &scene.run.motion;
        let warm = thermometer(scene, self.axis).filter(|_| self.expansion_per_k != 0.0);
        let ticks = motion.time_s.iter().zip(&motion.position[self.axis]);
        for (sum, (time_s, here)) in response.drive[self.axis].iter_mut().zip(ticks) {
            let mut strain = self.scale;
            if let Some(series) = warm {
                let above_k = scene.history.at(series, *time_s) - REFERENCE_DEGC;
                if above_k.is_finite() {
                    strain += self.expansion_per_k * above_k;
                }
            }
            *sum += strain * here; // (1)
        }
    }
}

/// Reference temperature of lengths, ISO 1.
const REFERENCE_DEGC: f64 = 20.0;

/// Temperatures of the thermometer that tells most of an axis' screw.
fn thermometer<'a>(scene: &Scene<'a>, axis: Axis) -> Option<&'a [f64]> {
    let nut = match axis {
        Axis::X => SensorPlace::NutX,
        Axis::Y => SensorPlace::NutY,
        _ => SensorPlace::NutZ,
    };
    [
        nut,
        SensorPlace::Bed,
        SensorPlace::Column,
        SensorPlace::Ambient,
    ]
    .into_iter()
    .find_map(|place| {
        let sensors = &scene.machine.temperature_sensors;
        let sensor = sensors.iter().find(|sensor| sensor.place == place)?;
        let series = scene.history.temperature_degc.get(&sensor.id)?;
        Some(series.as_slice())
    })
}
