//! Sessions in which something changes: an effect that begins is named from its run on, a slip is not counted as noise, and an effect that stays is reported as constant.

use gap_diagnosis::report::Status;
use gap_diagnosis::{Course, Diagnosis, Note};
use metrology::Axis;
use twin::Session;

use crate::trials::plant::{Circle, Noise, State, Wrong, diagnosed, go_on, names, soft_play, told};

/// One cycle: two feeds, both senses, twice.
const CYCLE: [Circle; 8] = [
    (50.0, 1500.0, true, 0),
    (50.0, 1500.0, false, 0),
    (50.0, 1500.0, true, 1),
    (50.0, 1500.0, false, 1),
    (50.0, 2400.0, true, 0),
    (50.0, 2400.0, false, 0),
    (50.0, 2400.0, true, 1),
    (50.0, 2400.0, false, 1),
];

/// Cycles one after another, each with its own error.
fn cycles(seed: u64, wrong: &[&Wrong]) -> Session {
    let mut session = Session::default();
    for (cycle, &wrong) in (0..).zip(wrong) {
        let seed = 100 * seed + cycle;
        go_on(&mut session, &CYCLE, 1, seed, Noise::default(), wrong);
    }
    session
}

fn nothing(_: &State) -> [f64; 2] {
    [0.0; 2]
}

fn changed(diagnosis: &Diagnosis) -> bool {
    let report = &diagnosis.report;
    let mut named = report.over_session.iter();
    !report.does_not_repeat.is_empty() || named.any(|own| own.from_run.is_some())
}

#[test]
fn a_play_that_begins_during_the_session_is_named_from_its_run_on() {
    let worn = soft_play(0, 5.6e-3);
    for seed in 1..4 {
        let diagnosis = diagnosed(&cycles(seed, &[&nothing, &nothing, &worn, &worn]));
        let report = &diagnosis.report;
        assert_eq!(names(&diagnosis), ["backlash X"], "{}", told(&diagnosis));
        let own = &report.over_session[0];
        assert_eq!(
            (&*own.effect, own.from_run),
            ("backlash", Some(16)),
            "{own:?}"
        );
        assert!(own.holds, "{own:?}");
        let cause = report
            .causes
            .iter()
            .find(|cause| cause.status != Status::Surrogate);
        let width = &cause.expect("a play").parameters[0];
        assert!((width.value - 5.6).abs() < 0.4, "{width:?}");
        assert!(report.does_not_repeat.is_empty(), "{report:?}");
        let begins = |note: &Note| matches!(note, Note::Course(Course::Begins { run: 16, .. }));
        assert!(diagnosis.notes.iter().any(begins));
    }
}

#[test]
fn a_plate_that_slips_is_told_and_the_play_beside_it_is_named_all_the_same() {
    let play = soft_play(1, 4e-3);
    let play_too = soft_play(1, 4e-3);
    let slipped = move |s: &State| {
        let [u, v] = play_too(s);
        [u + 5e-3, v]
    };
    for seed in 4..6 {
        let diagnosis = diagnosed(&cycles(seed, &[&play, &slipped, &slipped]));
        // One slip along X and one shift of the reference point of X are the same in a grid's readings: either may be named.
        let mut names = names(&diagnosis);
        names.retain(|name| name != "homing_shift X");
        assert_eq!(names, ["backlash Y"], "{}", told(&diagnosis));
        let slips = &diagnosis.report.does_not_repeat;
        assert_eq!(slips.len(), 1, "{slips:?}");
        let slip = &slips[0];
        assert_eq!((slip.last_run, slip.from_run), (7, 8), "{slip:?}");
        assert!(
            (slip.size_um - 5.0).abs() < 0.4 && slip.of_set_up,
            "{slip:?}"
        );
        assert_eq!(slip.channel, "grid.u");
    }
}

#[test]
fn a_plate_that_slips_twice_is_no_shift_of_the_reference_point() {
    let play = soft_play(1, 4e-3);
    let slipped = |by_mm: f64| {
        let play = soft_play(1, 4e-3);
        move |s: &State| {
            let [u, v] = play(s);
            [u + by_mm, v]
        }
    };
    let (once, twice) = (slipped(5e-3), slipped(9e-3));
    let diagnosis = diagnosed(&cycles(6, &[&play, &once, &twice]));
    assert_eq!(names(&diagnosis), ["backlash Y"], "{}", told(&diagnosis));
    let slips = diagnosis.report.does_not_repeat.iter();
    let slips: Vec<(u32, u32, bool)> = slips
        .map(|slip| (slip.last_run, slip.from_run, slip.of_set_up))
        .collect();
    assert_eq!(slips, [(7, 8, true), (15, 16, true)]);
}

