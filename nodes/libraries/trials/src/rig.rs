//! Draws a machine: travels, drives, instruments, what its file knows of it, and how much its runs scatter.
//!
//! A rig begins as a machine that its file describes well (`data/`): the plant has a few hundredths of a micrometre of
//! everything, and what is larger is in the file's list of known effects with its true size. An effect is hidden
//! afterwards, in the plant or the control alone.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use fake_cnc::PlantFile;
use fake_cnc::config::Config as ControlConfig;
use fake_cnc::plant::VibrationEntry;
use machine::MachineFile;
use machine::file::{
    AxisEntry, EffectEntry, GuideFrictionEntry, LinearAxisEntry, VelocityLoopEntry,
};
use metrology::Axis;
use nalgebra::Vector3;
use rand::Rng;
use rand::seq::IndexedRandom;
use rand_pcg::Pcg64Mcg;
use sequencer::Plan;

use crate::error::TrialError;
use crate::programme::{Conditions, plan};
use crate::scatter::{Heavier, Scatter, WAVES};
use crate::shift::{PlateMove, Spell};

const MACHINE: &str = include_str!("../data/machine.yaml");
const PLANT: &str = include_str!("../data/plant.yaml");

/// Rate of the recording, Hz; a servo period of 1 ms says no more of what is smooth over a millimetre.
pub(crate) const STATE_RATE_HZ: f64 = 250.0;
/// Rate while nothing is measured in motion, Hz.
const BACKGROUND_RATE_HZ: f64 = 125.0;
/// How much of a screw is beyond the travel at each end, mm.
const SCREW_BEYOND_MM: f64 = 80.0;
/// Shortest and longest wave of the deviation between runs, mm.
pub(crate) const WAVE_MM: [f64; 2] = [80.0, 800.0];
/// Share of machines that have outliers, and how many of their readings are.
const OUTLIERS: [f64; 2] = [0.05, 0.01];

/// First instant of a session, s since the epoch.
const START_S: i64 = 1_767_600_000;
/// Time from one session to the next, s.
const LATER_S: i64 = 3600;

/// Everything that a trial's session follows from.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    /// What the diagnosis and the sequencer are told of the machine.
    pub machine: MachineFile,
    /// What the control really runs with: the machine file but for gains that were changed.
    pub control: MachineFile,
    /// The plant.
    pub plant: PlantFile,
    /// Parameters of the control.
    pub config: ControlConfig,
    /// What is measured.
    pub plan: Plan,
    /// Programs that the plan runs, by name.
    pub programs: BTreeMap<String, String>,
    /// Those of them that pass in coarse steps.
    pub production: BTreeMap<String, Vec<Spell>>,
    /// What the machine did before the session.
    pub past: Vec<Spell>,
    /// How the plate of the grid encoder moves on the table.
    pub plate_moves: Option<PlateMove>,
    /// What no two runs have in common.
    pub scatter: Scatter,
    /// How much later the grid encoder stamps its readings than it should, s.
    pub grid_late_s: f64,
    /// How much of that wanders, as a share, from minute to minute.
    pub grid_late_wander: f64,
    /// How fast the grid encoder's clock is that was set when the session began, as a share.
    pub grid_fast: f64,
    /// When the session begins, s since the epoch.
    pub start_s: i64,
    /// Whether the motors' encoders are recorded; otherwise their positions are those that were commanded.
    pub has_motors: bool,
}

impl Rig {
    /// Draws one.
    ///
    /// # Errors
    /// When what is drawn breaks a rule of its file.
    pub fn draw(random: &mut Pcg64Mcg, is_heavy: bool) -> Result<Self, TrialError> {
        let mut machine = MachineFile::parse(MACHINE, "data/machine.yaml")?;
        let mut plant = PlantFile::from_yaml(PLANT)?;
        plant.seed = random.random();
        travels(random, &mut machine, &mut plant);
        instruments(random, &mut machine);
        for axis in Axis::LINEAR {
            drive(random, axis, &mut machine, &mut plant);
        }
        machine.effects = known(random, &mut plant);
        machine.check("drawn machine")?;
        let conditions = Conditions::draw(random);
        let heavier = is_heavy.then(|| Heavier {
            repeated_radius_mm: conditions.radius_mm[0],
            repeated_feed_mm_s: conditions.feed_mm_min[0] / 60.0,
            factor: random.random_range(1.3..2.0),
            ar: 0.9,
        });
        let plan = plan(random, &machine, &conditions)?;
        let config = ControlConfig {
            state_rate_hz: STATE_RATE_HZ,
            background_rate_hz: BACKGROUND_RATE_HZ,
            velocity_gain_per_s: random.random_range(450.0..650.0),
            start_mm: BTreeMap::from([(Axis::Z, 240.0)]),
            ..ControlConfig::default()
        };
        for axis in Axis::LINEAR {
            if let Some(entry) = linear(&mut machine, axis) {
                entry.velocity_loop = Some(velocity_loop(&config));
            }
        }
        machine.check("drawn machine")?;
        Ok(Self {
            plan,
            programs: BTreeMap::new(),
            production: BTreeMap::new(),
            past: vec![],
            plate_moves: None,
            control: machine.clone(),
            config,
            scatter: scatter(random, heavier),
            machine,
            plant,
            grid_late_s: 0.0,
            grid_late_wander: 0.0,
            grid_fast: 0.0,
            start_s: START_S,
            has_motors: random.random(),
        })
    }

