//! A program without the server.

use std::net::SocketAddr;

use super::{Account, Source};
use crate::config::Settings;
use crate::error::LiveViewError;
use crate::stage::LiveViewStage;

/// Never constructed: the server was not built.
#[derive(Debug)]
pub struct LiveViewIo(std::convert::Infallible);

impl LiveViewIo {
    /// Returns the error with the command that builds the server.
    ///
    /// # Errors
    /// Always.
    pub fn start(
        _: &Settings,
        _: Option<String>,
        _: LiveViewStage,
        _: Source,
    ) -> Result<Self, LiveViewError> {
        Err(LiveViewError::NotBuilt)
    }

    /// Unreachable.
    #[must_use]
    pub const fn address(&self) -> SocketAddr {
        match self.0 {}
    }

    /// Unreachable.
    #[must_use]
    pub fn account(&self) -> Account {
        match self.0 {}
    }
}
