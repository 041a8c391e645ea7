//! The machine itself: what the fake control moves and what the nodes' models can only guess.
//!
//! Torque demands go in, encoder positions, probe edges and sensor readings come out. In between, in
//! the order of the modules below: drives with friction and soft backlash; heat that the motion, the
//! spindle and the shop air bring into screws and castings; the chain of bodies with its errors; the
//! probe's ball among the artefacts. Drives run in the servo period, heat once a second, and geometry
//! only where a touch is possible or somebody asks. No formula is shared with the `machine` crate,
//! whose files this module only reads.
//!
//! The loop is closed by the motors' encoders (semi-closed), so a warm screw carries the slide away
//! unseen; linear scales see it, and grow themselves with the bed.
//!
//! # Frames
//! The workpiece frame is fixed to the table and coincides with the machine frame when every axis is at
//! zero. With rotary axes at zero, axis positions are coordinates of the tool's tip in it.
//!
//! # Agreement
//! `val_four_hours_of_work_drift_in_the_proportions_of_a_machining_centre`, tool against workpiece in
//! the span of the blocks after 4 h of short strokes at 8000 1/min: drift 55 µm (p95); the best line
//! per axis leaves 1.4 µm, the best affine field 1.2 µm; screws grow 33, 24 and 20 µm over X, Y and Z.

mod drive;

mod backlash;
mod friction;
mod lead_cycle;

mod heat;
mod network;
mod screw;
mod shop_air;
mod thermometer;

mod body;
mod chain;
mod error_motion;
mod guide_form;
mod oil_film;
mod structure;
mod vibration;

mod artefact;
mod contact;
mod pretravel;
mod touch_probe;

mod grid_plate;
mod laser;
mod linear_scale;
mod measuring;

mod work;

mod error;
mod file;
mod limits;
mod noise;

pub use error::PlantError;
pub use file::*;
pub use grid_plate::GridReading;
pub use laser::LengthReading;

use machine::MachineFile;
use machine::file::AxisEntry;
use metrology::stamp::Span;
use metrology::{Axis, AxisSet, PerAxis};
use nalgebra::Vector3;

use body::Body;
use contact::Contact;
use drive::Drive;
use grid_plate::GridPlate;
use heat::Heat;
use laser::Laser;
use lead_cycle::LeadCycle;
use linear_scale::LinearScales;
use structure::{Standing, Structure};

/// Fastest natural frequency times inner step that the drives' integration is trusted with.
const STIFFNESS_LIMIT: f64 = 1.5;
/// Edges that one period reports; more than a bounce of the greatest length has.
const EDGES_PER_PERIOD: usize = 64;

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

/// TRUTH: a change of the probe's contact itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TrueContact {
    /// When, since the plant's start.
    pub at: Span,
    /// Whether the probe is deflected after it.
    pub closed: bool,
}

/// The true machine.
#[derive(Clone, Debug)]
pub struct Plant {
    axes: AxisSet,
    drives: PerAxis<Option<Drive>>,
    lead_cycles: PerAxis<Option<LeadCycle>>,
    encoder_resolution: PerAxis<f64>,
    scale_resolution: PerAxis<Option<f64>>,
    heat: Heat,
    body: Body,
    structure: Structure,
    contact: Contact,
    scales: LinearScales,
    plate: Option<GridPlate>,
    laser: Option<Laser>,
    elapsed: Span,
    edges: Vec<ProbeEdge>,
}

