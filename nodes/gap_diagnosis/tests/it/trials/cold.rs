//! A column that warms, with its thermometer and without.

use gap_diagnosis::report::{GapReport, Status};
use gap_diagnosis::{Diagnosis, GapConfig, Note, diagnose};
use machine::MachineFile;
use metrology::PerAxis;
use twin::{History, Session};

use crate::trials::plant::{Circle, Noise, State, session_of, told};

/// Spacing of the history, s, and how long it is.
const STEP_S: f64 = 10.0;
const STEPS: u32 = 160;
/// Warming of the column, K, and its time constant, s; the back follows the front, and the head the difference.
const WARMING_K: f64 = 6.0;
const FRONT_S: f64 = 500.0;
const BACK_S: f64 = 1500.0;
const SHIFT_MM_PER_K: f64 = -4e-3;

/// Circles in both senses at two feeds, nine times, for that drifts are told from noise.
fn program() -> Vec<Circle> {
    let of = |repeat: u32| {
        let (other, feed) = [(80.0, 4000.0), (50.0, 4000.0), (65.0, 3000.0)][repeat as usize % 3];
        [
            (50.0, 2000.0, true, repeat),
            (50.0, 2000.0, false, repeat),
            (other, feed, repeat.is_multiple_of(2), repeat / 3),
        ]
    };
    (0..9).flat_map(of).collect()
}

fn warmed_k(time_s: f64, constant_s: f64) -> f64 {
    WARMING_K * (1.0 - (-time_s / constant_s).exp())
}

/// The head goes forward with the difference of the sides.
fn wrong(state: &State) -> [f64; 2] {
    let apart_k = warmed_k(state.time_s, FRONT_S) - warmed_k(state.time_s, BACK_S);
    [0.0, SHIFT_MM_PER_K * apart_k]
}

/// The machine of circles with a thermometer on its column and one in the shop.
fn machine() -> MachineFile {
    let text = include_str!("../../../../../launch_configs/grid_xy/machine.yaml");
    let sensors = "temperature_sensors:
  - {id: column, place: column, period_s: 10.0}
  - {id: ambient, place: ambient, period_s: 10.0}
grid_encoder:";
    let text = text.replace("grid_encoder:", sensors);
    MachineFile::parse(&text, "grid_xy").expect("a machine file")
}

fn recorded(with_thermometers: bool) -> Session {
    let mut session = session_of(&program(), 90, Noise::default(), &wrong);
    let still = || PerAxis::from_fn(|_| vec![0.0; STEPS as usize]);
    session.history = History {
        step_s: STEP_S,
        position: still(),
        speed: still(),
        speed_squared: still(),
        ..History::default()
    };
    if with_thermometers {
        let at = |k: u32| 20.0 + warmed_k(STEP_S * f64::from(k), FRONT_S);
        let all = [
            ("column", (0..STEPS).map(at).collect()),
            ("ambient", vec![20.0; STEPS as usize]),
        ];
        session.history.temperature_degc = all.map(|(id, series)| (id.to_owned(), series)).into();
    }
    session
}

fn diagnosed(with_thermometers: bool) -> Diagnosis {
    diagnose(
        &machine(),
        &recorded(with_thermometers),
        &GapConfig::default(),
    )
    .expect("the plant is sound")
}

/// What an effect needs that was not recorded.
fn needs<'r>(report: &'r GapReport, effect: &str) -> Option<&'r str> {
    let mut all = report.not_excited.iter();
    let own = all.find(|entry| entry.effect == effect);
    own.map(|entry| entry.needs.as_str())
}

#[test]
fn without_thermometers_what_heat_does_is_listed_and_described_and_nothing_wrong_is_named() {
    let with = diagnosed(true);
    assert_eq!(needs(&with.report, "column_bend"), None);
    assert!(!with.notes.contains(&Note::NoTemperatures));

    let without = diagnosed(false);
    assert_eq!(
        needs(&without.report, "column_bend"),
        Some("a thermometer on the column or in the shop whose reading changes")
    );
    assert!(without.notes.contains(&Note::NoTemperatures));
    let named = without.report.causes.iter();
    let named: Vec<_> = named
        .filter(|cause| cause.status == Status::Named)
        .collect();
    assert!(named.is_empty(), "{}", told(&without));
    assert!(without.report.unknown.flagged, "{}", told(&without));
    let description = &without.report.unknown.description;
    assert_eq!(description.covariate, "time", "{description:?}");
    assert!(description.time_constant_s.is_some());
}
