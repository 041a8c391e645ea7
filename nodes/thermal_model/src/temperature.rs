//! Temperatures between block cycles: what they say, and whether they have earned a say.
//!
//! # Model
//!
//! Between updates k−1 and k the drift of each face f and the temperature of each sensor s changed by
//! Δd_f and ΔT_s. One ridge regression per face, one penalty for all:
//!
//! ```text
//!   Δd_f = Σ_s b_fs ΔT_s + ε                                                      (1)
//!   b_f = V diag(σ/(σ² + λ)) Uᵀ Δd_f,   ΔT = U diag(σ) Vᵀ                         (2)
//!   e_k = (Δd_k − Δd̂_k) / (1 − h_kk),   H = U diag(σ²/(σ² + λ)) Uᵀ                (3)
//! ```
//!
//! (3) is the residual of update k predicted from all others, without fitting again. λ is the value
//! that makes its root mean square least; that least one is chosen from many by the very updates that
//! it is to judge, and so too small. What is reported, and decides, leaves each update out of the choice
//! of λ too:
//!
//! ```text
//!   e_k = Δd_k − b(λ_k)ᵀ ΔT_k,   λ_k and b from all updates but k                 (4)
//! ```
//!
//! The regression counts as proven when the root mean square of (4) stays under a share of what holding
//! leaves (the root mean square of Δd itself). The penalty takes the place of a rank decision: there are
//! often more sensors than updates.
//!
//! # Holds when
//! The heat paths are those of the updates used. Radiation and coolant have no sensor here.
//!
//! # Agreement
//! `eq3_is_the_residual_of_fitting_again_without_the_update`: below 1e-9 mm.
//! `eq4_is_no_optimist_where_temperatures_say_nothing`: of a variance of 1 that nothing explains, the
//! least (3) leaves 0.96 and (4) 1.31 in 500 sets of 8 updates and 4 sensors.
//!
//! # References
//! \[1\] G. H. Golub, M. Heath, G. Wahba, Technometrics 21(2), 1979, doi:10.1080/00401706.1979.10489751.

use std::collections::VecDeque;

use metrology::stamp::Span;
use metrology::{Host, Stamp};
use nalgebra::{DMatrix, DVector};

use crate::reference::FaceDrift;

/// Increments below which no regression is tried.
pub const LEAST_INCREMENTS: usize = 4;

/// Readings of all sensors of the machine file over the last while.
#[derive(Clone, Debug)]
pub struct Thermometers {
    readings: Vec<VecDeque<(Stamp<Host>, f64)>>,
    keep: Span,
}

impl Thermometers {
    /// `n_sensors` that are remembered for `keep_s`.
    #[must_use]
    pub fn new(n_sensors: usize, keep_s: f64) -> Self {
        Self {
            readings: vec![VecDeque::new(); n_sensors],
            keep: Span::from_secs_f64(keep_s),
        }
    }

    /// Adds a reading, °C; one that is older than the sensor's latest is dropped.
    pub fn add(&mut self, sensor: usize, at: Stamp<Host>, temperature_degc: f64) {
        let readings = &mut self.readings[sensor];
        if readings.back().is_some_and(|(last, _)| at <= *last) {
            return;
        }
        readings.push_back((at, temperature_degc));
        while readings
            .front()
            .is_some_and(|(first, _)| at - *first > self.keep)
        {
            readings.pop_front();
        }
    }

    /// Moves all instants after a step of the clock.
    pub fn shift(&mut self, by: Span) {
        for (at, _) in self.readings.iter_mut().flatten() {
            *at += by;
        }
    }

    /// Readings of one sensor in (`from`, `to`].
    pub fn between(
        &self,
        sensor: usize,
        from: Stamp<Host>,
        to: Stamp<Host>,
    ) -> impl Iterator<Item = (Stamp<Host>, f64)> + '_ {
        self.readings
            .get(sensor)
            .into_iter()
            .flatten()
            .copied()
            .filter(move |(at, _)| *at > from && *at <= to)
    }

    /// Age of a sensor's last reading, s; `None` if it never gave one.
    #[must_use]
    pub fn age_s(&self, sensor: usize, now: Stamp<Host>) -> Option<f64> {
        let (last, _) = self.readings.get(sensor)?.back()?;
        Some((now - *last).as_secs_f64())
    }

    /// Mean of every sensor over the last `window_s`, °C; `None` where it is silent.
    #[must_use]
    pub fn means_degc(&self, now: Stamp<Host>, window_s: f64) -> Vec<Option<f64>> {
        let from = now - Span::from_secs_f64(window_s);
        (0..self.readings.len())
            .map(|sensor| {
                let (mut sum, mut n) = (0.0, 0_u32);
                for (_, degc) in self.between(sensor, from, now) {
                    sum += degc;
                    n += 1;
                }
                (n > 0).then(|| sum / f64::from(n))
            })
            .collect()
    }
}

