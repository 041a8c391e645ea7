//! A machine that repeats itself far better than the simulator is right: small differences of form are no causes,
//! and a cause with a form of its own keeps its name.

use gap_diagnosis::report::Status;

use crate::trials::plant::{Noise, State, diagnosed, names, session, soft_play, told};

/// A tenth of the usual scatter.
const EXACT: Noise = Noise {
    white_mm: 0.02e-3,
    between_mm: 0.05e-3,
    other_runs: 1.0,
};

#[test]
fn a_small_difference_that_every_repeat_has_is_not_named() {
    for seed in 0..6 {
        let wrong = |s: &State| {
            let [x, y] = s.position.map(|p| p / 50.0);
            let v = s.velocity.map(|v| v / 50.0);
            [
                0.05e-3 * (3.0 * x * y + v[0] * y),
                0.05e-3 * (x * x - v[1] * v[1]),
            ]
        };
        let diagnosis = diagnosed(&session(300 + seed, EXACT, &wrong));
        assert!(
            names(&diagnosis).is_empty(),
            "{seed}: {:?}",
            names(&diagnosis)
        );
    }
}

#[test]
fn a_play_with_a_soft_edge_on_an_exact_machine_is_named_alone() {
    for (seed, axis, width_um) in [(310, 0, 6.0), (311, 1, 4.0), (312, 0, 12.0)] {
        let diagnosis = diagnosed(&session(seed, EXACT, &soft_play(axis, width_um * 1e-3)));
        let name = format!("backlash {}", ["X", "Y"][axis]);
        assert_eq!(names(&diagnosis), [name], "{:#?}", diagnosis.report.causes);
        let cause = &diagnosis.report.causes[0];
        assert_eq!(cause.status, Status::Named);
        let width = &cause.parameters[0];
        assert!(
            (width.value - width_um).abs() < 0.12 * width_um,
            "{width:?}"
        );
    }
}

#[test]
fn a_machine_that_repeats_itself_to_hundredths_of_a_micrometre_without_a_gap_gets_no_name() {
    for seed in 0..6 {
        let diagnosis = diagnosed(&session(320 + seed, EXACT, &|_| [0.0; 2]));
        assert!(names(&diagnosis).is_empty(), "{:?}", names(&diagnosis));
        assert!(!diagnosis.report.unknown.flagged);
    }
}

/// A rail that is bent about a joint near its middle, seen on circles over an eighth of its travel: its two lowest orders over the
/// travel are a small part of what the circles show. At one height a guide that turns reads the same.
#[test]
fn a_guide_that_is_dented_where_it_was_measured_is_found_with_its_curve() {
    for (seed, at_mm) in [(330, 21.0), (331, -34.0)] {
        let dent = move |s: &State| {
            let place = (s.position[0] - at_mm) / 24.0;
            let bow = (s.position[0] / 200.0).powi(2);
            [0.0, 9e-3 * (-place * place).exp() + 4e-3 * bow]
        };
        let diagnosis = diagnosed(&session(seed, Noise::default(), &dent));
        let causes = diagnosis.report.causes.iter();
        let kept: Vec<_> = causes.filter(|c| c.status != Status::Surrogate).collect();
        let [cause] = kept[..] else {
            panic!("{}", told(&diagnosis));
        };
        let rivals = cause.confusable_with.iter().filter(|r| !r.excluded);
        let mut set: Vec<String> = rivals.map(|r| format!("{} {}", r.effect, r.axis)).collect();
        set.push(format!("{} {}", cause.effect, cause.axis));
        set.sort();
        assert_eq!(set, ["angular_error AX", "straightness YX"]);
        assert!(!diagnosis.report.unknown.flagged);
    }
}
