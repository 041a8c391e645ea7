//! Parameters of the positioning part of one axis; keys carry their units.

use machine::MachineFile;
use metrology::Axis;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::deviation_table::{DeviationTable, SPACING_MM};
use super::loop_stability;
use super::offset::Reading;
use super::refresh::{Directions, Unpassed};
use super::refusal::PositioningRefusal;
use crate::error::AxisCompensationError;

/// Parameters of one axis. How it compensates has no default; how it measures has.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PositioningConfig {
    /// refreshed_table or weighted_increments: which reading of the dual loop compensates; the same keys exist for Y
    /// and Z.
    pub reading: Reading,
    /// Of a new measurement in the table (refreshed_table; 0: never), or of the table beside what is measured at
    /// once.
    #[schemars(range(min = WEIGHT.0, max = WEIGHT.1))]
    pub weight: f64,
    /// together: one table as the mean of both directions; apart: one for each.
    pub directions: Directions,
    /// Whether the thermal part is added too; a table that is measured again holds the screw's growth already.
    pub thermal_part: bool,
    /// Greatest difference between a measurement and what is known that is believed.
    #[schemars(range(min = MEASURED_LIMIT_UM.0, max = MEASURED_LIMIT_UM.1))]
    pub measured_limit_um: f64,
    /// Runs after which a test gives a table.
    #[serde(default = "default_runs")]
    #[schemars(range(min = RUN_LIMITS.0, max = RUN_LIMITS.1))]
    pub runs: u32,
    /// What is left out of a dwell at its begin.
    #[serde(default = "default_settle_s")]
    #[schemars(range(min = SETTLE_S.0, max = SETTLE_S.1))]
    pub settle_s: f64,
    /// Least time averaged at a point.
    #[serde(default = "default_dwell_s")]
    #[schemars(range(min = DWELL_S.0, max = DWELL_S.1))]
    pub dwell_s: f64,
    /// Greatest feed at which is measured while the machine works.
    #[serde(default = "default_measuring_feed_limit_mm_min")]
    #[schemars(range(min = FEED_MM_MIN.0, max = FEED_MM_MIN.1))]
    pub measuring_feed_limit_mm_min: f64,
    /// For how long the speed must have been one before a pass counts, 0: any below the feed limit.
    #[serde(default)]
    #[schemars(range(min = STEADY_S.0, max = STEADY_S.1))]
    pub steady_s: f64,
    /// Whether points that are not passed while the machine works move with those beside them that are.
    #[serde(default)]
    pub unpassed_follow: bool,
    /// The rule of before unpassed_follow: whether the ends move with the outermost point from its sixth pass on.
    #[serde(default)]
    pub ends_follow: bool,
    /// Cycle of the measured loop of weighted_increments.
    #[serde(default = "default_loop_cycle_s")]
    #[schemars(range(min = CYCLE_S.0, max = CYCLE_S.1))]
    pub loop_cycle_s: f64,
    /// Cycles until the scale shows what the loop asked for.
    #[serde(default = "default_loop_delay_cycles")]
    #[schemars(range(min = DELAY_CYCLES.0, max = DELAY_CYCLES.1))]
    pub loop_delay_cycles: u32,
    /// Points of a table to begin with, 10 to 20 mm apart; empty: none until a test gives one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub start_points_mm: Vec<f64>,
    /// Deviations scale minus motor at these points, upwards where directions are apart.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub start_deviations_um: Vec<f64>,
    /// The same downwards; empty: as upwards.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub start_deviations_down_um: Vec<f64>,
}

fn default_runs() -> u32 {
    10
}

fn default_settle_s() -> f64 {
    0.3
}

fn default_dwell_s() -> f64 {
    0.5
}

fn default_measuring_feed_limit_mm_min() -> f64 {
    1000.0
}

fn default_loop_cycle_s() -> f64 {
    0.2
}

fn default_loop_delay_cycles() -> u32 {
    1
}

/// Limits of ω: CN 1562563 A, claim 1, step (1).
pub const WEIGHT: (f64, f64) = (0.0, 0.3);
/// Limits of the number of runs.
pub const RUN_LIMITS: (f64, f64) = (10.0, 20.0);
/// Limits of what is believed, µm.
pub const MEASURED_LIMIT_UM: (f64, f64) = (0.1, 5000.0);
/// Limits of the time left out of a dwell, s.
pub const SETTLE_S: (f64, f64) = (0.0, 60.0);
/// Limits of the time at one speed, s.
pub const STEADY_S: (f64, f64) = (0.0, 10.0);
/// Limits of the time averaged, s.
pub const DWELL_S: (f64, f64) = (0.01, 600.0);
/// Limits of the feed limit, mm/min.
pub const FEED_MM_MIN: (f64, f64) = (1.0, 60000.0);
/// Limits of the measured loop's cycle, s.
pub const CYCLE_S: (f64, f64) = (0.001, 60.0);
/// Limits of its delay, cycles.
pub const DELAY_CYCLES: (f64, f64) = (0.0, 100.0);

impl PositioningConfig {
    /// What becomes of points that are not passed.
    #[must_use]
    pub fn unpassed(&self) -> Unpassed {
        match (self.unpassed_follow, self.ends_follow) {
            (true, _) => Unpassed::Follow,
            (false, true) => Unpassed::EndsFollow,
            (false, false) => Unpassed::Stay,
        }
    }

    /// Checks the loop and the start table; numbers are checked with all parameters.
    ///
    /// # Errors
    /// Names the first that is refused, with value and limits.
    pub fn check(&self, axis: Axis, machine: &MachineFile) -> Result<(), AxisCompensationError> {
        let linear = machine
            .linear(axis)
            .ok_or(AxisCompensationError::NotALinearAxis { axis })?;
        // A table from the parameter file that is never measured again needs no scale.
        let is_fixed = self.reading == Reading::RefreshedTable
            && self.weight <= 0.0
            && !self.start_points_mm.is_empty();
        if linear.scale_resolution_um.is_none() && !is_fixed {
            return Err(AxisCompensationError::NoScale { axis });
        }
        if self.reading == Reading::WeightedIncrements {
            loop_stability::check(axis, self.weight, self.loop_delay_cycles)?;
        }
        self.start_table(axis)?;
        Ok(())
    }

    /// The table to begin with, where there is one.
    ///
    /// # Errors
    /// When it is no table.
    pub fn start_table(&self, axis: Axis) -> Result<Option<DeviationTable>, PositioningRefusal> {
        let lengths = [
            self.start_deviations_um.len(),
            self.start_deviations_down_um.len(),
        ];
        if self.start_points_mm.is_empty() && lengths == [0, 0] {
            return Ok(None);
        }
        let mm = |um: &[f64]| um.iter().map(|um| um * 1e-3).collect::<Vec<_>>();
        let up_mm = mm(&self.start_deviations_um);
        let down_mm = match (lengths, self.directions) {
            ([_, 0], _) => up_mm.clone(),
            (_, Directions::Apart) => mm(&self.start_deviations_down_um),
            (_, Directions::Together) => return Err(PositioningRefusal::DownIsTogether { axis }),
        };
        DeviationTable::new(axis, &self.start_points_mm, &up_mm, &down_mm).map(Some)
    }

    /// As many points as a travel has room for.
    #[must_use]
    pub fn most_points(travel_mm: [f64; 2]) -> usize {
        let [lower_mm, upper_mm] = travel_mm;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a cast from f64 stops at the ends, and no axis is 1 km long"
        )]
        (((upper_mm - lower_mm) / SPACING_MM.0).clamp(0.0, 1e5) as usize + 2)
    }
}
