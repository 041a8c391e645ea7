//! TLS to a server by OpenSSL, with files and modes as libpq has them: files of the URL, else those in `~/.postgresql`.

use std::error::Error;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use openssl::error::ErrorStack;
use openssl::pkey::{PKey, Private};
use openssl::ssl::{
    self, SslConnector, SslConnectorBuilder, SslFiletype, SslMethod, SslVerifyMode, SslVersion,
};
use openssl::x509::X509;
use openssl::x509::store::{X509Lookup, X509StoreBuilder};
use openssl::x509::verify::X509VerifyFlags;
use postgres_openssl::MakeTlsConnector;
use tokio_postgres::Config;
use tokio_postgres::config::{Host, SslMode};

use super::parameters::{Mode, TlsParameters};
use crate::error::HistoryError;

/// Name of the authorities of the computer, instead of a file.
const SYSTEM: &str = "system";

/// Readies TLS for a connection, and tells `config` whether there must be TLS.
pub fn prepare(
    config: &mut Config,
    parameters: &TlsParameters,
    shown: &Path,
) -> Result<MakeTlsConnector, HistoryError> {
    name_hosts(config);
    // A local socket has no TLS, and needs none.
    let hosts = config.get_hosts();
    let is_local = !hosts.is_empty() && hosts.iter().all(|host| matches!(host, Host::Unix(_)));
    let mode = if is_local {
        Mode::Disable
    } else {
        parameters.mode()
    };
    config.ssl_mode(match mode {
        Mode::Disable => SslMode::Disable,
        Mode::Prefer => SslMode::Prefer,
        _ => SslMode::Require,
    });
    let files = Files {
        parameters,
        mode,
        shown,
    };
    let broken = |stack: ErrorStack| HistoryError::Unopened {
        path: shown.to_owned(),
        reason: reason_of(&stack),
    };
    let mut builder = SslConnector::builder(SslMethod::tls_client()).map_err(broken)?;
    builder.set_verify(SslVerifyMode::NONE);
    builder
        .set_min_proto_version(Some(SslVersion::TLS1_2))
        .map_err(broken)?;
    postgres_openssl::set_postgresql_alpn(&mut builder).map_err(broken)?;
    if mode != Mode::Disable {
        files.trust(&mut builder)?;
        files.identify(&mut builder)?;
    }
    let mut connector = MakeTlsConnector::new(builder.build());
    connector.set_callback(move |connection, _| {
        connection.set_verify_hostname(mode == Mode::VerifyFull);
        Ok(())
    });
    Ok(connector)
}

/// Addresses without names are their own names.
fn name_hosts(config: &mut Config) {
    if config.get_hosts().is_empty() {
        for address in config.get_hostaddrs().to_vec() {
            config.host(address.to_string());
        }
    }
}

/// Files of TLS, and what they are for.
struct Files<'a> {
    parameters: &'a TlsParameters,
    mode: Mode,
    shown: &'a Path,
}

