//! Noise of a thermometer: its readings scatter, and more where a draught cools it.
//!
//! # Model
//!
//! A sensor on something that is warmer than the air gives off some heat to it; where that share goes up and down with the
//! draught, its readings do:
//!
//! ```text
//!   variance = s2                                                         (1)
//!   variance += (p (T_m - T_air))2                                        (2)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | s | `sigma_k`, 1 standard deviation | K |
//! | p | `free_draught_percent`, 1 standard deviation | % |
//! | T_air | the first thermometer in the shop's air | °C |
//!
//! # Holds when
//! Readings scatter independently of each other. (1) is the same at every instant: where a thermometer was always as noisy
//! it is part of the noise floor, and only (2) shows. Without a thermometer in the air there is no (2).
//!
//! # Agreement
//! `val_thermometer_noise_of_a_digital_sensor`: steps of 0.0625 K scatter by 0.29 of a step \[1\], to 1 %.
//! `val_thermometer_noise_of_a_sensor_in_a_draught`: the heat balance of a sensor whose cooling goes up and down by a fifth,
//! at 4 and 12 K above the air, to 2 % of the standard deviation.
//!
//! # References
//! \[1\] JCGM 100:2008 (GUM), F.2.2.1 (resolution of a digital indication). \[2\] F. P. Incropera, D. P. DeWitt, Fundamentals
//! of heat and mass transfer, chapter 3 (temperature between two resistances). \[3\] IEC 60751:2008, 6.5.8 (immersion depth).

use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::{Channel, Response};
use machine::file::SensorPlace;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "thermometer_noise",
    title: "noise of a thermometer",
    targets: Targets::Thermometers,
    parameters: &[Parameter::size("sigma_k", 2.0, 0.1)],
    free: &[Parameter::size("free_draught_percent", 20.0, 1.0)],
    moment: Moment::Variance,
    wanders: 0.0,
    needs: "a temperature that another thermometer beside it shows, at two distances from that of the air",
    build: |target, values| {
        Box::new(ThermometerNoise {
            sensor: target.thermometer(),
            variance_k2: values[0].powi(2),
            draught: values[1] * 1e-2,
        })
    },
};

/// What temperatures are counted from; only differences are used.
const REFERENCE_DEGC: f64 = 20.0;

struct ThermometerNoise {
    sensor: String,
    variance_k2: f64,
    draught: f64,
}

impl Effect for ThermometerNoise {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let shown_k = scene.history.above_k(&self.sensor, REFERENCE_DEGC);
        let air_k = scene.above_k(&[SensorPlace::Ambient], REFERENCE_DEGC);
        let rows = scene
            .run
            .readings
            .iter()
            .zip(&mut response.reading_variance);
        for (reading, sum) in rows {
            if !matches!(&reading.channel, Channel::Thermometer(id) if *id == self.sensor) {
                continue;
            }
            *sum += self.variance_k2; // (1)
            if let (Some(shown_k), Some(air_k), Some(at_s)) =
                (&shown_k, &air_k, scene.run.time_of(reading))
            {
                let at = |series: &[f64]| scene.history.at(series, at_s);
                *sum += (self.draught * (at(shown_k) - at(air_k))).powi(2); // (2)
            }
        }
    }
}
