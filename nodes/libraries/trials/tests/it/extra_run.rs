//! The run that a diagnosis asks for, made on drawn machines.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use sequencer::{Step, extra_run};
use trials::{Rig, Sample, measure};

fn rig() -> Rig {
    Rig::draw(&mut Pcg64Mcg::seed_from_u64(6), false).unwrap()
}

#[test]
fn a_circle_is_run_on_the_plate_of_its_plane_at_every_feed() {
    let rig = rig();
    let words = "circle ZX R40 F3000 and F6000 both senses";
    let plan = extra_run(&rig.machine, &rig.plan, words).unwrap();
    assert_eq!(plan.steps.len(), 2);
    let Step::Grid(step) = &plan.steps[1] else {
        panic!("{plan:?}");
    };
    assert_eq!(
        (step.placement.as_str(), step.feed_mm_min),
        ("side", 6000.0)
    );
    assert_eq!(step.radius_mm, Some(40.0));
}

#[test]
fn the_machine_can_run_what_is_asked_for_and_it_reads_something() {
    let rig = rig();
    for words in [
        "circle XY R40 F3000 both senses at middle",
        "line Y F4000 there and back on the YZ plate",
        "positioning Z F2000, 20 stops of 2 s each way along beam along_z",
        "line X F4000 there and back along beam along_x",
        "steps of 0.4 mm along X with 2 s dwell, there and back on the ZX plate",
        "the same touches at F60, F120 and F480",
    ] {
        let plan = extra_run(&rig.machine, &rig.plan, words).unwrap();
        let later = rig.later(plan);
        let mut readings = 0;
        let measured = measure(&later, &mut |_, sample| {
            let reads = matches!(
                sample,
                Sample::Grid(_) | Sample::Length(_) | Sample::Trigger(_)
            );
            readings += u32::from(reads);
        });
        measured.unwrap_or_else(|error| panic!("{words}: {error}"));
        assert!(readings > 10, "{words}: {readings}");
    }
}

#[test]
fn the_session_in_reverse_has_each_condition_once() {
    let rig = rig();
    let words = "the session's 9 tests in reverse order";
    let plan = extra_run(&rig.machine, &rig.plan, words).unwrap();
    assert_eq!(plan.steps.first(), rig.plan.steps.last());
    assert!(plan.steps.len() < rig.plan.steps.len());
}

#[test]
fn what_a_plan_cannot_do_is_not_made() {
    let rig = rig();
    for words in [
        "standing still for 10 min on the plate",
        "line X F1000 and F4000 there and back on the YZ plate",
        "circle XY R40 F3000 both senses before and after 15 min of X to and fro, the other axes idle",
        "the same touches with stylus long",
    ] {
        assert_eq!(extra_run(&rig.machine, &rig.plan, words), None, "{words}");
    }
}
