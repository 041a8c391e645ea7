//! The bridge's sockets: the only part that does something itself.
//!
//! It is built with the feature `opcua`; without it a bridge cannot be opened, and the error names the build command.

use std::fmt;
use std::path::PathBuf;

#[cfg(feature = "opcua")]
mod client;
#[cfg(feature = "opcua")]
mod convert;
#[cfg(feature = "opcua")]
mod endpoint;
#[cfg(feature = "opcua")]
mod nodes;
#[cfg(not(feature = "opcua"))]
mod none;
#[cfg(feature = "opcua")]
mod sequence;
#[cfg(feature = "opcua")]
mod survey;
#[cfg(feature = "opcua")]
mod visit;

#[cfg(feature = "opcua")]
pub use client::BridgeIo;
#[cfg(not(feature = "opcua"))]
pub use none::{BridgeIo, survey};
#[cfg(feature = "opcua")]
pub use survey::survey;

/// Whether the program has the client.
pub const IS_BUILT: bool = cfg!(feature = "opcua");

/// What proves who we are.
#[derive(Clone, Default)]
pub struct Credentials {
    /// Folder of the certificates; `None`: no secured connection is made.
    pub pki_folder: Option<PathBuf>,
    /// The user's password; `None`: anonymous.
    pub password: Option<String>,
}

impl fmt::Debug for Credentials {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Credentials")
            .field("pki_folder", &self.pki_folder)
            .finish_non_exhaustive()
    }
}
