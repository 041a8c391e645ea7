//! Temperature sensors: first-order lag, a fixed offset, and noise in each reading.
//!
//! ```text
//!   dT_s/dt = (T - T_s) / tau,  exact for constant T over a heat step        (1)
//!   reading = T_s + offset + noise                                           (2)
//! ```

use machine::MachineFile;
use machine::file::SensorPlace;
use metrology::Axis;

use super::error::{PlantError, require_not_negative, require_positive};
use super::file::SensorsEntry;
use super::noise::{Effect, Stream};

/// One sensor with its state.
#[derive(Clone, Debug)]
pub(super) struct Thermometer {
    pub(super) id: String,
    pub(super) place: SensorPlace,
    follow: f64,
    temp_degc: f64,
    offset_k: f64,
    noise_k: f64,
    stream: Stream,
}

impl Thermometer {
    pub(super) fn all(
        machine: &MachineFile,
        entry: &SensorsEntry,
        seed: u64,
        start_degc: f64,
        step_s: f64,
    ) -> Result<Vec<Self>, PlantError> {
        require_positive("sensors.time_constant_s", entry.time_constant_s)?;
        require_not_negative("sensors.offset_k", entry.offset_k)?;
        require_not_negative("sensors.noise_k", entry.noise_k)?;
        machine
            .temperature_sensors
            .iter()
            .enumerate()
            .map(|(index, sensor)| {
                if let Some(axis) = nut_axis(sensor.place)
                    && machine.linear(axis).is_none()
                {
                    return Err(PlantError::AxisMissing {
                        place: "temperature_sensors",
                        axis,
                    });
                }
                let mut stream = Stream::new(seed, Effect::Sensors, index as u64);
                Ok(Self {
                    id: sensor.id.clone(),
                    place: sensor.place,
                    follow: 1.0 - (-step_s / entry.time_constant_s).exp(),
                    temp_degc: start_degc,
                    offset_k: entry.offset_k * stream.normal(),
                    noise_k: entry.noise_k,
                    stream,
                })
            })
            .collect()
    }

    /// (1) over one heat step.
    pub(super) fn step(&mut self, true_degc: f64) {
        self.temp_degc += self.follow * (true_degc - self.temp_degc);
    }

    /// (2).
    pub(super) fn read_degc(&mut self) -> f64 {
        self.temp_degc + self.offset_k + self.noise_k * self.stream.normal()
    }
}

/// The axis whose nut a sensor sits on.
pub(super) fn nut_axis(place: SensorPlace) -> Option<Axis> {
    match place {
        SensorPlace::NutX => Some(Axis::X),
        SensorPlace::NutY => Some(Axis::Y),
        SensorPlace::NutZ => Some(Axis::Z),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sensor(noise_k: f64) -> Thermometer {
        Thermometer {
            id: "t".to_owned(),
            place: SensorPlace::Bed,
            follow: 1.0 - (-1.0_f64 / 30.0).exp(),
            temp_degc: 20.0,
            offset_k: 0.05,
            noise_k,
            stream: Stream::new(1, Effect::Sensors, 0),
        }
    }

    #[test]
    fn eq1_a_step_is_followed_exponentially() {
        let mut sensor = sensor(0.0);
        for _ in 0..30 {
            sensor.step(30.0);
        }
        let expected = 30.0 - 10.0 * (-1.0_f64).exp() + 0.05;
        assert!((sensor.read_degc() - expected).abs() < 1e-9);
    }

    #[test]
    fn eq2_readings_scatter_as_stated() {
        let mut sensor = sensor(0.02);
        let n = 10_000;
        let squares: f64 = (0..n).map(|_| (sensor.read_degc() - 20.05).powi(2)).sum();
        assert!((squares / f64::from(n) / 4e-4 - 1.0).abs() < 0.05);
    }
}
