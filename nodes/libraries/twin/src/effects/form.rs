//! Curves that effects are made of: Legendre polynomials and splines over the travel, hats.
//!
//! ```text
//!   h_k(x) = max(0, 1 - |x - x_k| / d), equally spaced by d               (1)
//!   P_n of ((u - middle) / half travel)                                   (2)
//!   B(t) = 1 - 3/2 t^2 + 3/4 |t|^3 to |t| = 1, then (2 - |t|)^3 / 4 to |t| = 2    (3)
//! ```

use metrology::Axis;

use super::{Parameter, Scene};
use crate::Response;

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
    if heights.iter().all(|height| *height == 0.0) {
        return 0.0;
    }
    hats(-2.0, 0.5, heights, way_mm.max(1e-9).log10())
}

/// Places of the wide splines over the travel.
const WIDE_SPLINES: usize = 7;
/// Number of splines over the travel.
pub(super) const PLACE_SPLINES: usize = 2 * WIDE_SPLINES + 1;

/// Cubic B-spline with its peak of 1 at zero, its knots 1 apart: what a beam does that is pressed at one place.
fn spline(distance: f64) -> f64 {
    let t = distance.abs();
    if t < 1.0 {
        1.0 - 0.75 * t * t * (2.0 - t)
    } else {
        0.25 * (2.0 - t).max(0.0).powi(3)
    }
}

/// Splines (3) over the travel at a share of the half travel: at 1/8 .. 7/8 of it with knots an eighth apart, then halfway
/// between these and beyond them with knots a sixteenth apart. Together they are any cubic spline with knots at the
/// sixteenths that is nothing beyond both ends.
pub(super) fn place_splines(heights: &[f64; PLACE_SPLINES], share: f64) -> f64 {
    let (wide, narrow) = heights.split_at(WIDE_SPLINES);
    let place = (share + 0.75) / 0.25;
    let mut sum = 0.0;
    for (k, height) in wide.iter().enumerate() {
        sum += height * spline(place - k as f64);
    }
    for (k, height) in narrow.iter().enumerate() {
        sum += height * spline(2.0 * (place - k as f64) + 1.0);
    }
    sum
}

/// Parts of the travel over which a slope is summed; Simpson's rule.
const SLOPE_PARTS: usize = 128;

/// Slope of the least-squares line through the splines over the travel, for each unit of the share: 3/2 times the integral of
/// share times height from -1 to 1.
pub(super) fn slope_of_splines(heights: &[f64; PLACE_SPLINES]) -> f64 {
    let step = 2.0 / SLOPE_PARTS as f64;
    let of = |k: usize| {
        let share = step * k as f64 - 1.0;
        let weight = match k {
            0 | SLOPE_PARTS => 1.0,
            k if k % 2 == 1 => 4.0,
            _ => 2.0,
        };
        weight * share * place_splines(heights, share)
    };
    let sum: f64 = (0..=SLOPE_PARTS).map(of).sum();
    1.5 * sum * step / 3.0
}

/// Heights of any curve over the travel beside P2 and P3: P4 and P5, then the splines in the order of [`place_splines`].
pub(super) const CURVE_UM: &[Parameter] = &[
    Parameter::ordinate("free_p4_um", 500.0, 1.0),
    Parameter::ordinate("free_p5_um", 500.0, 1.0),
    Parameter::ordinate("free_1_of_8_um", 500.0, 1.0),
    Parameter::ordinate("free_2_of_8_um", 500.0, 1.0),
    Parameter::ordinate("free_3_of_8_um", 500.0, 1.0),
    Parameter::ordinate("free_4_of_8_um", 500.0, 1.0),
    Parameter::ordinate("free_5_of_8_um", 500.0, 1.0),
    Parameter::ordinate("free_6_of_8_um", 500.0, 1.0),
    Parameter::ordinate("free_7_of_8_um", 500.0, 1.0),
    Parameter::ordinate("free_1_of_16_um", 500.0, 1.0),
    Parameter::ordinate("free_3_of_16_um", 500.0, 1.0),
    Parameter::ordinate("free_5_of_16_um", 500.0, 1.0),
    Parameter::ordinate("free_7_of_16_um", 500.0, 1.0),
    Parameter::ordinate("free_9_of_16_um", 500.0, 1.0),
    Parameter::ordinate("free_11_of_16_um", 500.0, 1.0),
    Parameter::ordinate("free_13_of_16_um", 500.0, 1.0),
    Parameter::ordinate("free_15_of_16_um", 500.0, 1.0),
];

