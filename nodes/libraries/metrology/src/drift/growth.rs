//! How a drift goes on after the instant of its model: the sum of (1) and (2) of `drift`.

use nalgebra::Vector3;

use crate::sample::DriftGrowth;

/// What one growth has added to the drift since the model was fitted, mm: the sum's term of (1).
#[inline]
pub(super) fn growth_mm(
    growth: &DriftGrowth,
    lever_mm: &Vector3<f64>,
    relaxed: &mut Relaxed,
) -> f64 {
    let rate_mm_s = growth.rate_mm_s + growth.gradient_rate_per_s.dot(lever_mm);
    if rate_mm_s == 0.0 {
        return 0.0;
    }
    rate_mm_s * relaxed.with(growth.time_constant_s)
}

/// (2) at one instant, computed once for each time constant.
pub(super) struct Relaxed {
    elapsed_s: f64,
    /// Bits of a time constant, and (2) with it; the faces of each axis have one.
    known: [(u64, f64); 3],
    n: usize,
}

impl Relaxed {
    pub(super) const fn since(elapsed_s: f64) -> Self {
        Self {
            elapsed_s,
            known: [(0, 0.0); 3],
            n: 0,
        }
    }

    #[inline]
    fn with(&mut self, time_constant_s: f64) -> f64 {
        let bits = time_constant_s.to_bits();
        for (known, relaxed_s) in self.known.iter().take(self.n) {
            if *known == bits {
                return *relaxed_s;
            }
        }
        let new_s = relaxed_s(self.elapsed_s, time_constant_s);
        if let Some(free) = self.known.get_mut(self.n) {
            *free = (bits, new_s);
            self.n += 1;
        }
        new_s
    }
}

/// Effective time for which an initial rate has acted after `elapsed_s`, s: (2).
#[must_use]
pub fn relaxed_s(elapsed_s: f64, time_constant_s: f64) -> f64 {
    if time_constant_s.is_infinite() {
        return elapsed_s;
    }
    // exp_m1 keeps the difference exact while the elapsed time is a small part of the time constant.
    -time_constant_s * (-elapsed_s / time_constant_s).exp_m1()
}
