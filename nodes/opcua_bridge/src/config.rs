//! Parameters of the node, and their checked form.

use machine_report::{MapFile, Mapping};
use metrology::stamp::Span;
use metrology::{check_between, check_parameters};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::BridgeError;
use crate::node_key::NodeKey;

/// Longest time between attempts to connect, s: a day.
const LONGEST_RECONNECT_S: f64 = 86_400.0;

/// Parameters of the node.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BridgeConfig {
    /// URL of the server: `opc.tcp://HOST:PORT`.
    pub endpoint: String,
    /// What each node is, relative to the parameter file; or `ready:cnc`, `ready:machine_tool`, `ready:machinery`.
    pub map_file: String,
    /// How the connection is secured.
    #[serde(default)]
    pub security: SecurityConfig,
    /// What the server is asked to send.
    #[serde(default)]
    pub subscription: SubscriptionConfig,
    /// Times of the connection.
    #[serde(default)]
    pub connection: ConnectionConfig,
}

/// Security of the connection.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Mode {
    /// Everybody on the wire can read and change.
    #[default]
    None,
    /// Nobody can change.
    Sign,
    /// Nobody can read or change.
    SignAndEncrypt,
}

impl Mode {
    /// The word in the parameter file.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Sign => "sign",
            Self::SignAndEncrypt => "sign_and_encrypt",
        }
    }
}

/// Cryptography of a secured connection; those that OPC UA has withdrawn are not here.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Policy {
    /// `Basic256Sha256`.
    #[default]
    Basic256Sha256,
    /// `Aes128_Sha256_RsaOaep`.
    #[serde(rename = "Aes128-Sha256-RsaOaep")]
    Aes128Sha256RsaOaep,
    /// `Aes256_Sha256_RsaPss`.
    #[serde(rename = "Aes256-Sha256-RsaPss")]
    Aes256Sha256RsaPss,
}

/// How the connection is secured.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SecurityConfig {
    /// `none`, `sign` or `sign_and_encrypt`; an endpoint with less is refused.
    pub mode: Mode,
    /// `Basic256Sha256`, `Aes128-Sha256-RsaOaep` or `Aes256-Sha256-RsaPss`, for every mode but `none`.
    pub policy: Policy,
    /// Folder of the certificates (own, private, trusted, rejected), relative to the parameter file; an own certificate
    /// is made where there is none.
    pub pki_folder: String,
    /// User name; empty: anonymous.
    pub user: String,
    /// File that holds the user's password, relative to the parameter file.
    pub password_file: String,
}

/// What the server is asked to send.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SubscriptionConfig {
    /// The server is asked to look at each node this often.
    #[schemars(range(min = 0.0, max = 60_000.0))]
    pub sampling_ms: u32,
    /// The server is asked to send what has changed this often.
    #[schemars(range(min = 10.0, max = 60_000.0))]
    pub publishing_ms: u32,
    /// Changes of a node that the server keeps between two sendings.
    #[schemars(range(min = 1.0, max = 10_000.0))]
    pub queue: u32,
}

impl Default for SubscriptionConfig {
    fn default() -> Self {
        Self {
            sampling_ms: 100,
            publishing_ms: 100,
            queue: 100,
        }
    }
}

/// Times of the connection.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ConnectionConfig {
    /// Time to the second attempt to connect; each further one waits twice as long.
    #[schemars(range(min = 0.05, max = 3600.0))]
    pub reconnect_first_s: f64,
    /// Longest time between attempts.
    #[schemars(range(min = 0.05, max = LONGEST_RECONNECT_S))]
    pub reconnect_longest_s: f64,
    /// A later answer counts as missing.
    #[schemars(range(min = 0.1, max = 3600.0))]
    pub reply_timeout_s: f64,
    /// The server is asked this often whether it runs; two answers missing end the connection.
    #[schemars(range(min = 0.1, max = 3600.0))]
    pub keep_alive_s: f64,
    /// The server is asked to keep the session and what was not received so long after a break.
    #[schemars(range(min = 1.0, max = 3600.0))]
    pub session_s: f64,
}

impl Default for ConnectionConfig {
    fn default() -> Self {
        Self {
            reconnect_first_s: 0.5,
            reconnect_longest_s: 30.0,
            reply_timeout_s: 10.0,
            keep_alive_s: 5.0,
            session_s: 60.0,
        }
    }
}

