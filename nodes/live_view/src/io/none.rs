//! A program without the server.

use std::net::SocketAddr;

use super::{Account, Source};
use crate::config::Settings;
use crate::error::LiveViewError;
use crate::stage::LiveViewStage;

/// Nothing: the server was not built, and none is ever made.
#[derive(Debug)]
pub struct LiveViewIo(std::convert::Infallible);

impl LiveViewIo {
    /// Says how the server is built.
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

    /// Nothing.
    #[must_use]
    pub const fn address(&self) -> SocketAddr {
        match self.0 {}
    }

    /// Nothing.
    #[must_use]
    pub fn account(&self) -> Account {
        match self.0 {}
    }
}
