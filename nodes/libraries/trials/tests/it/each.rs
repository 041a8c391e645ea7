//! Every effect of the catalogue that moves the mean of readings, alone on a recording that shows it.
//!
//! What the plant of `fake_cnc` has physics of its own for is judged out of the plant (`tests/alone`). Here the twin adds every
//! effect but the classes of blind trials to recorded commands with noise: whether the search finds them among all others,
//! not whether their formulas are a machine's. Effects that only scatter readings are in
//! `gap_diagnosis/tests/trials/scatter.rs`.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]
#![expect(clippy::print_stdout, reason = "a test tells what it saw")]

mod session;

use gap_diagnosis::report::{Cause, Status};
use gap_diagnosis::{GapConfig, diagnose};
use session::{Recording, recordings};
use trials::Class;
use twin::Twin;
use twin::effects::{self, CATALOGUE, Effect, Kind, Moment, Role, Target};

/// Size that is added, as D on the rows of the recording; less where the greatest physical size is less.
const WANTED_D: f64 = 40.0;
/// D below which an effect need not be named.
const LEAST_D: f64 = 20.0;

/// What was said of an effect.
struct Answer {
    name: String,
    recording: &'static str,
    d: f64,
    own: Option<Cause>,
    others: Vec<String>,
}

fn name(kind: &Kind, target: &Target) -> String {
    format!("{} {target}", kind.id).trim_end().to_owned()
}

/// Norm of what an effect adds to the readings, in their own units: which shape shows most.
fn shown(recording: &Recording, effect: &dyn Effect) -> f64 {
    let twin = Twin::new(&recording.machine).unwrap();
    let session = &recording.session;
    let squares = session.runs.iter().map(|run| {
        let added = twin.predict(session, run, &[effect]);
        added.iter().map(|value| value * value).sum::<f64>()
    });
    squares.sum::<f64>().sqrt()
}

/// First amplitude at its typical size, with the shapes of the grid that show it most.
fn typical(recording: &Recording, kind: &Kind, target: &Target) -> Vec<f64> {
    let mut values = vec![0.0; kind.parameters.len() + kind.free.len()];
    let first = kind
        .parameters
        .iter()
        .position(|p| p.role == Role::Amplitude);
    values[first.unwrap_or(0)] = kind.parameters[first.unwrap_or(0)].typical;
    for (place, parameter) in kind.parameters.iter().enumerate() {
        if parameter.role != Role::Amplitude {
            values[place] = parameter.typical;
        }
    }
    for (place, parameter) in kind.parameters.iter().enumerate() {
        let Some(grid) = parameter.role.grid() else {
            continue;
        };
        let at = |value: f64| {
            let mut tried = values.clone();
            tried[place] = value;
            shown(recording, &*(kind.build)(target.clone(), &tried))
        };
        let best = grid
            .iter()
            .copied()
            .max_by(|a, b| at(*a).total_cmp(&at(*b)));
        if at(parameter.typical) < 0.5 * at(best.unwrap_or(parameter.typical)) {
            values[place] = best.unwrap_or(parameter.typical);
        }
    }
    values
}

/// Adds an effect and diagnoses.
fn diagnosed(recording: &Recording, kind: &Kind, target: &Target, values: &[f64]) -> Vec<Cause> {
    let twin = Twin::new(&recording.machine).unwrap();
    let known = effects::known(&recording.machine).unwrap();
    let own = (kind.build)(target.clone(), values);
    let mut all: Vec<&dyn Effect> = known.iter().map(|effect| &**effect).collect();
    all.push(&*own);
    let mut session = recording.session.clone();
    for (run, bare) in session.runs.iter_mut().zip(&recording.session.runs) {
        let added = twin.predict(&recording.session, bare, &all);
        for (reading, added) in run.readings.iter_mut().zip(added) {
            reading.deviation += added;
        }
    }
    let diagnosis = diagnose(&recording.machine, &session, &GapConfig::default()).unwrap();
    diagnosis.report.causes
}

