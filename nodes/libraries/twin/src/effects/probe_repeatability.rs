//! Probe repeatability: touches of one surface at one feed scatter.
//!
//! # Model
//!
//! ```text
//!   variance = s2                                                         (1)
//!   variance += (s_l |n_lateral|2 L/L_m)2                                 (2)
//! ```
//!
//! (2) is the wider form: lateral touches with a long stylus scatter more, as the ball's end of the lever moves
//! further for the same motion of the seat.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | s | `sigma_um`, 1 standard deviation | µm |
//! | s_l | `free_lateral_um` with the mounted stylus | µm |
//!
//! # Holds when
//! Scatter of different touches is independent and does not depend on the feed; what does is `latency_jitter`.
//!
//! # Agreement
//! `val_probe_repeatability_seat_and_lever`: a seat that settles anew in two angles and along the approach, 100 000
//! draws with two styli, to 0.8 % of the variance.
//!
//! # References
//! \[1\] ISO 230-10:2022 (probing repeatability).

use super::probe_pretravel::length_ratio;
use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "probe_repeatability",
    title: "scatter of the probe",
    targets: Targets::Machine,
    parameters: &[Parameter::size("sigma_um", 20.0, 0.5)],
    free: &[Parameter::size("free_lateral_um", 20.0, 0.5)],
    moment: Moment::Variance,
    wanders: 0.0,
    needs: "repeated touches of one surface",
    build: |_, values| {
        Box::new(ProbeRepeatability {
            sigma_mm: values[0] * 1e-3,
            lateral_mm: values[1] * 1e-3,
        })
    },
};

struct ProbeRepeatability {
    sigma_mm: f64,
    lateral_mm: f64,
}

impl Effect for ProbeRepeatability {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let longer = length_ratio(scene, scene.run);
        let touches = &scene.run.touches;
        for (variance, touch) in response.travel_variance_mm2.iter_mut().zip(touches) {
            let lateral = touch.approach.x.powi(2) + touch.approach.y.powi(2);
            *variance += self.sigma_mm.powi(2) + (self.lateral_mm * lateral * longer).powi(2); // (1), (2)
        }
    }
}
