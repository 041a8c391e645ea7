//! Offsets reach the drives, bounded by HAL, and fade when their source falls silent.

use std::time::Duration;

use linuxcnc_bridge::condition::Condition;
use linuxcnc_bridge::io::host_now;
use linuxcnc_bridge::live::LiveInput;
use metrology::sample::{AxisCompensation, CompensationState};
use metrology::{Axis, AxisSet, PerAxis};
use test_namespaces::isolated;

use crate::linuxcnc::rig::Rig;

fn offsets(x_mm: f64) -> LiveInput {
    let mut total = PerAxis::default();
    total[Axis::X] = x_mm;
    LiveInput::Compensation(AxisCompensation {
        at: host_now(),
        axes: AxisSet::XYZ,
        total,
        thermal: total,
        geometric: PerAxis::default(),
        positioning: PerAxis::default(),
        pulses: PerAxis::default(),
        remainder: total,
        state: PerAxis([CompensationState::Active; 6]),
    })
}

/// Offset of the motor from the command, mm.
fn offset_mm(rig: &Rig) -> f64 {
    rig.states
        .last()
        .map_or(0.0, |state| state.motor[Axis::X] - state.commanded[Axis::X])
}

fn greatest_rate_mm_s(rig: &Rig) -> f64 {
    rig.states
        .windows(2)
        .map(|pair| (pair[1].motor[Axis::X] - pair[0].motor[Axis::X]).abs())
        .fold(0.0, f64::max)
        * 1000.0
}

#[test]
fn offsets_reach_the_motor_without_a_step_and_fade_when_their_source_dies() {
    isolated(|| {
        let Some(mut rig) = Rig::new("linuxcnc_latency") else {
            return;
        };
        rig.states.clear();
        for _ in 0..500 {
            rig.tell(offsets(0.030));
            rig.turn();
        }
        assert!(
            (offset_mm(&rig) - 0.030).abs() < 2e-6,
            "{}",
            offset_mm(&rig)
        );
        assert!(rig.conditions.contains(&Condition::CompensationFresh));

        // Too large and not a number: refused, the last good one stays.
        for bad in [5.0, f64::NAN] {
            rig.tell(offsets(bad));
        }
        assert!(matches!(
            rig.conditions.last(),
            Some(Condition::CompensationRefused { .. })
        ));
        for _ in 0..40 {
            rig.tell(offsets(-0.020));
            rig.turn();
        }
        assert!(
            offset_mm(&rig) > -0.02 && offset_mm(&rig) < 0.030,
            "{}",
            offset_mm(&rig)
        );

        // Silence: HAL waits for 2 s, then fades at its own rate.
        rig.turn_for(Duration::from_secs(3));
        assert!(
            rig.conditions
                .iter()
                .any(|c| matches!(c, Condition::CompensationStale { .. }))
        );
        rig.turn_for(Duration::from_secs(3));
        assert!(offset_mm(&rig).abs() < 2e-6, "{}", offset_mm(&rig));
        let rate_mm_s = greatest_rate_mm_s(&rig);
        println!("greatest rate of the motor {rate_mm_s:.4} mm/s");
        // HAL's limit is 0.02 mm/s; positions are printed to 1 nm.
        assert!(rate_mm_s < 0.0225, "{rate_mm_s} mm/s");
        deactivated_it_lets_go(&mut rig);
    });
}

/// Not active, the bridge hears no offsets and takes no program, and HAL fades what it has.
fn deactivated_it_lets_go(rig: &mut Rig) {
    for _ in 0..80 {
        rig.tell(offsets(0.030));
        rig.turn();
    }
    assert!(offset_mm(rig) > 0.005, "{}", offset_mm(rig));
    rig.tell(LiveInput::Active(false));
    assert!(rig.at_rest, "no program runs");
    let goal = rig.begin("G21 G90\nG1 X1 F600\nM2\n");
    assert_eq!(rig.finish(goal).message, "the bridge is not active");
    rig.states.clear();
    for _ in 0..900 {
        rig.tell(offsets(0.030));
        rig.turn();
    }
    assert!(offset_mm(rig).abs() < 2e-6, "{}", offset_mm(rig));
    assert!(greatest_rate_mm_s(rig) < 0.0225);
    rig.tell(LiveInput::Active(true));
    let goal = rig.begin("G21 G90\nG1 X1 F600\nM2\n");
    assert_eq!(rig.finish(goal).message, "");
}
