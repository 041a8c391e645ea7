//! The space diagonals of ISO 230-6 as a person runs them, judged by where the plant's tool was at every stop.
//!
//! The truth is the plant of the scenario taken along the recorded motion of its motors (`shadow`): what its tool and its table were apart
//! at each stop, along the beam, with all its heat, play and friction, brought along by what the shadow's motors are short of. Nothing of it is in the bag, and nothing of ISO 230-6's evaluation is
//! in it: deviations are sorted here by place and side.

use std::collections::BTreeMap;

use abbe_msgs::topics;
use abbe_tests::foreseen::Foreseen;
use abbe_tests::scenario::Scenario;
use fake_cnc::plant::{Plant, PlantFile};
use machine::MachineFile;
use machine::file::BeamEntry;
use metrology::sample::{AxisState, TestKind};
use nalgebra::Vector3;
use recorder::Bag;
use serde_json::Value;

use crate::recorded::{all, stops, tests};
use crate::shadow::Shadow;

/// Targets on each diagonal, of the plan.
const TARGETS: usize = 9;
/// Runs of each, up and down.
const RUNS: usize = 5;
/// Way beyond the first and last target, mm.
const OVERRUN_MM: f64 = 10.0;
/// Rest after which a stop counts, s.
const REST_S: f64 = 0.4;
/// How far the shadow's motors may stand from the recorded ones at a stop, mm; some 11 µm, by which its tool is brought along.
const FOLLOWS_MM: f64 = 0.015;
/// How far a mean of the report may be from the truth, mm. Over 0.8 m the reference's wavelength is off by 0.08 µm and drifts by
/// 0.04 µm in a quarter of an hour; five readings of an axis that comes to rest within steps of its encoder, and the shadow, the rest.
const MEAN_MM: f64 = 0.0002;

/// What the report takes out for 20 degC, mm/mm: the scenario's budget states a machine that is 0.2 K warmer and grows by
/// 11 um/(m K), and an interferometer, which does not.
const TO_20_DEGC: f64 = 0.2 * 11e-6;

/// Deviations on one diagonal from its lower end's mean, mm: by target the means of approaches upwards and downwards.
type Means = Vec<[f64; 2]>;

/// The way along a beam at each stop of every run, mm.
struct Truth<'a> {
    beam: &'a BeamEntry,
    /// True minus nominal, by target and side.
    found_mm: BTreeMap<(usize, usize), Vec<f64>>,
}

impl Truth<'_> {
    /// Way from one target to the next, mm.
    fn step_mm(&self) -> f64 {
        let ends = [self.beam.from_mm, self.beam.to_mm].map(Vector3::from);
        ((ends[1] - ends[0]).norm() - 2.0 * OVERRUN_MM) / (TARGETS - 1) as f64
    }

    /// Takes in one stop; none of the targets: nothing.
    fn stop(
        &mut self,
        commanded_mm: &Vector3<f64>,
        came_from_mm: &Vector3<f64>,
        tool_mm: &Vector3<f64>,
    ) {
        let (from, to) = (
            Vector3::from(self.beam.from_mm),
            Vector3::from(self.beam.to_mm),
        );
        let direction = (to - from).normalize();
        let along_mm = |place: &Vector3<f64>| direction.dot(&(place - from));
        let target = (along_mm(commanded_mm) - OVERRUN_MM) / self.step_mm();
        if (target - target.round()).abs() < 1e-3 && target.round() >= 0.0 {
            let side = usize::from(along_mm(came_from_mm) > along_mm(commanded_mm));
            let key = (target.round() as usize, side);
            self.found_mm
                .entry(key)
                .or_default()
                .push(along_mm(tool_mm) - along_mm(commanded_mm));
        }
    }

    /// At 20 degC.
    fn means(&self) -> Means {
        assert_eq!(self.found_mm.len(), 2 * TARGETS);
        let mean = |key: (usize, usize)| {
            let values = &self.found_mm[&key];
            assert_eq!(values.len(), RUNS, "{key:?}");
            values.iter().sum::<f64>() / RUNS as f64
        };
        let lower_mm = f64::midpoint(mean((0, 0)), mean((0, 1)));
        (0..TARGETS)
            .map(|target| {
                let warm_mm = TO_20_DEGC * self.step_mm() * target as f64;
                [0, 1].map(|side| mean((target, side)) - lower_mm - warm_mm)
            })
            .collect()
    }
}

