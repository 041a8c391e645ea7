//! Thermometer offset: a sensor shows a temperature that is wrong by a constant.
//!
//! # Model
//!
//! ```text
//!   T_m - T = o                                                           (1)
//!   T_m - T += g (T_m - 20 degC)                                          (2)
//! ```
//!
//! (2) is the wider form: a wrong slope of the sensor's characteristic.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | o | `offset_k` | K |
//! | g | `free_slope_percent` | % |
//!
//! # Holds when
//! The sensor settled. A current that warms it is part of o.
//!
//! # Agreement
//! `val_thermometer_offset_pt100_read_with_its_leads`: a resistor at the limit of class B, and one with leads of 0.2 ohm, by
//! the equation of IEC 60751 from 10 to 40 °C: of 0.34 and 0.53 K 1e-4 is left.
//!
//! # References
//! \[1\] IEC 60751:2008, 4.1 (resistance by temperature), 5.1 (tolerance classes: 0.30 K + 0.005 |t| of class B).

use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::{Channel, Response};

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "thermometer_offset",
    title: "offset of a thermometer",
    targets: Targets::Thermometers,
    parameters: &[Parameter::amplitude("offset_k", 10.0, 0.3)],
    free: &[Parameter::amplitude("free_slope_percent", 20.0, 1.0)],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "a temperature that is known otherwise",
    build: |target, values| {
        Box::new(ThermometerOffset {
            sensor: target.thermometer(),
            offset_k: values[0],
            slope: values[1] * 1e-2,
        })
    },
};

const REFERENCE_DEGC: f64 = 20.0;

struct ThermometerOffset {
    sensor: String,
    offset_k: f64,
    slope: f64,
}

impl Effect for ThermometerOffset {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let shown = scene.history.above_k(&self.sensor, REFERENCE_DEGC);
        let rows = scene.run.readings.iter().zip(&mut response.reading);
        for (reading, sum) in rows {
            if !matches!(&reading.channel, Channel::Thermometer(id) if *id == self.sensor) {
                continue;
            }
            *sum += self.offset_k; // (1)
            if let (Some(shown_k), Some(at_s)) = (&shown, scene.run.time_of(reading)) {
                *sum += self.slope * scene.history.at(shown_k, at_s); // (2)
            }
        }
    }
}
