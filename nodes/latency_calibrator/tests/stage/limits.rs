//! Touches that are repeated, and runs that do not end.

use super::*;

#[test]
fn a_touch_that_is_told_again_changes_neither_the_latency_nor_its_uncertainty() {
    let run = |again: bool| {
        let mut rig = Rig::new(4_000_000);
        rig.scatter_mm = 0.0005;
        rig.tells_again = again;
        rig.run(&FEEDS_MM_S, 4);
        rig
    };
    let (once, again) = (run(false), run(true));
    assert_eq!(once.latency(), again.latency());
    let told_before = |refusal: &&Refusal| matches!(refusal, Refusal::ToldBefore { .. });
    assert_eq!(again.refusals().iter().filter(told_before).count(), 20);
    assert_eq!(once.refusals().iter().filter(told_before).count(), 0);
}

/// A stranger's run: as many touches as a run may have, each of a feature of its own, latched in a time to come. Were each
/// feature sought among all touches, this would take hours.
#[test]
fn a_run_of_endless_touches_is_held_to_its_limit_and_evaluated_at_once() {
    let mut rig = Rig::new(0);
    rig.segment(true, false);
    let most = metrology::bound::TOUCHES_OF_RUN;
    let axes = MachineFile::parse(BENCH, "bench.yaml").unwrap().axis_set();
    for n in 0..most + 10 {
        rig.now_ns += 1_000;
        let trigger = ProbeTrigger {
            received_at: Stamp::from_nanos(rig.now_ns),
            controller_at: Stamp::from_nanos(rig.now_ns + 1_000_000_000_000),
            feature_id: format!("f{n}"),
            approach: Vector3::x(),
            feed_mm_s: 1.0,
            axes,
            latched: PerAxis::default(),
            sequence: u32::try_from(n).unwrap(),
        };
        rig.send(Input::Trigger(trigger));
    }
    let refused = |out: &[Output]| {
        let is_too_many =
            |o: &&Output| matches!(o, Output::Refused(Refusal::TooManyTouches { .. }));
        out.iter().filter(is_too_many).count()
    };
    assert_eq!(refused(&rig.out), 10);
    rig.segment(false, true);
    rig.now_ns += 10_000_000_000;
    rig.send(Input::Tick);
    assert!(rig.out.len() > most, "{}", rig.out.len());
}