impl Plant {
    /// Builds the plant of `machine` in the state `truth`, soaked to the shop's air and at rest at zero.
    ///
    /// # Errors
    /// When a value is out of range or the two files do not fit each other.
    pub fn new(machine: &MachineFile, truth: &PlantFile) -> Result<Self, PlantError> {
        limits::check(truth)?;
        let heat = Heat::new(machine, truth)?;
        let contact = Contact::new(machine, truth)?;
        let tool_length_mm = machine
            .probe
            .styli
            .get(&machine.probe.mounted)
            .map_or(0.0, |stylus| stylus.length_mm);
        let mut plant = Self {
            axes: machine.axis_set(),
            drives: drives(machine, truth)?,
            lead_cycles: lead_cycles(machine, truth)?,
            encoder_resolution: PerAxis::default(),
            scale_resolution: PerAxis::from_fn(|_| None),
            structure: Structure::new(
                &truth.structure,
                truth.heat.reference_temp_degc,
                tool_length_mm,
                &heat.network,
            )?,
            heat,
            body: Body::new(machine, &truth.geometry, truth.seed)?
                .floating(machine, &truth.oil_film, truth.seed)?
                .shaking(truth.vibration.as_ref(), truth.seed)?,
            contact,
            scales: LinearScales::new(&truth.linear_scales, truth.seed)?,
            plate: machine
                .grid_encoder
                .as_ref()
                .map(|grid| GridPlate::new(grid, &truth.grid_encoder, truth.seed))
                .transpose()?,
            laser: machine
                .length_reference
                .as_ref()
                .map(|length| Laser::new(length, &truth.length_reference, truth.seed))
                .transpose()?,
            elapsed: Span::default(),
            edges: Vec::with_capacity(EDGES_PER_PERIOD),
        };
        for (&axis, entry) in &machine.axes {
            let resolution = match entry {
                AxisEntry::Linear(linear) => {
                    plant.scale_resolution[axis] = linear.scale_resolution_um.map(|um| um / 1e3);
                    linear.encoder_resolution_um / 1e3
                }
                AxisEntry::Rotary(rotary) => {
                    (rotary.encoder_resolution_arcsec / 3600.0).to_radians()
                }
            };
            error::require_positive(format!("axes.{axis}: encoder resolution"), resolution)?;
            if let Some(scale) = plant.scale_resolution[axis] {
                error::require_positive(format!("axes.{axis}: scale resolution"), scale)?;
            }
            plant.encoder_resolution[axis] = resolution;
        }
        Ok(plant)
    }

    /// One servo period under constant acceleration demands (torque over total inertia; mm/s², rad/s²)
    /// and spindle speed (1/min).
    pub fn step(&mut self, demand: &PerAxis<f64>, spindle_rpm: f64, period: Span) -> Feedback {
        let period_s = period.as_secs_f64();
        let start = self.elapsed;
        let motor_before = self.motor();
        let (mut linear_mm, mut rotary_rad) = (0.0, 0.0);
        for axis in Axis::ALL {
            let Some(drive) = &mut self.drives[axis] else {
                continue;
            };
            drive.step(demand[axis], period_s);
            let path = drive.motor_velocity.abs() * period_s;
            if axis.is_linear() {
                linear_mm += path;
            } else {
                rotary_rad += path;
            }
            self.heat
                .rub(axis, drive.slide, path, demand[axis], period_s);
        }
        self.heat.spin(spindle_rpm, period_s);
        self.body.pass(period_s);
        self.age(period);
        if self.contact.travel(linear_mm, rotary_rad) {
            let tool = self
                .body
                .workpiece_from_tool(&self.true_slide(), &self.structure);
            self.contact.look(start, period_s, &tool, &self.structure);
        }
        self.collect_edges(start, period, &motor_before);
        self.feedback()
    }

