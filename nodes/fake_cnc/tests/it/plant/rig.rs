//! The first-run machine under a plain servo.

use fake_cnc::{Plant, PlantFile};
use machine::MachineFile;
use metrology::PerAxis;
use metrology::stamp::Span;

pub const PERIOD: Span = Span::from_nanos(1_000_000);
pub const PERIOD_S: f64 = 1e-3;
pub const MACHINE_YAML: &str = include_str!("../../../../../launch_configs/first_run/machine.yaml");
pub const PLANT_YAML: &str = include_str!("../../../../../launch_configs/first_run/plant.yaml");

pub fn machine() -> MachineFile {
    MachineFile::parse(MACHINE_YAML, "machine.yaml").unwrap()
}

pub fn truth() -> PlantFile {
    PlantFile::from_yaml(PLANT_YAML).unwrap()
}

/// First-run plant whose artefacts stand where they should on a perfect cold machine.
pub fn perfect() -> PlantFile {
    let mut truth = truth();
    for errors in truth.geometry.linear.values_mut() {
        (errors.positioning_um, errors.straightness_um) = (0.0, 0.0);
        (errors.angular_urad, errors.lead_um_per_m) = (0.0, 0.0);
    }
    for errors in truth.geometry.rotary.values_mut() {
        (
            errors.run_out_um,
            errors.wobble_urad,
            errors.positioning_urad,
        ) = (0.0, 0.0, 0.0);
        (errors.location_um, errors.tilt_urad) = ([0.0; 3], [0.0; 3]);
    }
    let squareness = &mut truth.geometry.squareness_urad;
    (squareness.y_to_x, squareness.z_to_x, squareness.z_to_y) = (0.0, 0.0, 0.0);
    truth.artefacts.placement_um = 0.0;
    truth.touch_probe.repeatability_um = 0.0;
    truth.touch_probe.ball_radius_deviation_um = 0.0;
    truth.heat.shop_air.day_amplitude_k = 0.0;
    truth.heat.shop_air.draught_k = 0.0;
    truth
}

/// Cascade on the motors' encoders with velocity and acceleration fed forward.
#[derive(Default)]
pub struct Servo {
    integral: PerAxis<f64>,
}

/// Position, velocity and acceleration that are commanded.
#[derive(Clone, Copy, Default)]
pub struct Command {
    pub position: PerAxis<f64>,
    pub velocity: PerAxis<f64>,
    pub acceleration: PerAxis<f64>,
}

impl Servo {
    pub fn demand(&mut self, plant: &Plant, command: &Command) -> PerAxis<f64> {
        let feedback = plant.feedback();
        PerAxis::from_fn(|axis| {
            let lag = command.position[axis] - feedback.motor[axis];
            let short = command.velocity[axis] + 50.0 * lag - feedback.velocity[axis];
            self.integral[axis] += short * PERIOD_S;
            command.acceleration[axis] + 150.0 * short + 2500.0 * self.integral[axis]
        })
    }
}
