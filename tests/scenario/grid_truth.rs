//! What a grid encoder's recordings determine, judged by the plant itself.
//!
//! The truth is the plant of the scenario as warm as it was at the middle of each recording (`shadow`), at rest where the motors stood
//! at the points of the recordings, read by a grid without error. Brought through the same equations with the same weights, it gives
//! what perfect readings at these places would give, in the gauge of the estimate: the value of a coefficient, or of a sum of
//! coefficients, that the recordings determine. What the functions of the model cannot follow is left over there and said. Nothing of
//! the truth is in the bag.
//!
//! So an interval has to hold what the plate, noise, friction, play and drift within and between recordings put into an estimate. Not in
//! it: that the machine was colder before. A heat that all recordings share is the machine's, as it was while it was measured.

use fake_cnc::plant::{Plant, PlantFile};
use grid_encoder::identify::{Combination, Disturbed, Identification, identify};
use grid_encoder::recording::{Place, Recording};
use grid_encoder::{GridEncoderConfig, GridEncoderStage, Input, Output};
use machine::file::GridPlacement;
use machine::{Kinematics, MachineFile};
use metrology::sample::{AxisState, GridSample, TestSegment};
use metrology::stamp::{Host, Span, Stamp};
use metrology::{PerAxis, Stage};
use nalgebra::Vector3;
use recorder::{Bag, Event, Order};
use serde_json::Value;

use abbe_msgs::topics::{self, Topic};
use abbe_msgs::{Message, Wire, from_cdr};
use abbe_tests::scenario::Scenario;

use crate::recorded::{all, for_each, tests};
use crate::shadow::Shadow;

/// Standard uncertainties that the interval of 95 % reaches to either side.
const INTERVAL: f64 = 1.96;
/// After the last message every recording is taken in.
const AFTER: Span = Span::from_nanos(10_000_000_000);
/// The plant taken along lags a little where axes accelerate, mm.
const FOLLOWS_MM: f64 = 1.0;

/// A coefficient, or a sum of coefficients, that is determined; mm at the edge of what was recorded.
#[derive(Clone, Debug)]
pub struct Determined {
    /// Its name, members of a sum apart by `|`.
    pub name: String,
    /// The estimate.
    pub value_mm: f64,
    /// Its standard uncertainty.
    pub standard_uncertainty_mm: f64,
    /// What perfect readings of the cold plant give.
    pub truth_mm: f64,
}

impl Determined {
    /// Estimate minus truth, in standard uncertainties.
    pub fn score(&self) -> f64 {
        (self.value_mm - self.truth_mm) / self.standard_uncertainty_mm
    }

    /// Whether the interval of 95 % holds the truth.
    pub fn is_held(&self) -> bool {
        self.score().abs() <= INTERVAL
    }
}

/// An identification beside the truth.
pub struct Judged {
    /// Everything that it determines.
    pub determined: Vec<Determined>,
    /// Greatest and rms distance of the perfect readings from the best fit of the model's functions, mm.
    pub outside_mm: (f64, f64),
}

impl Judged {
    /// How far the truth lies beyond its interval of 95 % at most, mm; zero where every interval holds it.
    pub fn beyond_mm(&self) -> f64 {
        let beyond = |one: &Determined| {
            (one.value_mm - one.truth_mm).abs() - INTERVAL * one.standard_uncertainty_mm
        };
        self.determined.iter().map(beyond).fold(0.0, f64::max)
    }

    /// Root of the mean square of estimate minus truth in standard uncertainties: 1 where these are right, less where they are too wide.
    pub fn rms_score(&self) -> f64 {
        let squares = self.determined.iter().map(|one| one.score().powi(2));
        (squares.sum::<f64>() / self.determined.len() as f64).sqrt()
    }

    /// How many intervals hold the truth.
    pub fn held(&self) -> usize {
        self.determined.iter().filter(|one| one.is_held()).count()
    }

    /// Prints every estimate beside its truth.
    pub fn print(&self, scenario: &str) {
        for one in &self.determined {
            eprintln!(
                "{scenario}: {:<24} {:>8.3} um, u {:.3}, truth {:>8.3}, score {:>6.2}",
                one.name,
                one.value_mm * 1e3,
                one.standard_uncertainty_mm * 1e3,
                one.truth_mm * 1e3,
                one.score()
            );
        }
        let (greatest_mm, rms_mm) = self.outside_mm;
        eprintln!(
            "{scenario}: {} of {} intervals of 95 % hold the truth, which lies {:.2} um beyond at most; rms score {:.2}; outside of the model's functions lie {:.3} um rms, {:.3} um at most",
            self.held(),
            self.determined.len(),
            self.beyond_mm() * 1e3,
            self.rms_score(),
            rms_mm * 1e3,
            greatest_mm * 1e3
        );
    }
}

