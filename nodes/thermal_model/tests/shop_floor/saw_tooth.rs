//! What holding the last drift leaves, and what better predictions take away from it.

use crate::shop::{Shop, U_MM, config};
use metrology::Axis;
use metrology::drift::{Extrapolate, axis_drift_at};
use nalgebra::Vector3;
use rand::SeedableRng;
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64Mcg;
use thermal_model::config::Method;
use thermal_model::prediction::Predictor;
use thermal_model::{Diagnostic, ThermalModelConfig};

const A_MM: f64 = 0.060;

/// Share of the drift remaining at the last update that is missing right before the next.
fn residual_share(shop: &Shop, drift: impl Fn(f64) -> f64) -> f64 {
    let now_s = shop.now().as_secs_f64();
    let updated_s = now_s - 900.0;
    let p_mm = Vector3::new(40.0, 0.0, 0.0);
    let modelled = axis_drift_at(
        shop.model(),
        Axis::X,
        &p_mm,
        shop.now(),
        Extrapolate::Linear,
    )
    .unwrap();
    (drift(now_s) - modelled) / (A_MM - drift(updated_s))
}

fn first_order(extra: &str, tau_min: f64, n_updates: u32) -> (Shop, f64) {
    let drift = move |t_s: f64| A_MM * (1.0 - (-t_s / (tau_min * 60.0)).exp());
    let mut shop = Shop::new(config(extra));
    shop.cold();
    for _ in 0..n_updates {
        shop.wait_s(900.0);
        let d_mm = drift(shop.now().as_secs_f64());
        shop.cycle(false, |axis, corner| corner[axis.index()] + d_mm);
    }
    shop.wait_s(900.0);
    let share = residual_share(&shop, drift);
    (shop, share)
}

#[test]
fn val_hold_residual_is_22_and_39_percent() {
    for (tau_min, percent) in [(60.0, 22.0), (30.0, 39.0)] {
        let (_, share) = first_order(", relaxation: {enabled: false}", tau_min, 3);
        println!("tau {tau_min} min: residual {:.2} %", 100.0 * share);
        assert!((100.0 * share - percent).abs() < 0.5, "{share}");
        let closed = 1.0 - (-15.0 / tau_min).exp();
        assert!((share - closed).abs() < 1e-9);
    }
}

#[test]
fn an_identified_time_constant_takes_most_of_the_saw_tooth_away() {
    let (shop, share) = first_order("", 60.0, 4);
    println!("residual with relaxation {:.2} %", 100.0 * share);
    assert!(share.abs() < 0.02, "{share}");
    let x = shop.model().axes[Axis::X].unwrap();
    assert!((x.growth[0].unwrap().time_constant_s / 3600.0 - 1.0).abs() < 0.05);
    assert!(shop.diagnostics.iter().any(|d| matches!(
        d,
        Diagnostic::Scored {
            next: Predictor::Relaxation,
            ..
        }
    )));
}

#[test]
fn a_drift_with_constant_rate_leaves_the_rate_times_the_period() {
    let mut shop = Shop::new(config(""));
    shop.cold();
    for k in 1..5 {
        shop.wait_s(900.0);
        shop.cycle(false, |axis, corner| {
            corner[axis.index()] + 0.004 * f64::from(k)
        });
    }
    // No time constant can be seen in a straight line, so the drift is held.
    assert!(shop.model().axes[Axis::X].unwrap().growth == [None; 3]);
    let scores: Vec<_> = shop
        .diagnostics
        .iter()
        .filter_map(|d| match d {
            Diagnostic::Scored { score, .. } => Some(score.hold_um),
            _ => None,
        })
        .collect();
    assert_eq!(scores.len(), 4);
    assert!(
        scores.iter().all(|um| (um - 4.0).abs() < 1e-6),
        "{scores:?}"
    );
}

