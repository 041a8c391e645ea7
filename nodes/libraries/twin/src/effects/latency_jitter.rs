//! Latency jitter: each trigger is delivered a little earlier or later than the mean.
//!
//! # Model
//!
//! ```text
//!   variance = (f s)2                                                     (1)
//!   s = period / sqrt(12) where the input is polled                       (2)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | s | `jitter_ms`, 1 standard deviation | ms |
//! | f | feed at contact | mm/s |
//!
//! # Holds when
//! Delays of different touches are independent.
//!
//! No wider form: however the delays are distributed, the variance of their ways is that of the delays times the square of
//! the feed.
//!
//! # Agreement
//! `val_the_plants_trigger_scatters_with_the_feed` (`fake_cnc`): positions latched by the plant's probe at 2 and 10 mm/s have
//! this variance and that of `probe_repeatability`, within what 600 touches can tell. `val_latency_jitter_polled_input`:
//! touches at random instants of a 1 ms servo period, 200 000 drawn, scatter by (2) to 0.2 %.
//!
//! # References
//! \[1\] JCGM 100:2008 (GUM), 4.3.7 (rectangular distribution). \[2\] ISO 230-10:2022, 7.1 (touch trigger probes).

use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "latency_jitter",
    title: "jitter of the probe's latency",
    targets: Targets::Machine,
    parameters: &[Parameter::size("jitter_ms", 10.0, 0.1)],
    free: &[],
    moment: Moment::Variance,
    wanders: 0.0,
    needs: "repeated touches of one surface at two feeds or more",
    build: |_, values| {
        Box::new(LatencyJitter {
            jitter_s: values[0] * 1e-3,
        })
    },
};

struct LatencyJitter {
    jitter_s: f64,
}

impl Effect for LatencyJitter {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let touches = &scene.run.touches;
        for (variance, touch) in response.travel_variance_mm2.iter_mut().zip(touches) {
            *variance += (touch.feed_mm_s * self.jitter_s).powi(2); // (1)
        }
    }
}
