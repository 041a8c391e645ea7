//! Who signs: certificates and documents, by OpenSSL.

use std::fs;
use std::io::Write as _;
use std::os::unix::fs::{OpenOptionsExt as _, symlink};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use chrono::{DateTime, TimeDelta, Utc};
use node_runtime::environment::ENCLAVE_FILES;
use node_runtime::text_file;
use openssl::asn1::Asn1Time;
use openssl::bn::{BigNum, MsbOption};
use openssl::ec::{EcGroup, EcKey};
use openssl::hash::MessageDigest;
use openssl::nid::Nid;
use openssl::pkcs7::{Pkcs7, Pkcs7Flags};
use openssl::pkey::{PKey, Private};
use openssl::stack::Stack;
use openssl::x509::extension::{BasicConstraints, KeyUsage};
use openssl::x509::{X509, X509Builder, X509NameBuilder};
use reports::whole_file;

use super::documents;
use super::enclaves::Enclave;

/// When credentials hold.
pub struct Validity {
    /// Not before.
    pub from: DateTime<Utc>,
    /// Not after.
    pub until: DateTime<Utc>,
}

impl Validity {
    /// Valid from an hour before now, for computers whose clocks are behind, until so many days after now.
    ///
    /// # Errors
    /// When that day is beyond the calendar.
    pub fn from_now(now: DateTime<Utc>, days: u32) -> Result<Self> {
        let until = now.checked_add_signed(TimeDelta::days(days.into()));
        Ok(Self {
            from: now - TimeDelta::hours(1),
            until: until.with_context(|| format!("{days} days from {now}"))?,
        })
    }
}

/// The one whom all participants trust.
pub struct Authority {
    keystore: PathBuf,
    certificate: X509,
    key: PKey<Private>,
}

const AUTHORITY: &str = "abbe_keystore_ca";
const CERTIFICATE: &str = "public/ca.cert.pem";
const KEY: &str = "private/ca.key.pem";
const GOVERNANCE: &str = "enclaves/governance.xml";
const SIGNED_GOVERNANCE: &str = "enclaves/governance.p7s";
/// SROS 2's names of the one authority in its two parts.
const LINKS: [&str; 4] = [
    "public/identity_ca.cert.pem",
    "public/permissions_ca.cert.pem",
    "private/identity_ca.key.pem",
    "private/permissions_ca.key.pem",
];
/// Bits of a serial number.
const SERIAL_BITS: i32 = 127;

impl Authority {
    /// The authority of a keystore; a new one where the folder has none.
    ///
    /// # Errors
    /// When it has half of one, or files cannot be read or written.
    pub fn open_or_make(keystore: &Path, validity: &Validity) -> Result<Self> {
        let (certificate, key) = (keystore.join(CERTIFICATE), keystore.join(KEY));
        let context = || format!("keystore {}", keystore.display());
        match (certificate.is_file(), key.is_file()) {
            (true, true) => Self::open(keystore).with_context(context),
            (false, false) => Self::make(keystore, validity).with_context(context),
            (true, false) => bail!(
                "{} is there without {}",
                certificate.display(),
                key.display()
            ),
            (false, true) => bail!(
                "{} is there without {}",
                key.display(),
                certificate.display()
            ),
        }
    }

    fn open(keystore: &Path) -> Result<Self> {
        let read = |file: &str| text_file::bytes(&keystore.join(file));
        let own = Self {
            keystore: keystore.to_owned(),
            certificate: X509::from_pem(&read(CERTIFICATE)?).context(CERTIFICATE)?,
            key: PKey::private_key_from_pem(&read(KEY)?).context(KEY)?,
        };
        own.govern()?;
        Ok(own)
    }

    fn make(keystore: &Path, validity: &Validity) -> Result<Self> {
        for folder in ["public", "private", "enclaves"] {
            fs::create_dir_all(keystore.join(folder))?;
        }
        let key = new_key()?;
        let mut builder = certificate(AUTHORITY, &key, validity)?;
        builder.append_extension(BasicConstraints::new().critical().ca().build()?)?;
        let signs = KeyUsage::new()
            .critical()
            .key_cert_sign()
            .crl_sign()
            .digital_signature()
            .build()?;
        builder.append_extension(signs)?;
        let name = builder_name(AUTHORITY)?;
        builder.set_issuer_name(&name)?;
        builder.sign(&key, MessageDigest::sha256())?;
        let own = Self {
            keystore: keystore.to_owned(),
            certificate: builder.build(),
            key,
        };
        write(&keystore.join(CERTIFICATE), &own.certificate.to_pem()?)?;
        write_secret(&keystore.join(KEY), &own.key.private_key_to_pem_pkcs8()?)?;
        for link in LINKS {
            let to = if link.starts_with("public") {
                "ca.cert.pem"
            } else {
                "ca.key.pem"
            };
            symlink(to, keystore.join(link)).with_context(|| link.to_owned())?;
        }
        own.govern()?;
        Ok(own)
    }