/// Lower end of the part of the travel over which a curve is defined, in the machine's coordinates. With [`TO_MM`] at the same
/// value, as where neither is given, that is the whole travel.
pub(super) const FROM_MM: Parameter = Parameter::shape("free_from_mm", PART_MM, 10.0, &[]);
/// Upper end of that part.
pub(super) const TO_MM: Parameter = Parameter::shape("free_to_mm", PART_MM, 100.0, &[]);
/// Where a part of a travel can lie, mm.
const PART_MM: [f64; 2] = [-100_000.0, 100_000.0];

/// Heights of a curve, then the ends of the part of the travel that it is over.
pub(super) const fn with_part<const N: usize>(heights: &[Parameter]) -> [Parameter; N] {
    let mut all = [TO_MM; N];
    let mut place = 0;
    while place < heights.len() {
        all[place] = heights[place];
        place += 1;
    }
    all[heights.len()] = FROM_MM;
    all
}

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

    /// Of a part of an axis' travel, mm; of the whole travel where the part has no length.
    pub(super) fn part(scene: &Scene<'_>, axis: Axis, [from, to]: [f64; 2]) -> Self {
        if from >= to {
            return Self::of(scene, axis);
        }
        Self {
            middle: f64::midpoint(from, to),
            per_half: 2.0 / (to - from),
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

    /// The same of a curve that beyond a part of the travel stays as it is at its end.
    pub(super) fn share_within(self, position: f64, [from, to]: [f64; 2]) -> f64 {
        let share = self.share(position);
        if from < to {
            share.clamp(-1.0, 1.0)
        } else {
            share
        }
    }
}

/// Number of polynomials of a width that is another one along the axis.
const PLACE_ORDERS: usize = 6;

/// A width between both senses that is another one along the axis, x the place within the travel or a part of it, -1 to 1:
/// `q - m += -sgn(last motion) (w_1 P_1(x) + .. + w_6 P_6(x)) / 2`.
pub(super) struct WidthByPlace {
    axis: Axis,
    widths_mm: [f64; PLACE_ORDERS],
    part_mm: [f64; 2],
}

impl WidthByPlace {
    /// Of w_1 to w_6 in µm and the ends of the part in mm.
    pub(super) fn new(axis: Axis, values: &[f64]) -> Self {
        Self {
            axis,
            widths_mm: std::array::from_fn(|k| values[k] * 1e-3),
            part_mm: [0, 1].map(|k| values[PLACE_ORDERS + k]),
        }
    }

    pub(super) fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        if self.widths_mm.iter().all(|width| *width == 0.0) {
            return;
        }
        let travel = Travel::part(scene, self.axis, self.part_mm);
        let motion = &scene.run.motion;
        let ticks = motion.sense[self.axis]
            .iter()
            .zip(&motion.position[self.axis]);
        for (sum, (sense, here)) in response.drive[self.axis].iter_mut().zip(ticks) {
            let width_mm = legendre(1, &self.widths_mm, travel.share(*here));
            *sum -= 0.5 * f64::from(*sense) * width_mm;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splines_over_the_travel_are_any_cubic_spline_with_knots_at_the_sixteenths() {
        let fine = |k: i32, share: f64| spline(8.0 * (share + 1.0) - f64::from(k));
        let alone = |number: usize, share: f64| {
            let mut heights = [0.0; PLACE_SPLINES];
            heights[number] = 1.0;
            place_splines(&heights, share)
        };
        let shares = || (0..=260).map(|k| -1.3 + f64::from(k) / 100.0);
        for share in shares() {
            for number in 0..WIDE_SPLINES {
                let k = 2 * i32::try_from(number).unwrap() + 2;
                let around = |apart: i32| fine(k - apart, share) + fine(k + apart, share);
                let wanted = 0.75 * fine(k, share) + 0.5 * around(1) + 0.125 * around(2);
                assert!(
                    (alone(number, share) - wanted).abs() < 1e-12,
                    "{number} {share}"
                );
            }
            for number in 0..=WIDE_SPLINES {
                let k = 2 * i32::try_from(number).unwrap() + 1;
                let found = alone(WIDE_SPLINES + number, share);
                assert!((found - fine(k, share)).abs() < 1e-12, "{number} {share}");
            }
        }
    }

    #[test]
    fn splines_add_up_to_a_constant_within() {
        let mut heights = [2.0 / 3.0; PLACE_SPLINES];
        heights[WIDE_SPLINES..].fill(0.0);
        for k in 0..20 {
            let share = -0.5 + 0.05 * f64::from(k);
            assert!(
                (place_splines(&heights, share) - 1.0).abs() < 1e-12,
                "{share}"
            );
        }
    }
}
