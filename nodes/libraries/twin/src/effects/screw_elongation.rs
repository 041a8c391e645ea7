//! Screw elongation: friction warms the ball screw, and the nut moves away from the fixed bearing.
//!
//! # Model
//!
//! The strain of the screw follows the heat of friction with the time constant of the screw in air. Friction
//! that does not depend on speed makes heat in proportion to the mean speed, viscous friction to its square:
//!
//! ```text
//!   ds/dt = (g n <|v|>_z / v0 - s) / tau + D d2s/dx2,   v0 = 100 mm/s     (1)
//!   slide - motor = integral of s(x, t) from u_fix to u                   (2)
//!   u_fix = middle + f (travel / 2)                                       (3)
//! ```
//!
//! The heat is where the nut has rubbed: <|v|>_z is the way in one of n equal zones of the travel over the time. Where the
//! recording does not tell the zones, the heat is even.
//!
//! The wider form adds heat by v2, by the warming of the nut's thermometer, the time constants tau/3 and
//! 3 tau, and growth with the square of the distance (a zone that is warmer than the rest).
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | g | `growth_um_per_m` after infinite time at 100 mm/s mean speed | µm/m |
//! | tau | `lag_min` | min |
//! | D | thermal diffusivity of steel, 13 mm²/s | mm²/s |
//! | f | `fixed_end`: -1 low end of the travel, +1 high end | 1 |
//! | `free_fast`, `free_slow` | as g, with tau/3 and 3 tau | µm/m |
//! | `free_viscous` | as g, heat by the mean of v2 over v0 2 | µm/m |
//! | `free_nut` | strain with the nut's warming | µm/(m K) |
//! | `free_square_*` | as g, times distance over half the travel | µm/m |
//!
//! # Holds when
//! The position loop is closed by the motor encoder: the error enters between motor and slide. The screw is
//! cold and in balance with the shop when the session begins. Not modelled: a stretched screw, that first
//! relaxes; what the nut itself stores.
//!
//! # Agreement
//! `val_screw_elongation_uniform_bar`: a bar of 48 cells with a nut that rubs over the whole of it evenly, to
//! 0.1 µm of 54 where the heat is switched on or off. `eq1_matches_a_fine_integration`: 1e-4 µm of 18.
//! `val_screw_elongation_short_stroke`: of a nut that rubs over the middle half only, told by zones, 1.4 % is left; taken for even
//! heat it leaves 5.5 % of the growth, 2.5 % in the wider form.
//!
//! # References
//! \[1\] ISO 230-3:2020, clause 7 (thermal distortion caused by moving linear axes).

use metrology::Axis;

use super::slow::mixture;
use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::Response;
use crate::rubbing::ZONES;
use machine::file::SensorPlace;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "screw_elongation",
    title: "elongation of the ball screw",
    targets: Targets::LinearAxes,
    parameters: &[
        Parameter::amplitude("growth_um_per_m", 10_000.0, 40.0),
        Parameter::shape("lag_min", [1.0, 120.0], 20.0, &[2.0, 5.0, 12.0, 25.0, 60.0]),
        Parameter::shape("fixed_end", [-1.5, 1.5], 1.0, &[-1.0, 1.0]),
    ],
    free: &[
        Parameter::amplitude("free_fast_um_per_m", 10_000.0, 20.0),
        Parameter::amplitude("free_slow_um_per_m", 10_000.0, 20.0),
        Parameter::amplitude("free_viscous_um_per_m", 10_000.0, 20.0),
        Parameter::amplitude("free_nut_um_per_m_k", 30.0, 4.0),
        Parameter::amplitude("free_square_fast_um_per_m", 10_000.0, 10.0),
        Parameter::amplitude("free_square_um_per_m", 10_000.0, 10.0),
        Parameter::amplitude("free_square_slow_um_per_m", 10_000.0, 10.0),
    ],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "an axis that travels for some minutes and is measured at two places or more",
    build: |target, values| {
        Box::new(ScrewElongation {
            axis: target.axis(),
            growth_per_mm: values[0] * 1e-6,
            lag_s: values[1] * 60.0,
            fixed_end: values[2],
            free_per_mm: [3, 4, 5, 6, 7, 8, 9].map(|k| values[k] * 1e-6),
        })
    },
};

