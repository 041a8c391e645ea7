//! What is true of a shop's session.

use serde::{Deserialize, Serialize};

/// An effect of the catalogue by its id and what it acts on.
pub type Name = (String, String);

/// A name from its parts.
pub(super) fn name(effect: &str, axis: &str) -> Name {
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
    /// Cycles, circles of one kind, warm-ups, or block cycles of a shift.
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
    /// When a shift's runs were made.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shift: Option<ShiftTimes>,
}

/// When the runs of a shift were made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShiftTimes {
    /// Number and begin of each test, s since the first state of the bag.
    pub begins_s: Vec<(u32, f64)>,
    /// Longest time from one block cycle to the next, s.
    pub cycle_s: f64,
}

impl ShiftTimes {
    /// When a run began, s since the first state of the bag.
    #[must_use]
    pub fn begin_s(&self, run: u32) -> Option<f64> {
        let own = self.begins_s.iter().find(|(number, _)| *number == run);
        own.map(|(_, begin_s)| *begin_s)
    }
}

/// When something changed during a shift.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Change {
    /// The instant, s since the first state of the bag.
    pub at_s: f64,
    /// Begins of the last test before it and of the first one after it, of those that show the effect, s.
    pub between_s: [f64; 2],
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
    /// The catalogue's parameter that has a size of this effect, and that size; where the form is the catalogue's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parameter: Option<(String, f64)>,
    /// When it began, where it was not there from the begin.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub change: Option<Change>,
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