    /// The same machine an hour later, measured once more by another plan: it is cold again, and what its runs do not
    /// have in common is drawn anew.
    #[must_use]
    pub fn later(&self, plan: Plan) -> Self {
        let mut later = self.clone();
        later.plan = plan;
        later.start_s += LATER_S;
        later.scatter.seed ^= 0x5851_f42d_4c95_7f2d;
        later
    }

    /// Lets the tool shake at a frequency that wanders, in every run alike.
    pub(crate) fn shake(&mut self, random: &mut Pcg64Mcg) {
        self.plant.vibration = Some(VibrationEntry {
            amplitude_um: std::array::from_fn(|_| random.random_range(0.02..0.2)),
            frequency_hz: random.random_range(18.0..70.0),
            wander_hz: random.random_range(0.5..4.0),
            wander_time_s: random.random_range(0.3..5.0),
        });
    }

    /// Variance of a reading by the shaking of the tool, in the direction that shakes most, mm2.
    pub(crate) fn shaking_mm2(&self) -> f64 {
        let most_um = self.plant.vibration.as_ref().map_or(0.0, |vibration| {
            vibration.amplitude_um.iter().copied().fold(0.0, f64::max)
        });
        0.5 * (most_um / 1e3).powi(2)
    }

    /// The machine file as text.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn machine_text(&self) -> Result<String, TrialError> {
        Ok(serde_saphyr::to_string(&self.machine)?)
    }

    /// The control's own entry of a linear axis.
    pub(crate) fn control_of(&mut self, axis: Axis) -> Option<&mut LinearAxisEntry> {
        linear(&mut self.control, axis)
    }
}

fn linear(machine: &mut MachineFile, axis: Axis) -> Option<&mut LinearAxisEntry> {
    match machine.axes.get_mut(&axis) {
        Some(AxisEntry::Linear(entry)) => Some(entry),
        _ => None,
    }
}

fn travels(random: &mut Pcg64Mcg, machine: &mut MachineFile, plant: &mut PlantFile) {
    let half_x = random.random_range(200.0_f64..500.0).round();
    let half_y = random.random_range(180.0_f64..400.0).round();
    let top_z = random.random_range(300.0_f64..500.0).round();
    let travels = [[-half_x, half_x], [-half_y, half_y], [-60.0, top_z]];
    for (axis, travel_mm) in Axis::LINEAR.into_iter().zip(travels) {
        if let Some(entry) = linear(machine, axis) {
            entry.travel_mm = travel_mm;
        }
        if let Some(screw) = plant.heat.screws.get_mut(&axis) {
            screw.ends_mm = [
                travel_mm[0] - SCREW_BEYOND_MM,
                travel_mm[1] + SCREW_BEYOND_MM,
            ];
        }
    }
    let corner = [half_x - 40.0, half_y - 40.0];
    for (block, sign) in machine.blocks.iter_mut().zip([-1.0, 1.0]) {
        block.corner_mm[0] = sign * corner[0];
        block.corner_mm[1] = sign * corner[1];
    }
}

/// Where plates and beams stand.
fn instruments(random: &mut Pcg64Mcg, machine: &mut MachineFile) {
    let travel = |axis: Axis| {
        machine
            .linear(axis)
            .map_or([0.0; 2], |entry| entry.travel_mm)
    };
    let travels = Axis::LINEAR.map(travel);
    let mut near = |middle: f64| (middle + random.random_range(-20.0..20.0)).round();
    let centres = [
        [near(0.0), near(0.0), 30.0],
        [near(0.0), near(0.0), near(140.0)],
        [near(0.0), near(0.0), near(140.0)],
    ];
    let beam_at = [near(0.0), near(0.0), near(120.0)];
    if let Some(grid) = &mut machine.grid_encoder {
        for (placement, centre_mm) in grid.placements.iter_mut().zip(centres) {
            placement.centre_mm = centre_mm;
        }
    }
    if let Some(length) = &mut machine.length_reference {
        for (axis, beam) in length.beams.iter_mut().enumerate() {
            (beam.from_mm, beam.to_mm) = (beam_at, beam_at);
            beam.from_mm[axis] = travels[axis][0] + 20.0;
            beam.to_mm[axis] = travels[axis][1] - 20.0;
        }
    }
}

