//! All 21 errors of a three-axis machine: measured with a grid encoder, compensated, and what is left.
//!
//! The scenario is run as a person runs it, with drives, friction, lost motion and heat. Beside it the same
//! programme is measured on the plant at rest and cold, so that what the programme itself can and cannot see
//! stands apart from what heat does between measurement and use.
//!
//! What is left of 17.5 µm (p95 about a datum), from one run of each, without and with the plate's error told apart (`plate_and_drift`):
//!
//! | with | without, µm | with, µm |
//! |---|---|---|
//! | plate (0.2 µm) and tables alone, at rest and cold | 0.97 | 0.51 |
//! | drives, friction and lost motion besides, no heat | 1.03 | |
//! | heat of cabinet, hydraulics and screws besides: the scenario | 1.31 | 1.00 |
//! | 18 W in the middle of the table besides, whose growth no plate of glass ceramic shows | 2.28 | |
//! | poses in random order and approached from any side, at the end of the measurement, and those 18 W | 7.5 | |

use std::time::Instant;

use fake_cnc::{Plant, PlantFile};
use grid_encoder::GridEncoderConfig;
use grid_encoder::geometry::geometry_model;
use grid_encoder::identify::{Identification, identify};
use grid_encoder::recording::{Fixture, GridPoint, Place, Recording};
use machine::trajectory::{Arrival, Pace, PlanarOrder, Shape, Trajectory, planar};
use machine::volumetric::{VolumetricModel, components_of, sensitivity};
use machine::{Kinematics, MachineFile};
use metrology::drift::Extrapolate;
use metrology::sample::Sense;
use metrology::{Axis, ErrorComponent, PerAxis, Stamp};
use nalgebra::{DMatrix, DVector, Vector3};
use recorder::Bag;
use sequencer::{GridStep, GridTrajectory, Plan, Step};
use serde_json::Value;

use crate::grid_truth::judge;
use abbe_tests::foreseen::Foreseen;
use abbe_tests::program::root;
use abbe_tests::scenario::Scenario;

/// Requirement: this many times less.
const LEAST_REDUCTION: f64 = 10.0;
/// Readings that are averaged at a station of the plant at rest.
const READINGS: u32 = 20;
/// Least rms of estimate minus truth in standard uncertainties: intervals that hold everything because they are wide say nothing.
const NOT_TOO_WIDE: f64 = 0.5;
/// Greatest effect of one component's remaining error on the tip, rms over the poses, µm.
const LEFT_OF_COMPONENT_UM: f64 = 0.5;

fn text(name: &str) -> String {
    let folder = root().join("launch_configs/volumetric");
    std::fs::read_to_string(folder.join(name)).unwrap()
}

fn positions(p_mm: &Vector3<f64>) -> PerAxis<f64> {
    let mut positions = PerAxis::default();
    for axis in Axis::LINEAR {
        positions[axis] = p_mm[axis.index()];
    }
    positions
}

#[test]
fn scenario_volumetric_error_is_reduced_tenfold() {
    let began = Instant::now();
    let scenario = Scenario::copy_of("volumetric");
    let foreseen = Foreseen::begin(&scenario.folder());
    let run = scenario.run();
    let took = began.elapsed();
    foreseen.agrees(&scenario.folder(), &run);
    let report = std::fs::read_to_string(run.join("report.json")).unwrap();
    let report: Value = serde_json::from_str(&report).unwrap();
    let verified = report["verification"]["verifications"].as_array().unwrap();
    let p95_um = |label: &str| {
        let one = verified.iter().find(|one| one["label"] == label).unwrap();
        assert_eq!(one["poses"], 1000, "{label}");
        let figure = |key: &str| one[key].as_f64().unwrap() * 1e3;
        (figure("aligned_p95_mm"), figure("aligned_max_mm"))
    };
    let (without, with) = (p95_um("without compensation"), p95_um("with compensation"));
    eprintln!(
        "volumetric: {:.1} s; error at 1000 poses about a datum, p95 {:.2} um without, {:.2} um with compensation, {:.1}-fold; max {:.2} and {:.2} um",
        took.as_secs_f64(),
        without.0,
        with.0,
        without.0 / with.0,
        without.1,
        with.1
    );
    assert!(
        without.0 / with.0 >= 1.4 * LEAST_REDUCTION,
        "{without:?} {with:?}"
    );
    let judged = judge(&scenario, &Bag::open(run.join("bag")).unwrap());
    judged.print("volumetric");
    // Of 166 intervals of 95 % 158 hold the truth on average, and fewer than 152 once in 40 machines.
    let (held, all) = (judged.held(), judged.determined.len());
    assert!(all == 166 && held >= 152, "{held} of {all}");
    assert!(judged.rms_score() > NOT_TOO_WIDE, "{}", judged.rms_score());
}

/// The scenario's plant at rest and cold, measured stop by stop.
struct AtRest {
    machine: MachineFile,
    kinematics: Kinematics,
    plant: Plant,
    placement: String,
    mounted: u32,
}

