//! What can go wrong before or beneath the stage.

use metrology::bound::BoundError;

use crate::node_key::KeyFlaw;

/// Errors of the bridge: its parameters, its mapping, and its thread.
#[derive(Debug, thiserror::Error)]
pub enum BridgeError {
    /// A parameter outside its limits.
    #[error(transparent)]
    Parameter(#[from] BoundError),
    /// The endpoint is no URL of OPC UA's binary protocol.
    #[error(
        "endpoint = {endpoint:?}: must be opc.tcp://HOST:PORT, with a port from 1 to 65535 and a path where the server has one"
    )]
    Endpoint {
        /// What was read.
        endpoint: String,
    },
    /// The endpoint holds a user, and what holds it is shown in messages.
    #[error(
        "endpoint = \"…@{host}\": remove user and password, which messages would show, and use security.user and security.password_file"
    )]
    UserInEndpoint {
        /// What stands behind the user.
        host: String,
    },
    /// A secured connection needs a folder of certificates.
    #[error(
        "security.pki_folder is empty: security.mode = {mode} needs the folder of the certificates"
    )]
    NoPki {
        /// Mode in the words of the parameter file.
        mode: &'static str,
    },
    /// A password would be readable on the wire.
    #[error(
        "security.user = {user:?} with security.mode = none: the password could be read on the wire; take sign or sign_and_encrypt"
    )]
    ReadablePassword {
        /// User.
        user: String,
    },
    /// A user without a password, or the reverse.
    #[error("security.user and security.password_file belong together: one is empty")]
    HalfUser,
    /// The mapping cannot be read, or contradicts itself.
    #[error(transparent)]
    Mapping(#[from] machine_report::MappingError),
    /// A key of the mapping is no node.
    #[error("{key}: {flaw}")]
    Key {
        /// Key of the mapping.
        key: String,
        /// What is wrong with it.
        flaw: KeyFlaw,
    },
    /// The program was built without the client.
    #[error(
        "this program was built without OPC UA: build it with `cargo build --release --features opcua`"
    )]
    NotBuilt,
    /// The client cannot be set up.
    #[error("{action}: {reason}")]
    Client {
        /// What was tried.
        action: &'static str,
        /// Why it failed.
        reason: String,
    },
    /// The system has no thread or event queue left.
    #[error("{action}: {source}")]
    Io {
        /// What was tried.
        action: &'static str,
        /// The system's word.
        source: std::io::Error,
    },
    /// A server could not be asked.
    #[error("{endpoint}: {reason}")]
    Ask {
        /// Where.
        endpoint: String,
        /// Why.
        reason: String,
    },
}
