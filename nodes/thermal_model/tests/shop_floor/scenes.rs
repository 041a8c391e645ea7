//! Days in the shop: what goes wrong between a block and a model, one scene each.

use crate::shop::{Shop, U_MM, config};
use metrology::sample::{TestKind, TestSegment, UpdateReason};
use metrology::{Axis, Stamp};
use nalgebra::Vector3;
use thermal_model::{
    Diagnostic, Input, SingleBlockJump, ThermalModelConfig, ThermalModelError, ThermalModelStage,
};

fn drifted(shop: &mut Shop, by_mm: f64) {
    shop.cycle(false, |axis, corner| corner[axis.index()] + by_mm);
}

fn k0_um(shop: &Shop, axis: Axis) -> f64 {
    shop.model().axes[axis].unwrap().k0_mm * 1e3
}

fn seen(shop: &Shop, what: impl Fn(&Diagnostic) -> bool) -> usize {
    shop.diagnostics.iter().filter(|d| what(d)).count()
}

fn segment(shop: &Shop, kind: TestKind, begin: bool) -> Input {
    Input::Segment(TestSegment {
        begin,
        feed_mm_s: 2.0,
        completed: !begin,
        ..TestSegment::of_kind(kind, shop.run, shop.now())
    })
}

#[test]
fn the_published_cycle_cold_then_warm_then_a_request_at_exactly_ct() {
    let mut shop = Shop::new(config(""));
    shop.cold();
    assert_eq!(shop.models.len(), 1);
    assert!(k0_um(&shop, Axis::X).abs() < 1e-9);
    shop.wait_s(899.999_999_999);
    shop.tick();
    assert!(shop.requests.is_empty());
    shop.nanos += 1;
    shop.tick();
    assert_eq!(shop.requests.len(), 1);
    assert_eq!(shop.requests[0].reason, UpdateReason::Period);
    drifted(&mut shop, 0.012);
    assert!((k0_um(&shop, Axis::X) - 12.0).abs() < 1e-9);
    let model = shop.model();
    assert_eq!(
        (model.n_blocks, model.sequence, model.quarantined),
        (2, 2, false)
    );
    assert!(model.axes[Axis::X].unwrap().slope_identifiable);
}

#[test]
fn blocks_without_a_reference_or_of_a_strange_name_are_told() {
    let mut shop = Shop::new(config(""));
    drifted(&mut shop, 0.0);
    assert_eq!(
        seen(&shop, |d| matches!(d, Diagnostic::NoReference { run: 1 })),
        1
    );
    let mut strange = shop.measurement(0, false, |_, _| 0.0);
    strange.block_id = "vice".to_owned();
    shop.step(Input::Block(strange));
    assert_eq!(
        shop.diagnostics.last().unwrap().to_string(),
        "block \"vice\" is not in the machine file"
    );
    assert!(shop.models.is_empty());
}

#[test]
fn a_missing_block_closes_late_and_keeps_what_was_known() {
    let mut shop = Shop::new(config(""));
    shop.cold();
    shop.wait_s(900.0);
    drifted(&mut shop, 0.010);
    shop.wait_s(900.0);
    shop.run += 1;
    let only = shop.measurement(0, false, |axis, corner| corner[axis.index()] + 0.020);
    shop.step(Input::Block(only));
    shop.wait_s(301.0);
    shop.tick();
    assert_eq!(
        seen(
            &shop,
            |d| matches!(d, Diagnostic::BlockMissing { block_id, .. } if block_id == "block_2")
        ),
        1
    );
    assert_eq!(seen(&shop, |d| matches!(d, Diagnostic::AxisKept { .. })), 3);
    assert!((k0_um(&shop, Axis::X) - 10.0).abs() < 1e-9);
}

#[test]
fn a_missing_face_costs_its_axis_only_and_an_axis_long_without_faces_is_dropped() {
    let mut shop = Shop::new(config(""));
    shop.cold();
    for k in 1..=3 {
        shop.wait_s(900.0);
        shop.run += 1;
        for block in 0..2 {
            let mut measured = shop.measurement(block, false, |axis, c| {
                c[axis.index()] + 0.005 * f64::from(k)
            });
            if block == 1 {
                measured.faces[Axis::Y] = None;
            }
            shop.step(Input::Block(measured));
        }
        let expected_um = 5.0 * f64::from(k);
        assert!((k0_um(&shop, Axis::X) - expected_um).abs() < 1e-9);
        // Valid for 40 minutes: two cycles of 15 are survived, the third is not.
        assert_eq!(shop.model().axes[Axis::Y].is_some(), k < 3);
    }
    assert_eq!(
        seen(&shop, |d| matches!(
            d,
            Diagnostic::AxisDropped { axis: Axis::Y }
        )),
        1
    );
}