fn drive(random: &mut Pcg64Mcg, axis: Axis, machine: &mut MachineFile, plant: &mut PlantFile) {
    if let Some(entry) = linear(machine, axis) {
        entry.lead_mm = *[5.0, 10.0, 16.0].choose(random).unwrap_or(&10.0);
        entry.position_gain_per_s = random.random_range(45.0_f64..75.0).round();
        entry.velocity_feedforward = random.random_range(0.96..0.99);
    }
    if let Some(drive) = plant.linear_drives.get_mut(&axis) {
        drive.slide_mass_kg *= random.random_range(0.7..1.3);
        drive.screw_stiffness_n_per_um = [random.random_range(350.0..500.0); 2];
        let per_mass = 1e3 / drive.slide_mass_kg;
        let guides = &drive.guide_friction;
        let friction = GuideFrictionEntry {
            coulomb_mm_s2: guides.coulomb_n * per_mass,
            viscous_per_s: guides.viscous_n_s_per_mm * per_mass,
        };
        if let Some(entry) = linear(machine, axis) {
            entry.guide_friction = Some(friction);
        }
    }
}

/// A velocity loop as its maker's data sheet tells it, from gain and integral time; its filter is for `commissioning`.
fn velocity_loop(config: &ControlConfig) -> VelocityLoopEntry {
    let gain_per_s = config.velocity_gain_per_s;
    let frequency_rad_s = (gain_per_s / config.velocity_integral_time_s).sqrt();
    VelocityLoopEntry {
        frequency_hz: frequency_rad_s / TAU,
        damping: 0.5 * gain_per_s / frequency_rad_s,
        filter_ms: 0.0,
    }
}

/// Errors that the machine file knows: drawn, put into the plant, and listed with their true size.
fn known(random: &mut Pcg64Mcg, plant: &mut PlantFile) -> Vec<EffectEntry> {
    let mut effects = Vec::new();
    let mut list = |kind: &str, axis: Option<&str>, name: &str, value: f64| {
        effects.push(EffectEntry {
            kind: kind.to_owned(),
            axis: axis.map(str::to_owned),
            parameters: BTreeMap::from([(name.to_owned(), value)]),
        });
    };
    for (axis, drive) in &plant.linear_drives {
        // Mass times 1 m/s2 over stiffness.
        let windup_um = drive.slide_mass_kg / drive.screw_stiffness_n_per_um[0];
        list("drive_windup", Some(axis.letter()), "windup_um", windup_um);
    }
    plant.touch_probe.latency_ms = random.random_range(2.0..6.0);
    list(
        "probe_latency",
        None,
        "latency_ms",
        plant.touch_probe.latency_ms,
    );
    for (axis, entry) in &mut plant.geometry.linear {
        entry.lead_um_per_m = random.random_range(-15.0..15.0);
        list(
            "scale_error",
            Some(axis.letter()),
            "scale_um_per_m",
            entry.lead_um_per_m,
        );
    }
    let angle_urad: f64 = random.random_range(-20.0..20.0);
    plant.geometry.squareness_urad.y_to_x = -angle_urad;
    list("squareness", Some("XY"), "angle_urad", angle_urad);
    effects
}

fn scatter(random: &mut Pcg64Mcg, heavier: Option<Heavier>) -> Scatter {
    let has_outliers = random.random::<f64>() < OUTLIERS[0];
    let mut wave = || {
        let length_mm = WAVE_MM[0] * (WAVE_MM[1] / WAVE_MM[0]).powf(random.random());
        let height: f64 = random.random_range(-1.0..1.0);
        let turn: f64 = random.random_range(0.0..TAU);
        let level = (1.0 - height * height).sqrt();
        Vector3::new(level * turn.cos(), level * turn.sin(), height) * (TAU / length_mm)
    };
    let wave_rad_per_mm: [Vector3<f64>; WAVES] = std::array::from_fn(|_| wave());
    Scatter {
        seed: random.random(),
        between_runs_mm: random.random_range(0.1e-3..0.5e-3),
        white_mm: random.random_range(0.05e-3..0.3e-3),
        ar: if heavier.is_some() {
            0.6
        } else {
            random.random_range(0.0..0.9)
        },
        outliers: if has_outliers { OUTLIERS[1] } else { 0.0 },
        wave_rad_per_mm,
        heavier,
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn machines_differ_by_their_seed_and_repeat_themselves() {
        let draw = |seed| Rig::draw(&mut Pcg64Mcg::seed_from_u64(seed), false).unwrap();
        assert_eq!(draw(1), draw(1));
        assert_ne!(draw(1).machine, draw(2).machine);
        assert_ne!(draw(1).plan, draw(2).plan);
    }

    #[test]
    fn the_file_reads_back_as_it_was_drawn() {
        let rig = Rig::draw(&mut Pcg64Mcg::seed_from_u64(3), false).unwrap();
        let read = MachineFile::parse(&rig.machine_text().unwrap(), "again").unwrap();
        assert_eq!(read, rig.machine);
    }
}
