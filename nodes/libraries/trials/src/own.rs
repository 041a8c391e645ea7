//! Classes that the common programme does not show: each is hidden in a machine that does a programme of its own.
//!
//! | class | hidden as | programme |
//! |---|---|---|
//! | `plate_error` | a graduation that is too long | the common one |
//! | `clock_drift` | a clock of the grid encoder that is fast | the common one |
//! | `probe_lobing` | a spring that presses a seat of three supports | a ring gauge, twelve times |
//! | `probe_pretravel` | the same under a thin stylus of 80 mm | a sphere, twelve times |
//! | `latency_jitter` | triggers that come earlier or later | 720 touches at a very slow and a quick feed |
//! | `interpolation_error` | periods of a scale that are divided unevenly | circles of a tenth of a millimetre, by that scale |
//! | `rotary_location` | a table that turns about another line | two spheres at many poses |
//! | `rotary_motion` | a ring that is graduated unevenly | two spheres at many poses |
//! | `rotary_backlash` | a worm with play | two spheres at many poses |
//! | `spindle_growth` | bearings and motor that warm | blocks, and three minutes of the spindle, fourteen times |
//! | `column_bend` | a cabinet in front of the column | blocks every five minutes |
//! | `ambient_drift` | hydraulics that warm the bed | blocks every five minutes |
//!
//! A machine that is prepared for a class and hides nothing shows nothing of it. Three of four trials hide the class, one
//! hides nothing.
//!
//! Scatter has no signature. Triggers that come s earlier or later at a feed f scatter by more than they would, which D is
//! of as twice the divergence of the two laws:
//!
//! ```text
//!   D^2 = sum over touches of  v1/v0 - 1 - ln(v1/v0),   v1 = v0 + (f s)^2                 (1)
//! ```

mod places;

use std::fmt::Write as _;

use fake_cnc::PlantFile;
use fake_cnc::config::FeedbackSource;
use fake_cnc::plant::{Place, SquarenessEntry};
use machine::MachineFile;
use machine::file::{AxisEntry, PositionFeedback, SensorEntry, SensorPlace};
use metrology::Axis;
use rand_pcg::Pcg64Mcg;
use sequencer::{Plan, Step};

use crate::effect::{Class, Hidden};
use crate::error::TrialError;
use crate::rig::Rig;
use crate::size::touch_mm2;

use places::Places;

const FIVE_AXIS: [&str; 2] = [
    include_str!("../../../../launch_configs/five_axis/machine.yaml"),
    include_str!("../../../../launch_configs/five_axis/plant.yaml"),
];
/// A spring that presses nothing, N.
const NO_SPRING_N: f64 = 0.02;
/// A stylus that bends: length and diameter of its stem, mm.
const LONG_STYLUS_MM: (f64, f64) = (80.0, 1.5);
/// Part of the friction of rotary bearings that is left: gears hardly yield to it.
const EASY: f64 = 0.02;
/// Touches of the programme for scatter: feeds, mm/min, repeats of a step, and how often the two steps are done.
const TOUCHES: ([f64; 2], u32, usize) = ([30.0, 960.0], 12, 15);
/// Three minutes of the spindle.
const WARM_UP: &str = "(frame: machine)\nS10000 M3\nG4 P180\nM5\nM2\n";

