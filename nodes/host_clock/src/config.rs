//! Parameters of the host clock; keys carry their units, limits are checked once.

use metrology::bound::NAME_BYTES;
use metrology::check_parameters;
use metrology::stamp::Span;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::HostClockError;
use crate::estimate::Rules;

/// What the node is told at its start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HostClockConfig {
    /// Name of the host that this node runs on.
    pub host: String,
    /// Name of the host by whose clock the cell goes; the same: this node answers the others.
    pub reference: String,
    /// Between questions.
    #[serde(default = "period_ms")]
    #[schemars(range(min = 5.0, max = 10_000.0))]
    pub period_ms: f64,
    /// Over how long exchanges are looked at together.
    #[serde(default = "window_s")]
    #[schemars(range(min = 1.0, max = 3600.0))]
    pub window_s: f64,
    /// Exchanges that an estimate needs.
    #[serde(default = "least_exchanges")]
    #[schemars(range(min = 8.0, max = 10_000.0))]
    pub least_exchanges: usize,
    /// Greatest drift between two clocks.
    #[serde(default = "drift_limit_us_per_s")]
    #[schemars(range(min = 0.1, max = 10_000.0))]
    pub drift_limit_us_per_s: f64,
    /// Share of the shortest round trip by which its two ways may differ.
    #[serde(default = "asymmetry_share")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub asymmetry_share: f64,
    /// What three exchanges in a row must contradict the estimate by for a clock to have stepped.
    #[serde(default = "step_limit_us")]
    #[schemars(range(min = 1.0, max = 1e6))]
    pub step_limit_us: f64,
    /// Time without an answer that is reported.
    #[serde(default = "silence_s")]
    #[schemars(range(min = 0.1, max = 3600.0))]
    pub silence_s: f64,
}

const fn period_ms() -> f64 {
    50.0
}
const fn window_s() -> f64 {
    60.0
}
const fn least_exchanges() -> usize {
    20
}
const fn drift_limit_us_per_s() -> f64 {
    200.0
}
const fn asymmetry_share() -> f64 {
    0.2
}
const fn step_limit_us() -> f64 {
    500.0
}
const fn silence_s() -> f64 {
    3.0
}

impl HostClockConfig {
    /// The parameters of `host` in a cell that goes by the clock of `reference`.
    #[must_use]
    pub fn of(host: &str, reference: &str) -> Self {
        Self {
            host: host.to_owned(),
            reference: reference.to_owned(),
            period_ms: period_ms(),
            window_s: window_s(),
            least_exchanges: least_exchanges(),
            drift_limit_us_per_s: drift_limit_us_per_s(),
            asymmetry_share: asymmetry_share(),
            step_limit_us: step_limit_us(),
            silence_s: silence_s(),
        }
    }

    /// Whether this host is the one by which the others go.
    #[must_use]
    pub fn is_reference(&self) -> bool {
        self.host == self.reference
    }

    /// Between questions.
    #[must_use]
    pub fn period(&self) -> Span {
        Span::from_secs_f64(self.period_ms / 1e3)
    }

    /// Checks every value.
    ///
    /// # Errors
    /// A value outside its range, a host without a name, a window that holds too little.
    pub fn check(&self) -> Result<(), HostClockError> {
        for (name, value) in [("host", &self.host), ("reference", &self.reference)] {
            if value.is_empty() {
                return Err(HostClockError::Nameless { name });
            }
            let bytes = value.len();
            if bytes > NAME_BYTES {
                return Err(HostClockError::NameTooLong { name, bytes });
            }
        }
        check_parameters(self)?;
        let holds = self.exchanges();
        if holds < self.least_exchanges {
            return Err(HostClockError::WindowTooShort {
                window_s: self.window_s,
                period_ms: self.period_ms,
                holds,
                least_exchanges: self.least_exchanges,
            });
        }
        Ok(())
    }

    /// Exchanges that the window holds.
    fn exchanges(&self) -> usize {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "both were checked to be positive, and their ratio is at most 720,000"
        )]
        let exchanges = (self.window_s * 1e3 / self.period_ms) as usize;
        exchanges
    }

    pub(crate) fn rules(&self) -> Rules {
        Rules {
            window: Span::from_secs_f64(self.window_s),
            least_exchanges: self.least_exchanges,
            drift_limit: self.drift_limit_us_per_s * 1e-6,
            asymmetry_share: self.asymmetry_share,
            step_limit_s: self.step_limit_us * 1e-6,
        }
    }

    pub(crate) fn silence(&self) -> Span {
        Span::from_secs_f64(self.silence_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(change: impl Fn(&mut HostClockConfig)) -> String {
        let mut config = HostClockConfig::of("models", "controller");
        assert_eq!(config.check(), Ok(()));
        change(&mut config);
        config.check().unwrap_err().to_string()
    }

    #[test]
    fn values_that_cannot_work_are_refused_by_name() {
        assert_eq!(
            refused(|config| config.host.clear()),
            "host is empty: must be the name of a host"
        );
        assert_eq!(
            refused(|config| config.reference = "b".repeat(256)),
            "reference: 256 bytes of text: at most 255"
        );
        assert_eq!(
            refused(|config| config.host = "ü".repeat(200)),
            "host: 400 bytes of text: at most 255"
        );
        assert_eq!(
            refused(|config| config.asymmetry_share = 1.5),
            "asymmetry_share = 1.5: must be from 0 to 1"
        );
        assert_eq!(
            refused(|config| config.period_ms = f64::NAN),
            "period_ms = NaN ms: must be from 5 to 10000 ms"
        );
        assert_eq!(
            refused(|config| config.period_ms = 9000.0),
            "window_s = 60: holds 6 exchanges at period_ms = 9000, least_exchanges = 20 are needed"
        );
    }

    #[test]
    fn a_file_without_names_or_with_an_unknown_key_is_refused() {
        let read = |yaml: &str| serde_saphyr::from_str::<HostClockConfig>(yaml);
        let whole = read("host: models\nreference: controller").unwrap();
        assert_eq!(whole, HostClockConfig::of("models", "controller"));
        assert!(read("host: models").is_err());
        assert!(read("host: a\nreference: b\nperiod_s: 1").is_err());
    }
}
