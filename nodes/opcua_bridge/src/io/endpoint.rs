//! The endpoint of a server that the parameters ask for.

use opcua::client::{Client, IdentityToken};
use opcua::crypto::SecurityPolicy;
use opcua::types::{EndpointDescription, MessageSecurityMode, StatusCode, UserTokenType};

use super::Credentials;
use super::convert::{self, words};
use crate::config::{Mode, Policy, SecurityConfig, Settings};
use crate::stage::IoEvent;

/// Endpoints that are named in a message at most.
const ENDPOINTS_NAMED: usize = 12;

impl SecurityConfig {
    fn policy_uri(&self) -> &'static str {
        match (self.mode, self.policy) {
            (Mode::None, _) => SecurityPolicy::None,
            (_, Policy::Basic256Sha256) => SecurityPolicy::Basic256Sha256,
            (_, Policy::Aes128Sha256RsaOaep) => SecurityPolicy::Aes128Sha256RsaOaep,
            (_, Policy::Aes256Sha256RsaPss) => SecurityPolicy::Aes256Sha256RsaPss,
        }
        .to_uri()
    }

    const fn message_mode(&self) -> MessageSecurityMode {
        match self.mode {
            Mode::None => MessageSecurityMode::None,
            Mode::Sign => MessageSecurityMode::Sign,
            Mode::SignAndEncrypt => MessageSecurityMode::SignAndEncrypt,
        }
    }
}

/// Policy and mode in words.
pub(super) fn security(endpoint: &EndpointDescription) -> String {
    let uri: &str = endpoint.security_policy_uri.as_ref();
    let policy = uri.rsplit('#').next().unwrap_or_default();
    format!("{policy} {:?}", endpoint.security_mode)
}

/// The user as the client wants it.
pub(super) fn token(security: &SecurityConfig, credentials: &Credentials) -> IdentityToken {
    match &credentials.password {
        Some(password) => IdentityToken::new_user_name(security.user.as_str(), password.as_str()),
        None => IdentityToken::Anonymous,
    }
}

/// The endpoint to connect to, under the URL of the parameters.
///
/// # Errors
/// That nobody answers, or what the server has instead.
pub(super) async fn choose(
    client: &Client,
    settings: &Settings,
) -> Result<EndpointDescription, IoEvent> {
    let asked = client.get_server_endpoints_from_url(settings.endpoint.as_str());
    let limit_s = settings.reply_timeout.as_secs_f64();
    let limit = std::time::Duration::from_secs_f64(limit_s);
    let endpoints = match tokio::time::timeout(limit, asked).await {
        Ok(Ok(endpoints)) => endpoints,
        Ok(Err(error)) => {
            let reason = convert::reason(&error);
            return Err(IoEvent::Ended { reason });
        }
        Err(_) => {
            let reason = format!("no answer within {limit_s} s: is it an OPC UA server?");
            return Err(IoEvent::Ended { reason });
        }
    };
    let mut endpoint = matching(&settings.security, &endpoints)?;
    // What a server calls itself may be no name that is known here.
    endpoint.endpoint_url = settings.endpoint.as_str().into();
    Ok(endpoint)
}

fn matching(
    wanted: &SecurityConfig,
    endpoints: &[EndpointDescription],
) -> Result<EndpointDescription, IoEvent> {
    let is_secured = |endpoint: &&EndpointDescription| {
        let uri: &str = endpoint.security_policy_uri.as_ref();
        endpoint.security_mode == wanted.message_mode() && uri == wanted.policy_uri()
    };
    let secured: Vec<&EndpointDescription> = endpoints.iter().filter(is_secured).collect();
    let policy = wanted.policy_uri().rsplit('#').next().unwrap_or_default();
    let asked = format!("{policy} {:?}", wanted.message_mode());
    let refused = |reason| Err(IoEvent::Refused { reason });
    if secured.is_empty() {
        let mut offered: Vec<String> = endpoints
            .iter()
            .take(ENDPOINTS_NAMED)
            .map(security)
            .collect();
        offered.dedup();
        return refused(format!(
            "asked for {asked}, the server offers {}: set security.mode and security.policy to one of them, or open the endpoint at the server",
            offered.join(", ")
        ));
    }
    let (kind, name) = if wanted.user.is_empty() {
        (UserTokenType::Anonymous, "anonymous users")
    } else {
        (UserTokenType::UserName, "users with a password")
    };
    let takes = |endpoint: &&&EndpointDescription| {
        let tokens = endpoint.user_identity_tokens.as_ref();
        tokens.is_some_and(|tokens| tokens.iter().any(|token| token.token_type == kind))
    };
    match secured.iter().find(takes) {
        Some(endpoint) => Ok((*endpoint).clone()),
        None => refused(format!(
            "the endpoint {asked} does not take {name}: set security.user and security.password_file, or allow them at the server"
        )),
    }
}

/// What a status of a connection that was not made means.
pub(super) fn not_made(status: StatusCode, credentials: &Credentials) -> IoEvent {
    let name = words(status);
    let folder = credentials.pki_folder.as_ref();
    let folder = folder.map(|folder| folder.display().to_string());
    let is_certificate = name.starts_with("BadCertificate") || name == "BadSecurityChecksFailed";
    let is_user = name.starts_with("BadIdentityToken") || name == "BadUserAccessDenied";
    if is_certificate {
        let folder = folder.unwrap_or_default();
        IoEvent::Refused {
            reason: format!(
                "{name}: one side does not trust the other: move the server's certificate from {folder}/rejected to {folder}/trusted, and let the server trust {folder}/own/cert.der"
            ),
        }
    } else if is_user {
        IoEvent::Refused {
            reason: format!("{name}: the server does not take this user or password"),
        }
    } else if name.starts_with("BadSecurity") {
        IoEvent::Refused { reason: name }
    } else {
        IoEvent::Ended { reason: name }
    }
}