/// Gives a machine the programme of a class, and nothing of the class.
///
/// # Errors
/// When a file or the programme cannot be read.
pub(crate) fn prepare(
    random: &mut Pcg64Mcg,
    hidden: &Hidden,
    rig: &mut Rig,
) -> Result<(), TrialError> {
    rig.has_motors = true;
    match hidden.class {
        Class::ProbeLobing => touched(random, rig, "ring", 24)?,
        Class::ProbePretravel => {
            let probe = &mut rig.plant.touch_probe;
            (probe.stylus_length_mm, probe.stem_diameter_mm) = LONG_STYLUS_MM;
            touched(random, rig, "ball", 25)?;
        }
        Class::LatencyJitter => {
            let (feeds, repeats, times) = TOUCHES;
            let step = |axis: &str| {
                format!(
                    "latency, feature: block_1.{axis}, feeds_mm_min: {feeds:?}, repeats: {repeats}"
                )
            };
            rig.plan = plan(&["x", "y"].map(step), times)?;
        }
        Class::InterpolationError => slow_circles(hidden, rig)?,
        Class::RotaryLocation | Class::RotaryMotion | Class::RotaryBacklash => five_axis(rig)?,
        Class::SpindleGrowth => {
            let spindle = &mut rig.plant.heat.spindle;
            spindle.front_bearing_w_at_1000_rpm = 0.0;
            spindle.rear_bearing_w_at_1000_rpm = 0.0;
            spindle.motor_w_at_1000_rpm = 0.0;
            rig.programs.insert("warm".to_owned(), WARM_UP.to_owned());
            watched(rig, &["blocks", "run, program: warm"], 14)?;
        }
        Class::ColumnBend | Class::AmbientDrift => {
            watched(rig, &["blocks", "wait, seconds: 300"], 20)?;
        }
        _ => {}
    }
    Ok(())
}

/// Whether what is measured is the common programme.
pub(crate) const fn is_common(class: Class) -> bool {
    matches!(class, Class::PlateError | Class::ClockDrift) || (class as usize) < Class::ALL.len()
}

/// (1) of a jitter, ms.
pub(crate) fn jitter_d(jitter_ms: f64) -> f64 {
    let (feeds_mm_min, repeats, times) = TOUCHES;
    let each = f64::from(repeats) * 2.0 * times as f64;
    let square = |feed_mm_min: f64| {
        let ratio = 1.0 + (feed_mm_min / 60.0 * jitter_ms * 1e-3).powi(2) / touch_mm2(1.0);
        each * (ratio - 1.0 - ratio.ln())
    };
    feeds_mm_min.map(square).iter().sum::<f64>().sqrt()
}

/// Steps, each a line, a number of times.
fn plan(steps: &[String], times: usize) -> Result<Plan, TrialError> {
    let mut text = "title: a blind trial\nsteps:\n".to_owned();
    for step in std::iter::repeat_n(steps, times).flatten() {
        let _ = writeln!(text, "  - {{do: {step}}}");
    }
    Plan::from_yaml(&text).map_err(|source| TrialError::ProgrammeText { source })
}

fn in_both_files(rig: &mut Rig, change: impl Fn(&mut MachineFile)) {
    change(&mut rig.machine);
    change(&mut rig.control);
}

/// A ring gauge and a sphere somewhere on the table; one of them is touched, and faces at three feeds.
fn touched(random: &mut Pcg64Mcg, rig: &mut Rig, id: &str, points: u32) -> Result<(), TrialError> {
    let places = Places::draw(random, rig);
    in_both_files(rig, |file| file.artefacts.extend(places.artefacts()));
    rig.plant.touch_probe.spring_force_n = NO_SPRING_N;
    let is_kept = |step: &Step| matches!(step, Step::Latency { .. });
    rig.plan.steps.retain(is_kept);
    let (id, times) = (id.to_owned(), 12);
    let artefact = Step::Artefact { id, points };
    rig.plan.steps.extend(std::iter::repeat_n(artefact, times));
    Ok(())
}

