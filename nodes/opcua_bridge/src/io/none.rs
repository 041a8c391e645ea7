//! A program without the client.

use metrology::stamp::{Host, Stamp};

use super::Credentials;
use crate::config::Settings;
use crate::error::BridgeError;
use crate::proposal::Survey;
use crate::stage::{IoCommand, IoEvent};

/// Nothing: the client was not built, and none is ever made.
#[derive(Debug)]
pub struct BridgeIo(());

impl BridgeIo {
    /// Says how the client is built.
    ///
    /// # Errors
    /// Always.
    pub fn start(_: &Settings, _: Credentials) -> Result<Self, BridgeError> {
        Err(BridgeError::NotBuilt)
    }

    /// Nothing.
    pub const fn command(&self, _: IoCommand) {}

    /// Nothing.
    #[must_use]
    pub const fn event(&self) -> Option<(Stamp<Host>, IoEvent)> {
        None
    }
}

/// Says how the client is built.
///
/// # Errors
/// Always.
pub fn survey(_: &str) -> Result<Survey, BridgeError> {
    Err(BridgeError::NotBuilt)
}
