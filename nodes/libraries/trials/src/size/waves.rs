//! How far readings at two places go together, when waves of form have every direction and length.
//!
//! # Model
//!
//! ```text
//!   K = mean over wave lengths of sin(k d) / (k d),   k = 2 pi / length     (3)
//! ```
//!
//! as `size` numbers it; d is the distance of the places, mm, and lengths go from 80 to 800 mm.
//!
//! # Agreement
//! `eq3_is_the_covariance_of_many_drawn_waves`: 0.02 of 1.

use crate::rig::WAVE_MM;

/// Lengths that (3) is averaged over, evenly in their logarithm.
const LENGTHS: u32 = 24;

/// (3) at whole multiples of [`Waves::STEP_MM`], and linear between them: within 1e-5 of 1.
pub(super) struct Waves {
    alike: Vec<f64>,
}

impl Waves {
    const STEP_MM: f64 = 0.25;
    /// Longer than any travel's diagonal, in steps.
    const DIAGONAL_STEPS: u32 = 8000;

    /// At a distance.
    pub(super) fn alike(&self, apart_mm: f64) -> f64 {
        let place = apart_mm / Self::STEP_MM;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a distance of less than two metres"
        )]
        let below = place as usize;
        match self.alike.get(below..below + 2) {
            Some(&[before, after]) => before + (after - before) * (place - below as f64),
            _ => alike(apart_mm),
        }
    }
}

impl Default for Waves {
    fn default() -> Self {
        let at = |step: u32| alike(f64::from(step) * Self::STEP_MM);
        Self {
            alike: (0..Self::DIAGONAL_STEPS).map(at).collect(),
        }
    }
}

/// (3).
fn alike(apart_mm: f64) -> f64 {
    let [shortest, longest] = WAVE_MM;
    let of_length = |k: u32| {
        let share = (f64::from(k) + 0.5) / f64::from(LENGTHS);
        let phase =
            std::f64::consts::TAU * apart_mm / (shortest * (longest / shortest).powf(share));
        if phase < 1e-6 {
            1.0
        } else {
            phase.sin() / phase
        }
    };
    (0..LENGTHS).map(of_length).sum::<f64>() / f64::from(LENGTHS)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use rand::{Rng, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64Mcg;

    use super::*;

    #[test]
    fn eq3_is_the_covariance_of_many_drawn_waves() {
        let mut rng = Pcg64Mcg::seed_from_u64(11);
        let apart = Vector3::new(30.0, -20.0, 45.0);
        let count = 200_000;
        let mut sum = 0.0;
        for _ in 0..count {
            let length = WAVE_MM[0] * (WAVE_MM[1] / WAVE_MM[0]).powf(rng.random::<f64>());
            let direction = Vector3::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
            sum += (direction.normalize().dot(&apart) * std::f64::consts::TAU / length).cos();
        }
        let drawn = sum / f64::from(count);
        assert!((drawn - alike(apart.norm())).abs() < 0.02, "{drawn}");
        assert!((alike(0.0) - 1.0).abs() < 1e-12);
        let waves = Waves::default();
        for apart_mm in [0.0, 0.1, 33.33, 80.0, 611.7, 1999.9, 2500.0] {
            let off = waves.alike(apart_mm) - alike(apart_mm);
            assert!(off.abs() < 1e-5, "{apart_mm}: {off}");
        }
    }
}
