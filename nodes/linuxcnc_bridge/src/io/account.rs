//! The ordinary user under whom LinuxCNC and everything that shares its memory runs.

use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use nix::unistd::{Gid, Uid, User, chown, geteuid};
use tempfile::TempDir;

use crate::error::BridgeError;

/// Where LinuxCNC's programs are, and those which they call.
const PROGRAM_PATH: &str = "/usr/local/bin:/usr/bin:/bin:/usr/sbin:/sbin";

/// A user and a home of its own, which is gone when the last copy of this is dropped.
#[derive(Clone, Debug)]
pub struct Account {
    /// `None`: the user who runs this process.
    other: Option<(Uid, Gid)>,
    home: Arc<TempDir>,
}

impl Account {
    /// User `name` when this process runs as root, else the user who runs it; with a new home.
    ///
    /// # Errors
    /// When the user does not exist or is root, or no home can be made.
    pub fn ordinary(name: &str) -> Result<Self, BridgeError> {
        let other = if geteuid().is_root() {
            match User::from_name(name) {
                Ok(Some(user)) if !user.uid.is_root() => Some((user.uid, user.gid)),
                _ => {
                    return Err(BridgeError::NoSuchUser {
                        user: name.to_owned(),
                    });
                }
            }
        } else {
            None
        };
        let home = tempfile::Builder::new()
            .prefix("abbe-linuxcnc-")
            .tempdir()
            .map_err(|source| BridgeError::Io {
                action: "making a directory in",
                path: std::env::temp_dir(),
                source,
            })?;
        let account = Self {
            other,
            home: Arc::new(home),
        };
        account.own(account.home())?;
        Ok(account)
    }

    /// Home and working directory.
    #[must_use]
    pub fn home(&self) -> &Path {
        self.home.path()
    }

    /// Makes `command` run as this user, with an environment of its own.
    pub fn apply(&self, command: &mut Command) {
        command
            .env_clear()
            .env("HOME", self.home())
            .env("PATH", PROGRAM_PATH)
            // Error messages are understood in English.
            .env("LANG", "C")
            .current_dir(self.home());
        if let Some((user, group)) = self.other {
            command.uid(user.as_raw()).gid(group.as_raw());
        }
    }

    /// Gives a file or directory to this user, readable for everybody.
    ///
    /// # Errors
    /// When the system refuses.
    pub fn own(&self, path: &Path) -> Result<(), BridgeError> {
        let failed = |source| BridgeError::Io {
            action: "handing over",
            path: path.to_owned(),
            source,
        };
        let mode = if path.is_dir() { 0o755 } else { 0o644 };
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).map_err(failed)?;
        if let Some((user, group)) = self.other {
            chown(path, Some(user), Some(group)).map_err(|error| failed(error.into()))?;
        }
        Ok(())
    }
}