    /// Lets time pass for heat, and for what wears, dries or is knocked.
    fn age(&mut self, period: Span) {
        self.elapsed = Span::from_nanos(self.elapsed.nanos() + period.nanos());
        if self.heat.pass(period) {
            self.structure.follow(&self.heat.network);
            let elapsed_s = self.elapsed.as_secs_f64();
            self.contact.age(elapsed_s);
            for drive in self.drives.0.iter_mut().flatten() {
                drive.age(elapsed_s);
            }
        }
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
                let carried_mm = drive.slide + self.screw_error_mm(axis, drive.slide);
                let true_mm = carried_mm + self.body.along_error_mm(axis, carried_mm);
                let strain = self.structure.scale_strain;
                let read_mm = self.scales.reading_mm(axis, true_mm, strain);
                feedback.scale[axis] = quantised(read_mm, resolution);
            }
        }
        feedback
    }

    /// The first edge of the probe signal that arrived within the period just simulated.
    #[must_use]
    pub fn probe_edge(&self) -> Option<ProbeEdge> {
        self.edges.first().copied()
    }

    /// Every edge that arrived within the period just simulated; more than one while a contact bounces.
    #[must_use]
    pub fn probe_edges(&self) -> &[ProbeEdge] {
        &self.edges
    }

    /// The probe signal as the control sees it now: whether the stylus is deflected.
    #[must_use]
    pub fn probe_closed(&self) -> bool {
        self.contact.probe.closed(self.elapsed)
    }

    /// Reads the temperature sensor `id` (°C); `None` where the machine file has no such sensor.
    pub fn sensor_reading(&mut self, id: &str) -> Option<f64> {
        self.heat.read_degc(id)
    }

    /// Puts every axis at rest at `position`, free of elastic stress.
    pub fn settle_at(&mut self, position: &PerAxis<f64>) {
        for axis in Axis::ALL {
            if let Some(drive) = &mut self.drives[axis] {
                drive.settle_at(position[axis]);
            }
        }
        self.contact.forget(self.elapsed);
    }

    /// The axes that the machine has.
    #[must_use]
    pub fn axes(&self) -> AxisSet {
        self.axes
    }

    /// Simulated time since the start.
    #[must_use]
    pub fn elapsed(&self) -> Span {
        self.elapsed
    }

    /// TRUTH: tool tip in the frame of the table, mm.
    #[must_use]
    pub fn tool_in_workpiece_mm(&self) -> Vector3<f64> {
        let tool = self
            .body
            .workpiece_from_tool(&self.true_slide(), &self.structure);
        tool.translation.vector
    }

    /// TRUTH: error of the tool against the workpiece now, when `commanded` was programmed; workpiece
    /// frame, mm: actual minus what a perfect cold machine at `commanded` would give. The
    /// workpiece point that `commanded` names has moved with the table by then.
    #[must_use]
    pub fn tool_error_mm(&self, commanded: &PerAxis<f64>) -> Vector3<f64> {
        self.error_of(&self.true_slide(), commanded)
    }

    /// TRUTH: the same as [`Plant::tool_error_mm`] if the motors stood at `motor` with play and friction
    /// relaxed; moves nothing.
    #[must_use]
    pub fn tool_error_at_motor_pose_mm(
        &self,
        commanded: &PerAxis<f64>,
        motor: &PerAxis<f64>,
    ) -> Vector3<f64> {
        self.error_of(&self.carried(motor), commanded)
    }

    /// TRUTH: mean time from contact to the edge's arrival at the control, s.
    #[must_use]
    pub fn probe_latency_s(&self) -> f64 {
        self.contact.probe.latency_s()
    }

    /// TRUTH: the latest change of the probe's contact.
    #[must_use]
    pub fn true_contact(&self) -> Option<TrueContact> {
        let edge = self.contact.probe.last_contact?;
        Some(TrueContact {
            at: edge.at,
            closed: edge.closed,
        })
    }

    /// TRUTH: temperature of a casting, °C.
    #[must_use]
    pub fn true_temp_degc(&self, place: Place) -> f64 {
        self.heat.network.temp_degc(place)
    }

    /// TRUTH: how far the warm screw carries a nut that stands at `nut_mm`, mm.
    #[must_use]
    pub fn true_screw_growth_mm(&self, axis: Axis, nut_mm: f64) -> f64 {
        self.heat.screw_growth_mm(axis, nut_mm)
    }

    fn error_of(&self, slide: &PerAxis<f64>, commanded: &PerAxis<f64>) -> Vector3<f64> {
        let actual_mm = self
            .body
            .workpiece_from_tool(slide, &self.structure)
            .translation
            .vector;
        let nominal_mm = self.body.nominal_tip_mm(commanded);
        let workpiece_mm = self.structure.on_table_mm(&nominal_mm, Standing::Workpiece);
        actual_mm - nominal_mm - workpiece_mm
    }

    fn motor(&self) -> PerAxis<f64> {
        PerAxis::from_fn(|axis| self.drives[axis].as_ref().map_or(0.0, |drive| drive.motor))
    }

    /// Slides where the warm screws have carried them.
    fn true_slide(&self) -> PerAxis<f64> {
        self.carried(&PerAxis::from_fn(|axis| {
            self.drives[axis].as_ref().map_or(0.0, |drive| drive.slide)
        }))
    }

    /// How far heat and its own turns make the screw carry a nut that stands at `nut_mm`, mm.
    fn screw_error_mm(&self, axis: Axis, nut_mm: f64) -> f64 {
        let cycle_mm = self.lead_cycles[axis].map_or(0.0, |cycle| cycle.at_mm(nut_mm));
        self.heat.screw_growth_mm(axis, nut_mm) + cycle_mm
    }

    fn carried(&self, slide: &PerAxis<f64>) -> PerAxis<f64> {
        PerAxis::from_fn(|axis| slide[axis] + self.screw_error_mm(axis, slide[axis]))
    }

    fn collect_edges(&mut self, start: Span, period: Span, motor_before: &PerAxis<f64>) {
        self.edges.clear();
        while let Some(edge) = self.contact.probe.arrive(self.elapsed) {
            let after_nanos = (edge.at.nanos() - start.nanos()).max(0);
            let share = after_nanos as f64 / period.nanos() as f64;
            let motor_at_arrival = PerAxis::from_fn(|axis| {
                let Some(drive) = &self.drives[axis] else {
                    return 0.0;
                };
                let before = motor_before[axis];
                let motor = before + share * (drive.motor - before);
                quantised(motor, self.encoder_resolution[axis])
            });
            self.edges.push(ProbeEdge {
                after_period_start: Span::from_nanos(after_nanos),
                closed: edge.closed,
                motor_at_arrival,
            });
        }
    }
}

