//! Spindle growth: a running spindle warms, and its nose comes down towards the table.
//!
//! # Model
//!
//! Bearings and shaft warm within minutes, housing and head within an hour. With a thermometer at the spindle
//! both follow its warming, without one they follow the time since the session began:
//!
//! ```text
//!   tau_i dy_i/dt = w(t) - y_i                                            (1)
//!   w = warming of the spindle / 10 K, or 1 from the beginning            (2)
//!   tip_z = -(k_1 y_1 + k_2 y_2),   y_i = 1 - exp(-t/tau_i) where w = 1   (3)
//! ```
//!
//! Which thermometer goes with the growth is tried: of a spindle with thermometers at its front and at its rear the front one
//! is that of the entry without an axis, the rear one that of the entry that names it.
//!
//! The wider form lets the nose move sideways too, with the slower of the two.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | k_1, k_2 | `fast_um`, `slow_um`: for 10 K, or in the end | µm |
//! | tau_1, tau_2 | `fast_min`, `slow_min` | min |
//! | `free_x_um`, `free_y_um` | as k_2, along X and Y | µm |
//!
//! # Holds when
//! The spindle's axis is Z. Growth is the same everywhere in the working space. Without a thermometer the
//! spindle ran evenly from the session's beginning.
//!
//! # Agreement
//! `val_spindle_growth_two_bodies`: two bodies that warm each other and the air, integrated finely, are met by
//! their two time constants to 1e-9 µm of 101.
//!
//! # References
//! \[1\] ISO 230-3:2020, clause 6 (thermal distortion caused by rotating spindle).

use super::slow::mixture;
use super::{Effect, Kind, Moment, Parameter, Scene, Target, Targets};
use crate::Response;
use machine::file::SensorPlace;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "spindle_growth",
    title: "growth of the spindle",
    targets: Targets::Spindle,
    parameters: &[
        Parameter::amplitude("fast_um", 200.0, 15.0),
        Parameter::amplitude("slow_um", 200.0, 25.0),
        Parameter::shape("fast_min", [0.2, 15.0], 5.0, &[0.5, 2.0, 6.0]),
        Parameter::shape("slow_min", [10.0, 240.0], 45.0, &[15.0, 40.0, 100.0]),
    ],
    free: &[
        Parameter::amplitude("free_x_um", 200.0, 5.0),
        Parameter::amplitude("free_y_um", 200.0, 10.0),
    ],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "measurements of Z over some minutes while the spindle warms or cools",
    build: |target, values| {
        Box::new(SpindleGrowth {
            thermometer: match target {
                Target::Thermometer(id) => Some(id),
                _ => None,
            },
            fast_mm: values[0] * 1e-3,
            slow_mm: values[1] * 1e-3,
            fast_s: values[2] * 60.0,
            slow_s: values[3] * 60.0,
            sideways_mm: [values[4] * 1e-3, values[5] * 1e-3],
        })
    },
};

/// Warming for which growth is stated, K.
const STATED_WARMING_K: f64 = 10.0;

struct SpindleGrowth {
    /// The one whose warming it follows, where it is not the first of the spindle.
    thermometer: Option<String>,
    fast_mm: f64,
    slow_mm: f64,
    fast_s: f64,
    slow_s: f64,
    sideways_mm: [f64; 2],
}

impl SpindleGrowth {
    fn warming_k(&self, scene: &Scene<'_>) -> Option<Vec<f64>> {
        let places = [SensorPlace::SpindleFront, SensorPlace::SpindleRear];
        match &self.thermometer {
            Some(id) => scene.history.warming_k(id),
            None => scene.warming_k(&places),
        }
    }
}

impl Effect for SpindleGrowth {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let [x, y, z] = &mut response.tip_mm;
        let [along_x_mm, along_y_mm] = self.sideways_mm;
        let Some(warming_k) = self.warming_k(scene) else {
            if self.thermometer.is_some() {
                return;
            }
            let times = &scene.run.motion.time_s;
            let terms = [
                (x, [0.0, along_x_mm]),
                (y, [0.0, along_y_mm]),
                (z, [-self.fast_mm, -self.slow_mm]),
            ];
            for (sum, [fast_mm, slow_mm]) in terms {
                if fast_mm.abs() + slow_mm.abs() > 0.0 {
                    let risen = |at_s: f64, lag_s: f64| 1.0 - (-at_s.max(0.0) / lag_s).exp(); // (3)
                    for (sum, at_s) in sum.iter_mut().zip(times) {
                        *sum += fast_mm * risen(*at_s, self.fast_s);
                        *sum += slow_mm * risen(*at_s, self.slow_s);
                    }
                }
            }
            return;
        };
        let fast = || scene.history.lagged_temperature(&warming_k, self.fast_s); // (1)
        let slow = || scene.history.lagged_temperature(&warming_k, self.slow_s);
        let per_k = |mm: f64| mm / STATED_WARMING_K;
        let growth = mixture(&[(per_k(self.fast_mm), &fast), (per_k(self.slow_mm), &slow)]);
        scene.add_slow(&growth, z, |_| -1.0);
        for (sum, mm) in [(x, along_x_mm), (y, along_y_mm)] {
            scene.add_slow(&mixture(&[(per_k(mm), &slow)]), sum, |_| 1.0);
        }
    }
}
