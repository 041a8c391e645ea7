//! Errors before the page is served.

use std::net::SocketAddr;

use metrology::bound::BoundError;

/// Errors of the live view: its parameters, and its server.
#[derive(Debug, thiserror::Error)]
pub enum LiveViewError {
    /// A parameter outside its limits.
    #[error(transparent)]
    Parameter(#[from] BoundError),
    /// The address is malformed.
    #[error(
        "address = {address:?}: must be an IP address and a port, such as 127.0.0.1:8642 or [::1]:8642"
    )]
    Address {
        /// Value of the parameter.
        address: String,
    },
    /// Other computers reach the address, and there is no token.
    #[error(
        "address = {address}: other computers reach it: set token_file to a file with a token, or use 127.0.0.1"
    )]
    Open {
        /// The address.
        address: SocketAddr,
    },
    /// A malformed host name.
    #[error(
        "host_names: {name:?}: must be a name of letters, digits, `-`, `_` and dots, without a port"
    )]
    HostName {
        /// Value of the parameter.
        name: String,
    },
    /// The token is too short, too long, or needs escapes in a URL.
    #[error(
        "{file}: the token has {letters} characters: must be one line of {least} to {greatest} letters, digits, `-`, `.`, `_` and `~`, such as `openssl rand -hex 32` prints"
    )]
    Token {
        /// File of the token.
        file: String,
        /// Its length.
        letters: usize,
        /// Fewest characters.
        least: usize,
        /// Most characters.
        greatest: usize,
    },
    /// The program was built without the server.
    #[error(
        "this program was built without the live view: build it with `cargo build --release --features serve`"
    )]
    NotBuilt,
    /// The server cannot listen on the address.
    #[error("address = {address}: {source}; use another port, or port 0 for any free one")]
    Listen {
        /// Address.
        address: SocketAddr,
        /// Error of the system.
        source: std::io::Error,
    },
    /// The system has no thread or event queue left.
    #[error("{action}: {source}")]
    Io {
        /// Failed action.
        action: &'static str,
        /// Error of the system.
        source: std::io::Error,
    },
}