impl AtRest {
    fn new() -> Self {
        let machine = MachineFile::parse(&text("machine.yaml"), "machine.yaml").unwrap();
        let truth = PlantFile::from_yaml(&text("plant.yaml")).unwrap();
        Self {
            kinematics: Kinematics::new(&machine).unwrap(),
            plant: Plant::new(&machine, &truth).unwrap(),
            machine,
            placement: String::new(),
            mounted: 0,
        }
    }

    fn trajectory(&self, step: &GridStep, sense: Sense) -> Trajectory {
        assert_eq!(step.trajectory, GridTrajectory::Circle);
        let order = PlanarOrder {
            placement: &step.placement,
            shape: Shape::Circle {
                radius_mm: step.radius_mm.unwrap(),
                from_rad: 0.0,
            },
            offset_mm: step.offset_mm,
            feed_mm_min: step.feed_mm_min,
            sense,
            pace: Pace::Stationwise {
                stations: step.stations.unwrap(),
                dwell_s: step.dwell_s.unwrap(),
            },
            arrival: Arrival::Mount,
        };
        planar(&self.machine, &order).unwrap()
    }

    fn record(&mut self, run: u32, step: &GridStep, sense: Sense) -> Recording {
        let trajectory = self.trajectory(step, sense);
        if self.placement != step.placement {
            self.plant.mount(&step.placement);
            self.plant.settle_at(&positions(&trajectory.centre_mm));
            self.plant.zero_grid();
            self.placement.clone_from(&step.placement);
            self.mounted += 1;
        }
        let mut point = |stop: &Vector3<f64>| {
            self.plant.settle_at(&positions(stop));
            let mut sum = [0.0; 2];
            for _ in 0..READINGS {
                let reading = self.plant.grid_reading().unwrap();
                sum = [sum[0] + reading.u_mm, sum[1] + reading.v_mm];
            }
            GridPoint {
                positions: positions(stop),
                sense: Vector3::zeros(),
                velocity_mm_s: Vector3::zeros(),
                reading_mm: sum.map(|sum| sum / f64::from(READINGS)),
                standard_uncertainty_mm: [1e-4; 2],
                n_readings: READINGS,
            }
        };
        Recording {
            run,
            points: trajectory.stops_mm.iter().map(&mut point).collect(),
            place: Place {
                kind: trajectory.kind,
                plane: trajectory.plane,
                centre_mm: trajectory.centre_mm,
                radius_mm: trajectory.radius_mm,
                feed_mm_s: trajectory.feed_mm_s,
                sense,
                stations: trajectory.stations,
                tool_offset_mm: trajectory.tool_offset_mm,
                fixture: Fixture {
                    zero_id: self.mounted,
                    setup_id: self.mounted,
                },
            },
        }
    }

    /// The scenario's whole programme, identified with its parameters' tables.
    fn identify(&mut self) -> Identification {
        let plan = Plan::from_yaml(&text("plan.yaml")).unwrap();
        let mut recordings: Vec<Recording> = Vec::new();
        for step in &plan.steps {
            let Step::Grid(step) = step else { continue };
            for sense in step.sense.list() {
                let run = u32::try_from(recordings.len()).unwrap();
                recordings.push(self.record(run, step, *sense));
            }
        }
        let parameters: Value = serde_saphyr::from_str(&text("grid_encoder.yaml")).unwrap();
        let parameters = &parameters["/**"]["ros__parameters"];
        let config: GridEncoderConfig = serde_json::from_value(parameters.clone()).unwrap();
        let spans = PerAxis::from_fn(|axis| {
            let at = recordings.iter().flat_map(|recording| &recording.points);
            at.map(|point| point.positions[axis])
                .fold((f64::MAX, f64::MIN), |(l, g), q| (l.min(q), g.max(q)))
        });
        let components = components_of(self.kinematics.chain());
        let options = config.options(&components, &spans);
        identify(&self.kinematics, &recordings, &options).unwrap()
    }

    /// Truth at the poses with the motors where the model puts them, about a datum, mm.
    fn errors_mm(
        &self,
        poses: &[Vector3<f64>],
        model: Option<&VolumetricModel>,
    ) -> Vec<Vector3<f64>> {
        let error = |pose: &Vector3<f64>| {
            let commanded = positions(pose);
            let offset = model.map(|model| model.command_offset(&commanded, &Vector3::zeros()));
            let offset = offset.map_or_else(PerAxis::default, Result::unwrap);
            let motor = PerAxis::from_fn(|axis| commanded[axis] + offset[axis]);
            self.plant.tool_error_at_motor_pose_mm(&commanded, &motor)
        };
        let errors: Vec<Vector3<f64>> = poses.iter().map(error).collect();
        about_datum(poses, &errors)
    }
}

/// The poses of the verification.
fn poses() -> Vec<Vector3<f64>> {
    let word = |line: &str, letter: char| {
        let mut words = line.split_whitespace();
        let word = words.find(|word| word.starts_with(letter)).unwrap();
        word[1..].parse::<f64>().unwrap()
    };
    let program = text("verify.ngc");
    let reached = program.lines().filter(|line| line.starts_with("G1"));
    reached
        .map(|line| Vector3::new(word(line, 'X'), word(line, 'Y'), word(line, 'Z')))
        .collect()
}

