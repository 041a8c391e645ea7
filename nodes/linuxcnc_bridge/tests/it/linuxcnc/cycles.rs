//! The suite's own touching cycles on a real LinuxCNC, three axes and five.

use std::num::NonZeroU32;

use machine::cycle::{Cycle, blocks, latency};
use test_namespaces::isolated;

use crate::linuxcnc::latency::{on_delay_s, weighted_line};
use crate::linuxcnc::rig::Rig;

const PERIOD_S: f64 = 1e-3;

/// Runs a cycle and gives, for each touch, feed (mm/s) and depth behind the nominal contact (mm).
fn touch_all(rig: &mut Rig, cycle: &Cycle) -> Vec<(f64, f64)> {
    rig.touch(&cycle.program);
    assert_eq!(rig.triggers.len(), cycle.touches.len());
    let radius_mm = rig.machine.ball_radius_mm();
    rig.triggers
        .iter()
        .zip(&cycle.touches)
        .map(|(trigger, planned)| {
            assert_eq!(trigger.feature_id, planned.feature_id);
            assert!(
                (trigger.approach - planned.approach).norm() < 1e-6,
                "{trigger:?}"
            );
            let feed_mm_s = planned.feed_mm_min / 60.0;
            assert!(
                (trigger.feed_mm_s - feed_mm_s).abs() < 0.015 * feed_mm_s,
                "{trigger:?}"
            );
            let ball_mm = planned.contact_mm - planned.approach * radius_mm;
            (
                trigger.feed_mm_s,
                (trigger.latched.xyz() - ball_mm).dot(&planned.approach),
            )
        })
        .collect()
}

#[test]
fn the_latency_cycle_gives_the_delay_that_only_hal_holds() {
    isolated(|| {
        let Some(mut rig) = Rig::new("linuxcnc_latency") else {
            return;
        };
        let feeds_mm_min = [120.0, 300.0, 600.0, 1200.0, 1800.0];
        let repeats = NonZeroU32::new(8).unwrap();
        for feature in ["block_1.x", "block_1.z"] {
            let cycle = latency(&rig.machine, feature, &feeds_mm_min, repeats).unwrap();
            let (latency_s, surface_mm) = weighted_line(&touch_all(&mut rig, &cycle));
            let delay_s = on_delay_s();
            let expected_s = ((delay_s / PERIOD_S).ceil() - 0.5) * PERIOD_S;
            println!(
                "{feature}: latency {:.4} ms, surface {:.2} um",
                latency_s * 1e3,
                surface_mm * 1e3
            );
            assert!(
                (latency_s - expected_s).abs() < 0.1e-3,
                "{latency_s} s, {expected_s} s"
            );
            assert!(surface_mm.abs() < 1e-3, "{surface_mm} mm");
        }
    });
}

fn block_cycle_on(scenario: &str) {
    let Some(mut rig) = Rig::new(scenario) else {
        return;
    };
    let cycle = blocks(&rig.machine, &[], NonZeroU32::MIN).unwrap();
    for (feed_mm_s, depth_mm) in touch_all(&mut rig, &cycle) {
        let wait_ms = depth_mm / feed_mm_s * 1e3;
        assert!(
            (4.0..=5.01).contains(&wait_ms),
            "{wait_ms} ms at {feed_mm_s} mm/s"
        );
    }
    assert_eq!(rig.triggers.len(), 6);
}

#[test]
fn the_block_cycle_finds_both_blocks_with_three_axes() {
    isolated(|| {
        block_cycle_on("linuxcnc_latency");
    });
}

#[test]
fn the_block_cycle_finds_both_blocks_with_five_axes() {
    isolated(|| {
        block_cycle_on("linuxcnc_block_cycle");
    });
}
