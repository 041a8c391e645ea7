//! Programs of `machine::trajectory` under this control's reader, under LinuxCNC's, and on the plant.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#![expect(
    clippy::disallowed_methods,
    reason = "LinuxCNC's interpreter is run on a file, and CI is asked"
)]

mod plant;
mod programs;

use fake_cnc::{Cnc, Config, Input, Outcome, Output, Plant, PlantFile};
use machine::MachineFile;
use machine::trajectory::{
    Arrival, AxisRun, Diagonal, Pace, PlanarOrder, Shape, Trajectory, uneven_targets_mm,
};
use metrology::sample::{GridSample, LengthSample, Sense};
use metrology::stamp::Span;
use metrology::{Axis, Stage, Stamp};
use nalgebra::Vector3;

const MACHINE: &str = include_str!("../../../libraries/machine/tests/data/bench.yaml");
const PLANT: &str = include_str!("../../../../launch_configs/first_run/plant.yaml");

fn machine() -> MachineFile {
    MachineFile::parse(MACHINE, "bench.yaml").unwrap()
}

fn order(placement: &str, shape: Shape, pace: Pace) -> PlanarOrder<'_> {
    PlanarOrder {
        placement,
        shape,
        offset_mm: [5.0, -8.0],
        feed_mm_min: 1500.0,
        sense: Sense::CounterClockwise,
        pace,
        arrival: Arrival::Mount,
    }
}

const STOPS: Pace = Pace::Stationwise {
    stations: 36,
    dwell_s: 0.25,
};

fn run(beam: Option<&str>) -> AxisRun<'_> {
    AxisRun {
        axis: Axis::X,
        beam,
        at_mm: Vector3::new(0.0, 10.0, 120.0),
        targets_mm: uneven_targets_mm(-250.0, 250.0, 50.0).unwrap(),
        runs: 2,
        dwell_s: 0.25,
        feed_mm_min: 3000.0,
        overrun_mm: 15.0,
        arrival: Arrival::Mount,
    }
}

fn corner_to_corner() -> Diagonal<'static> {
    Diagonal {
        beam: "corner_to_corner",
        targets: 9,
        runs: 1,
        dwell_s: 0.25,
        feed_mm_min: 3000.0,
        overrun_mm: 3.0,
        arrival: Arrival::Mount,
    }
}

/// The bench machine, perfect and cold but for what the test puts in.
fn perfect() -> PlantFile {
    let mut truth = PlantFile::from_yaml(PLANT).unwrap();
    for errors in truth.geometry.linear.values_mut() {
        (errors.positioning_um, errors.straightness_um) = (0.0, 0.0);
        (errors.angular_urad, errors.lead_um_per_m) = (0.0, 0.0);
    }
    for errors in truth.geometry.rotary.values_mut() {
        (errors.run_out_um, errors.wobble_urad) = (0.0, 0.0);
        errors.positioning_urad = 0.0;
        (errors.location_um, errors.tilt_urad) = ([0.0; 3], [0.0; 3]);
    }
    let squareness = &mut truth.geometry.squareness_urad;
    (squareness.y_to_x, squareness.z_to_x, squareness.z_to_y) = (0.0, 0.0, 0.0);
    truth.heat.shop_air.day_amplitude_k = 0.0;
    truth.heat.shop_air.draught_k = 0.0;
    truth.heat.standing_heat_w.clear();
    truth.grid_encoder.placement_um = 0.0;
    truth.grid_encoder.rotation_urad = 0.0;
    truth.grid_encoder.plate_error_um = 0.0;
    truth.grid_encoder.head_noise_um = 0.0;
    truth.length_reference.misalignment_urad = 0.0;
    truth.length_reference.noise_um = 0.0;
    truth.length_reference.wavelength_error_ppm = 0.0;
    truth.length_reference.wavelength_drift_ppm_per_h = 0.0;
    truth
}

struct Bench {
    cnc: Cnc,
    now: Stamp<metrology::Host>,
}

/// Rest after which a drive has settled.
const SETTLED_MS: u32 = 150;

struct Recorded {
    outcome: Outcome,
    message: String,
    /// Readings while the program dwells, with the commanded position.
    grid: Vec<(GridSample, Vector3<f64>)>,
    length: Vec<(LengthSample, Vector3<f64>)>,
}

impl Bench {
    fn new(truth: &PlantFile) -> Self {
        let machine = machine();
        let config = Config {
            background_rate_hz: 20.0,
            start_mm: [(Axis::Z, 200.0)].into(),
            ..Config::default()
        };
        let plant = Plant::new(&machine, truth).unwrap();
        let mut bench = Self {
            cnc: Cnc::new(&config, &machine, plant).unwrap(),
            now: Stamp::from_nanos(1_000_000_000),
        };
        bench.step(Input::Tick);
        bench
    }

    fn step(&mut self, input: Input) -> Vec<Output> {
        let mut out = Vec::new();
        self.cnc.step(self.now, input, &mut out).unwrap();
        out
    }

    /// Sets up and records.
    fn measure(&mut self, trajectory: &Trajectory) -> Recorded {
        if let Some(setup) = &trajectory.setup {
            let recorded = self.run(setup);
            assert_eq!(recorded.outcome, Outcome::Done, "{}", recorded.message);
        }
        self.run(&trajectory.program)
    }

    fn run(&mut self, text: &str) -> Recorded {
        let mut recorded = Recorded {
            outcome: Outcome::Done,
            message: String::new(),
            grid: Vec::new(),
            length: Vec::new(),
        };
        let mut outputs = self.step(Input::RunProgram {
            goal: 1,
            text: text.to_owned(),
            name: "test".to_owned(),
        });
        let (mut last, mut at_rest_ms) = (Vector3::zeros(), 0);
        for _ in 0..3_600_000 {
            let at = self.cnc.commanded().xyz();
            at_rest_ms = if at == last { at_rest_ms + 1 } else { 0 };
            let rests = at_rest_ms > SETTLED_MS;
            last = at;
            for output in outputs {
                match output {
                    Output::Grid(sample) if rests => recorded.grid.push((sample, at)),
                    Output::Length(sample) if rests => recorded.length.push((sample, at)),
                    Output::Finished {
                        outcome, message, ..
                    } => {
                        (recorded.outcome, recorded.message) = (outcome, message);
                        return recorded;
                    }
                    _ => {}
                }
            }
            self.now += Span::from_nanos(1_000_000);
            outputs = self.step(Input::Tick);
        }
        panic!("the program does not end");
    }
}
