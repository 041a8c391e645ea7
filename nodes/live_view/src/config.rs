//! Parameters of the live view, and their checked form.

use std::net::SocketAddr;

use metrology::check_parameters;
use metrology::stamp::Span;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::LiveViewError;

/// Default address of the page.
pub const DEFAULT_ADDRESS: &str = "127.0.0.1:8642";
/// Fewest characters of a token: 20 of 64 letters are 120 bits.
const SHORTEST_TOKEN: usize = 20;
/// Most characters of a token.
const LONGEST_TOKEN: usize = 256;

/// Parameters of the node.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LiveViewConfig {
    /// Address and port of the page, by number; port 0: any free port.
    pub address: String,
    /// File with the token that browsers need, relative to the parameter file; required for addresses other than
    /// loopback.
    pub token_file: String,
    /// Host names of the page, beside `localhost` and IP addresses.
    pub host_names: Vec<String>,
    /// Parameter file of axis_compensation with the limits to show, relative to the parameter file.
    pub compensation_file: String,
    /// Most browsers at once.
    #[schemars(range(min = 1.0, max = 200.0))]
    pub most_browsers: u32,
    /// Rate of updates to browsers.
    #[schemars(range(min = 0.2, max = 20.0))]
    pub rate_hz: f64,
    /// Silence of a periodic topic after which its value is stale.
    #[schemars(range(min = 0.5, max = 3600.0))]
    pub stale_after_s: f64,
    /// Time within which a request must be complete.
    #[schemars(range(min = 0.1, max = 60.0))]
    pub request_timeout_s: f64,
    /// A browser that reads nothing for this time is dropped.
    #[schemars(range(min = 0.1, max = 600.0))]
    pub stall_timeout_s: f64,
}

impl Default for LiveViewConfig {
    fn default() -> Self {
        Self {
            address: DEFAULT_ADDRESS.to_owned(),
            token_file: String::new(),
            host_names: Vec::new(),
            compensation_file: String::new(),
            most_browsers: 20,
            rate_hz: 5.0,
            stale_after_s: 5.0,
            request_timeout_s: 5.0,
            stall_timeout_s: 10.0,
        }
    }
}

/// Checked settings.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Address of the page.
    pub address: SocketAddr,
    /// Host names of the page, in lower case.
    pub host_names: Vec<String>,
    /// The parameters, within their limits.
    pub config: LiveViewConfig,
}

fn is_of_a_name(letter: char) -> bool {
    letter.is_ascii_alphanumeric() || matches!(letter, '-' | '.' | '_')
}

impl Settings {
    /// Checks a configuration.
    ///
    /// # Errors
    /// A value out of range, a malformed address or name, or an address other than loopback without a token.
    pub fn new(config: &LiveViewConfig) -> Result<Self, LiveViewError> {
        check_parameters(config)?;
        let address: SocketAddr = config.address.parse().map_err(|_| LiveViewError::Address {
            address: config.address.clone(),
        })?;
        if !address.ip().is_loopback() && config.token_file.is_empty() {
            return Err(LiveViewError::Open { address });
        }
        let mut host_names = Vec::with_capacity(config.host_names.len());
        for name in &config.host_names {
            if name.is_empty() || !name.chars().all(is_of_a_name) {
                let name = name.clone();
                return Err(LiveViewError::HostName { name });
            }
            host_names.push(name.to_ascii_lowercase());
        }
        Ok(Self {
            address,
            host_names,
            config: config.clone(),
        })
    }

    /// Silence after which a periodic value is stale.
    #[must_use]
    pub fn stale_after(&self) -> Span {
        Span::from_secs_f64(self.config.stale_after_s)
    }
}

/// The token in the text of its file: one line of characters that need no escape in a URL.
///
/// # Errors
/// When it is too short or too long, or has another character. The error never shows the token.
pub fn checked_token(file: &str, text: &str) -> Result<String, LiveViewError> {
    let token = text.trim();
    let is_plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '.' | '_' | '~');
    let letters = token.chars().count();
    if token.chars().all(is_plain) && (SHORTEST_TOKEN..=LONGEST_TOKEN).contains(&letters) {
        return Ok(token.to_owned());
    }
    Err(LiveViewError::Token {
        file: file.to_owned(),
        letters,
        least: SHORTEST_TOKEN,
        greatest: LONGEST_TOKEN,
    })
}