/// Mean speed at which growth is stated, mm/s.
const STATED_SPEED_MM_S: f64 = 100.0;
/// Thermal diffusivity of steel, mm2/s.
const STEEL_MM2_S: f64 = 13.0;

struct ScrewElongation {
    axis: Axis,
    growth_per_mm: f64,
    lag_s: f64,
    fixed_end: f64,
    free_per_mm: [f64; 7],
}

impl Effect for ScrewElongation {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let Some(axis) = scene.machine.linear(self.axis) else {
            return;
        };
        let [low, high] = axis.travel_mm;
        let half_mm = 0.5 * (high - low);
        let fixed_mm = 0.5 * (low + high) + self.fixed_end * half_mm; // (3)
        let position = &scene.run.motion.position[self.axis];
        let [fast, slow, viscous, nut, of_square @ ..] = self.free_per_mm;
        let history = scene.history;
        let heat = &history.speed[self.axis];
        let square = &history.speed_squared[self.axis];
        let lagged = |series: &[f64], lags: f64, unit: f64| -> Vec<f64> {
            let lagged = history.lagged(series, lags * self.lag_s);
            lagged.into_iter().map(|v| v / unit).collect()
        };
        let by_speed = |lags: f64| lagged(heat, lags, STATED_SPEED_MM_S);
        let by_square = || lagged(square, 1.0, STATED_SPEED_MM_S.powi(2));
        let by_nut = || {
            let warming = scene.warming_k(&[nut_of(self.axis)]);
            warming.map_or_else(Vec::new, |series| {
                history.lagged_temperature(&series, self.lag_s)
            })
        };
        let (third, once, thrice) = (|| by_speed(1.0 / 3.0), || by_speed(1.0), || by_speed(3.0));
        let of_speed = [(self.growth_per_mm, 1.0), (fast, 1.0 / 3.0), (slow, 3.0)];
        let is_local = self.add_local(scene, response, &of_speed, fixed_mm);
        let even = |amplitude: f64| if is_local { 0.0 } else { amplitude };
        let linear = mixture(&[
            (even(self.growth_per_mm), &once),
            (even(fast), &third),
            (even(slow), &thrice),
            (viscous, &by_square),
            (nut, &by_nut),
        ]);
        let drive = &mut response.drive[self.axis];
        scene.add_slow(&linear, drive, |tick| position[tick] - fixed_mm); // (2)
        let [fast, middle, slow] = of_square;
        let curved = mixture(&[(fast, &third), (middle, &once), (slow, &thrice)]);
        scene.add_slow(&curved, drive, |tick| {
            let from_mm = position[tick] - fixed_mm;
            from_mm * from_mm.abs() / half_mm
        });
    }
}

impl ScrewElongation {
    /// (2) of amplitudes, each with its time constant over tau; whether the zones are known.
    fn add_local(
        &self,
        scene: &Scene<'_>,
        response: &mut Response,
        terms: &[(f64, f64)],
        fixed_mm: f64,
    ) -> bool {
        let rubbing = &scene.history.rubbing[self.axis];
        if rubbing.speed.is_empty() {
            return false;
        }
        let mut strain = vec![[0.0; ZONES]; rubbing.speed.len()];
        for (amplitude, lags) in terms.iter().filter(|(amplitude, _)| amplitude.abs() > 0.0) {
            let lagged = rubbing.lagged(scene.history.step_s, lags * self.lag_s, STEEL_MM2_S);
            let scale = amplitude * ZONES as f64 / STATED_SPEED_MM_S;
            for (sum, zones) in strain.iter_mut().zip(lagged) {
                for (sum, zone) in sum.iter_mut().zip(zones) {
                    *sum += scale * zone; // (1)
                }
            }
        }
        let motion = &scene.run.motion;
        let ticks = motion.time_s.iter().zip(&motion.position[self.axis]);
        for (sum, (at_s, position)) in response.drive[self.axis].iter_mut().zip(ticks) {
            let of = |zones: &[f64; ZONES]| {
                rubbing.integral(zones, *position) - rubbing.integral(zones, fixed_mm)
            };
            *sum += scene.history.between(&strain, *at_s, of); // (2)
        }
        true
    }
}

const fn nut_of(axis: Axis) -> SensorPlace {
    match axis {
        Axis::Y | Axis::B => SensorPlace::NutY,
        Axis::Z | Axis::C => SensorPlace::NutZ,
        Axis::X | Axis::A => SensorPlace::NutX,
    }
}