/// Judges the last model of a scenario's bag.
pub fn judge(scenario: &Scenario, bag: &Bag) -> Judged {
    let text = |name: &str| std::fs::read_to_string(scenario.path(name)).unwrap();
    let machine = MachineFile::parse(&text("machine.yaml"), "machine.yaml").unwrap();
    let parameters: Value = serde_saphyr::from_str(&text("grid_encoder.yaml")).unwrap();
    let parameters = parameters["/**"]["ros__parameters"].clone();
    let config: GridEncoderConfig = serde_json::from_value(parameters).unwrap();
    let (found, recordings) = as_the_node(bag, &config, &machine);
    let plant_file = PlantFile::from_yaml(&text("plant.yaml")).unwrap();
    let mut perfect = perfect_readings(bag, &recordings, &machine, plant_file);
    weigh_alike(&mut perfect, &found);
    let kinematics = Kinematics::new(&machine).unwrap();
    let mut options = config.options_for(kinematics.chain(), &recordings).unwrap();
    options.outlier_limit = f64::INFINITY;
    options.recording_noise = false;
    options.disturbed = found
        .disturbances
        .map_or(Disturbed::Ignored, |told| Disturbed::Given {
            ratios: told.ratios,
        });
    let truth = identify(&kinematics, &perfect, &options).unwrap();
    assert_eq!(truth.rank, found.rank);
    let left = || truth.residuals_mm.iter().flatten().flatten();
    let squares: f64 = left().map(|r| r * r).sum();
    Judged {
        determined: determined(&found, &truth),
        outside_mm: (
            left().fold(0.0, |greatest, r| r.abs().max(greatest)),
            (squares / left().count() as f64).sqrt(),
        ),
    }
}

/// Gives perfect readings the weights that the estimate gave the real ones, so that both are the same sums of readings.
fn weigh_alike(perfect: &mut [Recording], found: &Identification) {
    for (recording, weights) in perfect.iter_mut().zip(&found.weights) {
        for (point, weights) in recording.points.iter_mut().zip(weights) {
            for (u_mm, weight) in point.standard_uncertainty_mm.iter_mut().zip(weights) {
                *u_mm /= weight.sqrt();
            }
        }
    }
}

fn determined(found: &Identification, truth: &Identification) -> Vec<Determined> {
    let single = (0..found.n_coefficients).filter_map(|idx| {
        let (value, u) = found.estimate(idx)?;
        let scale = found.scale[idx];
        Some(Determined {
            name: found.unknowns[idx].to_string(),
            value_mm: value / scale,
            standard_uncertainty_mm: u / scale,
            truth_mm: truth.values[idx] / scale,
        })
    });
    let sum = |combination: &Combination| {
        let weights = combination.weights.iter();
        Determined {
            name: found.name_of(combination),
            value_mm: combination.value_mm,
            standard_uncertainty_mm: combination.standard_uncertainty_mm,
            truth_mm: weights.map(|(idx, w)| w * truth.values[*idx]).sum(),
        }
    };
    single.chain(found.combinations.iter().map(sum)).collect()
}

/// The identification that the node published last, with its recordings, from the messages that it took.
fn as_the_node(
    bag: &Bag,
    config: &GridEncoderConfig,
    machine: &MachineFile,
) -> (Identification, Vec<Recording>) {
    let mut stage = GridEncoderStage::new(config, machine).unwrap();
    let mut out = Vec::new();
    let mut found = None;
    let mut published = None;
    let mut take = |stage: &mut GridEncoderStage, at: Stamp<Host>, input: Input| {
        stage.step(at, input, &mut out).unwrap();
        for output in out.drain(..) {
            if let Output::Identification(one) = output {
                found = Some(*one);
            }
        }
    };
    let mut last = Stamp::from_nanos(0);
    let mut messages = bag.messages(Order::LogTime);
    while let Some(event) = messages.next_event() {
        let Event::Message(message) = event else {
            panic!("the bag has lost something");
        };
        let name = bag.topic(message.topic).topic.trim_start_matches('/');
        let data = message.data;
        if name == topics::AXES_STATE.name {
            let state: AxisState = decoded(&topics::AXES_STATE, data);
            last = state.received_at;
            take(&mut stage, last, Input::State(state));
        } else if name == topics::GRID_POSITION.name {
            let sample: GridSample = decoded(&topics::GRID_POSITION, data);
            take(&mut stage, last, Input::Reading(sample));
        } else if name == topics::TEST_SEGMENT.name {
            let segment: TestSegment = decoded(&topics::TEST_SEGMENT, data);
            take(&mut stage, segment.at, Input::Segment(segment));
        } else if name == topics::GEOMETRY_MODEL.name {
            published = Some(decoded(&topics::GEOMETRY_MODEL, data));
        }
    }
    take(&mut stage, last + AFTER, Input::Tick);
    let (found, published) = (found.unwrap(), published.unwrap());
    assert_eq!(published.rank as usize, found.rank);
    let apart_mm = published.residual_standard_deviation_mm - found.residual_standard_deviation_mm;
    assert!(apart_mm.abs() < 1e-9, "this is not what the node computed");
    (found, stage.recordings().to_vec())
}