fn bump(mode: SingleBlockJump) -> Shop {
    let mut shop = Shop::new(ThermalModelConfig {
        single_block_jump: mode,
        ..config("")
    });
    shop.cold();
    shop.wait_s(900.0);
    drifted(&mut shop, 0.010);
    let pushed = |axis: Axis, corner: Vector3<f64>| {
        let push = if axis == Axis::X && corner.x > 0.0 {
            0.080
        } else {
            0.0
        };
        corner[axis.index()] + 0.012 + push
    };
    shop.wait_s(900.0);
    shop.cycle(false, pushed);
    assert!(shop.model().quarantined);
    assert!((k0_um(&shop, Axis::X) - 10.0).abs() < 1e-9);
    assert_eq!(
        shop.requests.last().unwrap().reason,
        UpdateReason::Confirmation
    );
    shop.wait_s(60.0);
    shop.cycle(false, pushed);
    assert!(!shop.model().quarantined);
    shop
}

#[test]
fn a_bumped_block_is_quarantined_until_measured_again_and_then_accepted() {
    let shop = bump(SingleBlockJump::Accept);
    let x = shop.model().axes[Axis::X].unwrap();
    assert!((x.slope_mm_per_mm * 440.0 - 0.080).abs() < 1e-9);
    let single = |d: &Diagnostic| matches!(d, Diagnostic::JumpConfirmed { single_block: Some(b), rebased: false } if b == "block_2");
    assert_eq!(seen(&shop, single), 1);
    // Reference, first cycle, marked copy, then both measurements of the jump.
    assert_eq!(shop.models.len(), 5);
}

#[test]
fn a_bumped_block_may_be_rebased_instead() {
    let mut shop = bump(SingleBlockJump::Rebase);
    let x = shop.model().axes[Axis::X].unwrap();
    assert!(
        x.slope_mm_per_mm.abs() * 440.0 < 0.003,
        "{}",
        x.slope_mm_per_mm
    );
    shop.wait_s(900.0);
    shop.cycle(false, |axis, corner| {
        let push = if axis == Axis::X && corner.x > 0.0 {
            0.080
        } else {
            0.0
        };
        corner[axis.index()] + 0.014 + push
    });
    assert!(!shop.model().quarantined);
    assert!((k0_um(&shop, Axis::X) - 14.0).abs() < 1e-9);
    // The pushed face rests on three readings, the cold one, the last before and the first after.
    let x = shop.model().axes[Axis::X].unwrap();
    let slope_u = (2.0 + 4.0_f64).sqrt() * U_MM / 440.0;
    assert!((x.covariance[(1, 1)].sqrt() - slope_u).abs() < 0.03 * slope_u);
}

#[test]
fn a_model_renewed_without_touches_keeps_the_instant_of_the_last_ones() {
    let mut shop = Shop::new(config(""));
    shop.cold();
    shop.wait_s(900.0);
    drifted(&mut shop, 0.010);
    let measured_at = shop.model().measured_at();
    assert_eq!(measured_at, Some(shop.now()));
    shop.wait_s(300.0);
    drifted(&mut shop, 0.500);
    // The marked copy of the old model is new, its measurement is not.
    assert!(shop.model().quarantined && shop.model().sequence == 3);
    assert_eq!(shop.model().measured_at(), measured_at);
    // Nor is that of an axis with a face missing, beside others that were measured again.
    shop.wait_s(600.0);
    shop.run += 1;
    for block in 0..2 {
        let mut measured = shop.measurement(block, false, |axis, c| c[axis.index()] + 0.011);
        if block == 1 {
            measured.faces[Axis::Y] = None;
        }
        shop.step(Input::Block(measured));
    }
    let at = |axis| shop.model().axes[axis].map(|d| d.measured_at);
    assert_eq!(at(Axis::Y), measured_at);
    assert_eq!(at(Axis::X), Some(shop.now()));
}

#[test]
fn a_wrong_cycle_is_forgotten() {
    let mut shop = Shop::new(config(""));
    shop.cold();
    shop.wait_s(900.0);
    drifted(&mut shop, 0.900);
    assert!(shop.model().quarantined);
    shop.wait_s(60.0);
    drifted(&mut shop, 0.002);
    assert_eq!(seen(&shop, |d| *d == Diagnostic::JumpContradicted), 1);
    assert!((k0_um(&shop, Axis::X) - 2.0).abs() < 1e-9 && !shop.model().quarantined);
}

