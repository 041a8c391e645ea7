//! Latency drift: the delay of the probe's radio or optical link changes with time, or jumps once.
//!
//! # Model
//!
//! ```text
//!   travel = f dT for t > t_c, else 0                                     (1)
//!   travel += f k t                                                       (2)
//! ```
//!
//! (2) is the wider form, a delay that drifts.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | dT | `step_ms` | ms |
//! | t_c | `at_min`, since the session began | min |
//! | k | `free_rate_ms_per_h` | ms/h |
//! | f | feed at contact | mm/s |
//!
//! # Holds when
//! The link changes its mode once; two modes in no order are `latency_modes`.
//!
//! # Agreement
//! `val_latency_drift_of_a_link_whose_clock_runs_off`: of a probe whose clock runs off by 1e-6 of the receiver's and is set
//! once, counted by the microsecond, to that microsecond.
//!
//! # References
//! \[1\] A. V. Ling, N. D. Wilkin, Fast probing considerations for on-machine inspection of parts, NISTIR 1999 (error in
//! proportion to feed and timing of the trigger). \[2\] WO 2004/057552 A1 (a probe's radio link, whose stations
//! synchronise their clocks).

use super::coolant::EVENT_GRID_MIN;
use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "latency_drift",
    title: "drift of the probe's latency",
    targets: Targets::Machine,
    parameters: &[
        Parameter::amplitude("step_ms", 20.0, 0.3),
        Parameter::shape("at_min", [0.0, 1440.0], 20.0, EVENT_GRID_MIN),
    ],
    free: &[Parameter::amplitude("free_rate_ms_per_h", 20.0, 0.3)],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "touches at two feeds or more, at two times",
    build: |_, values| {
        Box::new(LatencyDrift {
            step_s: values[0] * 1e-3,
            at_s: values[1] * 60.0,
            rate_per_s: values[2] * 1e-3 / 3600.0,
        })
    },
};

struct LatencyDrift {
    step_s: f64,
    at_s: f64,
    rate_per_s: f64,
}

impl Effect for LatencyDrift {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        for (travel, touch) in response.travel_mm.iter_mut().zip(&scene.run.touches) {
            let step_s = if touch.time_s > self.at_s {
                self.step_s
            } else {
                0.0
            };
            *travel += touch.feed_mm_s * (step_s + self.rate_per_s * touch.time_s); // (1), (2)
        }
    }
}
