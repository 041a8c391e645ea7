//! Air of the shop: a day's cycle and slow draughts.
//!
//! ```text
//!   T(t) = T_start + A [sin(w t + f) - sin f] + x(t),   w = 2 pi / 24 h     (1)
//!   x[k+1] = p x[k] + s sqrt(1 - p^2) n,   p = exp(-dt / tau)              (2)
//! ```
//!
//! The draughts (2) are a Gauss-Markov process that starts at zero: the air is calm when the machine
//! is soaked.

use std::f64::consts::TAU;

use super::error::{PlantError, require_finite, require_not_negative, require_positive};
use super::file::ShopAirEntry;
use super::noise::{Effect, Stream};

const DAY_S: f64 = 86_400.0;

/// The air with its state.
#[derive(Clone, Debug)]
pub(super) struct ShopAir {
    entry: ShopAirEntry,
    phase_rad: f64,
    persistence: f64,
    draught_k: f64,
    stream: Stream,
}

impl ShopAir {
    pub(super) fn new(entry: &ShopAirEntry, seed: u64, step_s: f64) -> Result<Self, PlantError> {
        let at = |key: &str| format!("heat.shop_air.{key}");
        require_finite(at("start_temp_degc"), entry.start_temp_degc)?;
        require_finite(at("day_amplitude_k"), entry.day_amplitude_k)?;
        require_finite(at("day_phase_deg"), entry.day_phase_deg)?;
        require_not_negative(at("draught_k"), entry.draught_k)?;
        require_positive(at("draught_time_s"), entry.draught_time_s)?;
        Ok(Self {
            phase_rad: entry.day_phase_deg.to_radians(),
            persistence: (-step_s / entry.draught_time_s).exp(),
            draught_k: 0.0,
            stream: Stream::new(seed, Effect::ShopAir, 0),
            entry: entry.clone(),
        })
    }

    /// Advances the draughts by one heat step and gives the air's temperature at `elapsed_s`, °C.
    pub(super) fn step(&mut self, elapsed_s: f64) -> f64 {
        let noise = self.stream.normal();
        let spread = self.entry.draught_k * (1.0 - self.persistence * self.persistence).sqrt();
        self.draught_k = self.persistence * self.draught_k + spread * noise; // (2)
        let angle = TAU * elapsed_s / DAY_S + self.phase_rad;
        let day = self.entry.day_amplitude_k * (angle.sin() - self.phase_rad.sin());
        self.entry.start_temp_degc + day + self.draught_k // (1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn air(day_amplitude_k: f64, draught_k: f64) -> ShopAir {
        let entry = ShopAirEntry {
            start_temp_degc: 20.0,
            day_amplitude_k,
            day_phase_deg: 0.0,
            draught_k,
            draught_time_s: 100.0,
        };
        ShopAir::new(&entry, 3, 1.0).unwrap()
    }

    #[test]
    fn eq1_the_day_returns_after_24_hours_and_peaks_after_six() {
        let mut air = air(2.3, 0.0);
        assert!((air.step(21_600.0) - 22.3).abs() < 1e-12);
        assert!((air.step(86_400.0) - 20.0).abs() < 1e-9);
    }

    #[test]
    fn eq2_draughts_have_the_stated_variance() {
        let mut air = air(0.0, 0.2);
        let n = 200_000;
        let sum: f64 = (0..n).map(|_| (air.step(0.0) - 20.0).powi(2)).sum();
        // 2,000 correlation times, half of them independent: 1 standard deviation is 3.2 %.
        assert!((sum / f64::from(n) / 0.04 - 1.0).abs() < 0.1);
    }
}
