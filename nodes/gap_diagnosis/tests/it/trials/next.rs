//! Two effects that a poor program cannot tell apart: said so, a run proposed; with that run, told apart.

use gap_diagnosis::Note;
use gap_diagnosis::experiment::Pass;
use gap_diagnosis::report::Status;
use metrology::sample::Sense;

use crate::trials::plant::{Circle, Noise, State, diagnosed, go_on, names, session_of, told};

/// Circles of one sense and one angular speed: an oval at 45 degrees may be squareness or a lag.
const ONE_SENSE: [Circle; 7] = [
    (50.0, 2000.0, true, 0),
    (80.0, 3200.0, true, 0),
    (50.0, 2000.0, true, 1),
    (80.0, 3200.0, true, 1),
    (50.0, 2000.0, true, 2),
    (80.0, 3200.0, true, 2),
    (65.0, 2600.0, true, 0),
];

/// Y leans to X by 15 urad.
fn leaning(state: &State) -> [f64; 2] {
    [-15e-6 * state.position[1], 0.0]
}

/// X comes 0.25 ms late: where it was commanded a moment ago.
fn late(state: &State) -> [f64; 2] {
    let (delay_s, [x, y], [vx, _]) = (0.25e-3, state.position, state.velocity);
    let omega = -vx / y;
    let turn = if y.abs() > 1e-9 { omega * delay_s } else { 0.0 };
    [x * turn.cos() + y * turn.sin() - x, 0.0]
}

fn two_rounds(truth: &str, wrong: &crate::trials::plant::Wrong, seed: u64) {
    let mut session = session_of(&ONE_SENSE, seed, Noise::default(), wrong);
    let first = diagnosed(&session);
    let open: Vec<_> = first
        .report
        .causes
        .iter()
        .map(|c| (c.effect.clone(), c.status))
        .collect();
    assert!(
        open.iter().all(|(_, status)| *status != Status::Named),
        "{open:?}"
    );
    assert!(
        first.effects.is_empty(),
        "what is one of a set is not written"
    );
    let proposed = &first.report.next_experiments;
    assert!(!proposed.is_empty(), "{open:?} {:?}", first.notes);
    let next = &proposed[0];
    assert!(next.delta >= 9.0 && next.minutes > 0.0);
    let program: Vec<Circle> = first.experiments[0]
        .passes
        .iter()
        .filter_map(circle)
        .collect();
    assert!(!program.is_empty(), "{:?}", first.experiments[0]);
    go_on(&mut session, &program, 2, seed + 1, Noise::default(), wrong);
    let second = diagnosed(&session);
    assert_eq!(names(&second), [truth], "{}", told(&second));
    let open: Vec<String> = second.report.causes[0]
        .confusable_with
        .iter()
        .filter(|other| !other.excluded)
        .map(|other| other.effect.clone())
        .collect();
    let asked = ["squareness", "servo_lag"]
        .into_iter()
        .find(|effect| !truth.starts_with(effect));
    assert!(
        asked.is_some_and(|other| !open.iter().any(|o| o == other)),
        "{}",
        told(&second)
    );
}

fn circle(pass: &Pass) -> Option<Circle> {
    match pass {
        Pass::Circle {
            radius_mm,
            feed_mm_s,
            sense,
            ..
        } => Some((
            *radius_mm,
            feed_mm_s * 60.0,
            *sense == Sense::CounterClockwise,
            0,
        )),
        _ => None,
    }
}

#[test]
fn squareness_and_lag_look_alike_in_one_sense_and_the_proposed_run_tells_them_apart() {
    two_rounds("squareness XY", &leaning, 61);
    two_rounds("servo_lag X", &late, 71);
}

#[test]
fn where_every_effect_stands_alone_nothing_is_proposed_and_else_a_run_or_why_there_is_none() {
    let diagnosis = diagnosed(&crate::trials::plant::session(
        1,
        Noise::default(),
        &crate::trials::plant::soft_play(0, 4e-3),
    ));
    assert_eq!(names(&diagnosis), ["backlash X"]);
    let open = diagnosis
        .report
        .causes
        .iter()
        .any(|cause| cause.status != Status::Named);
    let is_told = |note: &Note| matches!(note, Note::NoRun(_));
    let why_none = diagnosis.notes.iter().any(is_told);
    let is_proposed = !diagnosis.report.next_experiments.is_empty();
    assert_eq!(is_proposed || why_none, open, "{}", told(&diagnosis));
    assert!(
        !diagnosis
            .notes
            .iter()
            .any(|note| matches!(note, Note::NotWritten { .. }))
    );
}
