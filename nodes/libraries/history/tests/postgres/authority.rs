//! Certificates of a test, made by the program `openssl`.

use std::path::{Path, PathBuf};
use std::process::Command;

use tempfile::TempDir;

/// An authority with the certificates that it signed.
pub struct Authority {
    home: TempDir,
}

/// A certificate and its key.
pub struct Signed {
    pub certificate: PathBuf,
    pub key: PathBuf,
}

fn openssl(home: &Path, line: &str) {
    let done = Command::new("openssl")
        .args(line.split(' '))
        .current_dir(home)
        .output()
        .unwrap();
    assert!(done.status.success(), "openssl {line}: {done:?}");
}

impl Authority {
    pub fn new(name: &str) -> Self {
        let home = tempfile::tempdir().unwrap();
        let line = format!(
            "req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -keyout ca.key -out ca.pem -days 2 -subj /CN={name}"
        );
        openssl(home.path(), &line);
        let settings =
            "[ca]\ndefault_ca=d\n[d]\ndatabase=index.txt\ndefault_md=sha256\ndefault_crl_days=2\n";
        std::fs::write(home.path().join("ca.cnf"), settings).unwrap();
        std::fs::write(home.path().join("index.txt"), "").unwrap();
        Self { home }
    }

    fn file(&self, name: &str) -> PathBuf {
        self.home.path().join(name)
    }

    /// The authority's own certificate.
    pub fn certificate(&self) -> PathBuf {
        self.file("ca.pem")
    }

    /// A certificate for a name, and for `days` from now.
    pub fn sign(&self, name: &str, days: i32) -> Signed {
        let line = format!(
            "req -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -keyout {name}.key -out {name}.csr -subj /CN={name} -addext subjectAltName=DNS:{name}"
        );
        openssl(self.home.path(), &line);
        let line = format!(
            "x509 -req -in {name}.csr -CA ca.pem -CAkey ca.key -CAcreateserial -copy_extensions copy -days {days} -out {name}.pem"
        );
        openssl(self.home.path(), &line);
        Signed {
            certificate: self.file(&format!("{name}.pem")),
            key: self.file(&format!("{name}.key")),
        }
    }

    /// The list of revoked certificates: with one of them, or empty.
    pub fn revoked(&self, one: Option<&Signed>) -> PathBuf {
        let keys = "-config ca.cnf -keyfile ca.key -cert ca.pem";
        if let Some(one) = one {
            let file = one.certificate.display();
            openssl(self.home.path(), &format!("ca {keys} -revoke {file}"));
        }
        openssl(
            self.home.path(),
            &format!("ca {keys} -gencrl -out list.crl"),
        );
        self.file("list.crl")
    }

    /// The key once more, encrypted with a password.
    pub fn encrypted(&self, signed: &Signed, password: &str) -> PathBuf {
        let key = signed.key.display();
        let line = format!("pkcs8 -topk8 -in {key} -out encrypted.key -passout pass:{password}");
        openssl(self.home.path(), &line);
        self.file("encrypted.key")
    }
}