#[test]
fn faces_with_a_time_constant_move_the_axes_they_are_coupled_to_and_no_others_are_invented() {
    // X is sheared along Y with one time constant; Y and Z only wander.
    let tau_s = 2400.0;
    let shear = |t_s: f64| 5e-4 * (1.0 - (-t_s / tau_s).exp());
    let noise = Normal::new(0.0, U_MM).unwrap();
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    let machine = serde_saphyr::from_str(include_str!(
        "../../../../launch_configs/four_blocks/machine.yaml"
    ));
    let config = config(", temperature: {enabled: false}");
    let config = ThermalModelConfig {
        method: Method::NBlock,
        slope_error_limit_um: 30.0,
        ..config
    };
    let mut shop = Shop::on(config, machine.unwrap());
    shop.cold();
    for _ in 0..5 {
        shop.wait_s(900.0);
        let angle = shear(shop.now().as_secs_f64());
        shop.cycle(false, |axis, corner| match axis {
            // The X faces are touched 6 mm inside of the corners.
            Axis::X => {
                let y_mm = corner.y - 6.0 * corner.y.signum();
                corner.x + angle * y_mm + U_MM * 0.3 * noise.sample(&mut rng)
            }
            _ => corner[axis.index()] + U_MM * 0.3 * noise.sample(&mut rng),
        });
    }
    let identified: Vec<bool> = Axis::LINEAR
        .iter()
        .map(|axis| {
            shop.diagnostics.iter().rev().find_map(|d| match d {
                Diagnostic::TimeConstant { axis: of, .. } if of == axis => Some(true),
                Diagnostic::NoTimeConstant { axis: of, .. } if of == axis => Some(false),
                _ => None,
            }) == Some(true)
        })
        .collect();
    assert_eq!(identified, [true, false, false]);
    let updated_s = shop.now().as_secs_f64();
    shop.wait_s(900.0);
    let now_s = shop.now().as_secs_f64();
    for p_mm in [
        Vector3::new(50.0, 150.0, 60.0),
        Vector3::new(-80.0, -170.0, 200.0),
    ] {
        let at = |axis| {
            let now = shop.now();
            axis_drift_at(shop.model(), axis, &p_mm, now, Extrapolate::Linear).unwrap()
        };
        let held_mm = (shear(now_s) - shear(updated_s)) * p_mm.y;
        let missed_mm = shear(now_s) * p_mm.y - at(Axis::X);
        let (held_um, missed_um) = (1e3 * held_mm, 1e3 * missed_mm);
        println!("at {p_mm:?}: holding misses {held_um:.2} µm, growth {missed_um:.2} µm");
        assert!(missed_um.abs() < 0.3 * held_um.abs());
        assert!(at(Axis::Y).abs() < 2e-3 && at(Axis::Z).abs() < 2e-3);
    }
}

#[test]
fn temperatures_are_used_once_they_have_proven_themselves_and_then_follow_between_cycles() {
    let noise = Normal::new(0.0, 1.0).unwrap();
    let mut rng = Pcg64Mcg::seed_from_u64(4);
    // A load that swings: no single time constant, but the spindle sensor knows.
    let spindle_k = |t_s: f64| 8.0 + 6.0 * (t_s / 2100.0).sin() + 3.0 * (t_s / 1300.0).cos();
    let drift_mm = |t_s: f64| 1.5e-3 * (spindle_k(t_s) - spindle_k(0.0));
    let mut shop = Shop::new(config(""));
    let mut used = Vec::new();
    for second in 0..14 * 900 {
        if second % 10 == 0 {
            let degc = 20.0 + spindle_k(f64::from(second)) + 0.05 * noise.sample(&mut rng);
            shop.temperature("spindle_front", degc);
            shop.temperature("ambient", 20.0 + 0.05 * noise.sample(&mut rng));
        }
        if second % 900 == 100 {
            let d_mm = drift_mm(f64::from(second)) - drift_mm(100.0);
            let cold = second == 100;
            shop.cycle(cold, |axis, corner| {
                let moved = if axis == Axis::Z { d_mm } else { 0.0 };
                corner[axis.index()] + moved + U_MM * noise.sample(&mut rng)
            });
            used.extend(shop.diagnostics.iter().rev().find_map(|d| match d {
                Diagnostic::Scored { next, .. } => Some(*next),
                _ => None,
            }));
        }
        shop.tick();
        shop.wait_s(1.0);
    }
    assert_eq!(used.first(), Some(&Predictor::Hold));
    assert_eq!(used.last(), Some(&Predictor::Temperature), "{used:?}");
    // Right before a cycle the model still knows the drift.
    let now_s = shop.now().as_secs_f64();
    let p_mm = Vector3::new(0.0, 0.0, 100.0);
    let modelled = axis_drift_at(
        shop.model(),
        Axis::Z,
        &p_mm,
        shop.now(),
        Extrapolate::Linear,
    )
    .unwrap();
    let missing_um = 1e3 * (drift_mm(now_s) - drift_mm(100.0) - modelled);
    println!("missing {missing_um:.2} µm");
    assert!(missing_um.abs() < 2.0, "{missing_um}");
}
