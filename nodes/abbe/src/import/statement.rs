//! What a map states of the measurement, as the bag of its table carries it.

use anyhow::{Result, bail};

use super::map::{Map, Test, units};

/// Longest time between two samples, ms: an hour.
const LONGEST_PERIOD_MS: f64 = 3_600_000.0;

impl Map {
    /// What the map states of the measurement, as a bag carries it (`params/import.yaml`); `assumed`: keys whose values nobody
    /// stated.
    pub fn statement(&self, assumed: &[String]) -> String {
        let of_motion: Vec<(&str, f64)> = match &self.test {
            Test::Positioning {
                axis,
                feed_mm_min,
                dwell_s,
                ..
            } => {
                let [feed, _] = units(*axis).keys;
                vec![(feed, *feed_mm_min), ("dwell_s", *dwell_s)]
            }
            Test::Circle { feed_mm_min, .. } => vec![("feed_mm_min", *feed_mm_min)],
            Test::Log { .. } | Test::Touches { .. } => vec![],
        };
        let times = match &self.test {
            Test::Touches { time_s: None, .. } => "touch_times: made_up\n",
            _ => "",
        };
        let numbers = self.resolution().into_iter().chain(of_motion);
        let numbers = numbers.map(|(key, value)| format!("{key}: {value:?}\n"));
        let keys = match assumed {
            [] => String::new(),
            keys => format!("assumed: [{}]\n", keys.join(", ")),
        };
        let begin = format!("start_s: {}\n", self.start_s);
        begin + &numbers.collect::<String>() + times + &keys
    }

    /// The period of numbered samples is one, and their numbers have no unit.
    pub(super) fn check_period(&self) -> Result<()> {
        let Test::Log {
            time_s,
            period_ms: Some(period_ms),
            ..
        } = &self.test
        else {
            return Ok(());
        };
        if !(*period_ms > 0.0 && *period_ms <= LONGEST_PERIOD_MS) {
            bail!(
                "test.log.period_ms = {period_ms}: must be more than 0 and at most {LONGEST_PERIOD_MS} ms"
            );
        }
        if self.units.contains_key(time_s) {
            bail!(
                "test.log.period_ms: the column \"{time_s}\" numbers samples, and units states its unit: remove one of them"
            );
        }
        Ok(())
    }

    /// The instrument's resolution with its key, where the map states it.
    pub(super) fn resolution(&self) -> Option<(&'static str, f64)> {
        let is_angle = match &self.test {
            Test::Positioning { axis, .. } => !axis.is_linear(),
            _ => false,
        };
        let key = if is_angle {
            "resolution_arcsec"
        } else {
            "resolution_um"
        };
        self.resolution_um.map(|value| (key, value))
    }
}