/// One node that is subscribed to.
#[derive(Clone, Debug, PartialEq)]
pub struct Item {
    /// Key of the mapping, as it stands there.
    pub key: String,
    /// Which node.
    pub node: NodeKey,
}

/// Checked settings in inner units.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// URL of the server.
    pub endpoint: String,
    /// What each key is.
    pub mapping: Mapping,
    /// The nodes that are subscribed to, in order; ignored keys are not among them.
    pub items: Vec<Item>,
    /// How the connection is secured.
    pub security: SecurityConfig,
    /// What the server is asked to send.
    pub subscription: SubscriptionConfig,
    /// Time to the second attempt.
    pub reconnect_first: Span,
    /// Longest time between attempts.
    pub reconnect_longest: Span,
    /// A later answer counts as missing.
    pub reply_timeout: Span,
    /// Time between two questions whether the server runs.
    pub keep_alive: Span,
    /// So long a session outlives a break.
    pub session: Span,
}

/// A URL of the binary protocol.
///
/// # Errors
/// When the text is no such URL.
pub fn checked_endpoint(endpoint: &str) -> Result<String, BridgeError> {
    let rest = endpoint.strip_prefix("opc.tcp://");
    let place = rest.map(|rest| rest.split('/').next().unwrap_or_default());
    let is_port = |port: &str| port.parse::<u16>().is_ok_and(|port| port > 0);
    let is_place = place.is_some_and(|place| match place.rsplit_once(':') {
        // The colons of [::1] are no port's.
        Some((host, port)) if !port.ends_with(']') => !host.is_empty() && is_port(port),
        _ => !place.is_empty(),
    });
    let is_word = endpoint.bytes().all(|byte| byte.is_ascii_graphic());
    let has_user = place.is_some_and(|place| place.contains('@'));
    let is_url = is_place && is_word && endpoint.len() <= 4096;
    if let Some((_, host)) = endpoint.rsplit_once('@')
        && (has_user || !is_url)
    {
        let host = host.to_owned();
        return Err(BridgeError::UserInEndpoint { host });
    }
    if is_url {
        Ok(endpoint.to_owned())
    } else {
        let endpoint = endpoint.to_owned();
        Err(BridgeError::Endpoint { endpoint })
    }
}

impl SecurityConfig {
    fn check(&self) -> Result<(), BridgeError> {
        if self.mode != Mode::None && self.pki_folder.is_empty() {
            let mode = self.mode.word();
            return Err(BridgeError::NoPki { mode });
        }
        if self.user.is_empty() != self.password_file.is_empty() {
            return Err(BridgeError::HalfUser);
        }
        if self.mode == Mode::None && !self.user.is_empty() {
            let user = self.user.clone();
            return Err(BridgeError::ReadablePassword { user });
        }
        Ok(())
    }
}

fn items(mapping: &Mapping) -> Result<Vec<Item>, BridgeError> {
    let mut items = Vec::new();
    for (key, used) in mapping.uses() {
        let node = NodeKey::read(key).map_err(|flaw| BridgeError::Key {
            key: key.to_owned(),
            flaw,
        })?;
        if *used != machine_report::mapping::Use::Nothing {
            let key = key.to_owned();
            items.push(Item { key, node });
        }
    }
    Ok(items)
}

impl Settings {
    /// Checks a configuration.
    ///
    /// # Errors
    /// Values out of range, an endpoint that is no address, a password that could be read, a key that is no node, or a mapping
    /// that contradicts itself.
    pub fn new(config: &BridgeConfig, map: &MapFile) -> Result<Self, BridgeError> {
        let connection = &config.connection;
        check_parameters(config)?;
        let (first_s, longest_s) = (connection.reconnect_first_s, connection.reconnect_longest_s);
        let of_longest = (first_s, LONGEST_RECONNECT_S);
        check_between("connection.reconnect_longest_s", longest_s, of_longest)?;
        config.security.check()?;
        let mapping = Mapping::new(map)?;
        Ok(Self {
            endpoint: checked_endpoint(&config.endpoint)?,
            items: items(&mapping)?,
            mapping,
            security: config.security.clone(),
            subscription: config.subscription.clone(),
            reconnect_first: Span::from_secs_f64(first_s),
            reconnect_longest: Span::from_secs_f64(longest_s),
            reply_timeout: Span::from_secs_f64(connection.reply_timeout_s),
            keep_alive: Span::from_secs_f64(connection.keep_alive_s),
            session: Span::from_secs_f64(connection.session_s),
        })
    }
}
