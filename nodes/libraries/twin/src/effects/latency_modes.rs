//! Latency in two modes: the link delivers some triggers later than others, in no order.
//!
//! # Model
//!
//! A share w of the triggers is later by dT. About their mean, which is part of the latency:
//!
//! ```text
//!   variance = w (1 - w) (f dT)2                                          (1)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | dT | `apart_ms` | ms |
//! | w | `late_share` | 1 |
//! | f | feed at contact | mm/s |
//!
//! # Holds when
//! Triggers fall into either mode independently. By its variance alone it is `latency_jitter`; only the two
//! clusters themselves tell the two apart.
//!
//! No wider form: three modes, or other shares, have the same variance but for its size.
//!
//! # Agreement
//! `val_latency_modes_of_a_link_that_sends_again`: of a link that loses 3 % and sends again until it is heard, 91 % of the
//! variance: what was lost twice has no mode here.
//!
//! # References
//! \[1\] WO 2004/057552 A1 (a probe's radio link: frames and their acknowledgement). \[2\] W. Feller, An introduction
//! to probability theory and its applications, vol. 1, chapter VI (Bernoulli trials) and chapter IX (variance).

use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "latency_modes",
    title: "two modes of the probe's latency",
    targets: Targets::Machine,
    parameters: &[
        Parameter::size("apart_ms", 20.0, 0.5),
        Parameter::shape("late_share", [0.02, 0.98], 0.3, &[0.1, 0.3, 0.5]),
    ],
    free: &[],
    moment: Moment::Variance,
    wanders: 0.0,
    needs: "repeated touches of one surface at two feeds or more",
    build: |_, values| {
        Box::new(LatencyModes {
            apart_s: values[0] * 1e-3,
            late_share: values[1],
        })
    },
};

struct LatencyModes {
    apart_s: f64,
    late_share: f64,
}

impl Effect for LatencyModes {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let share = self.late_share * (1.0 - self.late_share);
        let touches = &scene.run.touches;
        for (variance, touch) in response.travel_variance_mm2.iter_mut().zip(touches) {
            *variance += share * (touch.feed_mm_s * self.apart_s).powi(2); // (1)
        }
    }
}
