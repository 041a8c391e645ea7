//! Parameters of the node, and their checked form.

use machine_report::{MapFile, Mapping};
use metrology::stamp::Span;
use serde::{Deserialize, Serialize};

use crate::error::BridgeError;
use crate::node_key::NodeKey;
use crate::parameters::PARAMETERS;

/// Parameters of the node.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BridgeConfig {
    /// URL of the server.
    pub endpoint: String,
    /// What each node is, a path relative to the parameter file, or a ready mapping.
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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
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
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SecurityConfig {
    /// Signed, encrypted, or neither.
    pub mode: Mode,
    /// Cryptography.
    pub policy: Policy,
    /// Folder of the certificates.
    pub pki_folder: String,
    /// User name; empty: anonymous.
    pub user: String,
    /// File that holds the password.
    pub password_file: String,
}

/// What the server is asked to send.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SubscriptionConfig {
    /// Time between two looks at a node.
    pub sampling_ms: u32,
    /// Time between two sendings.
    pub publishing_ms: u32,
    /// Changes of a node that are kept between two sendings.
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ConnectionConfig {
    /// Time to the second attempt to connect; each further one waits twice as long.
    pub reconnect_first_s: f64,
    /// Longest time between attempts.
    pub reconnect_longest_s: f64,
    /// An answer later than this is none.
    pub reply_timeout_s: f64,
    /// Time between two questions whether the server runs.
    pub keep_alive_s: f64,
    /// So long a session outlives a break.
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
    /// An answer later than this is none.
    pub reply_timeout: Span,
    /// Time between two questions whether the server runs.
    pub keep_alive: Span,
    /// So long a session outlives a break.
    pub session: Span,
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

/// A URL of the binary protocol.
///
/// # Errors
/// When it is none.
pub fn checked_endpoint(endpoint: &str) -> Result<String, BridgeError> {
    let rest = endpoint.strip_prefix("opc.tcp://");
    let host = rest.map(|rest| rest.split(['/', ':']).next().unwrap_or_default());
    let is_word = endpoint.bytes().all(|byte| byte.is_ascii_graphic());
    if host.is_some_and(|host| !host.is_empty()) && is_word && endpoint.len() <= 4096 {
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
    /// Values out of range, an endpoint that is none, a password that could be read, a key that is no node, or a mapping
    /// that contradicts itself.
    pub fn new(config: &BridgeConfig, map: &MapFile) -> Result<Self, BridgeError> {
        let connection = &config.connection;
        let seconds = |key, value| checked(key, value).map(Span::from_secs_f64);
        let first_s = connection.reconnect_first_s;
        let longest_s = connection.reconnect_longest_s;
        let reconnect_first = seconds("connection.reconnect_first_s", first_s)?;
        let reconnect_longest = seconds("connection.reconnect_longest_s", longest_s)?;
        if longest_s < first_s {
            return Err(BridgeError::OutOfRange {
                key: "connection.reconnect_longest_s",
                value: longest_s,
                least: first_s,
                greatest: 86_400.0,
            });
        }
        let subscription = &config.subscription;
        checked(
            "subscription.sampling_ms",
            f64::from(subscription.sampling_ms),
        )?;
        checked(
            "subscription.publishing_ms",
            f64::from(subscription.publishing_ms),
        )?;
        checked("subscription.queue", f64::from(subscription.queue))?;
        config.security.check()?;
        let mapping = Mapping::new(map)?;
        Ok(Self {
            endpoint: checked_endpoint(&config.endpoint)?,
            items: items(&mapping)?,
            mapping,
            security: config.security.clone(),
            subscription: subscription.clone(),
            reconnect_first,
            reconnect_longest,
            reply_timeout: seconds("connection.reply_timeout_s", connection.reply_timeout_s)?,
            keep_alive: seconds("connection.keep_alive_s", connection.keep_alive_s)?,
            session: seconds("connection.session_s", connection.session_s)?,
        })
    }
}