/// One update as the regression sees it.
#[derive(Clone, Debug)]
pub struct Observed {
    /// Drift of the faces.
    pub faces: Vec<FaceDrift>,
    /// Mean temperature of each sensor then, °C.
    pub temperatures_degc: Vec<Option<f64>>,
}

/// A fitted regression.
#[derive(Clone, Debug)]
pub struct Regression {
    sensors: Vec<usize>,
    /// Row per face, column per sensor used, mm/K.
    coefficients_mm_per_k: DMatrix<f64>,
    /// Faces, as of the last update.
    faces: Vec<FaceDrift>,
    from_degc: Vec<f64>,
    /// Root mean square of (4), mm.
    pub left_out_rms_mm: f64,
    /// Root mean square of Δd, mm: what holding leaves.
    pub hold_rms_mm: f64,
    /// Increments used.
    pub n_increments: usize,
}

impl Regression {
    /// Fits (1) to successive updates; `None` when there are too few or no common sensor.
    #[must_use]
    pub fn fit(updates: &[Observed]) -> Option<Self> {
        let last = updates.last()?;
        let sensors: Vec<usize> = (0..last.temperatures_degc.len())
            .filter(|&s| {
                updates
                    .iter()
                    .all(|u| matches!(u.temperatures_degc.get(s), Some(Some(_))))
            })
            .collect();
        let faces: Vec<FaceDrift> = last
            .faces
            .iter()
            .filter(|f| {
                updates
                    .iter()
                    .all(|u| u.faces.iter().any(|g| g.same_face(f)))
            })
            .copied()
            .collect();
        let n = updates.len().checked_sub(1)?;
        if n < LEAST_INCREMENTS || sensors.is_empty() || faces.is_empty() {
            return None;
        }
        let degc =
            |k: usize, s: usize| updates[k].temperatures_degc[sensors[s]].unwrap_or(f64::NAN);
        let x = DMatrix::from_fn(n, sensors.len(), |k, s| degc(k + 1, s) - degc(k, s));
        let drift_mm = |k: usize, f: &FaceDrift| {
            let found = updates[k].faces.iter().find(|g| g.same_face(f));
            found.map_or(f64::NAN, |g| g.drift_mm)
        };
        let y = DMatrix::from_fn(n, faces.len(), |k, f| {
            drift_mm(k + 1, &faces[f]) - drift_mm(k, &faces[f])
        });
        let ridge = Ridge::best(&x, &y)?;
        Some(Self {
            from_degc: (0..sensors.len()).map(|s| degc(n, s)).collect(),
            coefficients_mm_per_k: ridge.coefficients.transpose(),
            sensors,
            faces,
            left_out_rms_mm: left_out_rms(&x, &y)?,
            hold_rms_mm: (y.norm_squared() / y.len() as f64).sqrt(),
            n_increments: n,
        })
    }

    /// Whether it predicted left-out updates well enough to be used.
    #[must_use]
    pub fn is_proven(&self, ratio: f64) -> bool {
        self.left_out_rms_mm < ratio * self.hold_rms_mm
    }

    /// The sensors it needs.
    #[must_use]
    pub fn sensors(&self) -> &[usize] {
        &self.sensors
    }

    /// Faces at the temperatures given (°C per sensor of the machine file); `None` if one it needs is silent.
    #[must_use]
    pub fn predict(&self, temperatures_degc: &[Option<f64>]) -> Option<Vec<FaceDrift>> {
        let mut change_k = DVector::zeros(self.sensors.len());
        for (row, (&sensor, from_degc)) in self.sensors.iter().zip(&self.from_degc).enumerate() {
            change_k[row] = (*temperatures_degc.get(sensor)?)? - from_degc;
        }
        let change_mm = &self.coefficients_mm_per_k * change_k;
        let moved = self.faces.iter().zip(change_mm.iter());
        Some(
            moved
                .map(|(face, change_mm)| FaceDrift {
                    drift_mm: face.drift_mm + change_mm,
                    ..*face
                })
                .collect(),
        )
    }
}

