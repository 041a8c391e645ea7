//! How a diagnosis is made: how finely readings are thinned, how hard is searched, how sure is sure.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use crate::error::GapError;
use crate::judgement::Check;
use crate::judgement::rule::Rule;

/// Settings of a diagnosis. The defaults are those that the trials were judged with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GapConfig {
    /// Stations that a circle, or one pass of a line, is thinned to.
    pub stations: usize,
    /// Rows of the whole session above which stations are made longer.
    pub most_rows: usize,
    /// Greatest order of the autoregression within a run, 0 to 3.
    pub most_ar: usize,
    /// Sets of effects that are followed side by side.
    pub beam: usize,
    /// Most effects in one set.
    pub most_effects: usize,
    /// Draws of the significance test.
    pub significance_draws: usize,
    /// Draws of the bootstrap over held-out runs.
    pub bootstrap_draws: usize,
    /// Seed of every draw.
    pub seed: u64,
    /// Scatter over that of the repeats, as a ratio of variances, above which the floor is not reproduced.
    pub most_inflation: f64,
    /// The same of both directions of a grid encoder, as a geometric mean.
    pub most_inflation_of_two: f64,
    /// Error of form that every simulator has, below which nothing is named, µm.
    pub form_error_um: f64,
    /// What is added to it where effects were found, as a share of their signatures.
    pub form_error_share: f64,
    /// Standard score at which an effect has two sizes.
    pub constancy_z: f64,
    /// Spread of its sizes, as a share of the mean, below which an effect is constant all the same.
    pub constancy_spread: f64,
    /// Whether some runs are held out for the shrink.
    pub hold_out: bool,
    /// Whether the readings are in the order of the measurement.
    pub is_order_known: bool,
    /// Ids of effects that are not considered.
    pub left_out: Vec<String>,
    /// Rules that are switched off, to see what they are worth.
    pub ablated: BTreeSet<Rule>,
}

impl Default for GapConfig {
    fn default() -> Self {
        Self {
            stations: 240,
            most_rows: 12_000,
            most_ar: 3,
            beam: 5,
            most_effects: 6,
            significance_draws: 999,
            bootstrap_draws: 2000,
            seed: 20_260_101,
            most_inflation: 1.2,
            most_inflation_of_two: 1.05,
            form_error_um: 0.2,
            form_error_share: 0.05,
            constancy_z: 4.0,
            constancy_spread: 0.1,
            hold_out: true,
            is_order_known: true,
            left_out: vec![],
            ablated: BTreeSet::new(),
        }
    }
}

impl GapConfig {
    /// Whether a rule is on.
    #[must_use]
    pub fn applies(&self, rule: Rule) -> bool {
        !self.ablated.contains(&rule)
    }

    /// The checks of a rule, as not tried where it is off.
    pub(crate) fn tried(&self, rule: Rule, checks: Vec<Check>) -> Vec<Check> {
        if self.applies(rule) {
            return checks;
        }
        checks.into_iter().map(Check::not_tried).collect()
    }

    /// Refuses settings that mean nothing.
    ///
    /// # Errors
    /// Names the key, the value and what is wanted.
    pub fn check(&self) -> Result<(), GapError> {
        let counts = [
            ("stations", self.stations, 16, 100_000),
            ("most_rows", self.most_rows, 100, 1_000_000),
            ("most_ar", self.most_ar, 0, 3),
            ("beam", self.beam, 1, 50),
            ("most_effects", self.most_effects, 1, 20),
            ("significance_draws", self.significance_draws, 99, 100_000),
            ("bootstrap_draws", self.bootstrap_draws, 100, 1_000_000),
        ];
        for (key, value, low, high) in counts {
            if !(low..=high).contains(&value) {
                return Err(GapError::Count {
                    key,
                    value,
                    low,
                    high,
                });
            }
        }
        let reals = [
            ("most_inflation", self.most_inflation, 1.0),
            ("most_inflation_of_two", self.most_inflation_of_two, 1.0),
            ("form_error_um", self.form_error_um, 0.0),
            ("form_error_share", self.form_error_share, 0.0),
            ("constancy_z", self.constancy_z, 0.0),
            ("constancy_spread", self.constancy_spread, 0.0),
        ];
        for (key, value, low) in reals {
            if !value.is_finite() || value < low {
                return Err(GapError::Setting { key, value, low });
            }
        }
        Ok(())
    }
}
