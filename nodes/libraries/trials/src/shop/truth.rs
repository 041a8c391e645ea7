//! What is true of a shop's session.

use serde::{Deserialize, Serialize};

/// An effect of the catalogue by its id and what it acts on.
pub type Name = (String, String);

/// A name from its parts.
pub(crate) fn name(effect: &str, axis: &str) -> Name {
    (effect.to_owned(), axis.to_owned())
}

/// The truth of one session.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShopTruth {
    /// The session in words.
    pub session: String,
    /// The layout of its tables.
    pub layout: String,
    /// Cycles, circles of one kind, or warm-ups.
    pub repeats: usize,
    /// Targets, planes or thermometers.
    pub places: usize,
    /// What is hidden.
    pub effects: Vec<ShopEffect>,
    /// Noise of a reading, µm.
    pub white_um: f64,
    /// Smooth deviation of runs from each other, µm.
    pub between_runs_um: f64,
    /// What a reading keeps of the noise of the one before.
    pub memory: f64,
    /// Runs and changes of a shift.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shift: Option<ShiftTruth>,
}

/// What is true of the course of a shift.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShiftTruth {
    /// Its runs: number, and begin since the session began, s.
    pub runs_s: Vec<(u32, f64)>,
    /// What changes.
    pub changes: Vec<TrueChange>,
}

/// What changes during a shift.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrueChange {
    /// Its place among the hidden effects.
    pub effect: usize,
    /// When it begins, since the session began, s.
    pub from_s: f64,
    /// When it ends, s; none where it changes at once.
    pub until_s: Option<f64>,
    /// Time from one test that shows it to the next, s.
    pub cycle_s: f64,
}

/// One hidden effect.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShopEffect {
    /// What it is, in the words of a shop.
    pub what: String,
    /// Names of the catalogue that are true of it.
    pub names: Vec<Name>,
    /// Names that are true as well and may be absent.
    #[serde(default)]
    pub besides: Vec<Name>,
    /// Other effects that make the same readings in this session: with one of these the only right answer is a set.
    #[serde(default)]
    pub same_readings: Vec<Name>,
    /// Its size.
    pub size: f64,
    /// The unit.
    pub unit: String,
    /// Size over noise after the constants of the set-up.
    #[serde(rename = "D")]
    pub d: f64,
    /// The same after everything else that is hidden and looks like it.
    #[serde(rename = "D_alone")]
    pub d_alone: f64,
    /// The temperature that it follows.
    #[serde(default)]
    pub follow: Option<Follow>,
}

impl ShopEffect {
    /// Whether a name is true of it.
    #[must_use]
    pub fn has_name(&self, found: &Name) -> bool {
        self.names.contains(found)
    }

    /// Whether the session tells it from every other effect.
    #[must_use]
    pub fn is_resolvable(&self) -> bool {
        self.same_readings.is_empty() && !self.names.is_empty()
    }
}

/// A displacement that follows a thermometer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Follow {
    /// The thermometer, by its name in the machine file.
    pub thermometer: String,
    /// Lag of first order that describes it best in this session, min.
    pub lag_min: f64,
    /// Size that goes with that lag, µm/K.
    pub um_per_k: f64,
}