/// One effect at [`WANTED_D`]; a first diagnosis at a middle size says what its D is.
fn answer(recording: &Recording, kind: &Kind, target: &Target) -> Option<Answer> {
    let mut values = typical(recording, kind, target);
    let place = kind
        .parameters
        .iter()
        .position(|p| p.role == Role::Amplitude)?;
    let parameter = kind.parameters[place];
    if shown(recording, &*(kind.build)(target.clone(), &values)) < 1e-9 {
        return None;
    }
    let is_own = |cause: &&Cause| cause.effect == kind.id && cause.axis == target.to_string();
    let mut answer = None;
    for _ in 0..3 {
        let causes = diagnosed(recording, kind, target, &values);
        let own = causes.iter().find(is_own).cloned();
        let d = own.as_ref().map_or(0.0, |cause| cause.d);
        let others = causes.iter().filter(|cause| !is_own(cause));
        let is_sized = (0.5..2.0).contains(&(d / WANTED_D)) || values[place] >= parameter.high;
        answer = Some(Answer {
            name: name(kind, target),
            recording: recording.title,
            d,
            others: others
                .filter(|cause| cause.status != Status::Surrogate)
                .map(|cause| format!("{} {}", cause.effect, cause.axis))
                .collect(),
            own,
        });
        if is_sized {
            break;
        }
        let factor = if d > 0.0 { WANTED_D / d } else { 4.0 };
        values[place] = (values[place] * factor).min(parameter.high);
    }
    answer
}

fn is_found(answer: &Answer) -> bool {
    let own = answer.own.as_ref();
    let is_named = own.is_some_and(|cause| cause.status != Status::Surrogate);
    is_named && answer.others.is_empty() && answer.d >= LEAST_D
}

/// The first recording that has the effect named alone at a size that it should be; else the last that shows it.
fn judged(recordings: &[Recording], kind: &'static Kind) -> (&'static Kind, Option<Answer>) {
    let mut last = None;
    for recording in recordings {
        let targets = kind.targets_on(&recording.machine);
        let of = |target| answer(recording, kind, &target);
        if let Some(answer) = targets.into_iter().find_map(of) {
            let is_done = is_found(&answer);
            last = Some(answer);
            if is_done {
                break;
            }
        }
    }
    (kind, last)
}

#[test]
fn every_effect_that_a_recording_shows_is_named_alone() {
    let recordings = recordings();
    let is_judged = |kind: &&&'static Kind| {
        let has_plant = Class::ALL.iter().any(|class| class.id() == kind.id);
        // Only logs have the shift with a temperature tried, which these recordings are not.
        kind.moment == Moment::Mean && !has_plant && kind.id != "thermal_shift"
    };
    let kinds: Vec<&'static Kind> = CATALOGUE.iter().filter(is_judged).copied().collect();
    let mut all: Vec<(&'static Kind, Option<Answer>)> = std::thread::scope(|scope| {
        let halves = [0, 1].map(|half| {
            let (kinds, recordings) = (&kinds, &recordings);
            scope.spawn(move || {
                let own = kinds.iter().skip(half).step_by(2);
                own.map(|kind| judged(recordings, kind)).collect::<Vec<_>>()
            })
        });
        halves
            .into_iter()
            .flat_map(|half| half.join().unwrap())
            .collect()
    });
    all.sort_by_key(|(kind, _)| kind.id);
    let mut lost = vec![];
    for (kind, answer) in &all {
        let Some(answer) = answer else {
            println!("{:28} shown by no recording", kind.id);
            lost.push(kind.id);
            continue;
        };
        let own = answer.own.as_ref();
        let words = own.map_or_else(String::new, |cause| {
            let [value, unit] = cause
                .parameters
                .first()
                .map_or_else(Default::default, |of| {
                    [format!("{:.3}", of.value), of.name.clone()]
                });
            format!("{:?}, D {:.0}, {unit} {value}", cause.status, cause.d)
        });
        println!(
            "{:28} {:9} {words} {}",
            answer.name,
            answer.recording,
            answer.others.join(", ")
        );
        if !is_found(answer) {
            lost.push(kind.id);
        }
    }
    assert!(all.len() >= 26, "{}", all.len());
    assert_eq!(lost, Vec::<&str>::new());
}