/// Root mean square of (4), mm.
fn left_out_rms(x: &DMatrix<f64>, y: &DMatrix<f64>) -> Option<f64> {
    let mut squares = 0.0;
    for k in 0..x.nrows() {
        let others = Ridge::best(&x.clone().remove_row(k), &y.clone().remove_row(k))?;
        let missed = y.row(k) - x.row(k) * &others.coefficients;
        squares += missed.norm_squared();
    }
    Some((squares / y.len() as f64).sqrt())
}

struct Ridge {
    /// Sensors by faces.
    coefficients: DMatrix<f64>,
    left_out_rms: f64,
}

impl Ridge {
    /// The penalty with the least left-out residual: (2), (3).
    fn best(x: &DMatrix<f64>, y: &DMatrix<f64>) -> Option<Self> {
        let svd = x.clone().try_svd(true, true, f64::EPSILON, 0)?;
        let greatest = svd.singular_values.max();
        if !(greatest > 0.0 && greatest.is_finite()) {
            return None;
        }
        let (u, v_t) = (svd.u?, svd.v_t?);
        (-12..=4)
            .map(|exponent| {
                let lambda = greatest.powi(2) * 10_f64.powf(f64::from(exponent) / 2.0);
                let shrink = |power: i32| {
                    svd.singular_values
                        .map(|s| s.powi(power) / (s * s + lambda))
                };
                let coefficients =
                    v_t.transpose() * DMatrix::from_diagonal(&shrink(1)) * u.transpose() * y;
                let hat = &u * DMatrix::from_diagonal(&shrink(2)) * u.transpose();
                let residual = y - &hat * y;
                let left_out = DMatrix::from_fn(y.nrows(), y.ncols(), |k, f| {
                    residual[(k, f)] / (1.0 - hat[(k, k)])
                });
                Self {
                    coefficients,
                    left_out_rms: (left_out.norm_squared() / y.len() as f64).sqrt(),
                }
            })
            .min_by(|a, b| a.left_out_rms.total_cmp(&b.left_out_rms))
    }
}

