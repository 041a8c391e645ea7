//! Clock offset: an instrument stamps its readings late, so that each shows where the machine was before.
//!
//! # Model
//!
//! ```text
//!   reading(t) = p(t - o)                                                 (1)
//!   reading(t) - p(t) = -v o + a o2 / 2 - ...                             (2)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | o | `offset_ms`; positive: the stamp is later than the reading | ms |
//! | p | commanded position along the instrument | mm |
//!
//! # Holds when
//! Stamps of machine and instrument are otherwise on one clock. (1) is exact on the recorded command between
//! ticks; what the control loop leaves moves with it and is not shifted again.
//!
//! No wider form: an offset is one number, and what grows with time is `clock_drift`. The number may wander by half of
//! itself: an instrument that is asked for its readings in blocks is late by half a block, from nothing to a whole one.
//!
//! # Agreement
//! `val_clock_offset_circle`: 2 ms on a circle of 50 mm at 3 m/min, the circle's own equation shifted, to
//! 1e-8 µm of 100.
//!
//! # References
//! \[1\] IEC/IEEE 61588:2021 (offset of a clock: its time less that of its master).

use super::stale;
use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::{Instrument, Response};

/// Instruments with a clock of their own.
pub(super) const INSTRUMENTS: &[Instrument] =
    &[Instrument::Grid, Instrument::Radial, Instrument::Length];

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "clock_offset",
    title: "offset of an instrument's clock",
    targets: Targets::Instruments(INSTRUMENTS),
    parameters: &[Parameter::amplitude("offset_ms", 200.0, 1.0)],
    free: &[],
    moment: Moment::Mean,
    wanders: 0.5,
    needs: "readings of the instrument while axes move",
    build: |target, values| {
        Box::new(ClockOffset {
            instrument: target.instrument(),
            offset_s: values[0] * 1e-3,
        })
    },
};

struct ClockOffset {
    instrument: Instrument,
    offset_s: f64,
}

impl Effect for ClockOffset {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        stale::add(scene, self.instrument, response, |_| self.offset_s); // (1)
    }
}