    fn govern(&self) -> Result<()> {
        let text = documents::governance();
        write(&self.keystore.join(GOVERNANCE), text.as_bytes())?;
        write(&self.keystore.join(SIGNED_GOVERNANCE), &self.signed(&text)?)
    }

    /// Makes an enclave or renews its permissions; a key that is there is kept.
    ///
    /// # Errors
    /// When a file cannot be read or written.
    pub fn enclave(&self, enclave: &Enclave, validity: &Validity) -> Result<PathBuf> {
        let folder = self
            .keystore
            .join("enclaves")
            .join(enclave.name.trim_start_matches('/'));
        let context = || format!("enclave {}", enclave.name);
        let is_new = !folder.exists();
        let filled = self.fill(&folder, enclave, validity);
        if filled.is_err() && is_new {
            // Half an enclave cannot be used; why it is none is told by the error.
            let _ = fs::remove_dir_all(&folder);
        }
        filled.with_context(context)?;
        Ok(folder)
    }

    fn fill(&self, folder: &Path, enclave: &Enclave, validity: &Validity) -> Result<()> {
        fs::create_dir_all(folder)?;
        let [
            identity_ca,
            own,
            key_file,
            permissions_ca,
            governance,
            permissions,
        ] = ENCLAVE_FILES.map(|file| folder.join(file));
        let key = if key_file.is_file() {
            PKey::private_key_from_pem(&text_file::bytes(&key_file)?).context("key.pem")?
        } else {
            let key = new_key()?;
            write_secret(&key_file, &key.private_key_to_pem_pkcs8()?)?;
            key
        };
        let mut builder = certificate(&enclave.name, &key, validity)?;
        builder.set_issuer_name(self.certificate.subject_name())?;
        builder.append_extension(BasicConstraints::new().critical().build()?)?;
        builder.sign(&self.key, MessageDigest::sha256())?;
        write(&own, &builder.build().to_pem()?)?;
        for copy in [identity_ca, permissions_ca] {
            write(&copy, &self.certificate.to_pem()?)?;
        }
        write(
            &governance,
            &text_file::bytes(&self.keystore.join(SIGNED_GOVERNANCE))?,
        )?;
        let text = documents::permissions(&enclave.name, &enclave.access, validity);
        write(&folder.join("permissions.xml"), text.as_bytes())?;
        write(&permissions, &self.signed(&text)?)
    }

    /// A document with its signature, as S/MIME (DDS Security 1.1, 9.4.1.1).
    fn signed(&self, text: &str) -> Result<Vec<u8>> {
        let flags = Pkcs7Flags::TEXT | Pkcs7Flags::DETACHED;
        let none = Stack::new()?;
        let signature = Pkcs7::sign(&self.certificate, &self.key, &none, text.as_bytes(), flags)?;
        Ok(signature.to_smime(text.as_bytes(), flags)?)
    }
}

fn new_key() -> Result<PKey<Private>> {
    let group = EcGroup::from_curve_name(Nid::X9_62_PRIME256V1)?;
    Ok(PKey::from_ec_key(EcKey::generate(&group)?)?)
}

fn builder_name(common_name: &str) -> Result<openssl::x509::X509Name> {
    let mut name = X509NameBuilder::new()?;
    name.append_entry_by_nid(Nid::COMMONNAME, common_name)?;
    Ok(name.build())
}

/// A certificate that nobody has signed yet.
fn certificate(name: &str, key: &PKey<Private>, validity: &Validity) -> Result<X509Builder> {
    let mut builder = X509Builder::new()?;
    builder.set_version(2)?;
    let mut serial = BigNum::new()?;
    serial.rand(SERIAL_BITS, MsbOption::MAYBE_ZERO, false)?;
    let serial = serial.to_asn1_integer()?;
    builder.set_serial_number(&serial)?;
    let name = builder_name(name)?;
    builder.set_subject_name(&name)?;
    builder.set_pubkey(key)?;
    let from = Asn1Time::from_unix(validity.from.timestamp())?;
    let until = Asn1Time::from_unix(validity.until.timestamp())?;
    builder.set_not_before(&from)?;
    builder.set_not_after(&until)?;
    Ok(builder)
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    whole_file::write_bytes(path, bytes).context("writing")
}

/// Readable by nobody else.
fn write_secret(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut options = fs::OpenOptions::new();
    let opened = options.write(true).create_new(true).mode(0o600).open(path);
    let place = || format!("writing {}", path.display());
    let mut file = opened.with_context(place)?;
    whole(path, file.write_all(bytes))
}

/// Removes what could not be written whole: half a key or certificate cannot be used.
fn whole(path: &Path, written: std::io::Result<()>) -> Result<()> {
    if written.is_err() {
        let _ = fs::remove_file(path);
    }
    written.with_context(|| format!("writing {}", path.display()))
}
