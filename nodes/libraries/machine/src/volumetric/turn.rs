//! Turns of a point: by a rotation vector, about a line, about a coordinate direction.
//!
//! ```text
//!   R(w) v = v + a w x v + b w x (w x v),   a = sin|w|/|w|,   b = (1 - cos|w|)/|w|^2       (1)
//!   |R(w) v - [v + w x (v + w x v/2)]| <= |w|^3 |v| (1/6 + |w|/24)                        (2)
//!   q = k pi/2 + r, |r| <= pi/4:  sin r, cos r by their series to r^15 and r^16            (3)
//! ```
//!
//! (2) is the remainder of both series of (1) and serves where |w|^2 < 1e-9: an error motion of 30 µrad, and below
//! 6e-12 mm at a metre. Up to 1 mrad the series of a and b serve, exact to the last bit there. (3) gives sine and cosine
//! of a rotary axis together; pi/2 is taken off in two parts, so that r keeps its digits over any number of turns.
//!
//! # Agreement
//! `eq2_leaves_less_than_its_bound`; `val_eq3_is_the_standard_library_s_sine_and_cosine`: 2.3e-16 over 300 turns.
//!
//! # References
//! \[1\] W. J. Cody, W. Waite, Software Manual for the Elementary Functions, Prentice-Hall 1980: reduction in (3) (from memory).

use std::f64::consts::{FRAC_2_PI, FRAC_PI_2};

use nalgebra::Vector3;

/// Sine and cosine of one angle.
pub(super) type SinCos = (f64, f64);

/// |w|² below which (2) serves.
const TINY: f64 = 1e-9;
/// |w|² below which the next term of either series of (1) is less than 1e-21.
const SMALL: f64 = 1e-6;

/// R(w) v.
#[inline(always)]
pub(super) fn turned(w: &Vector3<f64>, v: &Vector3<f64>) -> Vector3<f64> {
    let square = w.norm_squared();
    if square < TINY {
        return v + w.cross(&(v + w.cross(v) * 0.5)); // (2)
    }
    turned_far(w, v, square)
}

/// (1).
fn turned_far(w: &Vector3<f64>, v: &Vector3<f64>, square: f64) -> Vector3<f64> {
    let (a, b) = if square < SMALL {
        const A: (f64, f64) = (1.0 / 6.0, 1.0 / 120.0);
        const B: (f64, f64) = (1.0 / 24.0, 1.0 / 720.0);
        (
            1.0 - square * (A.0 - square * A.1),
            0.5 - square * (B.0 - square * B.1),
        )
    } else {
        let angle = square.sqrt();
        (angle.sin() / angle, (1.0 - angle.cos()) / square)
    };
    let once = w.cross(v);
    v + once * a + w.cross(&once) * b
}

/// Turn about a unit vector.
#[inline(always)]
pub(super) fn turned_by(n: &Vector3<f64>, (sin, cos): SinCos, v: &Vector3<f64>) -> Vector3<f64> {
    v * cos + n.cross(v) * sin + n * (n.dot(v) * (1.0 - cos))
}

/// Turn about a coordinate direction.
#[inline(always)]
pub(super) fn turned_about(row: usize, (sin, cos): SinCos, v: &Vector3<f64>) -> Vector3<f64> {
    match row {
        0 => Vector3::new(v.x, cos * v.y - sin * v.z, sin * v.y + cos * v.z),
        1 => Vector3::new(cos * v.x + sin * v.z, v.y, cos * v.z - sin * v.x),
        _ => Vector3::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y, v.z),
    }
}

/// π/2 less its last 20 bits: its multiples by whole numbers up to 2²⁰ are exact.
const UPPER: f64 = f64::from_bits(FRAC_PI_2.to_bits() & !0xF_FFFF);
/// The rest of π/2, of which f64 itself holds all but 6.1e-17.
const LOWER: f64 = (FRAC_PI_2 - UPPER) + 6.123_233_995_736_766e-17;
/// Added and taken off again it leaves the nearest whole number, whose last bits are its own last bits.
const ROUNDER: f64 = 6_755_399_441_055_744.0;
/// Angles for which the multiples of π/2 are exact, rad.
const EXACT_RAD: f64 = 1e6;

