//! Clock drift: an instrument's clock runs faster or slower than the machine's.
//!
//! # Model
//!
//! ```text
//!   reading(t) = p(t - k t),   t since the session began                  (1)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | k | `drift_ppm`; positive: the instrument's clock is fast | 1e-6 |
//! | p | commanded position along the instrument | mm |
//!
//! # Holds when
//! Both clocks agreed when the session began and were not set since; an offset besides is `clock_offset`.
//!
//! # Agreement
//! `val_clock_drift_between_two_runs`: the same line measured 10 and 40 min after the beginning is late by 18 ms
//! more at 10 ppm, to 1e-9 s.

use super::clock_offset::INSTRUMENTS;
use super::stale;
use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::twin::{Instrument, Response};

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "clock_drift",
    title: "drift of an instrument's clock",
    targets: Targets::Instruments(INSTRUMENTS),
    parameters: &[Parameter::amplitude("drift_ppm", 500.0, 2.0)],
    free: &[],
    moment: Moment::Mean,
    needs: "readings of the instrument while axes move, at two times",
    build: |target, values| {
        Box::new(ClockDrift {
            instrument: target.instrument(),
            drift: values[0] * 1e-6,
        })
    },
};

struct ClockDrift {
    instrument: Instrument,
    drift: f64,
}

impl Effect for ClockDrift {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        stale::add(scene, self.instrument, response, |at_s| self.drift * at_s); // (1)
    }
}
