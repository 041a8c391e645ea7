//! What a URL states of TLS, in libpq's parameters, and the URL without them.

use std::path::{Path, PathBuf};

use percent_encoding::percent_decode_str;

use crate::error::HistoryError;

/// How much of TLS a connection must have, from least to most.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Mode {
    /// No TLS.
    Disable,
    /// TLS where the server offers it.
    Prefer,
    /// TLS with any certificate, or with one of a named authority.
    Require,
    /// TLS with a certificate of a trusted authority.
    VerifyCa,
    /// The same, for the host of the URL.
    VerifyFull,
}

impl Mode {
    const ALL: [(&'static str, Self); 5] = [
        ("disable", Self::Disable),
        ("prefer", Self::Prefer),
        ("require", Self::Require),
        ("verify-ca", Self::VerifyCa),
        ("verify-full", Self::VerifyFull),
    ];

    fn of(name: &str) -> Option<Self> {
        let found = Self::ALL.iter().find(|(known, _)| *known == name);
        found.map(|(_, mode)| *mode)
    }
}

/// Parameters of TLS; an empty one is absent. It has no `Debug`: a password is in it.
#[derive(Default)]
pub struct TlsParameters {
    /// `sslmode`.
    pub mode: Option<Mode>,
    /// `sslrootcert`.
    pub root: Option<PathBuf>,
    /// `sslcert`.
    pub certificate: Option<PathBuf>,
    /// `sslkey`.
    pub key: Option<PathBuf>,
    /// `sslpassword`.
    pub key_password: Option<String>,
    /// `sslcrl`.
    pub revoked: Option<PathBuf>,
}

impl TlsParameters {
    /// Takes the parameters of TLS out of a URL, and gives the rest.
    pub fn split(url: &str, shown: &Path) -> Result<(String, Self), HistoryError> {
        let bad = |key, value: &str, must| HistoryError::BadParameter {
            path: shown.to_owned(),
            key,
            value: value.to_owned(),
            must,
        };
        let Some((place, query)) = url.split_once('?') else {
            return Ok((url.to_owned(), Self::default()));
        };
        // Otherwise a part of a password would be taken for a host or a key, and be shown.
        if query.contains('@') {
            let must = "written as %40, and `?` as %3F";
            return Err(bad("`@` after `?`", "@", must));
        }
        let (mut found, mut rest) = (Self::default(), Vec::new());
        for pair in query.split('&') {
            let (key, value) = pair.split_once('=').unwrap_or((pair, ""));
            let text = || percent_decode_str(value).decode_utf8_lossy().into_owned();
            let file = || Some(PathBuf::from(text())).filter(|it| !it.as_os_str().is_empty());
            match key {
                "sslmode" => {
                    let name = text();
                    let must = "disable, prefer, require, verify-ca or verify-full";
                    let mode = Mode::of(&name).ok_or_else(|| bad("sslmode", &name, must))?;
                    found.mode = Some(mode);
                }
                "sslrootcert" => found.root = file(),
                "sslcert" => found.certificate = file(),
                "sslkey" => found.key = file(),
                "sslcrl" => found.revoked = file(),
                "sslpassword" => found.key_password = Some(text()).filter(|it| !it.is_empty()),
                _ => rest.push(pair),
            }
        }
        let mut left = place.to_owned();
        if !rest.is_empty() {
            left.push('?');
            left.push_str(&rest.join("&"));
        }
        Ok((left, found))
    }

    /// The mode that holds: who names a file of TLS and no mode wants all of it.
    pub fn mode(&self) -> Mode {
        let files = [&self.root, &self.certificate, &self.key, &self.revoked];
        let has_file = files.iter().any(|file| file.is_some());
        let unstated = if has_file {
            Mode::VerifyFull
        } else {
            Mode::Prefer
        };
        self.mode.unwrap_or(unstated)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn split(url: &str) -> Result<(String, TlsParameters), String> {
        TlsParameters::split(url, Path::new("shown")).map_err(|error| error.to_string())
    }

    #[test]
    fn parameters_of_tls_are_taken_out_and_decoded() {
        let url = "postgres://a@h/d?connect_timeout=3&sslmode=verify-ca&sslrootcert=%2Fca%20b.pem&sslkey=&options=-c%20x%3D1";
        let (rest, found) = split(url).unwrap();
        assert_eq!(
            rest,
            "postgres://a@h/d?connect_timeout=3&options=-c%20x%3D1"
        );
        assert_eq!(found.mode(), Mode::VerifyCa);
        assert_eq!(found.root.as_deref(), Some(Path::new("/ca b.pem")));
        assert_eq!(found.key, None);
        let (rest, found) = split("postgres://a@h/d?sslmode=require").unwrap();
        assert_eq!(
            (rest.as_str(), found.mode()),
            ("postgres://a@h/d", Mode::Require)
        );
        let (_, found) = split("postgres://a@h/d").unwrap();
        assert_eq!(found.mode(), Mode::Prefer);
    }

    #[test]
    fn a_file_without_a_mode_means_the_strictest() {
        for name in ["sslrootcert", "sslcert", "sslkey", "sslcrl"] {
            let (_, found) = split(&format!("postgres://h/d?{name}=x.pem")).unwrap();
            assert_eq!(found.mode(), Mode::VerifyFull, "{name}");
        }
    }

    #[test]
    fn other_modes_and_passwords_with_bare_signs_are_refused() {
        for mode in ["allow", "verify_full", "", "REQUIRE"] {
            let Err(error) = split(&format!("postgres://h/d?sslmode={mode}")) else {
                panic!("{mode}");
            };
            assert!(error.contains("verify-full"), "{error}");
        }
        let Err(error) = split("postgres://a:se?cret@h/d") else {
            panic!();
        };
        assert!(error.contains("%40") && !error.contains("cret"), "{error}");
    }
}
