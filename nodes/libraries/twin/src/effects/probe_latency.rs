//! Probe latency: the position is latched some time after the probe triggered.
//!
//! # Model
//!
//! ```text
//!   travel = f T                                                          (1)
//!   travel += c (f / f0)2,   f0 = 1 m/min                                 (2)
//! ```
//!
//! (2) is the wider form: what grows faster than the feed, as an axis that is still accelerating when it
//! touches (its way is half the acceleration times the time squared) or a trigger force that grows with speed.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | T | `latency_ms`, beyond what the latched positions are corrected for | ms |
//! | c | `free_square_um` at 1 m/min | µm |
//! | f | feed at contact | mm/s |
//!
//! # Holds when
//! The feed is the one at contact and constant within T.
//!
//! # Agreement
//! `val_probe_latency_8_3_um_per_ms`: 8.33 µm a millisecond at 500 mm/min.
//! `val_probe_latency_two_feeds`: the two-feed rule |Pa - Pb| / |fa - fb| gives T back to 1e-12 s.
//!
//! # References
//! \[1\] A. V. Ling, N. D. Wilkin, Fast probing considerations for on-machine inspection of parts, NISTIR 1999 (error in
//! proportion to feed).

use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "probe_latency",
    title: "latency of the probe signal",
    targets: Targets::Machine,
    parameters: &[Parameter::amplitude("latency_ms", 50.0, 1.0)],
    free: &[Parameter::amplitude("free_square_um", 100.0, 2.0)],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "touches at two feeds or more",
    build: |_, values| {
        Box::new(ProbeLatency {
            latency_s: values[0] * 1e-3,
            square_mm: values[1] * 1e-3,
        })
    },
};

/// Feed for which the quadratic part is stated, mm/s.
const STATED_FEED_MM_S: f64 = 1000.0 / 60.0;

struct ProbeLatency {
    latency_s: f64,
    square_mm: f64,
}

impl Effect for ProbeLatency {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        for (travel, touch) in response.travel_mm.iter_mut().zip(&scene.run.touches) {
            let feed = touch.feed_mm_s;
            *travel += feed * self.latency_s + self.square_mm * (feed / STATED_FEED_MM_S).powi(2); // (1), (2)
        }
    }
}