impl Files<'_> {
    fn bad(&self, key: &'static str, file: &Path, reason: impl Into<String>) -> HistoryError {
        HistoryError::BadTlsFile {
            path: self.shown.to_owned(),
            key,
            file: file.to_owned(),
            reason: reason.into(),
        }
    }

    /// The authorities that a server's certificate must be of, and nobody else's.
    fn trust(&self, builder: &mut SslConnectorBuilder) -> Result<(), HistoryError> {
        const KEY: &str = "sslrootcert";
        let named = self.parameters.root.clone();
        if named.as_deref() == Some(Path::new(SYSTEM)) {
            if self.mode != Mode::VerifyFull {
                return Err(HistoryError::BadParameter {
                    path: self.shown.to_owned(),
                    key: "sslmode with sslrootcert=system",
                    value: "weaker".to_owned(),
                    must: "verify-full",
                });
            }
            // The builder has the authorities of the computer.
            builder.set_verify(SslVerifyMode::PEER);
            return Ok(());
        }
        let Some(file) = named.or_else(|| at_home("root.crt")) else {
            return if self.mode < Mode::VerifyCa {
                Ok(())
            } else {
                let file = Path::new("~/.postgresql/root.crt");
                Err(self.bad(
                    KEY,
                    file,
                    "is not there; `sslrootcert=system` means the authorities of this computer",
                ))
            };
        };
        let bad = |stack: ErrorStack| self.bad(KEY, &file, reason_of(&stack));
        let certificates = X509::stack_from_pem(&self.read(KEY, &file)?).map_err(bad)?;
        if certificates.is_empty() {
            return Err(self.bad(KEY, &file, "has no certificate"));
        }
        let mut store = X509StoreBuilder::new().map_err(bad)?;
        for certificate in certificates {
            store.add_cert(certificate).map_err(bad)?;
        }
        self.revoke(&mut store)?;
        builder.set_cert_store(store.build());
        builder.set_verify(SslVerifyMode::PEER);
        Ok(())
    }

    /// The certificates that are no longer trusted.
    fn revoke(&self, store: &mut X509StoreBuilder) -> Result<(), HistoryError> {
        let named = self.parameters.revoked.clone();
        let Some(file) = named.or_else(|| at_home("root.crl")) else {
            return Ok(());
        };
        let bad = |stack: ErrorStack| self.bad("sslcrl", &file, reason_of(&stack));
        let lookup = store.add_lookup(X509Lookup::file()).map_err(bad)?;
        lookup.load_crl_file(&file, SslFiletype::PEM).map_err(bad)?;
        let flags = X509VerifyFlags::CRL_CHECK | X509VerifyFlags::CRL_CHECK_ALL;
        store.set_flags(flags).map_err(bad)
    }

    /// The certificate of the client with its key, where it has one.
    fn identify(&self, builder: &mut SslConnectorBuilder) -> Result<(), HistoryError> {
        let named = self.parameters.certificate.clone();
        let Some(certificate) = named.or_else(|| at_home("postgresql.crt")) else {
            return match &self.parameters.key {
                Some(key) => {
                    Err(self.bad("sslkey", key, "has no certificate beside it in sslcert"))
                }
                None => Ok(()),
            };
        };
        let named = self.parameters.key.clone();
        let Some(key) = named.or_else(|| at_home("postgresql.key")) else {
            return Err(self.bad("sslcert", &certificate, "has no key beside it in sslkey"));
        };
        let bad = |stack: ErrorStack| self.bad("sslcert", &certificate, reason_of(&stack));
        builder
            .set_certificate_chain_file(&certificate)
            .map_err(bad)?;
        let private = self.private_key(&key)?;
        let bad = |stack: ErrorStack| self.bad("sslkey", &key, reason_of(&stack));
        builder.set_private_key(&private).map_err(bad)?;
        builder.check_private_key().map_err(bad)
    }

    /// A key that nobody else can read.
    fn private_key(&self, file: &Path) -> Result<PKey<Private>, HistoryError> {
        /// Rights that a key of root may not give.
        const BARRED_OF_ROOT: u32 = 0o037;
        /// Rights that a key of anybody else may not give.
        const BARRED: u32 = 0o077;
        let bad = |reason: String| self.bad("sslkey", file, reason);
        let about = std::fs::metadata(file).map_err(|error| bad(error.to_string()))?;
        let barred = if about.uid() == 0 {
            BARRED_OF_ROOT
        } else {
            BARRED
        };
        if about.mode() & barred != 0 {
            let mode = about.mode() & 0o777;
            return Err(bad(format!(
                "other users can read it (mode {mode:04o}): chmod 600"
            )));
        }
        let text = self.read("sslkey", file)?;
        let password = self.parameters.key_password.as_deref().unwrap_or_default();
        let read = PKey::private_key_from_pem_callback(&text, |room| {
            let place = room.get_mut(..password.len());
            place.map_or(Ok(0), |place| {
                place.copy_from_slice(password.as_bytes());
                Ok(password.len())
            })
        });
        read.map_err(|stack| {
            let reason = reason_of(&stack);
            bad(format!("{reason}; sslpassword has the password of a key"))
        })
    }

    #[expect(
        clippy::disallowed_methods,
        reason = "certificates are read where a connection is opened"
    )]
    fn read(&self, key: &'static str, file: &Path) -> Result<Vec<u8>, HistoryError> {
        std::fs::read(file).map_err(|error| self.bad(key, file, error.to_string()))
    }
}

/// A file of libpq's in the home folder, where it is there.
fn at_home(name: &str) -> Option<PathBuf> {
    let file = std::env::home_dir()?.join(".postgresql").join(name);
    file.exists().then_some(file)
}

/// What OpenSSL found last, in its own words.
fn reason_of(stack: &ErrorStack) -> String {
    let last = stack.errors().last();
    let reason = last.and_then(openssl::error::Error::reason);
    reason.unwrap_or("OpenSSL failed").to_owned()
}

/// Why there is no TLS with a server.
pub enum Fault {
    /// The server offers none, and there must be.
    NotOffered,
    /// It is not who it must be, or nobody whom it accepts, or speaks no TLS.
    Untrusted(String),
}

/// What an error says of TLS; nothing where the link broke.
pub fn fault(error: &tokio_postgres::Error) -> Option<Fault> {
    let source = error.source()?;
    // The library has no kind for it.
    if source.to_string() == "server does not support TLS" {
        return Some(Fault::NotOffered);
    }
    let found = of_openssl(source)?;
    let reason = reason_of(found.ssl_error()?);
    if reason == "unexpected eof while reading" {
        return None;
    }
    // The result of verification stands behind the library's own words.
    let (all, own) = (source.to_string(), found.to_string());
    let verified = all.strip_prefix(&own).and_then(|it| it.strip_prefix(": "));
    Some(Fault::Untrusted(match verified {
        Some(verified) => format!("{reason}: {verified}"),
        None => reason,
    }))
}

/// Whether OpenSSL reports it, or the link under it.
pub fn is_of_tls(source: &(dyn Error + 'static)) -> bool {
    of_openssl(source).is_some()
}

/// OpenSSL's error within one of reading, or of the begin of a connection.
fn of_openssl<'e>(source: &'e (dyn Error + 'static)) -> Option<&'e ssl::Error> {
    let of_reading = source
        .downcast_ref::<std::io::Error>()
        .and_then(|io| io.get_ref()?.downcast_ref::<ssl::Error>());
    of_reading.or_else(|| source.source()?.downcast_ref::<ssl::Error>())
}
