//! What was hidden: written before the diagnosis begins, sealed, and read by the judge alone.

use serde::{Deserialize, Serialize};

use crate::arm::Arm;
use crate::designed::DesignedTruth;
use crate::effect::{Class, Hidden};
use crate::shop::ShopTruth;

/// The truth of one trial.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Truth {
    /// Kind of trial.
    pub arm: Arm,
    /// Its number in the arm.
    pub index: u64,
    /// Seed of the series.
    pub seed: u64,
    /// What is hidden.
    pub effects: Vec<TrueEffect>,
    /// The class that the diagnosis is told to leave out.
    pub left_out: Option<String>,
    /// Smooth deviation of runs, µm.
    pub between_runs_um: f64,
    /// Noise of a reading, µm.
    pub white_um: f64,
    /// Whether there are outliers.
    pub has_outliers: bool,
    /// Whether the motors' encoders were recorded.
    pub has_motors: bool,
    /// What a simulator that knows the truth would leave on the held-out runs: their root mean square on the same
    /// machine with the same scatter and nothing hidden, µm.
    #[serde(default)]
    pub bare_um: Option<f64>,
    /// Which measure its D have; trials of different ones are not of one series.
    #[serde(default = "first_measure")]
    pub measure: u32,
    /// What is true of a shop's session, of which the fields above say nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shop: Option<ShopTruth>,
    /// What a designed programme was, where one was measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub designed: Option<DesignedTruth>,
}

impl Truth {
    /// The truth of a shop's session.
    #[must_use]
    pub const fn of_a_shop(arm: Arm, seed: u64, index: u64, shop: ShopTruth) -> Self {
        Self {
            arm,
            index,
            seed,
            effects: vec![],
            left_out: None,
            between_runs_um: shop.between_runs_um,
            white_um: shop.white_um,
            has_outliers: true,
            has_motors: false,
            bare_um: None,
            measure: MEASURE,
            shop: Some(shop),
            designed: None,
        }
    }
}

/// The measure of D of this program (`size`): 2, as a stop of a positioning run is one row. By 1 it was as many as it had
/// readings.
pub const MEASURE: u32 = 2;

const fn first_measure() -> u32 {
    1
}

/// One hidden effect.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrueEffect {
    /// Its class.
    pub class: Class,
    /// What it acts on, as the catalogue names it.
    pub axis: String,
    /// Size in the class' unit.
    pub size: f64,
    /// The unit.
    pub unit: String,
    /// The catalogue's parameter that has this size, where there is one and the form is the catalogue's.
    pub parameter: Option<String>,
    /// Whether its form is foreign.
    pub is_foreign: bool,
    /// What else the machine has by this form, as the catalogue names it: class and axis. To name it is right, not to
    /// name it is no miss.
    #[serde(default)]
    pub besides: Vec<(String, String)>,
    /// Size against the trial's scatter.
    #[serde(rename = "D")]
    pub d: f64,
    /// The same on the common programme, where a designed one was measured.
    #[serde(rename = "common_D", default, skip_serializing_if = "Option::is_none")]
    pub common_d: Option<f64>,
}

impl TrueEffect {
    pub(crate) fn of(hidden: &Hidden, d: f64) -> Self {
        let named = hidden.class.parameter().filter(|_| !hidden.is_foreign);
        Self {
            class: hidden.class,
            axis: hidden.axis.to_owned(),
            size: hidden.size,
            unit: hidden.class.sizes().1.to_owned(),
            parameter: named.map(str::to_owned),
            is_foreign: hidden.is_foreign,
            besides: hidden
                .besides()
                .map(|id| (id.to_owned(), hidden.axis.to_owned()))
                .into_iter()
                .collect(),
            d,
            common_d: None,
        }
    }
}
