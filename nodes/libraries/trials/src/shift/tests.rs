use rand::SeedableRng;

use metrology::sample::TestKind;

use super::*;
use crate::measurement::Sample;

fn bench(seed: u64) -> Bench {
    Bench::draw(&mut Pcg64Mcg::seed_from_u64(seed)).unwrap()
}

#[test]
fn a_shift_lasts_four_hours_and_nothing_of_production_is_sampled_quickly() {
    let bench = bench(3);
    let hours = bench.timeline.length_s() / 3600.0;
    assert!((3.9..4.6).contains(&hours), "{hours}");
    let (mut working, mut states, mut last_s) = (false, 0_usize, 0.0);
    let mut shortest_s = f64::MAX;
    measure(&bench.rig, &mut |at, sample| match sample {
        Sample::Segment(segment) => {
            working = segment.begin && segment.kind == TestKind::Production && segment.zero_id == 0;
            last_s = at.as_secs_f64();
        }
        Sample::State(_) if working => {
            let at_s = at.as_secs_f64();
            shortest_s = f64::min(shortest_s, at_s - last_s);
            (last_s, states) = (at_s, states + 1);
        }
        _ => {}
    })
    .unwrap();
    assert!(states > 10_000 && states < 60_000, "{states}");
    assert!(shortest_s > 0.2, "{shortest_s}");
}

#[test]
fn a_good_machine_hardly_drifts_over_its_shift() {
    let mut bench = bench(5);
    bench.rig.scatter.between_runs_mm = 0.0;
    let mut first = std::collections::BTreeMap::<String, f64>::new();
    let mut most_um = 0.0_f64;
    measure(&bench.rig, &mut |_, sample| {
        if let Sample::Trigger(trigger) = sample {
            let along_mm = trigger.latched.xyz().dot(&trigger.approach);
            let zero = *first.entry(trigger.feature_id.clone()).or_insert(along_mm);
            most_um = most_um.max(1e3 * (along_mm - zero).abs());
        }
    })
    .unwrap();
    // Two touches of a repeatability of 0.3 µm differ by 1.3 µm at most, three times their deviation.
    assert!(first.len() == 6 && most_um < 2.5, "{most_um} {first:?}");
}

#[test]
fn a_clamp_that_slips_by_ten_micrometres_is_as_large_as_its_touches_say() {
    let bench = bench(4);
    let mut random = Pcg64Mcg::seed_from_u64(1);
    let axes = [Axis::X, Axis::Y];
    let slip = Change::draw(&mut random, Kind::ClampSlips, &bench.timeline, &axes).unwrap();
    let blocks = bench.timeline.blocks();
    let before = blocks.iter().filter(|run| run.from_s < slip.from_s).count() as f64;
    let after = blocks.len() as f64 - before;
    let with = bench.with(&Thing::Change(slip), 10.0).unwrap();
    // A step s in n + m touches of variance v has D^2 = s^2/v n m/(n + m); three faces add up to the shift of 10 µm.
    let smooth_um = 1e3 * bench.rig.scatter.between_runs_mm;
    let variance_um2 = 0.3 * 0.3 + 2.0 * 0.2 * 0.2 + smooth_um * smooth_um;
    let wanted = 10.0 * (before * after / (before + after) / variance_um2).sqrt();
    let d = bench.d(&with);
    assert!((d / wanted - 1.0).abs() < 0.2, "{d} {wanted}");
    let alone = bench.d_beside(&with, &[&with]);
    assert!(alone < 0.05 * d, "beside itself nothing is left: {alone}");
}

#[test]
fn a_number_always_draws_the_same_shift_and_another_one_another() {
    let draw = |index| Bench::draw(&mut stream(Arm::ShopShift, 9, index)).unwrap();
    let (one, again, other) = (draw(0), draw(0), draw(1));
    assert_eq!(one.rig, again.rig);
    assert_eq!(one.timeline.runs, again.timeline.runs);
    assert_ne!(one.rig.machine, other.rig.machine);
}
