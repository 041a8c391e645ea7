//! What is played of a bag, and how: the node's parameters.

use metrology::check_parameters;
use metrology::stamp::Span;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::PlaybackError;

/// The parameter file of the node that plays.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlaybackConfig {
    /// Folder of the bag, or one file of it, relative to where the program was started.
    pub bag: String,
    /// Absolute names of topics to publish; * stands for any run of characters.
    #[serde(default = "PlaybackConfig::every_topic")]
    pub topics: Vec<String>,
    /// Time of the bag over time, from 0.001 on; 0: as fast as subscribers acknowledge.
    #[serde(default = "PlaybackConfig::default_rate")]
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub rate: f64,
    /// Messages before this are left out, from the bag's first message; of latched topics the last ones are sent
    /// first.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = LONGEST_S))]
    pub from_s: f64,
    /// Messages after this are left out, from the bag's first message; absent: to the end.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = LONGEST_S))]
    pub to_s: Option<f64>,
    /// Begin again at the end.
    #[serde(default)]
    pub repeat: bool,
    /// Wait for replayer/resume or replayer/step before the first message.
    #[serde(default)]
    pub start_paused: bool,
    /// Time for subscribers to find the topics before the first message.
    #[serde(default = "PlaybackConfig::default_delay_s")]
    #[schemars(range(min = 0.0, max = 60.0))]
    pub delay_s: f64,
    /// Publish /clock with the bag's time; a recorded /clock is left out then.
    #[serde(default = "PlaybackConfig::default_clock")]
    pub clock: bool,
    /// Play also where other nodes publish the same topics, or a controller follows the bag's offsets.
    #[serde(default)]
    pub onto_a_running_graph: bool,
}

/// Longest way into a bag, s: from a first message that was recorded before the clock was set to any later one.
const LONGEST_S: f64 = 9e9;

/// Least rate above 0: slower, a second of the bag takes a quarter of an hour.
const LEAST_RATE: f64 = 1e-3;

/// Checked settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Playback {
    /// Time of the bag over time; none: as fast as subscribers acknowledge.
    pub rate: Option<f64>,
    /// First time that is played, from the bag's first message.
    pub from: Span,
    /// Last time that is played.
    pub to: Option<Span>,
    /// Time for subscribers to find the topics.
    pub delay: Span,
}

impl PlaybackConfig {
    fn every_topic() -> Vec<String> {
        vec!["*".to_owned()]
    }

    const fn default_rate() -> f64 {
        1.0
    }

    const fn default_delay_s() -> f64 {
        0.5
    }

    const fn default_clock() -> bool {
        true
    }

    /// The whole of a bag at its own rate.
    #[must_use]
    pub fn whole(bag: String) -> Self {
        Self {
            bag,
            topics: Self::every_topic(),
            rate: Self::default_rate(),
            from_s: 0.0,
            to_s: None,
            repeat: false,
            start_paused: false,
            delay_s: Self::default_delay_s(),
            clock: Self::default_clock(),
            onto_a_running_graph: false,
        }
    }

    /// Checks every value once.
    ///
    /// # Errors
    /// A value out of its range, or a range of time that holds nothing.
    pub fn checked(&self) -> Result<Playback, PlaybackError> {
        check_parameters(self)?;
        let (from_s, to_s) = (self.from_s, self.to_s);
        if let Some(to_s) = to_s
            && to_s < from_s
        {
            return Err(PlaybackError::EmptyRange { from_s, to_s });
        }
        let rate = self.rate;
        if rate > 0.0 && rate < LEAST_RATE {
            return Err(PlaybackError::Slow {
                rate,
                least: LEAST_RATE,
            });
        }
        Ok(Playback {
            rate: (rate > 0.0).then_some(rate),
            from: Span::from_secs_f64(from_s),
            to: to_s.map(Span::from_secs_f64),
            delay: Span::from_secs_f64(self.delay_s),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_out_of_range_are_refused_by_name_value_and_limit() {
        let with = |change: fn(&mut PlaybackConfig)| {
            let mut config = PlaybackConfig::whole("bag".to_owned());
            change(&mut config);
            config.checked().unwrap_err().to_string()
        };
        assert_eq!(with(|c| c.rate = -1.0), "rate = -1: must be from 0 to 1000");
        assert_eq!(
            with(|c| c.rate = f64::NAN),
            "rate = NaN: must be from 0 to 1000"
        );
        for rate in [1e-300, 1e-9, 9.9e-4] {
            let mut config = PlaybackConfig::whole("bag".to_owned());
            config.rate = rate;
            let shown = config.checked().unwrap_err().to_string();
            assert!(shown.ends_with(": must be 0, or 0.001 to 1000"), "{shown}");
        }
        let text = with(|c| (c.from_s, c.to_s) = (5.0, Some(4.0)));
        assert_eq!(
            text,
            "to_s = 4 s is before from_s = 5 s: nothing would be played"
        );
        let whole = PlaybackConfig {
            rate: 0.0,
            ..PlaybackConfig::whole("bag".to_owned())
        };
        assert_eq!(whole.checked().unwrap().rate, None);
    }
}
