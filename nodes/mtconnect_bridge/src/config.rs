//! Parameters of the bridge, as a person writes them, and the settings that follow from them.

use metrology::stamp::Span;
use serde::{Deserialize, Serialize};

use crate::error::BridgeError;
use crate::mapping::{MapFile, Mapping};
use crate::parameters::PARAMETERS;

/// The parameter file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BridgeConfig {
    /// Who speaks.
    pub source: Source,
    /// Where the adapter or agent listens.
    #[serde(default = "BridgeConfig::default_host")]
    pub host: String,
    /// Its TCP port.
    #[serde(default = "BridgeConfig::default_port")]
    pub port: u16,
    /// Lines of an adapter that were logged, relative to the parameter file; for the source `log` alone.
    #[serde(default)]
    pub log_file: Option<String>,
    /// A longer pause in a log is a leap of the machine's clock.
    #[serde(default = "BridgeConfig::default_longest_pause_s")]
    pub log_longest_pause_s: f64,
    /// What each key is, relative to the parameter file.
    pub map_file: String,
    /// Times and limits of the connection.
    #[serde(default)]
    pub connection: ConnectionConfig,
    /// What an agent is asked.
    #[serde(default)]
    pub agent: AgentConfig,
}

/// Who speaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// An adapter, in lines over TCP.
    Shdr,
    /// An agent, in XML over HTTP.
    Agent,
    /// A file of an adapter's lines, told at its own pace.
    Log,
}

impl BridgeConfig {
    fn default_host() -> String {
        "127.0.0.1".to_owned()
    }

    const fn default_port() -> u16 {
        7878
    }

    /// Half a day: longer than a night shift's break, shorter than a day's step of a clock.
    #[must_use]
    pub const fn default_longest_pause_s() -> f64 {
        43_200.0
    }
}

/// Times and limits of the connection.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ConnectionConfig {
    /// Time to the second attempt to connect; each further one waits twice as long.
    pub reconnect_first_s: f64,
    /// Longest time between attempts.
    pub reconnect_longest_s: f64,
    /// An answer later than this ends the connection.
    pub reply_timeout_s: f64,
    /// A longer line of an adapter is refused.
    pub line_limit_bytes: u32,
}

impl Default for ConnectionConfig {
    fn default() -> Self {
        Self {
            reconnect_first_s: 0.5,
            reconnect_longest_s: 30.0,
            reply_timeout_s: 10.0,
            line_limit_bytes: 65536,
        }
    }
}

/// What an agent is asked.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AgentConfig {
    /// Device among those of the agent; empty: all.
    pub device: String,
    /// Least time between two parts of its stream.
    pub interval_ms: u32,
    /// The agent says at least this often that it lives.
    pub heartbeat_ms: u32,
    /// Observations in one part at most.
    pub count: u32,
}

impl Default for AgentConfig {
    fn default() -> Self {
        Self {
            device: String::new(),
            interval_ms: 100,
            heartbeat_ms: 2000,
            count: 1000,
        }
    }
}

/// Checked settings in inner units.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Who speaks.
    pub source: Source,
    /// `host:port`.
    pub address: String,
    /// A longer pause in a log is a leap of the machine's clock.
    pub longest_pause: Span,
    /// What each key is.
    pub mapping: Mapping,
    /// Time to the second attempt.
    pub reconnect_first: Span,
    /// Longest time between attempts.
    pub reconnect_longest: Span,
    /// An answer later than this ends the connection.
    pub reply_timeout: Span,
    /// A longer line is refused, bytes.
    pub line_limit: usize,
    /// What an agent is asked.
    pub agent: AgentConfig,
}

/// A number within the range that [`PARAMETERS`] states for it.
fn checked(key: &'static str, value: f64) -> Result<f64, BridgeError> {
    let doc = PARAMETERS.iter().find(|doc| doc.name == key);
    let (least, greatest) = doc
        .and_then(|doc| doc.range)
        .expect("every number of the configuration has a range in the table");
    if value >= least && value <= greatest {
        Ok(value)
    } else {
        Err(BridgeError::OutOfRange {
            key,
            value,
            least,
            greatest,
        })
    }
}

fn word(key: &'static str, value: &str) -> Result<(), BridgeError> {
    let is_word = |c: char| c.is_ascii_alphanumeric() || "._-:[]%".contains(c);
    if value.chars().all(is_word) {
        return Ok(());
    }
    Err(BridgeError::NotAWord {
        key,
        value: value.to_owned(),
    })
}

impl Settings {
    /// Checks a configuration.
    ///
    /// # Errors
    /// Values out of range, or a mapping that contradicts itself.
    pub fn new(config: &BridgeConfig, map: &MapFile) -> Result<Self, BridgeError> {
        let connection = &config.connection;
        let first_s = checked("connection.reconnect_first_s", connection.reconnect_first_s)?;
        let longest_s = checked(
            "connection.reconnect_longest_s",
            connection.reconnect_longest_s,
        )?;
        if longest_s < first_s {
            return Err(BridgeError::OutOfRange {
                key: "connection.reconnect_longest_s",
                value: longest_s,
                least: first_s,
                greatest: 86_400.0,
            });
        }
        let timeout_s = checked("connection.reply_timeout_s", connection.reply_timeout_s)?;
        checked(
            "connection.line_limit_bytes",
            f64::from(connection.line_limit_bytes),
        )?;
        checked("agent.interval_ms", f64::from(config.agent.interval_ms))?;
        checked("agent.heartbeat_ms", f64::from(config.agent.heartbeat_ms))?;
        checked("agent.count", f64::from(config.agent.count))?;
        checked("port", f64::from(config.port))?;
        if (config.source == Source::Log) != config.log_file.is_some() {
            return Err(BridgeError::LogFile);
        }
        word("host", &config.host)?;
        word("agent.device", &config.agent.device)?;
        Ok(Self {
            source: config.source,
            address: format!("{}:{}", config.host, config.port),
            longest_pause: Span::from_secs_f64(checked(
                "log_longest_pause_s",
                config.log_longest_pause_s,
            )?),
            mapping: Mapping::new(map)?,
            reconnect_first: Span::from_secs_f64(first_s),
            reconnect_longest: Span::from_secs_f64(longest_s),
            reply_timeout: Span::from_secs_f64(timeout_s),
            line_limit: connection.line_limit_bytes as usize,
            agent: config.agent.clone(),
        })
    }
}
