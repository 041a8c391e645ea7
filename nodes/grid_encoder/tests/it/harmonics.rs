//! Harmonics of the radial trace of one circle against the closed forms in the head of the library.
//!
//! a = EXX, b = EXY, c = EYX, d = EYY; the closed forms take squareness as C_x = φ y, ISO 230-1 has
//! C_x = −EC0Y y, so φ = −EC0Y. With the yaw of Y, C_x = (b₂ − e₁) y² + (b₃ − e₂) y³ − e₃ y⁴.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use grid_encoder::basis::ModelComponent;
use grid_encoder::identify::default_basis;
use grid_encoder::published::radial_system;
use grid_encoder::recording::Place;
use machine::Kinematics;
use metrology::PerAxis;
use metrology::sample::TestPlane;
use nalgebra::{DVector, Vector3};

const R_MM: f64 = 50.0;
const N: u32 = 360;
const AGREEMENT_MM: f64 = 1e-12;

/// Coefficients of the trace of one unknown, in its own unit: (cos k, sin k) for k = 0 to 6.
fn harmonics(name: &str, power: u8, value: f64) -> [(f64, f64); 7] {
    let kinematics = Kinematics::of_chain("[w X' Y' b Z t]".parse().unwrap(), PerAxis::default());
    let place = Place::circle(TestPlane::Xy, Vector3::zeros(), R_MM, N);
    let component = name.parse().unwrap();
    let basis = default_basis(component, 0.0, 3);
    let first = if component.is_location {
        0
    } else {
        4 - u8::try_from(basis.len()).unwrap()
    };
    let angles: Vec<f64> = (0..N)
        .map(|k| f64::from(k) * std::f64::consts::TAU / f64::from(N))
        .collect();
    let system = radial_system(
        &kinematics,
        &[ModelComponent { component, basis }],
        &place,
        &angles,
    );
    let idx = usize::from(power - first);
    let mut beta = DVector::zeros(system.scale.len());
    beta[idx] = value / system.scale[idx];
    let trace = &system.design * beta;
    std::array::from_fn(|k| {
        let share = if k == 0 { 1.0 } else { 2.0 } / f64::from(N);
        let sum = |f: fn(f64) -> f64| -> f64 {
            let terms = trace.iter().zip(&angles).map(|(r, a)| r * f(k as f64 * a));
            terms.sum::<f64>() * share
        };
        (sum(f64::cos), sum(f64::sin))
    })
}

/// Expected (harmonic, cosine, sine); all others are zero.
fn check(name: &str, power: u8, value: f64, expected: &[(usize, f64, f64)]) {
    for (k, (cosine, sine)) in harmonics(name, power, value).into_iter().enumerate() {
        let wanted = expected.iter().find(|(of, ..)| *of == k);
        let (c, s) = wanted.map_or((0.0, 0.0), |(_, c, s)| (*c, *s));
        assert!(
            (cosine - c).abs() < AGREEMENT_MM,
            "{name}{power} cos{k}: {cosine} {c}"
        );
        assert!(
            (sine - s).abs() < AGREEMENT_MM,
            "{name}{power} sin{k}: {sine} {s}"
        );
    }
}

#[test]
fn eq1_linear_and_cubic_positioning_give_the_mean_and_the_even_cosines() {
    let (v, w) = (1e-5, 1e-9);
    let (linear, cubic) = (R_MM * v, R_MM.powi(3) * w);
    check(
        "EXX",
        1,
        v,
        &[(0, linear / 2.0, 0.0), (2, linear / 2.0, 0.0)],
    );
    check(
        "EYY",
        1,
        v,
        &[(0, linear / 2.0, 0.0), (2, -linear / 2.0, 0.0)],
    );
    check(
        "EXX",
        3,
        w,
        &[
            (0, 0.375 * cubic, 0.0),
            (2, cubic / 2.0, 0.0),
            (4, cubic / 8.0, 0.0),
        ],
    );
    check(
        "EYY",
        3,
        w,
        &[
            (0, 0.375 * cubic, 0.0),
            (2, -cubic / 2.0, 0.0),
            (4, cubic / 8.0, 0.0),
        ],
    );
}

#[test]
fn eq2_eq3_quadratic_terms_give_the_odd_harmonics() {
    let v = 1e-7;
    let q = R_MM * R_MM * v / 4.0;
    check("EXX", 2, v, &[(1, 3.0 * q, 0.0), (3, q, 0.0)]);
    check("EXY", 2, v, &[(1, q, 0.0), (3, -q, 0.0)]);
    check("EYY", 2, v, &[(1, 0.0, 3.0 * q), (3, 0.0, -q)]);
    check("EYX", 2, v, &[(1, 0.0, q), (3, 0.0, q)]);
}

#[test]
fn eq4_squareness_and_cubic_straightness_give_the_even_sines() {
    let (v, w) = (1e-5, 1e-9);
    let cubic = R_MM.powi(3) * w;
    check("EC0Y", 0, v, &[(2, 0.0, -R_MM * v / 2.0)]);
    check(
        "EXY",
        3,
        w,
        &[(2, 0.0, cubic / 4.0), (4, 0.0, -cubic / 8.0)],
    );
    check("EYX", 3, w, &[(2, 0.0, cubic / 4.0), (4, 0.0, cubic / 8.0)]);
}

#[test]
fn the_yaw_of_y_acts_as_its_straightness_one_power_up_and_alone_gives_the_fifth() {
    let (v, w) = (1e-7, 1e-9);
    let q = R_MM * R_MM * v / 4.0;
    let cubic = R_MM.powi(3) * w;
    check("ECY", 1, v, &[(1, -q, 0.0), (3, q, 0.0)]);
    check(
        "ECY",
        2,
        w,
        &[(2, 0.0, -cubic / 4.0), (4, 0.0, cubic / 8.0)],
    );
    // −e₃ y⁴ cos: sin⁴ cos = (2 cos − 3 cos 3 + cos 5) / 16.
    let quartic = R_MM.powi(4) * 1e-11 / 16.0;
    check(
        "ECY",
        3,
        1e-11,
        &[
            (1, -2.0 * quartic, 0.0),
            (3, 3.0 * quartic, 0.0),
            (5, -quartic, 0.0),
        ],
    );
}

#[test]
fn the_yaw_of_x_is_on_no_circle_about_the_origin() {
    for power in 1..=3 {
        check("ECX", power, 1e-6, &[]);
    }
}
