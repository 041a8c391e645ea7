//! Where a recording's files stand: a directory, or whatever a test puts in its place.
#![expect(
    clippy::disallowed_methods,
    reason = "the recorder's purpose is to write files"
)]

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use crate::error::RecorderError;

/// A place for named files.
pub trait Shelf {
    /// A file that is being written.
    type File: Write + Send;

    /// Begins a file.
    ///
    /// # Errors
    /// The system's reason; a file of this name is one.
    fn create(&mut self, name: &str) -> io::Result<Self::File>;

    /// Puts a whole small file in place of the old one, so that a reader sees one or the other.
    ///
    /// # Errors
    /// The system's reason.
    fn replace(&mut self, name: &str, contents: &[u8]) -> io::Result<()>;

    /// Cuts a file to its first `length_bytes`.
    ///
    /// # Errors
    /// The system's reason.
    fn truncate(&mut self, name: &str, length_bytes: u64) -> io::Result<()>;

    /// Waits until a finished file is on the disk.
    ///
    /// # Errors
    /// The system's reason.
    fn settle(&mut self, name: &str) -> io::Result<()>;

    /// For messages: where this shelf stands.
    fn path(&self) -> &Path;
}

/// A directory made for one recording.
#[derive(Debug)]
pub struct Directory {
    path: PathBuf,
}

impl Directory {
    /// Makes the directory and its parents.
    ///
    /// # Errors
    /// It exists already, or cannot be made.
    pub fn create(path: &Path) -> Result<Self, RecorderError> {
        let failed = |source: io::Error| RecorderError::Create {
            path: path.to_owned(),
            source,
        };
        if let Some(parent) = path.parent() {
            fs::create_dir_all(parent).map_err(failed)?;
        }
        match fs::create_dir(path) {
            Ok(()) => Ok(Self {
                path: path.to_owned(),
            }),
            Err(source) if source.kind() == io::ErrorKind::AlreadyExists => {
                Err(RecorderError::Exists {
                    path: path.to_owned(),
                })
            }
            Err(source) => Err(failed(source)),
        }
    }
}

impl Shelf for Directory {
    type File = File;

    fn create(&mut self, name: &str) -> io::Result<File> {
        OpenOptions::new()
            .write(true)
            .create_new(true)
            .open(self.path.join(name))
    }

    fn replace(&mut self, name: &str, contents: &[u8]) -> io::Result<()> {
        let new = self.path.join(format!("{name}.new"));
        let written =
            fs::write(&new, contents).and_then(|()| fs::rename(&new, self.path.join(name)));
        if written.is_err() {
            // What could not be written whole must not stay beside the old file.
            let _ = fs::remove_file(&new);
        }
        written
    }

    fn truncate(&mut self, name: &str, length_bytes: u64) -> io::Result<()> {
        OpenOptions::new()
            .write(true)
            .open(self.path.join(name))?
            .set_len(length_bytes)
    }

    fn settle(&mut self, name: &str) -> io::Result<()> {
        File::open(self.path.join(name))?.sync_all()
    }

    fn path(&self) -> &Path {
        &self.path
    }
}
