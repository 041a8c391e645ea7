//! The fake machine's files of a designed scenario: those beside the machine file, or a stand-in of usual size.

use std::path::Path;

use anyhow::{Context, Result};
use fake_cnc::{Config, Plant, PlantFile};
use machine::MachineFile;
use machine::file::AxisEntry;
use node_runtime::text_file;

/// Plants of three and of five axes.
const THREE_AXES: &str = include_str!("../../../../../launch_configs/gap_first/plant.yaml");
const FIVE_AXES: &str = include_str!("../../../../../launch_configs/five_axis/plant.yaml");
/// The names that are looked for beside a machine file.
const OWN: [&str; 2] = ["fake_cnc.yaml", "plant.yaml"];
/// How much of a screw is beyond the travel at each end, mm.
const BEYOND_MM: f64 = 80.0;

/// Parameters and plant of the fake machine, as texts.
pub struct StandIn {
    /// `fake_cnc.yaml`.
    pub parameters: String,
    /// `plant.yaml`.
    pub plant: String,
    /// Whether they are those beside the machine file.
    pub is_own: bool,
}

/// The fake machine's files for a machine file at a path; `control`: with what the programme was planned.
///
/// # Errors
/// When no plant is at hand for these axes: names what to put beside the machine file.
pub fn of(path: &Path, machine: &MachineFile, control: &Config) -> Result<StandIn> {
    let beside = OWN.map(|name| path.with_file_name(name));
    if beside.iter().all(|path| path.is_file()) {
        let [parameters, plant] = &beside;
        return Ok(StandIn {
            parameters: text_file::yaml(parameters).context("parameter file")?,
            plant: text_file::yaml(plant).context("plant file")?,
            is_own: true,
        });
    }
    let remedy =
        "no stand-in fits this machine: put plant.yaml and fake_cnc.yaml beside the machine file";
    let plant = fitted(machine).context(remedy)?;
    let _ = Plant::new(machine, &plant).context(remedy)?;
    Ok(StandIn {
        parameters: parameters(control),
        plant: serde_saphyr::to_string(&plant).context("plant file")?,
        is_own: false,
    })
}

/// A plant of usual size for the axes and travels of a machine.
fn fitted(machine: &MachineFile) -> Result<PlantFile> {
    let turns = |entry: &AxisEntry| matches!(entry, AxisEntry::Rotary(_));
    let text = if machine.axes.values().any(turns) {
        FIVE_AXES
    } else {
        THREE_AXES
    };
    let mut plant = PlantFile::from_yaml(text)?;
    plant
        .linear_drives
        .retain(|axis, _| machine.axes.contains_key(axis));
    plant
        .rotary_drives
        .retain(|axis, _| machine.axes.contains_key(axis));
    for (axis, screw) in &mut plant.heat.screws {
        if let Some(entry) = machine.linear(*axis) {
            let [low, high] = entry.travel_mm;
            screw.ends_mm = [low - BEYOND_MM, high + BEYOND_MM];
        }
    }
    Ok(plant)
}

fn parameters(control: &Config) -> String {
    let start: Vec<String> = control
        .start_mm
        .iter()
        .map(|(axis, mm)| format!("{axis}: {mm:.3}"))
        .collect();
    format!(
        "/**:\n  ros__parameters:\n    machine_file: machine.yaml\n    plant_file: plant.yaml\n    \
         background_rate_hz: 50.0\n    following_error_limit_mm: {:.3}\n    following_error_limit_deg: {:.3}\n    \
         start_mm: {{{}}}\n",
        control.following_error_limit_mm,
        control.following_error_limit_deg,
        start.join(", ")
    )
}
