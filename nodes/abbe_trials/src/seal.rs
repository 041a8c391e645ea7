//! The truth of a trial in a file that nobody may read until the diagnosis is over.

use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use node_runtime::text_file;
use sha2::{Digest, Sha256};
use trials::Truth;

/// Nobody may do anything.
const SHUT: u32 = 0o000;
/// Its owner may read it.
const OPEN: u32 = 0o400;
/// Only the owner may look into the folder.
const PRIVATE: u32 = 0o700;

/// A sealed truth.
pub struct Seal {
    path: PathBuf,
    /// SHA-256 of the file, hexadecimal.
    pub sha256: String,
}

impl Seal {
    /// Writes and shuts it.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write(folder: &Path, name: &str, truth: &Truth) -> Result<Self> {
        let place = |path: &Path| format!("seal {}", path.display());
        std::fs::create_dir_all(folder).with_context(|| place(folder))?;
        mode(folder, PRIVATE)?;
        let path = folder.join(format!("{name}.json"));
        let text = serde_json::to_string_pretty(truth)?;
        if path.exists() {
            std::fs::remove_file(&path).with_context(|| place(&path))?;
        }
        std::fs::write(&path, &text).with_context(|| place(&path))?;
        mode(&path, SHUT)?;
        Ok(Self {
            sha256: format!("{:x}", Sha256::digest(&text)),
            path,
        })
    }

    /// Opens it.
    ///
    /// # Errors
    /// When it cannot be read, or is another file than was shut.
    pub fn open(&self) -> Result<Truth> {
        mode(&self.path, OPEN)?;
        let text = text_file::bytes(&self.path).context("seal")?;
        if format!("{:x}", Sha256::digest(&text)) != self.sha256 {
            bail!(
                "seal {}: was changed after it was shut",
                self.path.display()
            );
        }
        Ok(serde_json::from_slice(&text)?)
    }
}

fn mode(path: &Path, mode: u32) -> Result<()> {
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode))
        .with_context(|| format!("seal {}", path.display()))
}
