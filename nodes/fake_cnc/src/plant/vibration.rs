//! How the tool shakes against the workpiece at a frequency that does not stay.
//!
//! Pumps, fans and their foundations shake a machine at a frequency that wanders with load and slip, so that neither
//! phase nor period is the same from run to run:
//!
//! ```text
//!   x_d(t) = A_d sin(phi(t) + p_d)                                        (1)
//!   d phi/dt = 2 pi (f + w),   dw = -w/T dt + s sqrt(2/T) dB              (2)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | A_d | `amplitude_um`, direction by direction | µm |
//! | p_d | drawn once | rad |
//! | f, s, T | `frequency_hz`, `wander_hz`, `wander_time_s` | Hz, Hz, s |
//!
//! (2) is drawn exactly for a constant step: w' = e w + s sqrt(1 - e2) n, e = exp(-dt/T).
//!
//! # Holds when
//! The shaking does not depend on where the axes stand or how they move, and the step is short against 1/f. The
//! drives do not feel it.
//!
//! # Agreement
//! `eq1_…`, `eq2_…` below: half the amplitude's square within 2 %, the frequency and its wander within 5 %.
//!
//! # References
//! \[1\] G. E. Uhlenbeck, L. S. Ornstein, Phys. Rev. 36, 1930 (the process).

use std::f64::consts::TAU;

use nalgebra::Vector3;

use super::error::{PlantError, require_not_negative, require_positive};
use super::file::VibrationEntry;
use super::noise::{Effect, Stream};

/// The shaking of one machine.
#[derive(Clone, Debug)]
pub(super) struct Vibration {
    amplitude_mm: [f64; 3],
    phase_rad: [f64; 3],
    frequency_hz: f64,
    wander_hz: f64,
    time_s: f64,
    random: Stream,
    /// phi.
    turned_rad: f64,
    /// w.
    off_hz: f64,
}

impl Vibration {
    /// The vibration of a plant file.
    pub(super) fn new(entry: &VibrationEntry, seed: u64) -> Result<Self, PlantError> {
        for (direction, amplitude_um) in entry.amplitude_um.into_iter().enumerate() {
            require_not_negative(format!("vibration.amplitude_um[{direction}]"), amplitude_um)?;
        }
        require_positive("vibration.frequency_hz", entry.frequency_hz)?;
        require_not_negative("vibration.wander_hz", entry.wander_hz)?;
        require_positive("vibration.wander_time_s", entry.wander_time_s)?;
        let mut random = Stream::new(seed, Effect::Vibration, 0);
        Ok(Self {
            amplitude_mm: entry.amplitude_um.map(|um| um / 1e3),
            phase_rad: std::array::from_fn(|_| TAU * random.uniform()),
            frequency_hz: entry.frequency_hz,
            wander_hz: entry.wander_hz,
            time_s: entry.wander_time_s,
            turned_rad: TAU * random.uniform(),
            off_hz: entry.wander_hz * random.normal(),
            random,
        })
    }

    /// Lets time pass, (2).
    pub(super) fn pass(&mut self, period_s: f64) {
        self.turned_rad =
            (self.turned_rad + TAU * (self.frequency_hz + self.off_hz) * period_s) % TAU;
        let kept = (-period_s / self.time_s).exp();
        let fresh = self.wander_hz * (1.0 - kept * kept).sqrt();
        self.off_hz = kept * self.off_hz + fresh * self.random.normal();
    }

    /// (1), mm.
    pub(super) fn at_mm(&self) -> Vector3<f64> {
        Vector3::from_fn(|d, _| self.amplitude_mm[d] * (self.turned_rad + self.phase_rad[d]).sin())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry() -> VibrationEntry {
        VibrationEntry {
            amplitude_um: [0.3, 0.0, 0.1],
            frequency_hz: 47.0,
            wander_hz: 3.0,
            wander_time_s: 0.5,
        }
    }

    #[test]
    fn eq1_each_direction_has_half_the_square_of_its_amplitude() {
        let mut vibration = Vibration::new(&entry(), 4).unwrap();
        let mut squares = Vector3::zeros();
        let ticks = 400_000;
        for _ in 0..ticks {
            vibration.pass(1e-3);
            squares += vibration.at_mm().component_mul(&vibration.at_mm());
        }
        let mean_um2 = squares * 1e6 / f64::from(ticks);
        assert!((mean_um2.x / 0.045 - 1.0).abs() < 0.02, "{mean_um2}");
        assert!(mean_um2.y == 0.0);
        assert!((mean_um2.z / 0.005 - 1.0).abs() < 0.02, "{mean_um2}");
    }

    #[test]
    fn eq2_the_frequency_has_its_mean_and_wanders_as_far_as_it_should() {
        let mut vibration = Vibration::new(&entry(), 5).unwrap();
        let (mut sum, mut squares, mut product, mut turned) = (0.0, 0.0, 0.0, 0.0);
        let ticks = 2_000_000;
        let mut late = [0.0; 500];
        for tick in 0..ticks {
            let before = vibration.turned_rad;
            let off_hz = vibration.off_hz;
            vibration.pass(1e-3);
            turned += (vibration.turned_rad - before).rem_euclid(TAU);
            sum += off_hz;
            squares += off_hz * off_hz;
            product += off_hz * late[tick % 500];
            late[tick % 500] = off_hz;
        }
        let n = ticks as f64;
        assert!((turned / TAU / (n * 1e-3) / 47.0 - 1.0).abs() < 0.01);
        let variance = squares / n - (sum / n).powi(2);
        assert!((variance.sqrt() / 3.0 - 1.0).abs() < 0.05, "{variance}");
        // Half a second apart the correlation is 1/e.
        let kept = product / squares;
        assert!((kept - (-1.0_f64).exp()).abs() < 0.05, "{kept}");
    }

    #[test]
    fn a_frequency_that_is_none_is_refused_by_name() {
        let wrong = VibrationEntry {
            frequency_hz: 0.0,
            ..entry()
        };
        let error = Vibration::new(&wrong, 1).unwrap_err().to_string();
        assert!(error.contains("vibration.frequency_hz"), "{error}");
    }
}
