//! Curves that effects are made of: Legendre polynomials over the travel, hats, harmonics.
//!
//! ```text
//!   h_k(x) = max(0, 1 - |x - x_k| / d), equally spaced by d               (1)
//!   P_n of ((u - middle) / half travel)                                   (2)
//! ```

use metrology::Axis;

use super::{Parameter, Scene};

/// Sum of hats (1) with places `first`, `first + spacing`, ...; zero beyond the outer ones.
pub(super) fn hats(first: f64, spacing: f64, heights: &[f64], at: f64) -> f64 {
    let place = (at - first) / spacing;
    let mut sum = 0.0;
    for (k, height) in heights.iter().enumerate() {
        let distance = (place - k as f64).abs();
        if distance < 1.0 {
            sum += height * (1.0 - distance);
        }
    }
    sum
}

/// Number of hats over the way since a reversal.
pub(super) const WAY_HATS: usize = 6;

/// Hats over the decimal logarithm of the way since a reversal, at 0.01, 0.03, 0.1, 0.3, 1 and 3 mm.
pub(super) fn way_hats(heights: &[f64; WAY_HATS], way_mm: f64) -> f64 {
    hats(-2.0, 0.5, heights, way_mm.max(1e-9).log10())
}

/// Places of the wide hats over the travel.
const WIDE_HATS: usize = 7;
/// Number of hats over the travel.
pub(super) const PLACE_HATS: usize = 2 * WIDE_HATS + 1;

/// Hats over the travel at a share of the half travel: at 1/8 .. 7/8 of it, each an eighth wide to either side, then halfway
/// between these and beyond them, half as wide, for what is shorter. Together they have any height at every sixteenth.
pub(super) fn place_hats(heights: &[f64; PLACE_HATS], share: f64) -> f64 {
    let (wide, narrow) = heights.split_at(WIDE_HATS);
    let place = (share + 0.875) / 0.25;
    let nearest = place.round();
    let height = |k: &usize| narrow.get(*k).copied().unwrap_or(0.0);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "one of eight places"
    )]
    let of_narrow = if (0.0..=WIDE_HATS as f64).contains(&nearest) {
        let distance = 2.0 * (place - nearest).abs();
        height(&(nearest as usize)) * (1.0 - distance).max(0.0)
    } else {
        0.0
    };
    hats(-0.75, 0.25, wide, share) + of_narrow
}

/// Heights of any curve over the travel beside P2 and P3: P4 and P5, then the hats in the order of [`place_hats`].
pub(super) const CURVE_UM: &[Parameter] = &[
    Parameter::ordinate("free_p4_um", 60.0, 1.0),
    Parameter::ordinate("free_p5_um", 60.0, 1.0),
    Parameter::ordinate("free_1_of_8_um", 60.0, 1.0),
    Parameter::ordinate("free_2_of_8_um", 60.0, 1.0),
    Parameter::ordinate("free_3_of_8_um", 60.0, 1.0),
    Parameter::ordinate("free_4_of_8_um", 60.0, 1.0),
    Parameter::ordinate("free_5_of_8_um", 60.0, 1.0),
    Parameter::ordinate("free_6_of_8_um", 60.0, 1.0),
    Parameter::ordinate("free_7_of_8_um", 60.0, 1.0),
    Parameter::ordinate("free_1_of_16_um", 60.0, 1.0),
    Parameter::ordinate("free_3_of_16_um", 60.0, 1.0),
    Parameter::ordinate("free_5_of_16_um", 60.0, 1.0),
    Parameter::ordinate("free_7_of_16_um", 60.0, 1.0),
    Parameter::ordinate("free_9_of_16_um", 60.0, 1.0),
    Parameter::ordinate("free_11_of_16_um", 60.0, 1.0),
    Parameter::ordinate("free_13_of_16_um", 60.0, 1.0),
    Parameter::ordinate("free_15_of_16_um", 60.0, 1.0),
];

/// Sum of Legendre polynomials of the orders `first`, `first + 1`, ... at x.
pub(super) fn legendre(first: usize, amplitudes: &[f64], x: f64) -> f64 {
    let (mut before, mut here) = (1.0, x);
    let mut order = 1_usize;
    let mut sum = 0.0;
    let mut n = 1.0;
    if first == 0 {
        sum += amplitudes.first().copied().unwrap_or(0.0);
    }
    while order < first + amplitudes.len() {
        if order >= first {
            sum += amplitudes[order - first] * here;
        }
        (before, here) = (here, ((2.0 * n + 1.0) * x * here - n * before) / (n + 1.0));
        (order, n) = (order + 1, n + 1.0);
    }
    sum
}

/// Where an axis is within its travel, -1 to 1, as place = (position - middle) * scale.
#[derive(Clone, Copy, Debug)]
pub(super) struct Travel {
    middle: f64,
    per_half: f64,
}

impl Travel {
    /// Of an axis of the machine, mm or rad; an axis that the machine lacks stays in its middle.
    pub(super) fn of(scene: &Scene<'_>, axis: Axis) -> Self {
        let [low, high] = match (scene.machine.linear(axis), scene.machine.rotary_axis(axis)) {
            (Some(linear), _) => linear.travel_mm,
            (_, Some(rotary)) => rotary.travel_deg.map(f64::to_radians),
            _ => [0.0, f64::INFINITY],
        };
        Self {
            middle: if high.is_finite() {
                0.5 * (low + high)
            } else {
                0.0
            },
            per_half: 2.0 / (high - low),
        }
    }

    /// One over the half travel.
    pub(super) const fn per_half(self) -> f64 {
        self.per_half
    }

    /// Share of the half travel, (2).
    pub(super) fn share(self, position: f64) -> f64 {
        (position - self.middle) * self.per_half
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hats_over_the_travel_have_any_height_at_every_sixteenth() {
        let mut random = (1..16)
            .map(|k| f64::from(k * k % 7) - 3.0)
            .collect::<Vec<_>>();
        random.insert(0, 0.0);
        random.push(0.0);
        let mut heights = [0.0; PLACE_HATS];
        for k in 1..8 {
            heights[k - 1] = random[2 * k];
        }
        for k in 0..8 {
            let (before, here, after) = (random[2 * k], random[2 * k + 1], random[2 * k + 2]);
            heights[WIDE_HATS + k] = here - 0.5 * (before + after);
        }
        for (k, wanted) in (0_u32..).zip(&random) {
            let share = -1.0 + f64::from(k) / 8.0;
            assert!((place_hats(&heights, share) - wanted).abs() < 1e-12, "{k}");
        }
        assert!(place_hats(&heights, -1.3).abs() < 1e-12);
    }
}
