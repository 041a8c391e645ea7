//! Which of the causes that a diagnosis found a scenario's simulated machine really has, by its plant file.
//!
//! The plant is built of parts (drives, screws, heat, guides, probe), the catalogue of effects: what stands for an effect is the
//! key of the part that makes it. No node reads the plant for it: it is for the page alone.

use fake_cnc::PlantFile;
use metrology::Axis;
use metrology::text::Comments;
use node_runtime::text_file;
use reports::gap::diagnosed::InPlant;

use crate::launch::LaunchNode;
use crate::scenario::Scenario;

/// The node that simulates the machine, and its parameter with the plant file.
const SIMULATOR: (&str, &str) = ("fake_cnc", "plant_file");

/// What a plant says of an effect.
#[derive(Clone, Debug, PartialEq)]
pub enum Truth {
    /// It has a part that makes it: its key, and its value where one number says it.
    Has(String),
    /// It has nothing that makes it.
    Lacks,
    /// The plant file does not state it: an effect of clocks, or of the control.
    Unstated,
}

impl Truth {
    /// For the table of causes.
    #[must_use]
    pub fn in_table(self) -> InPlant {
        let (has_it, part) = match self {
            Self::Has(part) => ("yes", part),
            Self::Lacks => ("no", String::new()),
            Self::Unstated => ("not stated", String::new()),
        };
        InPlant { has_it, part }
    }
}

/// The plant of a scenario's simulated machine; none where the machine is another one.
#[must_use]
pub fn plant_of(scenario: &Scenario) -> Option<PlantFile> {
    let simulator = |node: &&LaunchNode| node.exec == SIMULATOR.0;
    let node = scenario.nodes.iter().find(simulator)?;
    let path = node.setup().ok()?.file_path(SIMULATOR.1).ok()?;
    let text = text_file::read(&path, Comments::Yaml).ok()?;
    PlantFile::from_yaml(&text).ok()
}

/// What the plant says of the effect with this id, on the axis that its entry names.
#[must_use]
pub fn truth(plant: &PlantFile, effect: &str, axis: &str) -> Truth {
    let of_axis = |at: Option<char>| at.and_then(|letter| letter.to_string().parse::<Axis>().ok());
    // Straightness in Z of X is written ZX: the guide is that of the last letter.
    let guide = of_axis(axis.chars().next_back());
    let found = match guide {
        Some(guide) => of_drive(plant, effect, guide).or_else(|| of_guide(plant, effect, guide)),
        None => None,
    };
    found
        .or_else(|| of_pair(plant, effect, axis))
        .or_else(|| of_heat(plant, effect))
        .or_else(|| of_probe(plant, effect))
        .or_else(|| of_instrument(plant, effect))
        .unwrap_or(if OF_NO_PART.contains(&effect) {
            Truth::Lacks
        } else {
            Truth::Unstated
        })
}

/// Effects that no part of a plant makes.
const OF_NO_PART: [&str; 8] = [
    "ambient_drift",
    "coolant",
    "homing_shift",
    "gravity_sag",
    "lateral_play",
    "latency_drift",
    "latency_modes",
    "stylus_jump",
];

/// A part with one number: there where it is not zero.
fn number(key: &str, value: f64) -> Truth {
    if value == 0.0 {
        Truth::Lacks
    } else {
        Truth::Has(format!("{key} {value}"))
    }
}

/// A part that is there or not.
fn part(key: impl Into<String>, is_there: bool) -> Truth {
    if is_there {
        Truth::Has(key.into())
    } else {
        Truth::Lacks
    }
}

fn of_drive(plant: &PlantFile, effect: &str, axis: Axis) -> Option<Truth> {
    if effect == "rotary_backlash" {
        let drive = plant.rotary_drives.get(&axis)?;
        return Some(number("backlash_arcsec", drive.backlash_arcsec));
    }
    let drive = plant.linear_drives.get(&axis)?;
    let friction = &drive.guide_friction;
    Some(match effect {
        "backlash" => match drive.wear.last() {
            Some(worn) if drive.backlash_um == 0.0 => {
                let (wide_um, after_s) = (worn.backlash_um, worn.after_s);
                Truth::Has(format!("backlash_um {wide_um} from {after_s} s on"))
            }
            _ => number("backlash_um", drive.backlash_um),
        },
        "friction_windup" => number("guide_friction.coulomb_n", friction.coulomb_n),
        "reversal_spike" | "stick_slip" => part(
            "guide_friction.breakaway_n above coulomb_n",
            friction.breakaway_n > friction.coulomb_n,
        ),
        // A screw gives way to every force.
        "drive_windup" | "load_deflection" | "structural_ringing" => {
            part("screw_stiffness_n_per_um", true)
        }
        "cyclic_error" => part("lead_cycle", drive.lead_cycle.is_some()),
        "feed_lost_motion" => part("oil_film", plant.oil_film.contains_key(&axis)),
        "screw_elongation" => part("heat.screws", plant.heat.screws.contains_key(&axis)),
        _ => return None,
    })
}

fn of_guide(plant: &PlantFile, effect: &str, axis: Axis) -> Option<Truth> {
    if let Some(table) = plant.geometry.rotary.get(&axis) {
        return Some(match effect {
            "rotary_location" => part(
                "location_um, tilt_urad",
                (table.location_um.iter().chain(&table.tilt_urad)).any(|value| *value != 0.0),
            ),
            "rotary_motion" => part(
                "run_out_um, wobble_urad",
                table.run_out_um != 0.0 || table.wobble_urad != 0.0,
            ),
            _ => return None,
        });
    }
    let guide = plant.geometry.linear.get(&axis)?;
    Some(match effect {
        "pitch_error" => number("positioning_um", guide.positioning_um),
        "scale_error" => number("lead_um_per_m", guide.lead_um_per_m),
        "straightness" if guide.form.is_empty() => number("straightness_um", guide.straightness_um),
        "angular_error" => number("angular_urad", guide.angular_urad),
        "straightness" | "guide_bow" => part("form", !guide.form.is_empty()),
        _ => return None,
    })
}

