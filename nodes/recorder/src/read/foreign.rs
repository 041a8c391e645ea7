//! Recordings of rosbag2 that are no MCAP, or whose contents it has compressed by itself: refused by name.
#![expect(
    clippy::disallowed_methods,
    reason = "opening a bag reads files; only recorder, replayer and the command line do"
)]

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::parts::Parts;
use super::regular;
use super::{Loss, LossReason};
use crate::error::RecorderError;
use crate::layout::{METADATA_FILE, compression_of, file_names_of};

/// How a file begins that Zstandard has compressed.
const ZSTD: &[u8] = &[0x28, 0xb5, 0x2f, 0xfd];
/// How an SQLite database begins.
const SQLITE: &[u8] = b"SQLite format 3";

/// The files of a bag that may be MCAP, and losses: those beside them of which nothing can be read.
///
/// # Errors
/// Names the file and what it is, where not one can be read, or where rosbag2 has compressed the messages one by one.
pub(super) fn readable(
    folder: &Path,
    parts: Parts,
) -> Result<(Vec<PathBuf>, Vec<Loss>), RecorderError> {
    let mut files = Vec::new();
    let mut unread: Vec<Loss> = parts
        .absent
        .into_iter()
        .map(|path| lost(path, LossReason::Absent))
        .collect();
    let mut first = None;
    for path in parts.files {
        match may_be_mcap(&path) {
            Ok(()) => files.push(path),
            Err(error) => {
                unread.push(lost(path, reason_of(&error)));
                first.get_or_insert(error);
            }
        }
    }
    if let (true, Some(error)) = (files.is_empty(), first) {
        return Err(error);
    }
    refuse(folder, &files)?;
    Ok((files, unread))
}

/// Refuses a path that is no regular file, cannot be opened, or is of another kind.
fn may_be_mcap(path: &Path) -> Result<(), RecorderError> {
    let kind = kind_of(regular::open(path)?).map_err(|source| RecorderError::Open {
        path: path.to_owned(),
        source,
    })?;
    match kind {
        None => Ok(()),
        Some(what) => Err(RecorderError::NotRead {
            path: path.to_owned(),
            what,
        }),
    }
}

/// Why nothing of a file can be read, as a loss of the bag.
fn reason_of(error: &RecorderError) -> LossReason {
    match error {
        RecorderError::NotRegular { kind, .. } => LossReason::NotRegular { kind },
        RecorderError::NotRead { what, .. } => LossReason::NotRead { what },
        RecorderError::Open { source, .. } => LossReason::Io {
            kind: source.kind(),
        },
        _ => LossReason::NotMcap,
    }
}

fn lost(file: PathBuf, reason: LossReason) -> Loss {
    Loss {
        file,
        at_byte: 0,
        reason,
        messages_read: 0,
    }
}

/// Refuses a bag without a byte, a file alone that is no MCAP, and messages that rosbag2 has compressed one by one.
fn refuse(folder: &Path, files: &[PathBuf]) -> Result<(), RecorderError> {
    let is_empty = |path: &PathBuf| path.metadata().is_ok_and(|it| it.len() == 0);
    if !files.is_empty() && files.iter().all(is_empty) {
        let path = match files {
            [only] => only.clone(),
            _ => folder.to_owned(),
        };
        return Err(RecorderError::Empty { path });
    }
    // Where one file of several is such it is damaged, and told with what else is missing.
    if let [only] = files
        && is_no_mcap(only).unwrap_or(false)
    {
        return Err(RecorderError::NotMcap { path: only.clone() });
    }
    let metadata = match files {
        [only] if folder == only => only.with_file_name(METADATA_FILE),
        _ => folder.join(METADATA_FILE),
    };
    let Some(text) = regular::text(&metadata) else {
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

/// Whether a file neither begins nor ends as MCAP does, as far as it goes.
fn is_no_mcap(path: &Path) -> Option<bool> {
    let mut file = File::open(path).ok()?;
    let mut first = Vec::new();
    file.by_ref()
        .take(mcap::MAGIC.len() as u64)
        .read_to_end(&mut first)
        .ok()?;
    if mcap::MAGIC.starts_with(&first) {
        return Some(false);
    }
    let mut last = [0; mcap::MAGIC.len()];
    let ends_as_one = first.len() == last.len()
        && file.seek(SeekFrom::End(-(last.len() as i64))).is_ok()
        && file.read_exact(&mut last).is_ok()
        && last == mcap::MAGIC;
    Some(!ends_as_one)
}

/// What a file is that rosbag2 writes besides MCAP.
fn kind_of(file: File) -> std::io::Result<Option<&'static str>> {
    let mut start = Vec::new();
    file.take(SQLITE.len() as u64).read_to_end(&mut start)?;
    Ok(if start.starts_with(ZSTD) {
        Some("is a file that rosbag2 has compressed as a whole")
    } else if start.starts_with(SQLITE) {
        Some("is an SQLite database")
    } else {
        None
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(files: &[(&str, &[u8])]) -> Option<String> {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        for (name, bytes) in files {
            std::fs::write(path(name), bytes).unwrap();
        }
        let parts = Parts {
            files: files.iter().map(|(name, _)| path(name)).collect(),
            absent: Vec::new(),
        };
        readable(folder.path(), parts).err().map(|e| e.to_string())
    }

    #[test]
    fn a_file_that_is_no_bag_is_refused_and_one_that_was_cut_or_damaged_is_not() {
        for (name, bytes) in [
            ("letter.mcap", &b"Dear all, here is it."[..]),
            ("short.mcap", b"hi"),
        ] {
            let none = refusal(&[(name, bytes)]).unwrap();
            assert!(none.contains(&format!("{name} is no bag")), "{none}");
        }
        // A recorder that was killed at once leaves half of the first bytes, or an empty file behind others.
        assert_eq!(
            refusal(&[("bag_0.mcap", mcap::MAGIC), ("bag_1.mcap", b"")]),
            None
        );
        assert_eq!(refusal(&[("bag_0.mcap", &mcap::MAGIC[..5])]), None);
        assert_eq!(
            refusal(&[("bag_0.mcap", mcap::MAGIC), ("bag_1.mcap", &[0; 64])]),
            None
        );
    }
}