#[test]
fn a_plate_that_is_mounted_anew_has_not_slipped() {
    let mut session = Session::default();
    for (cycle, at_mm) in (1..).zip([0.0, 0.085, -0.02, 0.04]) {
        let play = soft_play(1, 4e-3);
        let mounted = move |s: &State| {
            let [u, v] = play(s);
            [u + at_mm, v]
        };
        let seed = 700 + u64::from(cycle);
        go_on(
            &mut session,
            &CYCLE,
            cycle,
            seed,
            Noise::default(),
            &mounted,
        );
    }
    let diagnosis = diagnosed(&session);
    assert_eq!(names(&diagnosis), ["backlash Y"], "{}", told(&diagnosis));
    let slips = &diagnosis.report.does_not_repeat;
    assert!(slips.is_empty(), "{slips:?}");
}

/// A plate's clamp grows by 2 um/K in a shop that warms by 4 K and cools again; no thermometer was read.
#[test]
fn a_plate_that_wanders_with_the_shop_is_not_passed_over() {
    let wandered =
        [0.0, 1.5, 4.2, 7.6, 8.0, 5.1, 2.4].map(|um: f64| move |_: &State| [1e-3 * um, 0.0]);
    for seed in 40..42 {
        let all: Vec<&Wrong> = wandered.iter().map(|one| one as &Wrong).collect();
        let diagnosis = diagnosed(&cycles(seed, &all));
        let report = &diagnosis.report;
        assert!(
            changed(&diagnosis) || report.unknown.flagged || !names(&diagnosis).is_empty(),
            "{}",
            told(&diagnosis)
        );
        // A play, a squareness or a scale makes nothing like it.
        let wrong = ["backlash", "squareness", "scale_error", "servo_lag"];
        let is_wrong = |name: &String| wrong.iter().any(|one| name.starts_with(one));
        assert!(
            !names(&diagnosis).iter().any(is_wrong),
            "{}",
            told(&diagnosis)
        );
    }
}

#[test]
fn a_file_that_is_written_has_what_is_named_and_nothing_else() {
    let play = soft_play(0, 6e-3);
    let both = move |s: &State| {
        let [u, v] = play(s);
        let [x, y] = s.position;
        // Beside the play a shape of no class, of which something may look like a cause.
        let odd = 2e-3 * s.velocity[1].signum() * (x / 50.0).powi(2) * (y / 50.0);
        [u + odd, v]
    };
    for seed in 50..53 {
        let diagnosis = diagnosed(&cycles(seed, &[&both, &both]));
        let causes = diagnosis.report.causes.iter();
        let named = causes.filter(|cause| cause.status == Status::Named);
        let named: Vec<String> = named.map(|c| format!("{} {}", c.effect, c.axis)).collect();
        let written = diagnosis.effects.iter();
        let written: Vec<String> = written
            .map(|entry| format!("{} {}", entry.kind, entry.axis.clone().unwrap_or_default()))
            .collect();
        assert_eq!(written, named, "{}", told(&diagnosis));
    }
}

#[test]
fn what_holds_is_said_to_and_of_nothing_nothing_is_named() {
    let play = soft_play(0, 4e-3);
    for seed in 10..14 {
        let diagnosis = diagnosed(&cycles(seed, &[&nothing, &nothing, &nothing]));
        let all = told(&diagnosis);
        assert!(
            names(&diagnosis).is_empty() && !changed(&diagnosis),
            "{all}"
        );
        assert!(!diagnosis.report.unknown.flagged, "{all}");
    }
    for seed in 14..16 {
        let diagnosis = diagnosed(&cycles(seed, &[&play, &play, &play]));
        let all = told(&diagnosis);
        assert_eq!(names(&diagnosis), ["backlash X"], "{all}");
        assert!(!changed(&diagnosis), "{all}");
        let own = &diagnosis.report.over_session[0];
        assert!(own.holds && own.chance.is_some(), "{own:?}");
    }
}

#[test]
fn what_changes_without_a_name_does_not_repeat() {
    // A product of position and direction, that no catalogue holds, from the second cycle on.
    let odd = |s: &State| {
        let [x, y] = s.position;
        [
            4e-3 * s.velocity[1].signum() * (x / 50.0).powi(2) * (y / 50.0),
            0.0,
        ]
    };
    for seed in 20..22 {
        let diagnosis = diagnosed(&cycles(seed, &[&nothing, &odd, &odd]));
        let all = told(&diagnosis);
        let first = diagnosis.report.does_not_repeat.first().expect("a change");
        assert_eq!((first.last_run, first.from_run), (7, 8), "{first:?} {all}");
        assert!(
            !first.of_set_up && diagnosis.report.unknown.flagged,
            "{all}"
        );
    }
}

