//! The grid encoder scenario as a person runs it: what it estimates is what the plant's file makes.
//!
//! The truth is the plant itself, cold, at the stations of the recordings, brought through the same equations: what
//! perfect readings at these places would give. Nothing of it is in the bag.

use std::time::{Duration, Instant};

use abbe_msgs::topics;
use abbe_tests::scenario::Scenario;
use fake_cnc::plant::{Plant, PlantFile};
use grid_encoder::identify::{Identification, IdentifyOptions, identify};
use grid_encoder::recording::{Recording, in_plane};
use grid_encoder::{GridEncoderConfig, GridEncoderStage, Input, Output};
use machine::{Kinematics, MachineFile};
use metrology::Stage;
use metrology::sample::{GridSample, TestSegment};
use recorder::Bag;

use crate::recorded::{all, tests};

/// The longest that a run and its evaluation may take on two cores.
const LIMIT: Duration = Duration::from_secs(60);
/// Share of the estimates whose 95 % interval must hold the truth.
const LEAST_SHARE: f64 = 0.9;

fn machine(scenario: &Scenario) -> MachineFile {
    let text = std::fs::read_to_string(scenario.path("machine.yaml")).unwrap();
    MachineFile::parse(&text, "machine.yaml").unwrap()
}

/// The recordings as the node made them, from the readings of the bag.
fn recordings(bag: &Bag, machine: &MachineFile) -> Vec<Recording> {
    let mut inputs: Vec<(metrology::Stamp<metrology::Host>, u8, Input)> = Vec::new();
    let segments = all(bag, &topics::TEST_SEGMENT).into_iter();
    inputs.extend(segments.map(|s| (s.at, u8::from(!s.begin), Input::Segment(s))));
    let states = all(bag, &topics::AXES_STATE).into_iter();
    inputs.extend(states.map(|s| (s.received_at, 0, Input::State(s))));
    let readings = all(bag, &topics::GRID_POSITION).into_iter();
    inputs.extend(readings.map(|s| (s.at, 0, Input::Reading(s))));
    inputs.sort_by_key(|(at, place, _)| (*at, *place));
    let mut stage = GridEncoderStage::new(&GridEncoderConfig::default(), machine).unwrap();
    let mut found = Vec::new();
    let mut out = Vec::new();
    for (at, _, input) in inputs {
        stage.step(at, input, &mut out).unwrap();
        for output in out.drain(..) {
            if let Output::Recording(recording) = output {
                found.push(*recording);
            }
        }
    }
    found
}

/// The same recordings with the readings of a perfect grid on the plant as it is cold.
fn true_recordings(made: &[Recording], plant: &Plant) -> Vec<Recording> {
    let mut perfect = made.to_vec();
    for recording in &mut perfect {
        for point in &mut recording.points {
            let positions = point.positions;
            let error = plant.tool_error_at_motor_pose_mm(&positions, &positions);
            let at = in_plane(recording.place.plane, &(positions.xyz() + error));
            point.reading_mm = at;
        }
    }
    perfect
}

fn options(machine: &MachineFile, recordings: &[Recording]) -> (Kinematics, IdentifyOptions) {
    let kinematics = Kinematics::new(machine).unwrap();
    let options = GridEncoderConfig::default()
        .options_for(kinematics.chain(), recordings)
        .unwrap();
    (kinematics, options)
}

/// Name, estimate and truth over the estimate's standard uncertainty, of every determined coefficient.
fn scores(found: &Identification, truth: &Identification) -> Vec<(String, f64)> {
    (0..found.n_coefficients)
        .filter_map(|idx| {
            let (value, u) = found.estimate(idx)?;
            let off = value - truth.values[idx];
            Some((found.unknowns[idx].to_string(), off / u))
        })
        .collect()
}

/// Every reading within a test is of its zero and plane.
fn check_readings(segments: &[TestSegment], samples: &[GridSample]) {
    let planar = tests(segments);
    let planar = planar.iter().filter(|(begin, _)| begin.zero_id > 0);
    let mut n = 0;
    for (begin, end) in planar {
        assert!(end.completed, "{end:?}");
        let within = samples
            .iter()
            .filter(|sample| sample.at >= begin.at && sample.at <= end.at);
        for sample in within {
            let told = (sample.zero_id, sample.plane);
            assert_eq!(told, (begin.zero_id, begin.plane), "run {}", begin.run);
            n += 1;
        }
    }
    assert!(n > 100_000, "{n} readings within tests");
}

#[test]
fn what_grid_xy_determines_is_what_the_plant_is_and_every_reading_is_of_its_segment() {
    let began = Instant::now();
    let scenario = Scenario::copy_of("grid_xy");
    let run = scenario.run();
    let ran = began.elapsed();
    let bag = Bag::open(&run.join("bag")).unwrap();
    let segments = all(&bag, &topics::TEST_SEGMENT);
    check_readings(&segments, &all(&bag, &topics::GRID_POSITION));

    let machine = machine(&scenario);
    let made = recordings(&bag, &machine);
    let text = std::fs::read_to_string(scenario.path("plant.yaml")).unwrap();
    let plant = Plant::new(&machine, &PlantFile::from_yaml(&text).unwrap()).unwrap();
    let (kinematics, options) = options(&machine, &made);
    let found = identify(&kinematics, &made, &options).unwrap();
    let perfect = true_recordings(&made, &plant);
    let truth = identify(&kinematics, &perfect, &options).unwrap();
    let published = all(&bag, &topics::GEOMETRY_MODEL).pop().unwrap();
    assert_eq!(published.rank as usize, found.rank);

    let scores = scores(&found, &truth);
    let held = scores
        .iter()
        .filter(|(_, score)| score.abs() <= 1.96)
        .count();
    eprintln!(
        "grid_xy: run and page {:.1} s; {held} of {} determined coefficients within 1.96 u: {scores:.1?}",
        ran.as_secs_f64(),
        scores.len()
    );
    assert!(scores.len() >= 10, "{scores:?}");
    assert!(
        held as f64 >= LEAST_SHARE * scores.len() as f64,
        "{scores:?}"
    );
    assert!(began.elapsed() < LIMIT, "{:?}", began.elapsed());
}
