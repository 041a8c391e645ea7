//! ROS's variables of DDS Security, and the enclave that a node finds its credentials in.
//!
//! As SROS 2 has it: a keystore is a folder, an enclave in it a folder below `enclaves`, with the six files that
//! [`FILES`] names. A node's enclave is its own full name unless the environment or `--enclave` says another.

use std::path::{Path, PathBuf};

use super::EnvironmentError;

/// What an enclave holds.
pub const FILES: [&str; 6] = [
    "identity_ca.cert.pem",
    "cert.pem",
    "key.pem",
    "permissions_ca.cert.pem",
    "governance.p7s",
    "permissions.p7s",
];

/// How nodes identify themselves and what they keep secret.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Security {
    /// `ROS_SECURITY_KEYSTORE`.
    pub keystore: PathBuf,
    /// `ROS_SECURITY_STRATEGY=Enforce`: a node without credentials does not start. Otherwise it goes unsecured.
    pub enforced: bool,
    /// `ROS_SECURITY_ENCLAVE_OVERRIDE`, else `--enclave`: the enclave of every node of the process.
    pub enclave: Option<String>,
}

/// Why a node has no credentials.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "DDS Security: enclave {enclave} in {folder} lacks {missing}; `abbe keystore` and `ros2 security create_enclave` make it",
    folder = folder.display()
)]
pub struct NoCredentials {
    /// As ROS names it.
    pub enclave: String,
    /// Where it should be.
    pub folder: PathBuf,
    /// Files that are not there.
    pub missing: String,
}

impl Security {
    /// What the variables say; `None`: nothing is secured.
    pub(super) fn from_variables(
        set: impl Fn(&'static str) -> Option<String>,
    ) -> Result<Option<Self>, EnvironmentError> {
        let bad = |variable, value: &str, allowed| EnvironmentError::BadVariable {
            variable,
            value: value.to_owned(),
            allowed,
        };
        match set("ROS_SECURITY_ENABLE").as_deref() {
            None | Some("false") => return Ok(None),
            Some("true") => {}
            Some(value) => return Err(bad("ROS_SECURITY_ENABLE", value, "true or false")),
        }
        let enforced = match set("ROS_SECURITY_STRATEGY").as_deref() {
            None | Some("Permissive") => false,
            Some("Enforce") => true,
            Some(value) => {
                return Err(bad("ROS_SECURITY_STRATEGY", value, "Enforce or Permissive"));
            }
        };
        let keystore = set("ROS_SECURITY_KEYSTORE").ok_or_else(|| {
            bad(
                "ROS_SECURITY_KEYSTORE",
                "",
                "a folder, since ROS_SECURITY_ENABLE=true",
            )
        })?;
        let enclave = set("ROS_SECURITY_ENCLAVE_OVERRIDE");
        if let Some(enclave) = enclave.as_deref().filter(|name| !is_enclave(name)) {
            return Err(bad("ROS_SECURITY_ENCLAVE_OVERRIDE", enclave, ENCLAVE));
        }
        Ok(Some(Self {
            keystore: keystore.into(),
            enforced,
            enclave,
        }))
    }

    /// The folder of a node's credentials, whether or not it is there.
    #[must_use]
    pub fn folder(&self, node: &str) -> PathBuf {
        let enclave = self.enclave.as_deref().unwrap_or(node);
        self.keystore
            .join("enclaves")
            .join(enclave.trim_start_matches('/'))
    }

    /// The same, checked.
    ///
    /// # Errors
    /// When a file is missing.
    pub fn credentials(&self, node: &str) -> Result<PathBuf, NoCredentials> {
        let folder = self.folder(node);
        let missing = FILES.iter().filter(|file| !is_there(&folder, file));
        let missing: Vec<&str> = missing.copied().collect();
        if missing.is_empty() {
            return Ok(folder);
        }
        Err(NoCredentials {
            enclave: self.enclave.as_deref().unwrap_or(node).to_owned(),
            folder,
            missing: missing.join(", "),
        })
    }
}

fn is_there(folder: &Path, file: &str) -> bool {
    folder.join(file).is_file()
}

/// What names an enclave.
pub(crate) const ENCLAVE: &str = "an absolute name of letters, digits, _ and /";

/// Whether a name can be an enclave's: it becomes a path below the keystore.
#[must_use]
pub fn is_enclave(name: &str) -> bool {
    let is_part = |part: &str| {
        !part.is_empty() && part.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
    };
    name == "/"
        || name
            .strip_prefix('/')
            .is_some_and(|rest| rest.split('/').all(is_part))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(pairs: &[(&str, &str)]) -> Result<Option<Security>, String> {
        let set = |name: &'static str| {
            let found = pairs.iter().find(|(n, _)| *n == name);
            found.map(|(_, value)| (*value).to_owned())
        };
        Security::from_variables(set).map_err(|error| error.to_string())
    }

    #[test]
    fn variables_have_the_meaning_of_ros() {
        assert_eq!(read(&[]), Ok(None));
        assert_eq!(read(&[("ROS_SECURITY_ENABLE", "false")]), Ok(None));
        let all = [
            ("ROS_SECURITY_ENABLE", "true"),
            ("ROS_SECURITY_STRATEGY", "Enforce"),
            ("ROS_SECURITY_KEYSTORE", "/keys"),
        ];
        let security = read(&all).unwrap().unwrap();
        assert!(security.enforced);
        assert_eq!(
            security.folder("/cell/probe"),
            Path::new("/keys/enclaves/cell/probe")
        );
        let other = Security {
            enclave: Some("/shop".to_owned()),
            ..security
        };
        assert_eq!(
            other.folder("/cell/probe"),
            Path::new("/keys/enclaves/shop")
        );
    }

    #[test]
    fn bad_variables_are_refused_by_name() {
        let on = ("ROS_SECURITY_ENABLE", "true");
        let keys = ("ROS_SECURITY_KEYSTORE", "/keys");
        for pairs in [
            &[("ROS_SECURITY_ENABLE", "yes")][..],
            &[keys, ("ROS_SECURITY_STRATEGY", "enforce"), on],
            &[on, ("ROS_SECURITY_KEYSTORE", "")],
            &[on, keys, ("ROS_SECURITY_ENCLAVE_OVERRIDE", "/../other")],
            &[on, keys, ("ROS_SECURITY_ENCLAVE_OVERRIDE", "probe")],
        ] {
            let pairs: Vec<_> = pairs
                .iter()
                .copied()
                .filter(|(_, v)| !v.is_empty())
                .collect();
            let error = read(&pairs).unwrap_err();
            assert!(error.starts_with("ROS_SECURITY_"), "{error}");
        }
    }

    #[test]
    fn a_missing_file_is_named_with_its_enclave_and_folder() {
        let keystore = tempfile::tempdir().unwrap();
        let security = Security {
            keystore: keystore.path().to_owned(),
            enforced: true,
            enclave: None,
        };
        let folder = keystore.path().join("enclaves/probe");
        std::fs::create_dir_all(&folder).unwrap();
        for file in &FILES[..5] {
            std::fs::write(folder.join(file), "").unwrap();
        }
        let error = security.credentials("/probe").unwrap_err().to_string();
        for word in ["/probe", "enclaves/probe", "permissions.p7s"] {
            assert!(error.contains(word), "{error}");
        }
        std::fs::write(folder.join(FILES[5]), "").unwrap();
        assert_eq!(security.credentials("/probe"), Ok(folder));
    }
}