fn stacked(errors: &[Vector3<f64>]) -> DVector<f64> {
    DVector::from_fn(3 * errors.len(), |row, _| errors[row / 3][row % 3])
}

fn unstacked(stack: &DVector<f64>) -> Vec<Vector3<f64>> {
    let rows = stack.as_slice().chunks_exact(3);
    rows.map(Vector3::from_column_slice).collect()
}

/// Less the shift and turn that suit all poses best.
fn about_datum(poses: &[Vector3<f64>], errors: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let design = DMatrix::from_fn(3 * poses.len(), 6, |row, column| {
        let unit = Vector3::ith(column % 3, 1.0);
        if column < 3 {
            unit[row % 3]
        } else {
            unit.cross(&poses[row / 3])[row % 3]
        }
    });
    let right = stacked(errors);
    let fit = design.clone().svd(true, true).solve(&right, 0.0).unwrap();
    unstacked(&(right - design * fit))
}

fn rms_um(errors: &[Vector3<f64>]) -> f64 {
    let squares: f64 = errors.iter().map(Vector3::norm_squared).sum();
    (squares / errors.len() as f64).sqrt() * 1e3
}

fn p95_um(errors: &[Vector3<f64>]) -> f64 {
    let mut sizes: Vec<f64> = errors.iter().map(Vector3::norm).collect();
    sizes.sort_by(f64::total_cmp);
    sizes[sizes.len() * 95 / 100] * 1e3
}

/// Shares a field of errors among the 21 components, each a polynomial of the fifth degree over its axis' travel:
/// the smallest such sum that explains it, component by component, rms over the poses about a datum in µm.
fn by_component(
    kinematics: &Kinematics,
    poses: &[Vector3<f64>],
    errors: &[Vector3<f64>],
) -> Vec<(ErrorComponent, f64)> {
    const SMALLEST: f64 = 1e-4;
    let components = components_of(kinematics.chain());
    let mut owner = Vec::new();
    let mut columns = Vec::new();
    for component in &components {
        let along = |pose: &Vector3<f64>| pose[component.of.index()];
        let least = poses.iter().map(along).fold(f64::MAX, f64::min);
        let greatest = poses.iter().map(along).fold(f64::MIN, f64::max);
        let powers = if component.is_location { 0..=0 } else { 1..=5 };
        for power in powers {
            let effect = |pose: &Vector3<f64>| {
                let share = 2.0 * (along(pose) - least) / (greatest - least) - 1.0;
                sensitivity(kinematics, &positions(pose), &Vector3::zeros(), *component)
                    * share.powi(power)
            };
            let effects: Vec<Vector3<f64>> = poses.iter().map(effect).collect();
            let column = stacked(&effects);
            let size = column.norm().max(f64::MIN_POSITIVE);
            columns.push(column / size);
            owner.push(*component);
        }
    }
    let design = DMatrix::from_columns(&columns);
    let normal =
        design.transpose() * &design + DMatrix::identity(columns.len(), columns.len()) * SMALLEST;
    let fit = normal
        .cholesky()
        .unwrap()
        .solve(&(design.transpose() * stacked(errors)));
    let of = |component: &ErrorComponent| {
        let own = (0..owner.len()).filter(|k| owner[*k] == *component);
        let field = own.fold(DVector::zeros(3 * poses.len()), |sum, k| {
            sum + &columns[k] * fit[k]
        });
        (*component, rms_um(&about_datum(poses, &unstacked(&field))))
    };
    components.iter().map(of).collect()
}

#[test]
fn the_programme_sees_every_component_over_the_whole_travel() {
    let mut at_rest = AtRest::new();
    let found = at_rest.identify();
    let chain = at_rest.kinematics.chain().to_string();
    let published = geometry_model(&found, &chain, Stamp::from_nanos(0), 1);
    // Poses beyond what was measured would be refused here.
    let model = VolumetricModel::new(&at_rest.kinematics, &published)
        .unwrap()
        .with_extrapolate(Extrapolate::Refuse);
    let poses = poses();
    assert_eq!(poses.len(), 1000);
    let before = at_rest.errors_mm(&poses, None);
    let after = at_rest.errors_mm(&poses, Some(&model));
    let parts = |errors: &[Vector3<f64>]| by_component(&at_rest.kinematics, &poses, errors);
    for ((component, without), (_, with)) in parts(&before).into_iter().zip(parts(&after)) {
        eprintln!("{component}: {without:.2} um without, {with:.2} um with compensation");
        assert!(with < LEFT_OF_COMPONENT_UM, "{component}: {with}");
    }
    let (without, with) = (p95_um(&before), p95_um(&after));
    eprintln!(
        "at rest and cold: p95 {without:.2} um without, {with:.2} um with compensation, {:.1}-fold; residual of the fit {:.3} um",
        without / with,
        found.residual_standard_deviation_mm * 1e3
    );
    assert!(without / with > 2.5 * LEAST_REDUCTION, "{without} {with}");
}
