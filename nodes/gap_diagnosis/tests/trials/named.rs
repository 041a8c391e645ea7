//! One effect, or two: named, on their axes, with intervals that hold the truth.

use gap_diagnosis::report::Status;

use crate::plant::{Noise, diagnosed, names, session, soft_play};

#[test]
fn a_play_with_a_soft_edge_is_named_backlash_of_its_axis() {
    for (seed, axis, width_um) in [(1, 0, 4.0), (2, 1, 3.0), (3, 0, 1.5)] {
        let wrong = soft_play(axis, width_um * 1e-3);
        let diagnosis = diagnosed(&session(seed, Noise::default(), &wrong));
        let name = format!("backlash {}", ["X", "Y"][axis]);
        assert_eq!(names(&diagnosis), [name]);
        let cause = &diagnosis.report.causes[0];
        assert_ne!(cause.status, Status::Surrogate);
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
            shown += usize::from(is_shown && cause.d < 6.5);
        }
    }
    assert!(shown > 0);
}

#[test]
fn two_plays_are_named_both() {
    let (x, y) = (soft_play(0, 5e-3), soft_play(1, -3e-3));
    let wrong = move |state: &crate::plant::State| [x(state)[0], y(state)[1]];
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