/// Circles whose stations are shorter than a period of the scale that closes the loop of one axis.
fn slow_circles(hidden: &Hidden, rig: &mut Rig) -> Result<(), TrialError> {
    let axis = hidden.moving().unwrap_or(Axis::X);
    in_both_files(rig, |file| {
        if let Some(AxisEntry::Linear(entry)) = file.axes.get_mut(&axis) {
            entry.scale_resolution_um = Some(0.005);
            entry.position_feedback = PositionFeedback::Scale;
        }
    });
    rig.config.feedback.insert(axis, FeedbackSource::Scale);
    rig.plant.linear_scales.interpolation_um = 0.0;
    let circle = |radius_mm: f64, feed_mm_min: f64| {
        format!(
            "grid, placement: middle, trajectory: circle, radius_mm: {radius_mm}, feed_mm_min: {feed_mm_min:.1}, \
             sense: both, on_the_fly: true, repeats: 3"
        )
    };
    rig.plan = plan(&[circle(0.1, 6.0), circle(0.2, 15.0)], 1)?;
    Ok(())
}

/// The five-axis machine of `launch_configs` on the drives of this one, with rotary axes that its file describes well.
fn five_axis(rig: &mut Rig) -> Result<(), TrialError> {
    let [machine, plant] = FIVE_AXIS;
    let mut machine = MachineFile::parse(machine, "five_axis/machine.yaml")?;
    let mut own = PlantFile::from_yaml(plant)?;
    own.seed = rig.plant.seed;
    own.linear_drives.clone_from(&rig.plant.linear_drives);
    own.geometry.linear.clone_from(&rig.plant.geometry.linear);
    for entry in own.geometry.linear.values_mut() {
        entry.lead_um_per_m = 0.0;
    }
    own.geometry.squareness_urad = SquarenessEntry {
        y_to_x: 0.0,
        z_to_x: 0.0,
        z_to_y: 0.0,
    };
    for entry in own.geometry.rotary.values_mut() {
        (entry.location_um, entry.tilt_urad) = ([0.0; 3], [0.0; 3]);
        (entry.run_out_um, entry.wobble_urad, entry.positioning_urad) = (0.05, 0.2, 0.2);
    }
    for drive in own.rotary_drives.values_mut() {
        (drive.backlash_arcsec, drive.backlash_softness_arcsec) = (0.0, 0.02);
        drive.bearing_friction.coulomb_n_m *= EASY;
        drive.bearing_friction.breakaway_n_m *= EASY;
    }
    own.heat.shop_air.clone_from(&rig.plant.heat.shop_air);
    own.heat.standing_heat_w.clear();
    for screw in own.heat.screws.values_mut() {
        (screw.nut_torque_n_m, screw.bearing_torque_n_m) = (0.0, 0.0);
        screw.motor_loss_w_per_kn2 = 0.0;
    }
    for axis in Axis::LINEAR {
        if let (Some(AxisEntry::Linear(entry)), Some(like)) =
            (machine.axes.get_mut(&axis), rig.machine.linear(axis))
        {
            entry.guide_friction.clone_from(&like.guide_friction);
        }
    }
    rig.plant = own;
    rig.control = machine.clone();
    rig.machine = machine;
    let spheres = [
        "artefact, id: high, points: 25",
        "rotary, sphere: high, planned: 20, points: 6, repeats: 4",
        "rotary, sphere: low, planned: 20, points: 6, repeats: 4",
        "rotary, sphere: high, planned: 8, points: 6, verification: true",
        "artefact, id: high, points: 25",
    ];
    rig.plan = plan(&spheres.map(str::to_owned), 1)?;
    Ok(())
}

/// Steps that are repeated under thermometers on spindle and column.
fn watched(rig: &mut Rig, steps: &[&str], times: usize) -> Result<(), TrialError> {
    in_both_files(rig, |file| {
        let Some(like) = file.temperature_sensors.first().cloned() else {
            return;
        };
        let places = [
            ("spindle_front", SensorPlace::SpindleFront),
            ("column", SensorPlace::Column),
        ];
        for (id, place) in places {
            file.temperature_sensors.push(SensorEntry {
                id: id.to_owned(),
                place,
                ..like.clone()
            });
        }
    });
    let steps: Vec<String> = steps.iter().map(|step| (*step).to_owned()).collect();
    rig.plan = plan(&steps, times)?;
    Ok(())
}