#[cfg(test)]
#[expect(clippy::print_stdout, reason = "figures that the header quotes")]
mod tests {
    use super::*;
    use crate::latency_share::LatencyShares;
    use metrology::Axis;
    use nalgebra::Vector3;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};
    use rand_pcg::Pcg64Mcg;

    fn face(block: usize, drift_mm: f64) -> FaceDrift {
        FaceDrift {
            block,
            axis: Axis::Z,
            point_mm: Vector3::zeros(),
            drift_mm,
            standard_uncertainty_mm: 4e-4,
            hot_uncertainty_mm: 3e-4,
            latency: LatencyShares::default(),
            at: Stamp::from_nanos(0),
        }
    }

    fn history(n: usize, drift: impl Fn(f64, f64) -> f64) -> Vec<Observed> {
        let noise = Normal::new(0.0, 0.02).unwrap();
        let mut rng = Pcg64Mcg::seed_from_u64(3);
        (0..n)
            .map(|k| {
                let t = k as f64 * 15.0;
                let spindle_k = 14.0 * (1.0 - (-t / 40.0).exp()) + 3.0 * (t / 25.0).sin();
                let ambient_k = 0.02 * t;
                let d_mm = drift(spindle_k, ambient_k);
                let mut read = |k: f64| Some(20.0 + k + noise.sample(&mut rng));
                Observed {
                    faces: vec![face(0, d_mm), face(1, 0.5 * d_mm)],
                    temperatures_degc: vec![read(spindle_k), read(ambient_k), None],
                }
            })
            .collect()
    }

    #[test]
    fn drift_that_follows_a_sensor_is_proven_and_predicted() {
        let updates = history(10, |spindle_k, _| 2.5e-3 * spindle_k);
        let fit = Regression::fit(&updates).unwrap();
        assert!(
            fit.is_proven(0.7),
            "{} {}",
            fit.left_out_rms_mm,
            fit.hold_rms_mm
        );
        assert_eq!(fit.sensors(), [0, 1]);
        let mut warmer = updates[9].temperatures_degc.clone();
        warmer[0] = warmer[0].map(|t| t + 4.0);
        let predicted = fit.predict(&warmer).unwrap();
        assert!((predicted[0].drift_mm - updates[9].faces[0].drift_mm - 0.010).abs() < 5e-4);
        assert!(fit.predict(&[None, Some(20.0), None]).is_none());
    }

    #[test]
    fn drift_that_no_sensor_knows_is_not_proven() {
        let noise = Normal::new(0.0, 5e-3).unwrap();
        let mut rng = Pcg64Mcg::seed_from_u64(8);
        let mut updates = history(12, |_, _| 0.0);
        for update in &mut updates {
            update
                .faces
                .iter_mut()
                .for_each(|f| f.drift_mm = noise.sample(&mut rng));
        }
        assert!(!Regression::fit(&updates).unwrap().is_proven(0.7));
    }

    #[test]
    fn eq3_is_the_residual_of_fitting_again_without_the_update() {
        let x =
            DMatrix::from_row_slice(5, 2, &[1.0, 0.3, 2.0, -0.5, 0.4, 1.2, -1.0, 0.8, 0.6, 0.1]);
        let y = DMatrix::from_row_slice(5, 1, &[1.1, 2.3, 0.1, -0.7, 0.9]);
        let chosen = Ridge::best(&x, &y).unwrap().left_out_rms;
        let by_refit = (-12..=4)
            .map(|exponent| {
                let lambda = x.clone().svd(false, false).singular_values.max().powi(2)
                    * 10_f64.powf(f64::from(exponent) / 2.0);
                let sum: f64 = (0..5)
                    .map(|k| {
                        let (xk, yk) = (x.clone().remove_row(k), y.clone().remove_row(k));
                        let normal = xk.transpose() * &xk + DMatrix::identity(2, 2) * lambda;
                        let b = normal.lu().solve(&(xk.transpose() * yk)).unwrap();
                        (y[(k, 0)] - (x.row(k) * b)[0]).powi(2)
                    })
                    .sum();
                (sum / 5.0).sqrt()
            })
            .fold(f64::INFINITY, f64::min);
        assert!((chosen - by_refit).abs() < 1e-9, "{chosen} {by_refit}");
    }

    #[test]
    fn eq4_is_no_optimist_where_temperatures_say_nothing() {
        let noise = Normal::new(0.0, 1.0).unwrap();
        let mut rng = Pcg64Mcg::seed_from_u64(12);
        let (mut chosen, mut left_out) = (0.0, 0.0);
        for _ in 0..500 {
            let mut matrix =
                |rows, columns| DMatrix::from_fn(rows, columns, |_, _| noise.sample(&mut rng));
            let (x, y) = (matrix(8, 4), matrix(8, 2));
            chosen += Ridge::best(&x, &y).unwrap().left_out_rms.powi(2) / 500.0;
            left_out += left_out_rms(&x, &y).unwrap().powi(2) / 500.0;
        }
        println!("variance 1 left: chosen by (3) {chosen:.3}, by (4) {left_out:.3}");
        assert!(chosen < 0.97, "the choice flatters itself: {chosen}");
        assert!(left_out > 1.0, "{left_out}");
    }

    #[test]
    fn too_few_updates_or_silent_sensors_give_no_regression() {
        assert!(Regression::fit(&history(LEAST_INCREMENTS, |s, _| s)).is_none());
        let mut silent = history(8, |s, _| s);
        silent[3].temperatures_degc = vec![None; 3];
        assert!(Regression::fit(&silent).is_none());
    }

    #[test]
    fn means_are_over_the_window_and_a_silent_sensor_has_none() {
        let at = |s: i64| Stamp::from_nanos(s * 1_000_000_000);
        let mut thermometers = Thermometers::new(2, 100.0);
        for (s, degc) in [(0, 10.0), (50, 20.0), (60, 22.0), (55, 90.0)] {
            thermometers.add(0, at(s), degc);
        }
        assert_eq!(thermometers.means_degc(at(60), 30.0), [Some(21.0), None]);
        assert_eq!(thermometers.age_s(0, at(70)), Some(10.0));
    }
}
