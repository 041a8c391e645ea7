//! Recordings of rosbag2 that are no MCAP, or whose contents it has compressed by itself: refused by name.
#![expect(
    clippy::disallowed_methods,
    reason = "opening a bag reads files; only recorder, replayer and the command line do"
)]

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use crate::error::RecorderError;
use crate::layout::{METADATA_FILE, compression_of, file_names_of};

/// How a file begins that Zstandard has compressed.
const ZSTD: &[u8] = &[0x28, 0xb5, 0x2f, 0xfd];
/// How an SQLite database begins.
const SQLITE: &[u8] = b"SQLite format 3";

/// Refuses files that rosbag2 has written and that are not read here.
///
/// # Errors
/// Names the file and what it is. A file that cannot be opened is told by whoever reads it.
pub(super) fn refuse(folder: &Path, files: &[PathBuf]) -> Result<(), RecorderError> {
    for path in files {
        if let Some(what) = kind_of(path) {
            let path = path.clone();
            return Err(RecorderError::NotRead { path, what });
        }
    }
    let metadata = match files {
        [only] if folder == only => only.with_file_name(METADATA_FILE),
        _ => folder.join(METADATA_FILE),
    };
    let Ok(text) = std::fs::read_to_string(&metadata) else {
        return Ok(());
    };
    let names = file_names_of(&text).unwrap_or_default();
    let is_listed = |path: &PathBuf| names.iter().any(|name| path.ends_with(name));
    match compression_of(&text) {
        Some(mode) if mode == "message" && files.iter().any(is_listed) => {
            Err(RecorderError::NotRead {
                path: folder.to_owned(),
                what: "holds messages that rosbag2 has compressed one by one",
            })
        }
        _ => Ok(()),
    }
}

fn kind_of(path: &Path) -> Option<&'static str> {
    let mut start = Vec::new();
    let file = File::open(path).ok()?;
    file.take(SQLITE.len() as u64)
        .read_to_end(&mut start)
        .ok()?;
    if start.starts_with(ZSTD) {
        Some("is a file that rosbag2 has compressed as a whole")
    } else if start.starts_with(SQLITE) {
        Some("is an SQLite database")
    } else {
        None
    }
}
