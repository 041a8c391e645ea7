//! Spindle growth against two bodies that warm each other.

use metrology::Axis;
use twin::{Channel, History};

use crate::effects::past::{instants, integrate, predict, read, stands, warm};
use crate::effects::scene::bench;

const ID: (&str, &str) = ("spindle_growth", "");

/// Shaft and head: heat capacities, conductances to each other and to the air.
const SHAFT_J_PER_K: f64 = 5000.0;
const HEAD_J_PER_K: f64 = 60_000.0;
const BETWEEN_W_PER_K: f64 = 12.0;
const SHAFT_AIR_W_PER_K: f64 = 2.0;
const HEAD_AIR_W_PER_K: f64 = 16.0;
const LOSS_W: f64 = 220.0;
/// Growth of the nose for each, mm/K: 0.3 m of shaft, 0.15 m of head.
const SHAFT_MM_PER_K: f64 = 11.5e-6 * 300.0;
const HEAD_MM_PER_K: f64 = 11.5e-6 * 150.0;

fn two_bodies(_: f64, [shaft_k, head_k]: [f64; 2]) -> [f64; 2] {
    let across_w = BETWEEN_W_PER_K * (shaft_k - head_k);
    [
        (LOSS_W - across_w - SHAFT_AIR_W_PER_K * shaft_k) / SHAFT_J_PER_K,
        (across_w - HEAD_AIR_W_PER_K * head_k) / HEAD_J_PER_K,
    ]
}

/// Time constants, s, and shares of the growth in the end, mm, from the eigenvalues of the two balances.
fn modes() -> [(f64, f64); 2] {
    let a = -(BETWEEN_W_PER_K + SHAFT_AIR_W_PER_K) / SHAFT_J_PER_K;
    let b = BETWEEN_W_PER_K / SHAFT_J_PER_K;
    let c = BETWEEN_W_PER_K / HEAD_J_PER_K;
    let d = -(BETWEEN_W_PER_K + HEAD_AIR_W_PER_K) / HEAD_J_PER_K;
    let (half, root) = (0.5 * (a + d), (0.25 * (a - d).powi(2) + b * c).sqrt());
    let (fast, slow) = (half - root, half + root);
    let determinant = a * d - b * c;
    let heat = LOSS_W / SHAFT_J_PER_K;
    let (shaft_end, head_end) = (-d * heat / determinant, c * heat / determinant);
    // Eigenvectors (b, lambda - a); the end state is the sum of both.
    let share = |one: f64, other: f64| {
        let weight = (head_end * b - shaft_end * (other - a)) / (b * (one - other));
        weight * (SHAFT_MM_PER_K * b + HEAD_MM_PER_K * (one - a))
    };
    [
        (-1.0 / fast, share(fast, slow)),
        (-1.0 / slow, share(slow, fast)),
    ]
}

#[test]
fn val_spindle_growth_two_bodies() {
    let machine = bench();
    let [(fast_s, fast_mm), (slow_s, slow_mm)] = modes();
    let given = [
        ("fast_um", fast_mm * 1e3),
        ("slow_um", slow_mm * 1e3),
        ("fast_min", fast_s / 60.0),
        ("slow_min", slow_s / 60.0),
    ];
    let at_s = [60.0, 300.0, 900.0, 3600.0, 10_800.0];
    let mut run = stands(&at_s, |_| [0.0; 3]);
    read(&mut run, &Channel::Length(Axis::Z));
    let seen = predict(&machine, &History::default(), &run, ID, &given);
    let mut worst = 0.0_f64;
    for (end_s, seen) in at_s.iter().zip(&seen) {
        let [shaft_k, head_k] = integrate(two_bodies, [0.0; 2], *end_s, 4000);
        let grown_mm = SHAFT_MM_PER_K * shaft_k + HEAD_MM_PER_K * head_k;
        worst = worst.max((seen + grown_mm).abs());
    }
    println!("two bodies: worst {worst:.2e} mm of {:.4}", seen[4]);
    assert!(seen[4] < -0.03, "the nose comes down: {seen:?}");
    assert!(worst < 1e-12, "{worst}");
}

#[test]
fn eq1_follows_the_spindle_s_thermometer() {
    let machine = bench();
    let warming = |t: f64| 8.0 * (1.0 - (t / 1500.0).cos());
    let history = warm(5.0, 1500, "spindle_front", &|t| 22.0 + warming(t));
    let given = [
        ("fast_um", 12.0),
        ("slow_um", 30.0),
        ("fast_min", 2.0),
        ("slow_min", 50.0),
        ("free_y_um", 6.0),
    ];
    let mut run = stands(&[7000.0], |_| [0.0; 3]);
    read(&mut run, &Channel::Length(Axis::Z));
    read(&mut run, &Channel::Length(Axis::Y));
    let seen = predict(&machine, &history, &run, ID, &given);
    let follow = |t: f64, [a, b]: [f64; 2]| {
        [
            (warming(t) / 10.0 - a) / 120.0,
            (warming(t) / 10.0 - b) / 3000.0,
        ]
    };
    let [fast, slow] = integrate(follow, [0.0; 2], 7000.0, 7000);
    assert!(
        (seen[0] + 0.012 * fast + 0.030 * slow).abs() < 2e-6,
        "{seen:?}"
    );
    assert!((seen[1] - 0.006 * slow).abs() < 2e-6, "{seen:?}");
}

#[test]
fn every_place_grows_alike() {
    let machine = bench();
    let given = [
        ("fast_um", 12.0),
        ("slow_um", 30.0),
        ("fast_min", 2.0),
        ("slow_min", 50.0),
    ];
    let seen = |z: f64| {
        let mut run = stands(&instants(4, 600.0), |_| [100.0, -20.0, z]);
        read(&mut run, &Channel::Length(Axis::Z));
        predict(&machine, &History::default(), &run, ID, &given)
    };
    assert_eq!(seen(0.0), seen(400.0));
}

/// A front bearing that stays cold, and a rear one that is warmer by 20 K from 10 s on: 11 985 s later, with a lag of 40 min,
/// 20 K/10 K 9.3 um (1 - exp(-11 985/2400)).
#[test]
fn where_a_spindle_has_two_thermometers_the_rear_one_may_be_followed() {
    let machine = bench();
    let warming = |t: f64| if t < 10.0 { 22.0 } else { 42.0 };
    let mut history = warm(10.0, 1200, "spindle_rear", &warming);
    let cold = ("spindle_front".to_owned(), vec![22.0; 1200]);
    history.temperature_degc.extend([cold]);
    let given = [
        ("fast_um", 0.0),
        ("slow_um", 9.3),
        ("fast_min", 2.0),
        ("slow_min", 40.0),
    ];
    let mut run = stands(&[11_995.0], |_| [0.0; 3]);
    read(&mut run, &Channel::Length(Axis::Z));
    let seen = |on: &str| predict(&machine, &history, &run, (ID.0, on), &given)[0];
    assert!(seen("").abs() < 1e-12);
    let wanted_mm = -2.0 * 9.3e-3 * (1.0 - (-11_985.0_f64 / 2400.0).exp());
    assert!(
        (seen("spindle_rear") - wanted_mm).abs() < 1e-9,
        "{}",
        seen("spindle_rear")
    );
}
