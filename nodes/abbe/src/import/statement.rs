//! What a map states of the measurement, as the bag of its table carries it.

use super::map::{Map, Test, units};

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
            Test::Log { .. } => vec![],
        };
        let numbers = self.resolution().into_iter().chain(of_motion);
        let numbers = numbers.map(|(key, value)| format!("{key}: {value:?}\n"));
        let keys = match assumed {
            [] => String::new(),
            keys => format!("assumed: [{}]\n", keys.join(", ")),
        };
        let begin = format!("start_s: {}\n", self.start_s);
        begin + &numbers.collect::<String>() + &keys
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