#[test]
fn what_goes_on_evenly_without_a_name_does_not_repeat_either() {
    // The same product, that grows from cycle to cycle: no step explains it better than a line.
    let odd = |um: f64| {
        move |s: &State| {
            let [x, y] = s.position;
            let shape = s.velocity[1].signum() * (x / 50.0).powi(2) * (y / 50.0);
            [1e-3 * um * shape, 0.0]
        }
    };
    let grown = [0.0, 1.5, 3.0, 4.5, 6.0, 7.5].map(odd);
    let all: Vec<&Wrong> = grown.iter().map(|one| one as &Wrong).collect();
    let diagnosis = diagnosed(&cycles(30, &all));
    let said = told(&diagnosis);
    let changes = &diagnosis.report.does_not_repeat;
    let own = changes.iter().find(|one| one.channel == "grid.u");
    let own = own.expect("a change");
    assert!(own.evenly && !own.of_set_up, "{own:?} {said}");
    assert_eq!((own.last_run, own.from_run), (0, 47), "{own:?}");
    assert!(diagnosis.report.unknown.flagged, "{said}");
}

#[test]
fn a_name_that_explains_only_a_part_counts_for_less() {
    let play = soft_play(0, 6e-3);
    let both = move |s: &State| {
        let [u, v] = play(s);
        let x = s.position[0] / 50.0;
        [u + 3e-3 * s.velocity[1].signum() * x * x, v]
    };
    let diagnosis = diagnosed(&cycles(30, &[&both, &both]));
    let all = told(&diagnosis);
    let is_left = |note: &Note| matches!(note, Note::Course(Course::Remainder { .. }));
    let named = names(&diagnosis);
    if !named.is_empty() {
        assert!(diagnosis.notes.iter().any(is_left), "{all}");
        let mut causes = diagnosis.report.causes.iter();
        assert!(causes.all(|cause| cause.confidence < 0.9), "{all}");
    }
    assert!(diagnosis.report.unknown.flagged, "{all}");
}

/// A machine that works for half an hour before the session goes on: its axes move and nothing is read.
fn work(session: &mut Session, seconds: f64) {
    let mut run = session.runs[0].clone();
    let from_s = session.runs[session.runs.len() - 1].motion.time_s[0] + 60.0;
    let first_s = run.motion.time_s[0];
    for time_s in &mut run.motion.time_s {
        *time_s += from_s + seconds - first_s;
    }
    run.readings.clear();
    session.runs.push(run);
}

/// A screw that is longer as soon as the machine has worked, by as much in all warm runs, whatever a model of its heat says.
#[test]
fn a_scale_that_begins_as_the_machine_warms_is_listed_with_the_screw() {
    let longer = |s: &State| [60e-6 * s.position[0], 0.0];
    let listed = |speed_mm_s: f64| {
        let mut session = cycles(11, &[&nothing]);
        // The plate is mounted anew for each cycle.
        for mounting in 2..6 {
            work(&mut session, 1800.0);
            go_on(
                &mut session,
                &CYCLE,
                mounting,
                1200 + u64::from(mounting),
                Noise::default(),
                &longer,
            );
        }
        let end_s = session
            .runs
            .iter()
            .filter_map(|run| run.motion.time_s.last().copied());
        let n = (end_s.fold(0.0, f64::max) / 30.0) as usize + 2;
        let history = &mut session.history;
        history.step_s = 30.0;
        for axis in [Axis::X, Axis::Y] {
            // The cycle itself takes four minutes.
            let speed = (0..n).map(|at| if at < 8 { 5.0 } else { speed_mm_s });
            history.speed[axis] = speed.collect();
            history.speed_squared[axis] = history.speed[axis].iter().map(|v| v * v).collect();
        }
        let diagnosis = diagnosed(&session);
        let mut causes = diagnosis.report.causes.iter();
        let cause = causes.find(|cause| cause.status != Status::Surrogate);
        let cause = cause.unwrap_or_else(|| panic!("{}", told(&diagnosis)));
        let mut alike = cause.confusable_with.iter();
        let is_screw = |id: &str, axis: &str| (id, axis) == ("screw_elongation", "X");
        let is_listed = is_screw(&cause.effect, &cause.axis)
            || alike.any(|own| is_screw(&own.effect, &own.axis));
        (is_listed, format!("{} {cause:?}", told(&diagnosis)))
    };
    let (of_warm, said) = listed(120.0);
    assert!(of_warm, "the machine worked: {said}");
    let (of_cold, said) = listed(0.0);
    assert!(!of_cold, "the machine stood: {said}");
}
