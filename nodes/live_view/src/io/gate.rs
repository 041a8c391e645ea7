//! Checks of requests: host name, origin, body and token.
//!
//! A page of another site can send requests to this computer, but cannot read the answers: there is no CORS header. A site
//! whose name resolves to this computer (DNS rebinding) could; its `Host` is refused.

use std::collections::BTreeMap;
use std::net::IpAddr;
use std::sync::atomic::{AtomicU64, Ordering};

use axum::http::header::{AUTHORIZATION, CONTENT_LENGTH, HOST, ORIGIN, TRANSFER_ENCODING};
use axum::http::uri::Authority;
use axum::http::{HeaderMap, HeaderName, StatusCode, Uri};
use sha2::{Digest, Sha256};
use subtle::ConstantTimeEq;

/// Why a request is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Refusal {
    Host,
    CrossSite,
    Token,
    Body,
    Full,
}

impl Refusal {
    const ALL: [Self; 5] = [
        Self::Host,
        Self::CrossSite,
        Self::Token,
        Self::Body,
        Self::Full,
    ];

    pub const fn status(self) -> StatusCode {
        match self {
            Self::Host => StatusCode::MISDIRECTED_REQUEST,
            Self::CrossSite => StatusCode::FORBIDDEN,
            Self::Token => StatusCode::UNAUTHORIZED,
            Self::Body => StatusCode::PAYLOAD_TOO_LARGE,
            Self::Full => StatusCode::SERVICE_UNAVAILABLE,
        }
    }

    /// Text of the answer.
    pub const fn sentence(self) -> &'static str {
        match self {
            Self::Host => {
                "Unknown host name: use an IP address or localhost, or list the name in host_names.\n"
            }
            Self::CrossSite => "Requests from other sites are refused.\n",
            Self::Token => {
                "Missing or wrong token: use ?token=TOKEN or the header Authorization: Bearer TOKEN.\n"
            }
            Self::Body => "Requests must have no body.\n",
            Self::Full => "Too many browsers (most_browsers): close one and reload.\n",
        }
    }

    /// Key in the account.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Host => "refused_host_name",
            Self::CrossSite => "refused_cross_site",
            Self::Token => "refused_token",
            Self::Body => "refused_body",
            Self::Full => "refused_too_many",
        }
    }
}

/// The checks, and the number of refused requests.
pub(super) struct Gate {
    token: Option<[u8; 32]>,
    host_names: Vec<String>,
    refused: [AtomicU64; Refusal::ALL.len()],
}

const FETCH_SITE: HeaderName = HeaderName::from_static("sec-fetch-site");
const FETCH_MODE: HeaderName = HeaderName::from_static("sec-fetch-mode");
const FETCH_DEST: HeaderName = HeaderName::from_static("sec-fetch-dest");

/// The only value of a header; `None`: it is absent, repeated or not text.
fn one<'h>(headers: &'h HeaderMap, name: &HeaderName) -> Option<&'h str> {
    let mut all = headers.get_all(name).iter();
    let first = all.next()?.to_str().ok()?;
    all.next().is_none().then_some(first)
}

fn digest(token: &str) -> [u8; 32] {
    Sha256::digest(token).into()
}

/// The token of a request, from its header or from its address.
fn token<'r>(uri: &'r Uri, headers: &'r HeaderMap) -> Option<&'r str> {
    if headers.contains_key(AUTHORIZATION) {
        return one(headers, &AUTHORIZATION)?.strip_prefix("Bearer ");
    }
    let mut pairs = uri.query()?.split('&');
    pairs.find_map(|pair| pair.strip_prefix("token="))
}

impl Gate {
    pub fn new(token: Option<&str>, host_names: &[String]) -> Self {
        Self {
            token: token.map(digest),
            host_names: host_names.to_vec(),
            refused: Default::default(),
        }
    }

    fn is_known(&self, authority: &str) -> bool {
        let Ok(authority) = authority.parse::<Authority>() else {
            return false;
        };
        let host = authority.host().to_ascii_lowercase();
        let number = host.trim_start_matches('[').trim_end_matches(']');
        let is_user_given = authority.as_str().contains('@');
        let is_number = number.parse::<IpAddr>().is_ok();
        !is_user_given && (is_number || host == "localhost" || self.host_names.contains(&host))
    }

    /// Whether another site sent the request; links to the page are allowed.
    fn is_cross_site(uri: &Uri, headers: &HeaderMap, host: &str) -> bool {
        if headers.contains_key(ORIGIN) {
            let origin = one(headers, &ORIGIN).and_then(|origin| origin.split_once("://"));
            if origin.is_none_or(|(_, authority)| !authority.eq_ignore_ascii_case(host)) {
                return true;
            }
        }
        if !headers.contains_key(FETCH_SITE) {
            return false;
        }
        let is_own = matches!(one(headers, &FETCH_SITE), Some("same-origin" | "none"));
        let is_link = uri.path() == "/"
            && one(headers, &FETCH_MODE) == Some("navigate")
            && one(headers, &FETCH_DEST) == Some("document");
        !is_own && !is_link
    }

    fn has_token(&self, uri: &Uri, headers: &HeaderMap) -> bool {
        let Some(right) = &self.token else {
            return true;
        };
        // Digests have one length; the comparison takes constant time.
        token(uri, headers).is_some_and(|given| digest(given).ct_eq(right).into())
    }

    fn judge(&self, uri: &Uri, headers: &HeaderMap) -> Result<(), Refusal> {
        let host = one(headers, &HOST).ok_or(Refusal::Host)?;
        let asked = uri.authority().map(Authority::as_str);
        if !self.is_known(host) || asked.is_some_and(|asked| !self.is_known(asked)) {
            return Err(Refusal::Host);
        }
        if Self::is_cross_site(uri, headers, host) {
            return Err(Refusal::CrossSite);
        }
        let length = headers.get(CONTENT_LENGTH);
        if headers.contains_key(TRANSFER_ENCODING) || length.is_some_and(|length| length != "0") {
            return Err(Refusal::Body);
        }
        if !self.has_token(uri, headers) {
            return Err(Refusal::Token);
        }
        Ok(())
    }

    /// Checks a request.
    ///
    /// # Errors
    /// The refusal, which is counted.
    pub fn check(&self, uri: &Uri, headers: &HeaderMap) -> Result<(), Refusal> {
        self.judge(uri, headers)
            .inspect_err(|&refusal| self.count(refusal))
    }

    pub fn count(&self, refusal: Refusal) {
        self.refused[refusal as usize].fetch_add(1, Ordering::Relaxed);
    }

    /// Number of refused requests, by reason.
    pub fn refused(&self) -> BTreeMap<&'static str, u64> {
        let count = |refusal: &Refusal| self.refused[*refusal as usize].load(Ordering::Relaxed);
        let all = Refusal::ALL.iter().map(|one| (one.name(), count(one)));
        all.filter(|(_, count)| *count > 0).collect()
    }
}
