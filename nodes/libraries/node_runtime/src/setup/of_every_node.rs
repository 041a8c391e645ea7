//! The parameters that the runtime gives to every node.

use std::borrow::Cow;

use metrology::stamp::NANOS_PER_S;
use metrology::{ParameterDoc, Stamp};
use serde::Deserialize;

use super::{Setup, SetupError, Tree, tree};
use crate::clock::{ClockError, HostTime};
use crate::parameter::{Parameter, Value};

/// Whether time comes from `/clock`.
pub(super) const USE_SIM_TIME: &str = "use_sim_time";
/// The host by whose name its clock's map is known.
const CLOCK_HOST: &str = "clock_host";
/// An error that the computer's clock is given.
const CLOCK_ERROR: &str = "clock_error";

/// What the parameters of every node mean, beside those of its own table.
pub const PARAMETERS_OF_EVERY_NODE: [ParameterDoc; 5] = [
    ParameterDoc {
        name: Cow::Borrowed(USE_SIM_TIME),
        unit: Cow::Borrowed(""),
        description: Cow::Borrowed("Whether time comes from /clock."),
        range: None,
    },
    ParameterDoc {
        name: Cow::Borrowed(CLOCK_HOST),
        unit: Cow::Borrowed(""),
        description: Cow::Borrowed(
            "Host by whose map of host_clock/map stamps are taken over to the reference's clock.",
        ),
        range: None,
    },
    ParameterDoc {
        name: Cow::Borrowed("clock_error.offset_s"),
        unit: Cow::Borrowed("s"),
        description: Cow::Borrowed("What this node's clock is made to show too much at since_s"),
        range: Some((-GREATEST_OFFSET_S, GREATEST_OFFSET_S)),
    },
    ParameterDoc {
        name: Cow::Borrowed("clock_error.drift_us_per_s"),
        unit: Cow::Borrowed("µs/s"),
        description: Cow::Borrowed("What this node's clock is made to gain"),
        range: Some((-GREATEST_DRIFT_US_PER_S, GREATEST_DRIFT_US_PER_S)),
    },
    ParameterDoc {
        name: Cow::Borrowed("clock_error.since_s"),
        unit: Cow::Borrowed("s"),
        description: Cow::Borrowed(
            "When its error is offset_s, in seconds since 1970 by the computer's clock",
        ),
        range: Some((-GREATEST_OFFSET_S, GREATEST_OFFSET_S)),
    },
];

/// Greatest error of a clock, s: a century.
const GREATEST_OFFSET_S: f64 = 3.2e9;
/// Greatest drift of a clock, µs/s.
const GREATEST_DRIFT_US_PER_S: f64 = 1e4;

/// What every node is told beside its own parameters.
#[derive(Clone, Debug, Default)]
pub(super) struct OfEveryNode {
    pub use_sim_time: bool,
    pub clock_host: String,
    /// As it was given.
    clock_error: Option<GivenError>,
    pub host_time: HostTime,
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct GivenError {
    offset_s: f64,
    drift_us_per_s: f64,
    since_s: f64,
}

impl OfEveryNode {
    /// Takes them out of a node's parameters.
    pub fn take_from(setup: &mut Setup) -> Result<Self, SetupError> {
        let mut taken = Self::default();
        match setup.parameters.remove(USE_SIM_TIME) {
            None => {}
            Some(Tree::Bool(simulated)) => taken.use_sim_time = simulated,
            Some(other) => {
                return Err(setup.bad(USE_SIM_TIME, &other, "must be true or false".to_owned()));
            }
        }
        match setup.parameters.remove(CLOCK_HOST) {
            None => {}
            Some(Tree::String(host)) => taken.clock_host = host,
            Some(other) => {
                return Err(setup.bad(CLOCK_HOST, &other, "must be the name of a host".to_owned()));
            }
        }
        if let Some(given) = setup.parameters.remove(CLOCK_ERROR) {
            let read = tree::read::<GivenError>(&given)
                .map_err(|error| setup.bad(CLOCK_ERROR, &given, error.reason()))?;
            read.check()
                .map_err(|reason| setup.bad(CLOCK_ERROR, &given, reason))?;
            taken.clock_error = Some(read);
        }
        taken.host_time = HostTime::with_error(taken.clock_error.map(GivenError::inner));
        Ok(taken)
    }

    /// As ROS serves them; those of the clock where they were given.
    pub fn parameters(&self) -> Vec<Parameter> {
        let values = [
            Some(Value::Bool(self.use_sim_time)),
            (!self.clock_host.is_empty()).then(|| Value::String(self.clock_host.clone())),
            self.clock_error.map(|error| Value::Double(error.offset_s)),
            { self.clock_error }.map(|error| Value::Double(error.drift_us_per_s)),
            self.clock_error.map(|error| Value::Double(error.since_s)),
        ];
        let all = PARAMETERS_OF_EVERY_NODE.iter().zip(values);
        all.filter_map(|(doc, value)| {
            Some(Parameter {
                name: doc.name.to_string(),
                value: value?,
                description: super::describe_doc(doc),
                range: None,
            })
        })
        .collect()
    }
}

impl GivenError {
    fn check(self) -> Result<(), String> {
        let within = |name: &str, value: f64, limit: f64| {
            if value.abs() <= limit {
                return Ok(());
            }
            Err(format!("{name} = {value}: must be {} to {limit}", -limit))
        };
        within("offset_s", self.offset_s, GREATEST_OFFSET_S)?;
        within(
            "drift_us_per_s",
            self.drift_us_per_s,
            GREATEST_DRIFT_US_PER_S,
        )?;
        within("since_s", self.since_s, GREATEST_OFFSET_S)
    }

    fn inner(self) -> ClockError {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "at most a century of nanoseconds"
        )]
        let nanos = (self.since_s * NANOS_PER_S as f64) as i64;
        ClockError {
            offset_s: self.offset_s,
            drift: self.drift_us_per_s * 1e-6,
            since: Stamp::from_nanos(nanos),
        }
    }
}