fn decoded<M: Message + Wire>(_: &Topic<M>, data: &[u8]) -> M::Inner {
    from_cdr::<M>(data).unwrap().into_inner().unwrap()
}

/// The same recordings, read by a grid without error on the plant at rest, each as warm as it was when the recording was half done.
///
/// Each recording is zeroed anew: how the place of the plate drifted between two recordings under one zero is no geometry.
fn perfect_readings(
    bag: &Bag,
    recordings: &[Recording],
    machine: &MachineFile,
    mut file: PlantFile,
) -> Vec<Recording> {
    let grid = &mut file.grid_encoder;
    grid.placement_um = 0.0;
    grid.rotation_urad = 0.0;
    grid.plate_error_um = 0.0;
    grid.head_noise_um = 0.0;
    let cold = Plant::new(machine, &file).unwrap();
    let segments = all(bag, &topics::TEST_SEGMENT);
    let tests = tests(&segments);
    let middle = |recording: &Recording| {
        let mut of = tests.iter().filter(|(begin, _)| begin.run == recording.run);
        let (begin, end) = of.next().unwrap();
        begin.at + Span::from_nanos((end.at - begin.at).nanos() / 2)
    };
    let mut left = recordings.iter();
    let mut next = left.next();
    let mut perfect = Vec::new();
    let mut shadow: Option<Shadow> = None;
    for_each(bag, &topics::AXES_STATE, |state: AxisState| {
        let Some(recording) = next else { return };
        let shadow = shadow.get_or_insert_with(|| Shadow::new(cold.clone(), &state));
        shadow.follow(&state);
        if state.received_at >= middle(recording) {
            assert!(shadow.apart_mm() < FOLLOWS_MM, "{}", shadow.apart_mm());
            perfect.push(read_by(shadow.plant(), recording, machine));
            next = left.next();
        }
    });
    assert_eq!(perfect.len(), recordings.len());
    perfect
}

fn read_by(mut plant: Plant, recording: &Recording, machine: &MachineFile) -> Recording {
    let place = &recording.place;
    plant.mount(placement_of(place, machine));
    plant.settle_at(&positions(&place.centre_mm));
    plant.zero_grid();
    let mut perfect = recording.clone();
    for point in &mut perfect.points {
        plant.settle_at(&point.positions);
        let reading = plant.grid_reading().unwrap();
        point.reading_mm = [reading.u_mm, reading.v_mm];
    }
    perfect
}

fn positions(at_mm: &Vector3<f64>) -> PerAxis<f64> {
    let mut positions = PerAxis::default();
    positions.0[..3].copy_from_slice(at_mm.as_slice());
    positions
}

/// The placement on whose plate a recording was made.
fn placement_of<'a>(place: &Place, machine: &'a MachineFile) -> &'a str {
    let placements = &machine.grid_encoder.as_ref().unwrap().placements;
    let head_mm = place.centre_mm + place.tool_offset_mm;
    let away_mm = |placement: &GridPlacement| (Vector3::from(placement.centre_mm) - head_mm).norm();
    let fits = |placement: &&GridPlacement| {
        place.plane == placement.plane.into()
            && (Vector3::from(placement.tool_offset_mm) - place.tool_offset_mm).norm() < 1e-6
    };
    let nearest = placements
        .iter()
        .filter(fits)
        .min_by(|a, b| away_mm(a).total_cmp(&away_mm(b)));
    &nearest.unwrap().id
}
