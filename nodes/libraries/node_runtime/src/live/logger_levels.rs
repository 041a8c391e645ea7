//! The services for a node's log level, as a C++ node with `enable_logger_service` has them.
//!
//! A node has one logger, called after it; a level that is set holds for its lines on the console and
//! on `/rosout`, until it is set to unknown, which takes it back.

use abbe_msgs::rcl_interfaces::msg::{LoggerLevel, SetLoggerLevelsResult};
use abbe_msgs::rcl_interfaces::srv::{
    GetLoggerLevels, GetLoggerLevelsRequest, GetLoggerLevelsResponse, SetLoggerLevels,
    SetLoggerLevelsRequest, SetLoggerLevelsResponse,
};
use abbe_msgs::{Service, WireError, from_cdr, to_cdr};

use super::service::shared;
use crate::log::{self, Severity};
use crate::node::Bytes;

/// One of the two services.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LoggerService {
    Get,
    Set,
}

impl LoggerService {
    /// Each with its name below the node and its type.
    pub const ALL: [(Self, &'static str, &'static str); 2] = [
        (Self::Get, "~/get_logger_levels", GetLoggerLevels::TYPE_NAME),
        (Self::Set, "~/set_logger_levels", SetLoggerLevels::TYPE_NAME),
    ];

    /// The answer of the node that is called `node`, in whose span this runs.
    ///
    /// # Errors
    /// When the request is malformed.
    pub fn answer(self, node: &str, bytes: &[u8]) -> Result<Bytes, WireError> {
        let own = log::logger(node);
        let answer = match self {
            Self::Get => {
                let GetLoggerLevelsRequest { names } = from_cdr(bytes)?;
                let levels = names.into_iter().map(|name| told(&own, name)).collect();
                to_cdr(&GetLoggerLevelsResponse { levels })
            }
            Self::Set => {
                let SetLoggerLevelsRequest { levels } = from_cdr(bytes)?;
                let results = levels.iter().map(|wanted| set(&own, wanted)).collect();
                to_cdr(&SetLoggerLevelsResponse { results })
            }
        };
        Ok(shared(&answer))
    }
}

fn told(own: &str, name: String) -> LoggerLevel {
    let chosen = (name == own).then(log::chosen).flatten();
    let level = chosen.map_or(u32::from(LoggerLevel::LOG_LEVEL_UNKNOWN), |level| {
        u32::from(level.number())
    });
    LoggerLevel { name, level }
}

fn set(own: &str, wanted: &LoggerLevel) -> SetLoggerLevelsResult {
    let LoggerLevel { name, level } = wanted;
    let reason = if name != own {
        format!("logger `{name}` is none of this node's, which is `{own}`")
    } else if *level == u32::from(LoggerLevel::LOG_LEVEL_UNKNOWN) {
        refusal(log::choose(None))
    } else {
        match Severity::of_number(*level) {
            Some(severity) => refusal(log::choose(Some(severity))),
            None => format!("log level {level}: must be 0, 10, 20, 30, 40 or 50"),
        }
    };
    SetLoggerLevelsResult {
        successful: reason.is_empty(),
        reason,
    }
}

fn refusal(is_set: bool) -> String {
    if is_set {
        String::new()
    } else {
        "this program logs in its own way, without levels per node".to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn level(name: &str, level: u32) -> LoggerLevel {
        let name = name.to_owned();
        LoggerLevel { name, level }
    }

    fn reasons(levels: Vec<LoggerLevel>) -> Vec<String> {
        let request = to_cdr(&SetLoggerLevelsRequest { levels });
        let answer = LoggerService::Set.answer("/mill/probe", &request).unwrap();
        let response: SetLoggerLevelsResponse = from_cdr(&answer).unwrap();
        let reasons = response.results.into_iter();
        reasons
            .inspect(|result| assert_eq!(result.successful, result.reason.is_empty()))
            .map(|result| result.reason)
            .collect()
    }

    #[test]
    fn other_loggers_and_unknown_levels_are_refused_with_the_reason() {
        let wanted = vec![level("probe", 10), level("mill.probe", 11)];
        assert_eq!(
            reasons(wanted),
            [
                "logger `probe` is none of this node's, which is `mill.probe`",
                "log level 11: must be 0, 10, 20, 30, 40 or 50",
            ]
        );
    }

    #[test]
    fn a_logger_that_nobody_set_has_no_level() {
        let names = vec!["mill.probe".to_owned(), "probe".to_owned()];
        let request = to_cdr(&GetLoggerLevelsRequest { names });
        let answer = LoggerService::Get.answer("/mill/probe", &request).unwrap();
        let response: GetLoggerLevelsResponse = from_cdr(&answer).unwrap();
        assert_eq!(response.levels, [level("mill.probe", 0), level("probe", 0)]);
    }
}
