//! What can go wrong before or beneath the stage.

use metrology::bound::BoundError;
use metrology::number::number;

/// Errors of the bridge: its parameters, its mapping, and its thread.
#[derive(Debug, thiserror::Error)]
pub enum BridgeError {
    /// A parameter outside its limits.
    #[error(transparent)]
    Parameter(#[from] BoundError),
    /// A word that goes over the wire would break the line.
    #[error("{key} = {value:?}: must be one word without white space")]
    NotAWord {
        /// Key in the parameter file.
        key: &'static str,
        /// What was read.
        value: String,
    },
    /// A log without the source, or the source without a log.
    #[error("log_file: belongs to source = log, and to no other")]
    LogFile,
    /// The mapping file cannot be read as a mapping, or contradicts itself.
    #[error(transparent)]
    Mapping(#[from] machine_report::MappingError),
    /// The system has no thread or event queue left.
    #[error("{action}: {source}")]
    Io {
        /// What was tried.
        action: &'static str,
        /// The system's word.
        source: std::io::Error,
    },
    /// An agent could not be asked.
    #[error("{url}: {reason}")]
    Ask {
        /// Where.
        url: String,
        /// Why.
        reason: String,
    },
    /// An agent has several devices.
    #[error("the agent has {} devices: choose one by --device: {}", .names.len(), .names.join(", "))]
    Devices {
        /// Their names.
        names: Vec<String>,
    },
    /// An agent has no such device.
    #[error("the agent has no device {name:?}: it has {}", .names.join(", "))]
    NoDevice {
        /// The name.
        name: String,
        /// Those that it has.
        names: Vec<String>,
    },
    /// Several devices of an agent share a name.
    #[error(
        "the agent has {count} devices {name:?}: give each a name of its own in the agent's device file"
    )]
    DeviceTwice {
        /// The name.
        name: String,
        /// How many have it.
        count: usize,
    },
    /// Data items share an id.
    #[error("data items with one id, whose values cannot be kept apart: {}; correct the agent's device file", .ids.join("; "))]
    IdTwice {
        /// Each id with its items.
        ids: Vec<String>,
    },
    /// The mapping has no such spindle.
    #[error(
        "the mapping has no spindle speed {name:?}: give one that name, or name another as spindle in the order"
    )]
    NoSpindle {
        /// Its name.
        name: String,
    },
    /// The log never says how fast the spindle turns.
    #[error(
        "spindle \"{name}\": the log has no speed of it from {from} to {to} (UTC): correct its key in the mapping, or take another range; {account}"
    )]
    SilentSpindle {
        /// Its name.
        name: String,
        /// First instant that was asked for.
        from: String,
        /// Last one.
        to: String,
        /// What of the log was taken and left out.
        account: String,
    },
    /// The log has no value within the shift.
    #[error(
        "the order asks for {from} to {to}, and nothing of the log lies within (all times in UTC): {reason}; {account}"
    )]
    NothingWithin {
        /// First instant that was asked for.
        from: String,
        /// Last instant.
        to: String,
        /// Why, and what to do.
        reason: String,
        /// What was taken and left out.
        account: String,
    },
    /// A part of a shift is too fast for the other machine.
    #[error(
        "at {} s: feed {feed_mm_min:.0} mm/min, limit {limit_mm_min:.0} mm/min: take longer bins",
        number(*at_s)
    )]
    FeedTooHigh {
        /// Time from the shift's begin, s.
        at_s: f64,
        /// The feed.
        feed_mm_min: f64,
        /// The limit.
        limit_mm_min: f64,
    },
    /// A part of a shift turns the spindle faster than the other machine can.
    #[error(
        "at {} s: S{rpm}, limit {} 1/min (spindle.max_speed_rpm of the machine file; 0: it has no spindle): correct the log or the unit in the mapping, or take another range",
        number(*at_s), number(*limit_rpm)
    )]
    SpindleTooFast {
        /// Time from the shift's begin, s.
        at_s: f64,
        /// The speed, 1/min.
        rpm: i64,
        /// The limit, 1/min.
        limit_rpm: f64,
    },
    /// More lines than programs may have.
    #[error(
        "the travels of the log need {lines:.0} lines within the windows of the order, limit {limit}: widen the windows or shorten the range"
    )]
    TooManyLines {
        /// Lines of all programs.
        lines: f64,
        /// The limit.
        limit: u32,
    },
}