fn of_pair(plant: &PlantFile, effect: &str, axis: &str) -> Option<Truth> {
    let angles = &plant.geometry.squareness_urad;
    Some(match (effect, axis) {
        ("squareness", "XY") => number("y_to_x", angles.y_to_x),
        ("squareness", "XZ") => number("z_to_x", angles.z_to_x),
        ("squareness", "YZ") => number("z_to_y", angles.z_to_y),
        ("vibration_random", _) => part("vibration", plant.vibration.is_some()),
        _ => return None,
    })
}

fn of_heat(plant: &PlantFile, effect: &str) -> Option<Truth> {
    let spindle = &plant.heat.spindle;
    Some(match effect {
        "spindle_growth" => number(
            "heat.spindle.front_bearing_w_at_1000_rpm",
            spindle.front_bearing_w_at_1000_rpm,
        ),
        "column_bend" => part("structure", true),
        "thermal_shift" => part("structure, heat", true),
        "workpiece_expansion" => number(
            "workpiece_expansion_um_per_m_k",
            plant.structure.workpiece_expansion_um_per_m_k,
        ),
        "thermometer_lag" => number("sensors.time_constant_s", plant.sensors.time_constant_s),
        "thermometer_offset" => number("sensors.offset_k", plant.sensors.offset_k),
        "thermometer_noise" => number("sensors.noise_k", plant.sensors.noise_k),
        _ => return None,
    })
}

fn of_probe(plant: &PlantFile, effect: &str) -> Option<Truth> {
    let probe = &plant.touch_probe;
    Some(match effect {
        "probe_latency" => number("latency_ms", probe.latency_ms),
        "latency_jitter" => number("jitter_ms", probe.jitter_ms),
        "probe_repeatability" => number("repeatability_um", probe.repeatability_um),
        "probe_pretravel" => number("spring_force_n", probe.spring_force_n),
        // A seat of three supports gives way more between them.
        "probe_lobing" => part("three supports", probe.spring_force_n != 0.0),
        _ => return None,
    })
}

fn of_instrument(plant: &PlantFile, effect: &str) -> Option<Truth> {
    let laser = &plant.length_reference;
    Some(match effect {
        "length_wavelength" => number("wavelength_error_ppm", laser.wavelength_error_ppm),
        "length_misalignment" => number("misalignment_urad", laser.misalignment_urad),
        "plate_error" => number("plate_error_um", plant.grid_encoder.plate_error_um),
        "interpolation_error" => number("interpolation_um", plant.linear_scales.interpolation_um),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use twin::effects;

    use super::*;

    fn first_run() -> PlantFile {
        let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../launch_configs/first_run");
        plant_of(&Scenario::read(&shipped).unwrap()).unwrap()
    }

    #[test]
    fn a_plant_has_what_its_file_states_and_lacks_what_is_zero_or_absent() {
        let mut plant = first_run();
        let table = [
            ("backlash", "X", "yes", "backlash_um 2.5"),
            ("probe_latency", "", "yes", "latency_ms 3.7"),
            ("screw_elongation", "Y", "yes", "heat.screws"),
            ("squareness", "XZ", "yes", "z_to_x -9"),
            ("straightness", "ZX", "yes", "straightness_um 2.5"),
            ("rotary_backlash", "C", "yes", "backlash_arcsec 0.6"),
            ("rotary_location", "X0C", "yes", "location_um, tilt_urad"),
            ("ambient_drift", "Y", "no", ""),
            ("cyclic_error", "X", "no", ""),
            ("vibration_random", "X", "no", ""),
            ("clock_offset", "grid", "not stated", ""),
            ("servo_lag", "X", "not stated", ""),
        ];
        for (effect, axis, has_it, part) in table {
            let found = truth(&plant, effect, axis).in_table();
            assert_eq!(
                (found.has_it, found.part.as_str()),
                (has_it, part),
                "{effect} {axis}"
            );
        }
        for drive in plant.linear_drives.values_mut() {
            drive.backlash_um = 0.0;
        }
        assert_eq!(truth(&plant, "backlash", "X"), Truth::Lacks);
    }

    #[test]
    fn every_effect_of_the_catalogue_is_looked_up_or_known_to_be_none_of_the_machines_body() {
        /// Of clocks and of the control, which a plant file does not describe.
        const OF_OTHERS: [&str; 5] = [
            "clock_offset",
            "clock_drift",
            "acceleration_lag",
            "servo_lag",
            "quantisation",
        ];
        let plant = first_run();
        let axes = ["X", "C", "ZX", "CX", "XY", "X0C", "XC", ""];
        for kind in effects::CATALOGUE {
            let known = |axis: &&str| truth(&plant, kind.id, axis) != Truth::Unstated;
            let is_known = axes.iter().any(known);
            assert_eq!(is_known, !OF_OTHERS.contains(&kind.id), "{}", kind.id);
        }
    }

    #[test]
    fn a_scenario_of_another_control_has_no_plant() {
        let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../launch_configs");
        let scenario = Scenario::read(&shipped.join("linuxcnc_latency")).unwrap();
        assert_eq!(plant_of(&scenario), None);
    }
}
