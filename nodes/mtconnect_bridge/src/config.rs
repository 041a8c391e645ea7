//! Parameters of the bridge, as a person writes them, and the settings that follow from them.

use metrology::stamp::Span;
use metrology::{check_between, check_parameters};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::BridgeError;
use crate::mapping::{MapFile, Mapping};

/// Longest time between attempts to connect, s: a day.
const LONGEST_RECONNECT_S: f64 = 86_400.0;

/// The parameter file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BridgeConfig {
    /// shdr: an adapter, in lines over TCP; agent: an agent, in XML over HTTP; log: a file of an adapter's lines,
    /// told at its own pace.
    pub source: Source,
    /// Where the adapter or agent listens.
    #[serde(default = "BridgeConfig::default_host")]
    pub host: String,
    /// TCP port of the adapter (often 7878) or agent (often 5000).
    #[serde(default = "BridgeConfig::default_port")]
    #[schemars(range(min = 1.0, max = 65535.0))]
    pub port: u16,
    /// Lines of an adapter that were logged, relative to the parameter file; for the source log alone.
    #[serde(default)]
    pub log_file: Option<String>,
    /// A longer pause in a log is taken for a leap of the machine's clock: it is said, and the lines go on without
    /// it.
    #[serde(default = "BridgeConfig::default_longest_pause_s")]
    #[schemars(range(min = 60.0, max = 31_622_400.0))]
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
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ConnectionConfig {
    /// Time to the second attempt to connect; each further one waits twice as long.
    #[schemars(range(min = 0.05, max = 3600.0))]
    pub reconnect_first_s: f64,
    /// Longest time between attempts.
    #[schemars(range(min = 0.05, max = LONGEST_RECONNECT_S))]
    pub reconnect_longest_s: f64,
    /// An answer of an agent later than this ends the connection.
    #[schemars(range(min = 0.1, max = 3600.0))]
    pub reply_timeout_s: f64,
    /// A longer line of an adapter is refused, with its length.
    #[schemars(range(min = 64.0, max = 16777216.0))]
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AgentConfig {
    /// Device among those of the agent; empty: all.
    pub device: String,
    /// Least time between two parts of its stream.
    #[schemars(range(min = 0.0, max = 60000.0))]
    pub interval_ms: u32,
    /// The agent says at least this often that it lives; twice as long and a second without a word ends the
    /// connection.
    #[schemars(range(min = 10.0, max = 600000.0))]
    pub heartbeat_ms: u32,
    /// Observations in one part at most.
    #[schemars(range(min = 1.0, max = 100000.0))]
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
        check_parameters(config)?;
        let (first_s, longest_s) = (connection.reconnect_first_s, connection.reconnect_longest_s);
        let of_longest = (first_s, LONGEST_RECONNECT_S);
        check_between("connection.reconnect_longest_s", longest_s, of_longest)?;
        if (config.source == Source::Log) != config.log_file.is_some() {
            return Err(BridgeError::LogFile);
        }
        word("host", &config.host)?;
        word("agent.device", &config.agent.device)?;
        Ok(Self {
            source: config.source,
            address: format!("{}:{}", config.host, config.port),
            longest_pause: Span::from_secs_f64(config.log_longest_pause_s),
            mapping: Mapping::new(map)?,
            reconnect_first: Span::from_secs_f64(first_s),
            reconnect_longest: Span::from_secs_f64(longest_s),
            reply_timeout: Span::from_secs_f64(connection.reply_timeout_s),
            line_limit: connection.line_limit_bytes as usize,
            agent: config.agent.clone(),
        })
    }
}
