//! Thermometer lag: a sensor shows the temperature of a while ago.
//!
//! # Model
//!
//! A sensor that exchanges heat with what it measures reads T_m:
//!
//! ```text
//!   tau dT_m/dt = T - T_m                                                 (1)
//!   T_m - T = -tau dT_m/dt                                                (2)
//! ```
//!
//! (2) needs only the reading itself, so that the lag is an amplitude. The wider form has the next order: an element in
//! a sheath, each with a time constant of its own, whose sum is tau and whose product is q:
//!
//! ```text
//!   T_m - T = -tau dT_m/dt - q d2T_m/dt2                                  (3)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | tau | `lag_s` | s |
//! | q | `free_square_s2` | s2 |
//!
//! # Holds when
//! The spacing of the history is short against the changes of temperature. Self-heating is `thermometer_offset`.
//!
//! # Agreement
//! `val_thermometer_lag_of_an_element_in_a_sheath`: of 70 and 20 s, (3) to 2e-3 K.
//! `val_thermometer_lag_ramp_and_step`: (1) integrated finely for a ramp and an exponential rise, to 3e-5 K of 0.6.
//!
//! # References
//! \[1\] IEC 60751:2008, 6.5.2 (thermal response time). \[2\] F. P. Incropera, D. P. DeWitt, Fundamentals of heat and mass
//! transfer, chapter 5 (lumped capacitance).

use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::{Channel, Response};

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "thermometer_lag",
    title: "lag of a thermometer",
    targets: Targets::Thermometers,
    parameters: &[Parameter::size("lag_s", 600.0, 60.0)],
    free: &[Parameter::amplitude("free_square_s2", 90_000.0, 900.0)],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "a temperature that changes and another one to compare it with",
    build: |target, values| {
        Box::new(ThermometerLag {
            sensor: target.thermometer(),
            lag_s: values[0],
            square_s2: values[1],
        })
    },
};

struct ThermometerLag {
    sensor: String,
    lag_s: f64,
    square_s2: f64,
}

impl Effect for ThermometerLag {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let Some(reading_k) = scene.history.warming_k(&self.sensor) else {
            return;
        };
        let step_s = scene.history.step_s;
        let rows = scene.run.readings.iter().zip(&mut response.reading);
        for (reading, sum) in rows {
            if !matches!(&reading.channel, Channel::Thermometer(id) if *id == self.sensor) {
                continue;
            }
            if let Some(at_s) = scene.run.time_of(reading) {
                let at = |t_s: f64| scene.history.at(&reading_k, t_s);
                let slope = (at(at_s + 0.5 * step_s) - at(at_s - 0.5 * step_s)) / step_s;
                let ends = at(at_s + step_s) + at(at_s - step_s);
                let bend = (ends - 2.0 * at(at_s)) / step_s.powi(2);
                *sum -= self.lag_s * slope + self.square_s2 * bend; // (2), (3)
            }
        }
    }
}
