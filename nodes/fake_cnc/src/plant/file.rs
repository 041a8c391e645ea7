//! The plant file: the true state of the machine, which reaches no topic, bag or other node.
//!
//! Units are those of data sheets and end every key; unknown keys are refused by name; physics has
//! no default.

mod body;
mod drives;
mod heat;
mod reference;
mod touching;

pub use body::{
    GeometryEntry, GuideFormEntry, LinearErrorEntry, OilFilmEntry, RotaryErrorEntry,
    SquarenessEntry, StructureEntry, VibrationEntry,
};
pub use drives::{
    FrictionEntry, LeadCycleEntry, LinearDriveEntry, LubricationEntry, RotaryDriveEntry,
    RotaryFrictionEntry, WearEntry,
};
pub use heat::{
    HeatEntry, LinkEntry, Place, PlaceEntry, ScrewEnd, ScrewEntry, ShopAirEntry, SpindleLossEntry,
};
pub use reference::{GridPlateEntry, LaserEntry, LinearScalesEntry};
pub use touching::{
    ArtefactsEntry, BumpEntry, FaultsEntry, ProbeFaultEntry, SensorsEntry, TouchProbeEntry,
};

use std::collections::BTreeMap;

use metrology::Axis;
use serde::{Deserialize, Serialize};

use super::error::PlantError;

/// A whole plant file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlantFile {
    /// Seed of all random streams.
    pub seed: u64,
    /// Drives of the linear axes.
    pub linear_drives: BTreeMap<Axis, LinearDriveEntry>,
    /// Drives of the rotary axes.
    pub rotary_drives: BTreeMap<Axis, RotaryDriveEntry>,
    /// Heat.
    pub heat: HeatEntry,
    /// What heat does to the structure.
    pub structure: StructureEntry,
    /// Errors of the cold geometry.
    pub geometry: GeometryEntry,
    /// The oil under the slides; where absent, a slide comes back to where it was.
    #[serde(default)]
    pub oil_film: BTreeMap<Axis, OilFilmEntry>,
    /// How the tool shakes against the workpiece; where absent, not at all.
    #[serde(default)]
    pub vibration: Option<VibrationEntry>,
    /// The touch probe.
    pub touch_probe: TouchProbeEntry,
    /// The artefacts.
    pub artefacts: ArtefactsEntry,
    /// Temperature sensors.
    pub sensors: SensorsEntry,
    /// Linear scales.
    pub linear_scales: LinearScalesEntry,
    /// The grid encoder.
    pub grid_encoder: GridPlateEntry,
    /// The laser interferometer.
    pub length_reference: LaserEntry,
    /// What is broken; nothing where absent.
    #[serde(default)]
    pub faults: FaultsEntry,
}

impl PlantFile {
    /// Reads a plant file from its text.
    ///
    /// # Errors
    /// When a key is unknown, missing or of the wrong type; the message has line and column.
    pub fn from_yaml(text: &str) -> Result<Self, PlantError> {
        Ok(metrology::yaml::read(text)?)
    }
}
