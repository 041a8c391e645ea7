//! What can go wrong before the page is served.

use std::net::SocketAddr;

use metrology::bound::BoundError;

/// Errors of the live view: its parameters, and its server.
#[derive(Debug, thiserror::Error)]
pub enum LiveViewError {
    /// A parameter outside its limits.
    #[error(transparent)]
    Parameter(#[from] BoundError),
    /// The address is none.
    #[error(
        "address = {address:?}: must be a number and a port, such as 127.0.0.1:8642 or [::1]:8642"
    )]
    Address {
        /// What was read.
        address: String,
    },
    /// Others could look at the cell.
    #[error(
        "address = {address}: other computers reach it: give token_file, a file that holds a token, or take 127.0.0.1"
    )]
    Open {
        /// The address.
        address: SocketAddr,
    },
    /// A name that cannot stand in a request.
    #[error(
        "host_names: {name:?}: must be a name of letters, digits, `-`, `_` and dots, without a port"
    )]
    HostName {
        /// What was read.
        name: String,
    },
    /// The token is too easy to guess, or cannot stand in an address.
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
    /// The address cannot be listened on.
    #[error("address = {address}: {source}; give another port, or port 0 for one that is free")]
    Listen {
        /// Where.
        address: SocketAddr,
        /// The system's word.
        source: std::io::Error,
    },
    /// The system has no thread or event queue left.
    #[error("{action}: {source}")]
    Io {
        /// What was tried.
        action: &'static str,
        /// The system's word.
        source: std::io::Error,
    },
}
