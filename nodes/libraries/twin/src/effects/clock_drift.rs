//! Clock drift: an instrument's clock runs faster or slower than the machine's.
//!
//! # Model
//!
//! ```text
//!   reading(t) = p(t - k t),   t since the session began                  (1)
//!   reading(t) = p(t - k t - r t2 / 2)                                    (2)
//! ```
//!
//! (2) is the wider form: the rate itself changes, as the quartz of an instrument that warms does.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | k | `drift_ppm`; positive: the instrument's clock is fast | 1e-6 |
//! | r | `free_ppm_per_h` | 1e-6/h |
//! | p | commanded position along the instrument | mm |
//!
//! # Holds when
//! Both clocks agreed when the session began and were not set since; an offset besides is `clock_offset`.
//!
//! # Agreement
//! `val_clock_drift_of_a_tuning_fork`: an instrument that counts the cycles of its crystal at 45 °C, -12.0 ppm by the data
//! sheet \[2\], to the cycle after 8 h. `val_clock_drift_of_a_crystal_that_warms`: of 7.4 ms in an hour (rms) (1) leaves 2.1
//! and (2) 0.07.
//!
//! # References
//! \[1\] D. W. Allan, N. Ashby, C. C. Hodge, The science of timekeeping, Hewlett-Packard application note 1289, 1997.
//! \[2\] CTS, TF20 series tuning fork crystal, data sheet 008-0353 (-0.030 ppm/K2 about 25 °C). \[3\] IEC/IEEE
//! 61588:2021 (rate and offset of a clock against its master).

use super::clock_offset::INSTRUMENTS;
use super::stale;
use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::{Instrument, Response};

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "clock_drift",
    title: "drift of an instrument's clock",
    targets: Targets::Instruments(INSTRUMENTS),
    parameters: &[Parameter::amplitude("drift_ppm", 500.0, 2.0)],
    free: &[Parameter::amplitude("free_ppm_per_h", 500.0, 2.0)],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "readings of the instrument while axes move, at two times",
    build: |target, values| {
        Box::new(ClockDrift {
            instrument: target.instrument(),
            drift: values[0] * 1e-6,
            change_per_s: values[1] * 1e-6 / 3600.0,
        })
    },
};

struct ClockDrift {
    instrument: Instrument,
    drift: f64,
    change_per_s: f64,
}

impl Effect for ClockDrift {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        stale::add(scene, self.instrument, response, |at_s| {
            at_s * (self.drift + 0.5 * self.change_per_s * at_s) // (1), (2)
        });
    }
}
