//! The one reader of text files: machine files, parameters, plans, maps, tables, programs, launch files. It reads regular
//! files alone, of at most 256 MiB, however much longer a file grows while it is read. A device, a pipe, a socket or a
//! folder is refused by its kind before it is opened, since opening a pipe waits for its other end.
#![expect(
    clippy::disallowed_methods,
    reason = "the files that people name are read here"
)]

use std::fs::{File, FileType};
use std::io::Read;
use std::os::unix::fs::FileTypeExt;
use std::path::{Path, PathBuf};

use metrology::text::{self, TextError};

pub use metrology::text::Comments;

/// Length of a text: a program of 1,000,000 lines, the most that a control takes, has a tenth of it.
const MAX_TEXT_BYTES: u64 = 256 << 20;

/// Why a file gives no text.
#[derive(Debug, thiserror::Error)]
pub enum TextFileError {
    /// It cannot be opened or read.
    #[error("{path}: {source}", path = path.display())]
    Unreadable {
        /// Which.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// It is not a regular file.
    #[error("{path}: is {kind}, must be a regular file: write what it holds to a file and name that", path = path.display())]
    NotRegular {
        /// Which.
        path: PathBuf,
        /// Its kind.
        kind: &'static str,
    },
    /// It is too long.
    #[error("{path}: longer than {most_bytes} bytes, the most that is read: split it", path = path.display())]
    TooLong {
        /// Which.
        path: PathBuf,
        /// The limit.
        most_bytes: u64,
    },
    /// It holds a byte that is not UTF-8 where it counts.
    #[error("{path}:{source}", path = path.display())]
    NotUtf8 {
        /// Which.
        path: PathBuf,
        /// Line, column and byte.
        source: TextError,
    },
}

impl TextFileError {
    /// Whether there is no such file.
    #[must_use]
    pub fn is_absent(&self) -> bool {
        matches!(self, Self::Unreadable { source, .. } if source.kind() == std::io::ErrorKind::NotFound)
    }
}

/// The text of a file without byte order mark, its lines ended by line feeds; comments may hold any byte.
///
/// # Errors
/// The file with the system's reason, with its kind or length, or with line and column of a byte that is not UTF-8.
pub fn read(path: &Path, comments: Comments) -> Result<String, TextFileError> {
    text::decode(&bytes(path)?, comments).map_err(|source| TextFileError::NotUtf8 {
        path: path.to_owned(),
        source,
    })
}

/// The bytes of a file of whatever encoding.
///
/// # Errors
/// When it cannot be read, is no regular file, or is longer than 256 MiB.
pub fn bytes(path: &Path) -> Result<Vec<u8>, TextFileError> {
    bytes_at_most(path, MAX_TEXT_BYTES)
}

/// A regular file of any length, to be read in pieces, and its length.
///
/// # Errors
/// When it cannot be opened or is no regular file.
pub fn open(path: &Path) -> Result<(File, u64), TextFileError> {
    let unreadable = |source| TextFileError::Unreadable {
        path: path.to_owned(),
        source,
    };
    let regular = |kind: FileType| match kind_of(kind) {
        None => Ok(()),
        Some(kind) => Err(TextFileError::NotRegular {
            path: path.to_owned(),
            kind,
        }),
    };
    regular(std::fs::metadata(path).map_err(unreadable)?.file_type())?;
    let file = File::open(path).map_err(unreadable)?;
    let metadata = file.metadata().map_err(unreadable)?;
    // Another file may have taken its name.
    regular(metadata.file_type())?;
    Ok((file, metadata.len()))
}

/// The kind of a file that is not regular; `None` for a regular file.
fn kind_of(kind: FileType) -> Option<&'static str> {
    if kind.is_file() {
        None
    } else if kind.is_dir() {
        Some("a folder")
    } else if kind.is_fifo() {
        Some("a pipe (FIFO)")
    } else if kind.is_socket() {
        Some("a socket")
    } else {
        Some("a device")
    }
}

fn bytes_at_most(path: &Path, most_bytes: u64) -> Result<Vec<u8>, TextFileError> {
    let (file, length) = open(path)?;
    let too_long = || TextFileError::TooLong {
        path: path.to_owned(),
        most_bytes,
    };
    if length > most_bytes {
        return Err(too_long());
    }
    let mut bytes = Vec::new();
    let read = file.take(most_bytes + 1).read_to_end(&mut bytes);
    read.map_err(|source| TextFileError::Unreadable {
        path: path.to_owned(),
        source,
    })?;
    if bytes.len() as u64 > most_bytes {
        return Err(too_long());
    }
    Ok(bytes)
}

/// The text of a YAML file, as [`read`].
///
/// # Errors
/// As [`read`].
pub fn yaml(path: &Path) -> Result<String, TextFileError> {
    read(path, Comments::Yaml)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_named_with_line_and_column_of_what_is_not_utf8() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.yaml");
        std::fs::write(&path, b"\xEF\xBB\xBF# \xB5m\r\nname: m\r\n").unwrap();
        assert_eq!(yaml(&path).unwrap(), "# \u{FFFD}m\nname: m\n");
        std::fs::write(&path, b"# m\nname: \xB5\n").unwrap();
        let error = yaml(&path).unwrap_err().to_string();
        let wanted = format!("{}:2:7: byte 0xB5 is not UTF-8", path.display());
        assert!(error.starts_with(&wanted), "{error}");
        let absent = read(&folder.path().join("a"), Comments::None);
        assert!(absent.unwrap_err().to_string().contains("/a: No such file"));
    }

    #[test]
    fn a_text_is_read_up_to_its_limit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("text");
        std::fs::write(&path, "steps").unwrap();
        assert_eq!(bytes_at_most(&path, 5).unwrap(), b"steps");
        let refused = bytes_at_most(&path, 4).unwrap_err().to_string();
        assert!(refused.contains("longer than 4 bytes"), "{refused}");
        // A file without contents of 1 TiB takes no room on the disk, and none in memory.
        let huge = folder.path().join("huge");
        File::create(&huge).unwrap().set_len(1 << 40).unwrap();
        let refused = bytes(&huge).unwrap_err().to_string();
        assert!(
            refused.contains("/huge: longer than 268435456 bytes"),
            "{refused}"
        );
        assert_eq!(open(&huge).unwrap().1, 1 << 40);
    }

    #[test]
    fn what_is_no_regular_file_is_refused_by_its_kind_without_waiting() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        assert!(made.unwrap().success());
        let link = folder.path().join("link");
        std::os::unix::fs::symlink(&pipe, &link).unwrap();
        let socket = folder.path().join("socket");
        let _listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
        let table: [(&Path, &str); 8] = [
            (Path::new("/dev/zero"), "a device"),
            (Path::new("/dev/null"), "a device"),
            (Path::new("/dev/tty"), "a device"),
            (&pipe, "a pipe (FIFO)"),
            (&link, "a pipe (FIFO)"),
            (&socket, "a socket"),
            (folder.path(), "a folder"),
            (Path::new("/proc/self"), "a folder"),
        ];
        for (path, kind) in table {
            let wanted = format!("{}: is {kind}, must be a regular file", path.display());
            for refused in [
                bytes(path).err(),
                yaml(path).err(),
                read(path, Comments::Gcode).err(),
                open(path).err(),
            ] {
                let refused = refused.unwrap().to_string();
                assert!(refused.starts_with(&wanted), "{refused}");
            }
        }
        assert!(open(&folder.path().join("none")).unwrap_err().is_absent());
    }
}
