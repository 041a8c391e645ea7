//! The files of a bag's directory, and their order.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::bag::BagFile;
use super::regular;
use crate::layout::{METADATA_FILE, file_names_of};

/// The names of the files of a bag.
#[derive(Debug, Default)]
pub(super) struct Parts {
    /// As the description orders them, then those that it does not name.
    pub files: Vec<PathBuf>,
    /// Named by the description, and not there.
    pub absent: Vec<PathBuf>,
}

impl Parts {
    /// A bag of one file.
    pub(super) fn one(path: &Path) -> Self {
        Self {
            files: vec![path.to_owned()],
            absent: Vec::new(),
        }
    }

    /// Whether no file is there or named.
    pub(super) const fn is_empty(&self) -> bool {
        self.files.is_empty() && self.absent.is_empty()
    }
}

/// Files of a directory as its description orders them, then those that it does not know yet.
pub(super) fn of(directory: &Path) -> std::io::Result<Parts> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(directory)? {
        let path = entry?.path();
        if path
            .extension()
            .is_some_and(|extension| extension == "mcap")
        {
            let stem = path
                .file_stem()
                .map(|stem| stem.to_string_lossy().into_owned());
            let stem = stem.unwrap_or_default();
            found.insert((number(&stem), stem), path);
        }
    }
    let text = regular::text(&directory.join(METADATA_FILE)).unwrap_or_default();
    let listed = file_names_of(&text).unwrap_or_default();
    let mut parts = Parts::default();
    for name in listed {
        let path = directory.join(name);
        // A link that leads nowhere is there: its kind is reported.
        if path.symlink_metadata().is_ok() {
            parts.files.push(path);
        } else {
            parts.absent.push(path);
        }
    }
    found.retain(|_, path| !parts.files.contains(path));
    parts.files.extend(found.into_values());
    Ok(parts)
}

/// Place of a file by its name: `run_3`, or as rosbag2 of Lyrical names it, `3_run_2026_11_30-17_24_28`.
fn number(stem: &str) -> Option<u64> {
    let place = match stem.split_once('_') {
        Some((first, rest)) if ends_with_time(rest) => first,
        _ => stem.rsplit('_').next()?,
    };
    place.parse().ok()
}

/// Whether a name ends with a local time, `_YYYY_MM_DD-HH_MM_SS`.
fn ends_with_time(name: &str) -> bool {
    const PATTERN: &[u8] = b"_9999_99_99-99_99_99";
    let end = name.len().checked_sub(PATTERN.len());
    let end = end.and_then(|from| name.as_bytes().get(from..));
    end.is_some_and(|end| {
        let mut both = end.iter().zip(PATTERN);
        both.all(|(found, wanted)| match wanted {
            b'9' => found.is_ascii_digit(),
            _ => found == wanted,
        })
    })
}

/// Puts files with messages in the order of their log times, where each begins when the one before it has ended or is a copy
/// of it.
pub(super) fn sort_by_time(files: &mut Vec<BagFile>) {
    let bounds = |file: &BagFile| file.index.span.bounds_nanos();
    let mut order: Vec<usize> = (0..files.len())
        .filter(|at| bounds(&files[*at]).is_some())
        .collect();
    let places = order.clone();
    order.sort_by_key(|at| (bounds(&files[*at]), *at));
    let follow = |pair: &[usize]| {
        let (before, after) = (bounds(&files[pair[0]]), bounds(&files[pair[1]]));
        before == after
            || before
                .zip(after)
                .is_some_and(|((_, end), (begin, _))| end <= begin)
    };
    if order == places || !order.windows(2).all(follow) {
        return;
    }
    let mut taken: Vec<Option<BagFile>> = files.drain(..).map(Some).collect();
    let mut by_place: BTreeMap<usize, usize> = (0..taken.len()).map(|at| (at, at)).collect();
    by_place.extend(places.into_iter().zip(order));
    files.extend(by_place.into_values().filter_map(|from| taken[from].take()));
}

/// Whether a file begins before one that stands before it has ended.
pub(super) fn overlap(files: &[BagFile]) -> bool {
    let bounds = files
        .iter()
        .filter_map(|file| file.index.span.bounds_nanos());
    let mut latest = None;
    bounds.into_iter().any(|(begin, end)| {
        let is_inside = latest.is_some_and(|latest| begin < latest);
        latest = latest.max(Some(end));
        is_inside
    })
}

/// Whether two files have equal bounds and equally many messages.
pub(super) fn is_doubled(files: &[BagFile]) -> bool {
    let messages = |file: &BagFile| {
        file.index
            .channels
            .values()
            .map(|it| it.messages)
            .sum::<u64>()
    };
    let mut keys: Vec<_> = files
        .iter()
        .filter_map(|file| Some((file.index.span.bounds_nanos()?, messages(file))))
        .collect();
    keys.sort_unstable();
    keys.windows(2).any(|pair| pair[0] == pair[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_numbered_at_the_end_and_by_lyrical_in_front_of_a_local_time() {
        for (stem, expected) in [
            ("run_3", Some(3)),
            ("my_run_10", Some(10)),
            ("2_run_7", Some(7)),
            ("3_run_2026_11_30-17_24_28", Some(3)),
            ("10_my_run_2026_11_30-17_24_28", Some(10)),
            ("0_rosbag2_2026_11_30-17_24_28", Some(0)),
            // The directory of a recording of Jazzy has its time in its name.
            ("rosbag2_2026_11_30-17_24_28_4", Some(4)),
            ("1_é_2026_11_30-17_24_28", Some(1)),
            ("x_run_2026_11_30-17_24_28", None),
            ("run", None),
            ("", None),
        ] {
            assert_eq!(number(stem), expected, "{stem}");
        }
    }
}