/// (3).
#[inline]
pub(super) fn sin_cos(angle_rad: f64) -> SinCos {
    let is_exact = angle_rad.abs() < EXACT_RAD;
    if !is_exact {
        return angle_rad.sin_cos();
    }
    let rounded = angle_rad * FRAC_2_PI + ROUNDER;
    let quarters = rounded - ROUNDER;
    let r = (angle_rad - quarters * UPPER) - quarters * LOWER;
    let (sin, cos) = (sine(r), cosine(r));
    match rounded.to_bits() & 3 {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

/// 1/n!, with the sign of the series.
const fn term(n: u32) -> f64 {
    let mut product = 1.0;
    let mut k = 2;
    while k <= n {
        product *= k as f64;
        k += 1;
    }
    if n & 2 == 0 {
        1.0 / product
    } else {
        -1.0 / product
    }
}

#[inline(always)]
fn sine(r: f64) -> f64 {
    const SINE_TERMS: [f64; 7] = [
        term(15),
        term(13),
        term(11),
        term(9),
        term(7),
        term(5),
        term(3),
    ];
    let square = r * r;
    let mut sum = SINE_TERMS[0];
    for c in &SINE_TERMS[1..] {
        sum = sum * square + c;
    }
    r + r * (square * sum)
}

#[inline(always)]
fn cosine(r: f64) -> f64 {
    const COSINE_TERMS: [f64; 7] = [
        term(16),
        term(14),
        term(12),
        term(10),
        term(8),
        term(6),
        term(4),
    ];
    let square = r * r;
    let mut sum = COSINE_TERMS[0];
    for c in &COSINE_TERMS[1..] {
        sum = sum * square + c;
    }
    let half = 0.5 * square;
    let whole = 1.0 - half;
    // What 1 - half has rounded away is put back.
    whole + ((1.0 - whole - half) + square * square * sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    #[test]
    fn eq2_leaves_less_than_its_bound() {
        let mut rng = Pcg64Mcg::seed_from_u64(12);
        let mut draw = |size: f64| Vector3::from_fn(|_, _| rng.random_range(-size..size));
        for _ in 0..20_000 {
            let (w, v) = (draw(1.8e-5), draw(1000.0));
            let exact = turned_far(&w, &v, w.norm_squared());
            let bound = w.norm().powi(3) * v.norm() * (1.0 / 6.0 + w.norm() / 24.0);
            let rounding = 4.0 * f64::EPSILON * v.norm();
            assert!((turned(&w, &v) - exact).norm() <= bound + rounding);
            assert!(bound < 1.2e-11, "{bound}");
        }
    }

    #[test]
    fn val_eq3_is_the_standard_library_s_sine_and_cosine() {
        let mut rng = Pcg64Mcg::seed_from_u64(13);
        let mut greatest = 0.0_f64;
        let random = (0..200_000).map(|_| rng.random_range(-2000.0..2000.0));
        let quarters = (-64..=64).flat_map(|k| {
            let at = f64::from(k) * FRAC_PI_2 / 2.0;
            [at - 1e-9, at, at + 1e-9]
        });
        for angle in random.chain(quarters) {
            let (sin, cos) = sin_cos(angle);
            let expected = angle.sin_cos();
            greatest = greatest.max((sin - expected.0).abs());
            greatest = greatest.max((cos - expected.1).abs());
        }
        assert!(greatest < 2.3e-16, "{greatest}");
        assert_eq!(sin_cos(0.0), (0.0, 1.0));
        assert!(sin_cos(f64::NAN).0.is_nan());
        assert_eq!(sin_cos(1e9), 1e9_f64.sin_cos());
    }
}
