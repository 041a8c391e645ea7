//! A bag is made of regular files. Anything else is refused before it is opened: a pipe waits for its other end, and a
//! device may have no end.
#![expect(
    clippy::disallowed_methods,
    reason = "opening a bag reads files; only recorder, replayer and the command line do"
)]

use std::fs::{self, File};
use std::io::Read;
use std::os::unix::fs::FileTypeExt;
use std::path::Path;

use crate::error::RecorderError;

/// Length of a description: that of a bag of a million files has a quarter of it.
const MOST_TEXT_BYTES: u64 = 256 << 20;

/// The kind of a file that is not regular; `None` for a regular file.
fn kind_of(path: &Path) -> std::io::Result<Option<&'static str>> {
    let kind = match fs::metadata(path) {
        Ok(metadata) => metadata.file_type(),
        Err(_) if path.is_symlink() => return Ok(Some("a link that leads nowhere")),
        Err(error) => return Err(error),
    };
    Ok(if kind.is_file() {
        None
    } else if kind.is_dir() {
        Some("a folder")
    } else if kind.is_fifo() {
        Some("a pipe (FIFO)")
    } else if kind.is_socket() {
        Some("a socket")
    } else {
        Some("a device")
    })
}

/// Opens a file of a bag.
///
/// # Errors
/// When it cannot be opened, or is no regular file.
pub(super) fn open(path: &Path) -> Result<File, RecorderError> {
    let failed = |source| RecorderError::Open {
        path: path.to_owned(),
        source,
    };
    if let Some(kind) = kind_of(path).map_err(failed)? {
        return Err(RecorderError::NotRegular {
            path: path.to_owned(),
            kind,
        });
    }
    File::open(path).map_err(failed)
}

/// The text of a bag's description.
///
/// # Errors
/// Why it cannot be read.
pub(super) fn description(path: &Path) -> Result<String, String> {
    let file = match open(path) {
        Ok(file) => file,
        Err(RecorderError::NotRegular { kind, .. }) => {
            return Err(format!("the description is {kind}, no regular file"));
        }
        Err(error) => return Err(format!("the description cannot be read: {error}")),
    };
    let mut text = String::new();
    match file.take(MOST_TEXT_BYTES).read_to_string(&mut text) {
        Ok(_) => Ok(text),
        Err(_) => Err("the description cannot be read as UTF-8 text".to_owned()),
    }
}

/// The text of a bag's description, as far as there is one.
pub(super) fn text(path: &Path) -> Option<String> {
    description(path).ok()
}

#[cfg(test)]
mod tests {
    use crate::Bag;

    #[test]
    fn what_is_no_regular_file_is_no_bag_and_nothing_waits_for_it() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("bag_0.mcap");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        assert!(made.unwrap().success());
        let nested = folder.path().join("nested");
        std::fs::create_dir_all(nested.join("bag_0.mcap")).unwrap();
        let described = folder.path().join("described");
        std::fs::create_dir(&described).unwrap();
        let made = std::process::Command::new("mkfifo")
            .arg(described.join("metadata.yaml"))
            .status();
        assert!(made.unwrap().success());
        let text = |path: &std::path::Path| Bag::open(path).unwrap_err().to_string();
        for (path, kind) in [
            (pipe.as_path(), "is a pipe (FIFO)"),
            (folder.path(), "is a pipe (FIFO)"),
            (&nested, "is a folder"),
            (std::path::Path::new("/dev/zero"), "is a device"),
            (std::path::Path::new("/dev/null"), "is a device"),
        ] {
            let refused = text(path);
            assert!(refused.contains(kind), "{refused}");
        }
        let link = folder.path().join("link.mcap");
        std::os::unix::fs::symlink("nowhere", &link).unwrap();
        let refused = text(&link);
        assert!(
            refused.contains("is a link that leads nowhere"),
            "{refused}"
        );
        // A pipe is not read as a description.
        let refused = text(&described);
        assert!(refused.contains("described"), "{refused}");
    }

    #[test]
    fn files_without_a_byte_are_no_bag_alone_as_in_a_folder() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("bag_0.mcap");
        std::fs::write(&file, "").unwrap();
        for path in [file.as_path(), folder.path()] {
            let refused = Bag::open(path).unwrap_err().to_string();
            assert!(
                refused.contains("is no bag: nothing is in it (0 bytes)"),
                "{refused}"
            );
        }
        std::fs::write(folder.path().join("bag_1.mcap"), "").unwrap();
        assert!(Bag::open(folder.path()).is_err());
        // Beside a file with contents an empty one is damage.
        std::fs::write(&file, mcap::MAGIC).unwrap();
        assert!(Bag::open(folder.path()).is_ok());
    }
}
