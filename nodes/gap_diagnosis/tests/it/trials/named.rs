//! One effect, or two: named, on their axes, with intervals that hold the truth.

use gap_diagnosis::report::{Cause, Check, CheckId, LeftOut, Side, Status, Verdict};

use crate::trials::plant::{Noise, diagnosed, names, session, soft_play};

fn check(cause: &Cause, id: CheckId) -> Option<&Check> {
    cause.why.iter().find(|check| check.check == id)
}

/// Each verdict is that of its figures, D is that of the cause with the least D of the manual, and the status is what
/// `docs/reference` says of the verdicts.
fn follows_from_its_checks(cause: &Cause) {
    for check in &cause.why {
        let (Some(value), Some(limit)) = (check.value, check.limit) else {
            continue;
        };
        let holds = match check.passes {
            Side::AtLeast => value >= limit,
            Side::Above => value > limit,
            Side::AtMost => value <= limit,
            Side::Below => value < limit,
        };
        assert_eq!(holds, check.verdict == Verdict::Passed, "{check:?}");
    }
    let noise = check(cause, CheckId::AboveNoise).expect("every effect has a D");
    assert_eq!(noise.value, Some(cause.d));
    assert!(noise.limit.is_some_and(|least| least >= 6.5), "{noise:?}");
    let failed = |is_rival: bool| {
        let mut all = cause.why.iter();
        all.any(|check| {
            check.verdict == Verdict::Failed && (check.check == CheckId::NoRival) == is_rival
        })
    };
    let wanted = match (failed(false), failed(true)) {
        (true, _) => Status::Surrogate,
        (false, true) => Status::Set,
        (false, false) => Status::Named,
    };
    assert_eq!(cause.status, wanted, "{:#?}", cause.why);
    // What is named was tried on runs left out and has no more rival.
    let ids = [CheckId::HeldOutGain, CheckId::Sure, CheckId::NoRival];
    let is_tried = ids.iter().all(|id| check(cause, *id).is_some());
    assert!(
        is_tried || cause.status == Status::Surrogate,
        "{:#?}",
        cause.why
    );
}

#[test]
fn a_play_with_a_soft_edge_is_named_backlash_of_its_axis() {
    for (seed, axis, width_um) in [(1, 0, 4.0), (2, 1, 3.0), (3, 0, 1.5)] {
        let wrong = soft_play(axis, width_um * 1e-3);
        let diagnosis = diagnosed(&session(seed, Noise::default(), &wrong));
        let name = format!("backlash {}", ["X", "Y"][axis]);
        assert_eq!(names(&diagnosis), [name]);
        let cause = &diagnosis.report.causes[0];
        assert_ne!(cause.status, Status::Surrogate);
        follows_from_its_checks(cause);
        let width = &cause.parameters[0];
        assert!(
            (width.value - width_um).abs() < 0.12 * width_um,
            "{width:?}"
        );
        let closed = diagnosis.report.shrink.gap_closed.unwrap();
        assert!(closed.value > 0.8, "{closed:?}");
        assert_eq!(diagnosis.effects.len(), 1);
    }
}

#[test]
fn what_noise_makes_now_and_then_is_shown_with_the_reason_and_not_named() {
    let mut shown = 0;
    for (seed, width_um) in (400..).zip([0.12, 0.15, 0.18, 0.21, 0.24, 0.27, 0.3, 0.35]) {
        let wrong = soft_play(0, width_um * 1e-3);
        let diagnosis = diagnosed(&session(seed, Noise::default(), &wrong));
        for cause in &diagnosis.report.causes {
            assert!(
                cause.status == Status::Surrogate || cause.d >= 6.5,
                "{width_um}: {cause:?}"
            );
            let is_shown = cause.status == Status::Surrogate && cause.effect == "backlash";
            follows_from_its_checks(cause);
            if is_shown && cause.d < 6.5 {
                shown += 1;
                let check = check(cause, CheckId::AboveNoise).expect("every effect has a D");
                assert_eq!(check.verdict, Verdict::Failed, "{check:?}");
            }
        }
    }
    assert!(shown > 0);
}

#[test]
fn two_plays_are_named_both() {
    let (x, y) = (soft_play(0, 5e-3), soft_play(1, -3e-3));
    let wrong = move |state: &crate::trials::plant::State| [x(state)[0], y(state)[1]];
    let diagnosis = diagnosed(&session(7, Noise::default(), &wrong));
    let mut found = names(&diagnosis);
    found.sort();
    assert_eq!(
        found,
        ["backlash X", "backlash Y"],
        "{:#?}",
        diagnosis.report.causes
    );
}

#[test]
fn without_one_of_two_effects_more_of_the_gap_is_left_and_most_without_the_larger() {
    let (x, y) = (soft_play(0, 3e-3), soft_play(1, 6e-3));
    let wrong = move |state: &crate::trials::plant::State| [x(state)[0], y(state)[1]];
    let shrink = diagnosed(&session(8, Noise::default(), &wrong))
        .report
        .shrink;
    let (before_um, after_um) = (shrink.rms_um.before.unwrap(), shrink.rms_um.after.unwrap());
    let without_um = |axis: &str| {
        let own = |out: &&LeftOut| out.effect == "backlash" && out.axis == axis;
        let out = shrink.leave_one_out.iter().find(own);
        out.unwrap_or_else(|| panic!("{shrink:?}")).rms_um_without
    };
    assert_eq!(shrink.leave_one_out.len(), 2, "{shrink:?}");
    let (small_um, large_um) = (without_um("X"), without_um("Y"));
    assert!(after_um < 0.6 * small_um, "{shrink:?}");
    assert!(
        small_um < 0.7 * large_um && large_um < before_um,
        "{shrink:?}"
    );
    // Half of 6 um either way in one of two channels, what is left in the other.
    let square = |um: f64| um * um;
    let wanted_um = (0.5 * square(3.0) + square(after_um)).sqrt();
    assert!(
        (large_um - wanted_um).abs() < 0.1 * wanted_um,
        "{large_um} {wanted_um}"
    );
}