impl Hidden {
    /// Hides an effect of such a class.
    pub(crate) fn in_own(&self, rig: &mut Rig) -> Option<()> {
        let plant = &mut rig.plant;
        match self.class {
            Class::PlateError => plant.grid_encoder.plate_scale_um_per_m += self.size,
            Class::ClockDrift => rig.grid_fast += 1e-6 * self.size,
            Class::ProbeLobing | Class::ProbePretravel => {
                plant.touch_probe.spring_force_n += self.size;
            }
            Class::LatencyJitter => {
                let known_ms = plant.touch_probe.jitter_ms;
                plant.touch_probe.jitter_ms = known_ms.hypot(self.size);
            }
            Class::InterpolationError => plant.linear_scales.interpolation_um += self.size,
            Class::RotaryLocation => {
                let table = plant.geometry.rotary.get_mut(&self.moving()?)?;
                let along: Axis = self.axis.get(..1)?.parse().ok()?;
                table.location_um[along.index()] += self.size;
            }
            Class::RotaryMotion => {
                let table = plant.geometry.rotary.get_mut(&self.moving()?)?;
                table.positioning_urad += self.size;
            }
            Class::RotaryBacklash => {
                let table = plant.rotary_drives.get_mut(&self.moving()?)?;
                table.backlash_arcsec += self.size;
            }
            Class::SpindleGrowth => {
                let spindle = &mut plant.heat.spindle;
                spindle.front_bearing_w_at_1000_rpm += self.size;
                spindle.rear_bearing_w_at_1000_rpm += 0.7 * self.size;
                spindle.motor_w_at_1000_rpm += 4.0 * self.size;
            }
            Class::ColumnBend => warm(rig, &[(Place::ColumnFront, self.size)]),
            Class::AmbientDrift => {
                let base_w = 1.3 * self.size;
                warm(rig, &[(Place::Bed, self.size), (Place::BedBase, base_w)]);
            }
            _ => return None,
        }
        Some(())
    }
}

fn warm(rig: &mut Rig, places: &[(Place, f64)]) {
    for (place, heat_w) in places {
        *rig.plant.heat.standing_heat_w.entry(*place).or_default() += heat_w;
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    fn hidden(class: Class, axis: &'static str, size: f64) -> Hidden {
        Hidden {
            class,
            axis,
            size,
            is_foreign: false,
            shape: [0.5; 2],
        }
    }

    #[test]
    fn every_class_can_be_hidden_on_every_axis_of_its_machine() {
        for class in Class::OWN {
            let ([low, high], _) = class.sizes();
            for axis in class.axes() {
                for size in [low, high] {
                    let mut random = Pcg64Mcg::seed_from_u64(4);
                    let mut rig = Rig::draw(&mut random, false).unwrap();
                    let hidden = hidden(class, axis, size);
                    prepare(&mut random, &hidden, &mut rig).unwrap();
                    let mut with = rig.clone();
                    hidden.hide(&mut with).unwrap();
                    assert_eq!(with.machine, rig.machine);
                    assert_ne!(with, rig, "{class:?} {axis}");
                    fake_cnc::Plant::new(&with.control, &with.plant).unwrap();
                }
            }
        }
    }

    /// Of 360 touches at 16 mm/s, 0.1 ms are 1.6 um beside 0.3 um and a simulator's own 0.2 um, twice.
    #[test]
    fn eq1_is_of_the_touches_that_are_quick() {
        let ratio: f64 = 1.0 + 1.6 * 1.6 / (0.3 * 0.3 + 2.0 * 0.2 * 0.2);
        let quick = (360.0 * (ratio - 1.0 - ratio.ln())).sqrt();
        let d = jitter_d(0.1);
        assert!((d / quick - 1.0).abs() < 1e-3, "{d} {quick}");
        assert!(jitter_d(0.01) < 2.0 && jitter_d(0.4) > 4.0 * d);
    }
}