#[test]
fn a_clock_that_goes_back_an_hour_keeps_ages_and_says_so() {
    let mut shop = Shop::new(config(""));
    shop.wait_s(7200.0);
    shop.cold();
    shop.wait_s(600.0);
    shop.tick();
    shop.wait_s(-3600.0);
    shop.tick();
    assert_eq!(
        seen(
            &shop,
            |d| matches!(d, Diagnostic::ClockWentBack { by_s } if (by_s - 3600.0).abs() < 1e-6)
        ),
        1
    );
    assert_eq!(shop.model().at, Stamp::from_nanos(3_600_000_000_000));
    assert!(shop.requests.is_empty());
    shop.wait_s(300.0);
    shop.tick();
    assert!((shop.requests[0].elapsed_s - 900.0).abs() < 1e-6);
    drifted(&mut shop, 0.003);
    assert!((k0_um(&shop, Axis::X) - 3.0).abs() < 1e-9);
}

#[test]
fn messages_a_moment_out_of_order_are_no_changed_clock() {
    let mut shop = Shop::new(config(""));
    shop.wait_s(10.0);
    shop.tick();
    shop.wait_s(-0.5);
    shop.cold();
    assert_eq!(
        seen(&shop, |d| matches!(d, Diagnostic::ClockWentBack { .. })),
        0
    );
    assert_eq!(shop.models.len(), 1);
}

#[test]
fn a_program_that_never_yields_is_overdue() {
    let mut shop = Shop::new(config(""));
    shop.cold();
    for _ in 0..25 {
        shop.wait_s(60.0);
        shop.tick();
    }
    assert_eq!(
        seen(&shop, |d| matches!(d, Diagnostic::UpdateOverdue { .. })),
        1
    );
    assert!(shop.requests.len() >= 4);
}

#[test]
fn predicted_drift_asks_before_the_period_is_over() {
    let mut shop = Shop::new(ThermalModelConfig {
        drift_limit_um: 8.01,
        ..config("")
    });
    shop.cold();
    shop.wait_s(900.0);
    drifted(&mut shop, 0.015);
    let asked_s = (1..900).find(|_| {
        shop.wait_s(1.0);
        shop.tick();
        !shop.requests.is_empty()
    });
    // 1 µm/min passes 8.01 µm after 480.6 s.
    assert_eq!(asked_s, Some(481));
    assert_eq!(shop.requests[0].reason, UpdateReason::PredictedDrift);
}

#[test]
fn a_change_of_load_asks_and_stops_extrapolating() {
    let mut shop = Shop::new(config(""));
    shop.cold();
    let start = segment(&shop, TestKind::Production, true);
    shop.step(start);
    for k in 0..5 {
        let left = (-f64::from(k) * 900.0 / 2400.0_f64).exp();
        drifted(&mut shop, 0.040 * (1.0 - left));
        shop.wait_s(900.0);
    }
    assert!(
        shop.model().axes[Axis::X].unwrap().growth[0]
            .unwrap()
            .rate_mm_s
            > 0.0
    );
    shop.requests.clear();
    let before_um = {
        let p_mm = Vector3::zeros();
        1e3 * metrology::drift::axis_drift_at(
            shop.model(),
            Axis::X,
            &p_mm,
            shop.now(),
            metrology::drift::Extrapolate::Linear,
        )
        .unwrap()
    };
    let mut faster = segment(&shop, TestKind::Production, true);
    if let Input::Segment(s) = &mut faster {
        s.feed_mm_s = 90.0;
    }
    shop.step(faster);
    let x = shop.model().axes[Axis::X].unwrap();
    assert!(x.growth == [None; 3]);
    assert!((k0_um(&shop, Axis::X) + x.slope_mm_per_mm * 220.0 * 1e3 - before_um).abs() < 1e-6);
}

#[test]
fn repeated_touches_within_one_segment_are_averaged() {
    let mut shop = Shop::new(config(""));
    shop.cold();
    shop.wait_s(900.0);
    let begin = segment(&shop, TestKind::Block, true);
    shop.step(begin);
    shop.run += 1;
    for by_mm in [0.010, 0.012] {
        for block in 0..2 {
            let measured = shop.measurement(block, false, |axis, c| c[axis.index()] + by_mm);
            shop.step(Input::Block(measured));
        }
    }
    assert_eq!(shop.models.len(), 1);
    let end = segment(&shop, TestKind::Block, false);
    shop.step(end);
    assert!((k0_um(&shop, Axis::X) - 11.0).abs() < 1e-9);
}

