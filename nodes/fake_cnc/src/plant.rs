//! The machine itself: what the fake control moves and what the nodes' models can only guess.

mod backlash;
mod drive;
mod error;
mod file;
mod friction;

pub use error::PlantError;
pub use file::{FrictionEntry, LinearDriveEntry, PlantFile, RotaryDriveEntry, RotaryFrictionEntry};

use machine::MachineFile;
use machine::file::AxisEntry;
use metrology::stamp::Span;
use metrology::{Axis, AxisSet, PerAxis};
use nalgebra::Vector3;

use drive::Drive;

/// Fastest natural frequency times inner step that the drives' integration is trusted with.
const STIFFNESS_LIMIT: f64 = 1.5;

/// What the control reads back at the end of a servo period; mm, rad, per second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Feedback {
    /// Motor encoder, at the nut or table, quantised.
    pub motor: PerAxis<f64>,
    /// Velocity of the motor as the drive's own electronics tell it, not quantised.
    pub velocity: PerAxis<f64>,
    /// Linear scale, quantised; NaN where there is none.
    pub scale: PerAxis<f64>,
}

/// A change of the probe signal that arrives at the control.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProbeEdge {
    /// When it arrives, after the start of the period just simulated.
    pub after_period_start: Span,
    /// Whether the probe is deflected after it.
    pub closed: bool,
    /// Motor encoders at that instant, quantised: what a hardware latch catches; mm, rad.
    pub motor_at_arrival: PerAxis<f64>,
}

/// The true machine.
#[derive(Clone, Debug)]
pub struct Plant {
    axes: AxisSet,
    drives: PerAxis<Option<Drive>>,
    encoder_resolution: PerAxis<f64>,
    scale_resolution: PerAxis<Option<f64>>,
}

impl Plant {
    /// Builds the plant of `machine` in the state `truth`, cold and at rest at zero.
    ///
    /// # Errors
    /// When a value is out of range or the two files do not fit each other.
    pub fn new(machine: &MachineFile, truth: &PlantFile) -> Result<Self, PlantError> {
        let period_s = machine.control.servo_period_ms / 1e3;
        let mut plant = Self {
            axes: machine.axis_set(),
            drives: PerAxis::from_fn(|_| None),
            encoder_resolution: PerAxis::default(),
            scale_resolution: PerAxis::from_fn(|_| None),
        };
        for (&axis, entry) in &machine.axes {
            let (constants, resolution) = match entry {
                AxisEntry::Linear(linear) => {
                    plant.scale_resolution[axis] = linear.scale_resolution_um.map(|um| um / 1e3);
                    let drive = truth.linear_drives.get(&axis);
                    (
                        drive.map(|d| d.constants(axis)),
                        linear.encoder_resolution_um / 1e3,
                    )
                }
                AxisEntry::Rotary(rotary) => {
                    let drive = truth.rotary_drives.get(&axis);
                    let resolution_deg = rotary.encoder_resolution_arcsec / 3600.0;
                    (
                        drive.map(|d| d.constants(axis)),
                        resolution_deg.to_radians(),
                    )
                }
            };
            let place = if axis.is_linear() {
                "linear_drives"
            } else {
                "rotary_drives"
            };
            let drive = Drive::new(constants.ok_or(PlantError::AxisMissing { place, axis })??);
            let product = drive.natural_step_product(period_s);
            if product >= STIFFNESS_LIMIT {
                return Err(PlantError::TooStiff {
                    axis,
                    product,
                    limit: STIFFNESS_LIMIT,
                });
            }
            plant.drives[axis] = Some(drive);
            plant.encoder_resolution[axis] = resolution;
        }
        Ok(plant)
    }

    /// One servo period under constant acceleration demands (mm/s², rad/s²) and spindle speed (1/min).
    pub fn step(&mut self, demand: &PerAxis<f64>, spindle_rpm: f64, period: Span) -> Feedback {
        let _ = spindle_rpm;
        let period_s = period.as_secs_f64();
        for axis in Axis::ALL {
            if let Some(drive) = &mut self.drives[axis] {
                drive.step(demand[axis], period_s);
            }
        }
        self.feedback()
    }

    /// The last period's feedback.
    #[must_use]
    pub fn feedback(&self) -> Feedback {
        let mut feedback = Feedback {
            motor: PerAxis::default(),
            velocity: PerAxis::default(),
            scale: PerAxis::from_fn(|_| f64::NAN),
        };
        for axis in Axis::ALL {
            let Some(drive) = &self.drives[axis] else {
                continue;
            };
            feedback.motor[axis] = quantised(drive.motor, self.encoder_resolution[axis]);
            feedback.velocity[axis] = drive.motor_velocity;
            if let Some(resolution) = self.scale_resolution[axis] {
                feedback.scale[axis] = quantised(drive.slide, resolution);
            }
        }
        feedback
    }

    /// The first edge of the probe signal that arrived within the period just simulated.
    #[must_use]
    pub fn probe_edge(&self) -> Option<ProbeEdge> {
        None
    }

    /// The probe signal as the control sees it now: whether the stylus is deflected.
    #[must_use]
    pub fn probe_closed(&self) -> bool {
        false
    }

    /// Reads the temperature sensor `id` (°C); `None` where the machine file has no such sensor.
    pub fn sensor_reading(&mut self, id: &str) -> Option<f64> {
        let _ = id;
        None
    }

    /// Grid encoder: position of its head over the plate (mm), `None` outside its field.
    #[must_use]
    pub fn grid_position(&self) -> Option<(f64, f64)> {
        None
    }

    /// Puts every axis at rest at `position`, free of elastic stress.
    pub fn settle_at(&mut self, position: &PerAxis<f64>) {
        for axis in Axis::ALL {
            if let Some(drive) = &mut self.drives[axis] {
                drive.settle_at(position[axis]);
            }
        }
    }

    /// The axes that the machine has.
    #[must_use]
    pub fn axes(&self) -> AxisSet {
        self.axes
    }

    /// TRUTH: error of the tool against the workpiece when `commanded` was programmed, in the
    /// workpiece frame, mm: actual minus what a perfect cold machine at `commanded` would give.
    #[must_use]
    pub fn tool_error_mm(&self, commanded: &PerAxis<f64>) -> Vector3<f64> {
        let slide =
            PerAxis::from_fn(|axis| self.drives[axis].as_ref().map_or(0.0, |drive| drive.slide));
        slide.xyz() - commanded.xyz()
    }

    /// TRUTH: the same as [`Plant::tool_error_mm`] if the motors stood at rest at `motor`, friction
    /// and backlash relaxed; moves nothing.
    #[must_use]
    pub fn tool_error_at_motor_pose_mm(
        &self,
        commanded: &PerAxis<f64>,
        motor: &PerAxis<f64>,
    ) -> Vector3<f64> {
        motor.xyz() - commanded.xyz()
    }

    /// TRUTH: mean time from contact to the edge's arrival at the control, s.
    #[must_use]
    pub fn probe_latency_s(&self) -> f64 {
        0.0
    }
}

fn quantised(value: f64, resolution: f64) -> f64 {
    (value / resolution).round() * resolution
}
