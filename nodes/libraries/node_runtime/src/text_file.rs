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
use metrology::yaml::{self, YamlError};

pub use metrology::text::Comments;

/// Length of a text: a program of 1,000,000 lines, the most that a control takes, has a tenth of it.
const MAX_TEXT_BYTES: u64 = 256 << 20;

/// Most files of a chain in which each names the next as its base.
const MAX_BASES: usize = 8;

/// A YAML text and the file that holds it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct YamlFile {
    /// The file that was named, or the one that its key `base` leads to.
    pub path: PathBuf,
    /// Its text.
    pub text: String,
}

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
    /// Its key `base` is no path, or not its only key.
    #[error("{path}:{reason}", path = path.display())]
    BadBase {
        /// Which.
        path: PathBuf,
        /// Line, column and what is wrong.
        reason: YamlError,
    },
    /// The file that its key `base` names cannot be read.
    #[error("{path}: base = {base}: {reason}: must name a file that can be read, relative to the folder of this one", path = path.display())]
    UnreadableBase {
        /// Which.
        path: PathBuf,
        /// What it names.
        base: String,
        /// Why that cannot be read.
        reason: Box<TextFileError>,
    },
    /// The files that `base` leads to never end.
    #[error("{path}: base leads through {chain}: must lead to a file with keys of its own after at most {most} files: let one of them hold the keys", path = path.display())]
    EndlessBase {
        /// Which.
        path: PathBuf,
        /// The files on the way.
        chain: String,
        /// The limit.
        most: usize,
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
#[must_use]
pub fn kind_of(kind: FileType) -> Option<&'static str> {
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

/// The text of a YAML file, as [`yaml_file`].
///
/// # Errors
/// As [`yaml_file`].
pub fn yaml(path: &Path) -> Result<String, TextFileError> {
    Ok(yaml_file(path)?.text)
}

/// A YAML file; where `base: PATH` is its only key, the file at that path, relative to its own folder.
///
/// # Errors
/// As [`read`]; where `base` is no path, is not the only key, names no file that can be read, or leads back to its own file.
pub fn yaml_file(path: &Path) -> Result<YamlFile, TextFileError> {
    let mut path = path.to_owned();
    let mut text = read(&path, Comments::Yaml)?;
    let mut chain = vec![path.clone()];
    while let Some(base) = base_of(&path, &text)? {
        let next = path.parent().unwrap_or(Path::new("")).join(&base);
        let is_known = chain.iter().any(|known| is_same(known, &next));
        if is_known || chain.len() > MAX_BASES {
            chain.push(next);
            let names: Vec<_> = chain
                .iter()
                .map(|file| file.display().to_string())
                .collect();
            return Err(TextFileError::EndlessBase {
                path: chain.swap_remove(0),
                chain: names.join(" -> "),
                most: MAX_BASES,
            });
        }
        text = read(&next, Comments::Yaml).map_err(|reason| TextFileError::UnreadableBase {
            path,
            base,
            reason: Box::new(reason),
        })?;
        path = next;
        chain.push(path.clone());
    }
    Ok(YamlFile { path, text })
}

fn base_of(path: &Path, text: &str) -> Result<Option<String>, TextFileError> {
    yaml::base_of(text).map_err(|reason| TextFileError::BadBase {
        path: path.to_owned(),
        reason,
    })
}

/// Whether two paths lead to one file.
fn is_same(a: &Path, b: &Path) -> bool {
    match (a.canonicalize(), b.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        _ => false,
    }
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

    #[test]
    fn a_base_is_read_in_place_of_the_file_that_names_it() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for name in ["mill", "copy"] {
            std::fs::create_dir(at(name)).unwrap();
        }
        std::fs::write(at("mill/machine.yaml"), "name: mill\n").unwrap();
        std::fs::write(
            at("copy/machine.yaml"),
            "# shared\nbase: ../mill/machine.yaml\n",
        )
        .unwrap();
        std::fs::write(at("third.yaml"), "base: copy/machine.yaml\n").unwrap();
        let read = yaml_file(&at("third.yaml")).unwrap();
        assert_eq!(read.text, "name: mill\n");
        assert_eq!(read.path, at("copy/../mill/machine.yaml"));
        assert_eq!(yaml(&at("mill/machine.yaml")).unwrap(), "name: mill\n");
        let place = at("mill/machine.yaml").display().to_string();
        std::fs::write(at("absolute.yaml"), format!("base: {place}\n")).unwrap();
        assert_eq!(yaml(&at("absolute.yaml")).unwrap(), "name: mill\n");
    }

    #[test]
    fn a_base_that_leads_nowhere_or_back_is_refused_with_the_way() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for (name, text) in [
            ("gone.yaml", "base: none.yaml\n".to_owned()),
            ("self.yaml", "base: ./self.yaml\n".to_owned()),
            ("a.yaml", "base: b.yaml\n".to_owned()),
            ("b.yaml", "base: a.yaml\n".to_owned()),
            ("both.yaml", "base: a.yaml\nname: mill\n".to_owned()),
            ("folder.yaml", "base: .\n".to_owned()),
        ] {
            std::fs::write(at(name), text).unwrap();
        }
        for n in 0..20 {
            let next = format!("base: long_{}.yaml\n", n + 1);
            std::fs::write(at(&format!("long_{n}.yaml")), next).unwrap();
        }
        for (name, words) in [
            (
                "gone.yaml",
                &["/gone.yaml: base = none.yaml: ", "/none.yaml: No such file"][..],
            ),
            (
                "self.yaml",
                &[
                    "/self.yaml: base leads through ",
                    "let one of them hold the keys",
                ],
            ),
            ("a.yaml", &["/a.yaml -> ", "/b.yaml -> "]),
            (
                "both.yaml",
                &["/both.yaml:1:7: base = a.yaml: must be the only key"],
            ),
            ("folder.yaml", &["/folder.yaml: base = .: ", "is a folder"]),
            ("long_0.yaml", &["after at most 8 files"]),
        ] {
            let error = yaml_file(&at(name)).unwrap_err();
            assert!(!error.is_absent(), "{error}");
            for words in words {
                assert!(error.to_string().contains(words), "{words}: {error}");
            }
        }
        assert!(yaml_file(&at("none.yaml")).unwrap_err().is_absent());
    }
}