#[test]
fn four_blocks_follow_a_rotation_that_two_cannot_see() {
    let mut machine = crate::shop::machine();
    let mut third = machine.blocks[0].clone();
    third.id = "block_3".to_owned();
    third.corner_mm = [220.0, -180.0, 60.0];
    let mut fourth = third.clone();
    fourth.id = "block_4".to_owned();
    fourth.corner_mm = [-220.0, 180.0, 300.0];
    machine.blocks.extend([third, fourth]);
    let refused = ThermalModelStage::new(config(""), &machine);
    assert!(matches!(
        refused,
        Err(ThermalModelError::BlockCount { n_blocks: 4, .. })
    ));
    let config = ThermalModelConfig {
        method: thermal_model::Method::NBlock,
        slope_error_limit_um: 5.0,
        ..config("")
    };
    let mut shop = Shop::new(config.clone());
    shop.stage = ThermalModelStage::new(config, &machine).unwrap();
    shop.machine = machine;
    shop.cold();
    shop.wait_s(900.0);
    shop.cycle(false, |axis, corner| {
        let turned = Vector3::new(0.0, 0.0, 40e-6).cross(&corner);
        corner[axis.index()] + turned[axis.index()]
    });
    let p_mm = Vector3::new(200.0, -170.0, 100.0);
    let d_mm = metrology::drift::axis_drift_at(
        shop.model(),
        Axis::X,
        &p_mm,
        shop.now(),
        metrology::drift::Extrapolate::Refuse,
    );
    // The touch points lie a few mm beside the corners at which the readings were made up.
    assert!((d_mm.unwrap() - 40e-6 * 170.0).abs() < 1e-3, "{d_mm:?}");
    assert_eq!(
        seen(
            &shop,
            |d| matches!(d, Diagnostic::Fitted { terms, .. } if terms.len() == 12)
        ),
        2
    );
}

#[test]
fn a_copy_in_mid_run_goes_on_exactly_as_the_original() {
    let mut shop = Shop::new(config(""));
    shop.cold();
    for k in 1..4 {
        shop.wait_s(900.0);
        drifted(&mut shop, 0.030 * (1.0 - (-f64::from(k) / 3.0).exp()));
    }
    let mut copy = Shop {
        stage: shop.stage.clone(),
        ..Shop::new(config(""))
    };
    copy.nanos = shop.nanos;
    copy.run = shop.run;
    for s in [&mut shop, &mut copy] {
        s.wait_s(900.0);
        drifted(s, 0.025);
        s.tick();
    }
    assert_eq!(format!("{:?}", shop.model()), format!("{:?}", copy.model()));
}

/// A message that comes twice: the cycle of the reference is over, and its last block must not begin another.
#[test]
fn a_cold_block_that_is_told_twice_leaves_the_whole_reference() {
    let mut shop = Shop::new(config(""));
    shop.run = 1;
    for block in 0..2 {
        shop.wait_s(30.0);
        let measured = shop.measurement(block, true, |axis, corner| corner[axis.index()]);
        shop.step(Input::Block(measured.clone()));
        shop.step(Input::Block(measured));
    }
    shop.wait_s(600.0);
    shop.tick();
    drifted(&mut shop, 0.012);
    assert_eq!(
        seen(&shop, |d| matches!(d, Diagnostic::BlockMissing { .. })),
        0
    );
    assert_eq!(
        seen(&shop, |d| matches!(d, Diagnostic::FaceRefused { .. })),
        3
    );
    assert!((k0_um(&shop, Axis::X) - 12.0).abs() < 1e-9);
}

/// What an earlier run measured comes again while another cycle is open: that one goes on.
#[test]
fn a_block_of_an_earlier_run_does_not_end_an_open_cycle() {
    let mut shop = Shop::new(config(""));
    shop.cold();
    let cold = |axis: Axis, corner: Vector3<f64>| corner[axis.index()];
    let old = shop.measurement(1, true, cold);
    shop.wait_s(900.0);
    shop.run += 1;
    for block in 0..2 {
        let warm = |axis: Axis, corner: Vector3<f64>| corner[axis.index()] + 0.012;
        let measured = shop.measurement(block, false, warm);
        shop.step(Input::Block(measured));
        shop.step(Input::Block(old.clone()));
    }
    assert_eq!(
        seen(&shop, |d| matches!(d, Diagnostic::BlockMissing { .. })),
        0
    );
    assert!((k0_um(&shop, Axis::X) - 12.0).abs() < 1e-9);
}