/// Where the plant's tool was at the stops of every beam.
fn truths(scenario: &Scenario, bag: &Bag) -> BTreeMap<String, Means> {
    let text = |name: &str| std::fs::read_to_string(scenario.path(name)).unwrap();
    let machine = MachineFile::parse(&text("machine.yaml"), "machine.yaml").unwrap();
    let plant_file = PlantFile::from_yaml(&text("plant.yaml")).unwrap();
    let states: Vec<AxisState> = all(bag, &topics::AXES_STATE);
    let segments = all(bag, &topics::TEST_SEGMENT);
    let runs = tests(&segments)
        .into_iter()
        .filter(|(begin, _)| begin.kind == TestKind::Diagonal);
    let mut wanted = runs.flat_map(|run| {
        let found = stops(&states, run, REST_S);
        found
            .into_iter()
            .map(move |stop| (run.0.features[0].clone(), stop))
    });
    let beams = &machine.length_reference.as_ref().unwrap().beams;
    let begin = |beam| Truth {
        beam,
        found_mm: BTreeMap::new(),
    };
    let mut truths: BTreeMap<String, Truth<'_>> =
        beams.iter().map(|b| (b.id.clone(), begin(b))).collect();
    let mut shadow = Shadow::new(Plant::new(&machine, &plant_file).unwrap(), &states[0]);
    let mut next = wanted.next();
    let mut commands_mm = [states[0].commanded.xyz(); 2];
    for state in &states {
        shadow.follow(state);
        if (state.commanded.xyz() - commands_mm[1]).norm() > 1e-9 {
            commands_mm = [commands_mm[1], state.commanded.xyz()];
        }
        let Some((beam, stop)) = &next else { break };
        if stop.received_at == state.received_at {
            assert!(shadow.apart_mm() < FOLLOWS_MM, "{} mm", shadow.apart_mm());
            let tool_mm = shadow.plant().tool_in_workpiece_mm() + shadow.short_mm();
            truths
                .get_mut(beam)
                .unwrap()
                .stop(&commands_mm[1], &commands_mm[0], &tool_mm);
            next = wanted.next();
        }
    }
    truths
        .into_iter()
        .map(|(beam, truth)| (beam, truth.means()))
        .collect()
}

/// Greatest difference within all means of a diagonal, and greatest mean reversal with any sign, mm.
fn error_and_reversal_mm(means: &Means) -> [f64; 2] {
    let all = || means.iter().flatten();
    let (least, most) = (
        all().copied().fold(f64::INFINITY, f64::min),
        all().copied().fold(f64::NEG_INFINITY, f64::max),
    );
    let reversal = means.iter().map(|[up, down]| (up - down).abs());
    [most - least, reversal.fold(0.0, f64::max)]
}

fn means_of(diagonal: &Value) -> Means {
    let mean = |point: &Value, side: &str| point[side]["mean_mm"].as_f64().unwrap();
    let points = diagonal["positioning"]["points"].as_array().unwrap().iter();
    points
        .map(|point| [mean(point, "up"), mean(point, "down")])
        .collect()
}

#[test]
fn the_four_space_diagonals_are_what_the_plants_tool_did_along_them() {
    let scenario = Scenario::copy_of("diagonals");
    let foreseen = Foreseen::begin(&scenario.folder());
    let run = scenario.run();
    foreseen.agrees(&scenario.folder(), &run);
    let report = std::fs::read_to_string(run.join("report.json")).unwrap();
    let report: Value = serde_json::from_str(&report).unwrap();
    let tests = report["tests"].as_array().unwrap();
    let found = tests.iter().find_map(|test| test.get("iso230_6")).unwrap();
    let truths = truths(&scenario, &Bag::open(run.join("bag")).unwrap());
    let mut all_off_mm = Vec::new();
    let mut greatest_mm = [0.0_f64; 2];
    for diagonal in found["diagonals"].as_array().unwrap() {
        let name = diagonal["diagonal"].as_str().unwrap().to_lowercase();
        let (means, truth) = (means_of(diagonal), &truths[&name]);
        assert_eq!(means.len(), TARGETS);
        let pairs = means.iter().flatten().zip(truth.iter().flatten());
        let off_mm = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let (own, true_mm) = (error_and_reversal_mm(&means), error_and_reversal_mm(truth));
        eprintln!(
            "{name}: E {:.2} um, B {:.2} um; of the plant {:.2} and {:.2}; a mean is off by {:.3} um at most",
            own[0] * 1e3,
            own[1] * 1e3,
            true_mm[0] * 1e3,
            true_mm[1] * 1e3,
            off_mm * 1e3
        );
        all_off_mm.push(off_mm);
        greatest_mm = [0, 1].map(|k| greatest_mm[k].max(true_mm[k]));
    }
    assert!(
        all_off_mm.iter().all(|off_mm| *off_mm < MEAN_MM),
        "{all_off_mm:?} mm"
    );
    let figure_mm = |name: &str| found[name]["value_mm"].as_f64().unwrap();
    for (name, true_mm) in ["systematic_error", "reversal"]
        .into_iter()
        .zip(greatest_mm)
    {
        assert!(
            (figure_mm(name) - true_mm).abs() < 2.0 * MEAN_MM,
            "{name}: {} {true_mm}",
            figure_mm(name)
        );
    }
    // The plant's squareness makes them unlike, its play and friction give each a reversal: there is something to be seen.
    assert!(
        greatest_mm[0] > 0.02 && greatest_mm[1] > 0.005,
        "{greatest_mm:?}"
    );
}