fn lead_cycles(
    machine: &MachineFile,
    truth: &PlantFile,
) -> Result<PerAxis<Option<LeadCycle>>, PlantError> {
    let mut cycles = PerAxis::from_fn(|_| None);
    for (&axis, entry) in &truth.linear_drives {
        if let (Some(cycle), Some(linear)) = (&entry.lead_cycle, machine.linear(axis)) {
            let place = format!("linear_drives.{axis}.lead_cycle");
            let made = LeadCycle::new(&place, cycle, linear.lead_mm, linear.travel_mm)?;
            cycles[axis] = Some(made);
        }
    }
    Ok(cycles)
}

fn drives(machine: &MachineFile, truth: &PlantFile) -> Result<PerAxis<Option<Drive>>, PlantError> {
    let period_s = machine.control.servo_period_ms / 1e3;
    error::require_positive("control.servo_period_ms", machine.control.servo_period_ms)?;
    let mut drives = PerAxis::from_fn(|_| None);
    for &axis in truth.linear_drives.keys() {
        if machine.linear(axis).is_none() {
            return Err(PlantError::AxisUnknown {
                place: "linear_drives",
                axis,
            });
        }
    }
    for &axis in truth.rotary_drives.keys() {
        if machine.rotary_axis(axis).is_none() {
            return Err(PlantError::AxisUnknown {
                place: "rotary_drives",
                axis,
            });
        }
    }
    for &axis in machine.axes.keys() {
        let (place, constants) = if axis.is_linear() {
            (
                "linear_drives",
                truth
                    .linear_drives
                    .get(&axis)
                    .map(|drive| drive.constants(axis)),
            )
        } else {
            (
                "rotary_drives",
                truth
                    .rotary_drives
                    .get(&axis)
                    .map(|drive| drive.constants(axis)),
            )
        };
        let drive = Drive::new(constants.ok_or(PlantError::AxisMissing { place, axis })??);
        let drive = match truth.linear_drives.get(&axis) {
            Some(entry) => drive
                .that_wears(entry.wear(axis)?)
                .that_dries(entry.dryness(axis)?),
            None => drive,
        };
        let product = drive.natural_step_product(period_s);
        if product >= STIFFNESS_LIMIT {
            return Err(PlantError::TooStiff {
                axis,
                product,
                limit: STIFFNESS_LIMIT,
            });
        }
        drives[axis] = Some(drive);
    }
    Ok(drives)
}

fn quantised(value: f64, resolution: f64) -> f64 {
    (value / resolution).round() * resolution
}
