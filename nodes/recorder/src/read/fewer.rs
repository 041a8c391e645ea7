//! Whether the files of a recording hold as many messages as its recorder wrote.
//!
//! The recorder writes at its end, into the last file, how many messages it has written in all (`abbe.recording`), and how many of each
//! topic (`rosbag2`). Topics that were not recorded are in neither. A tool that takes messages out keeps both, so that nothing
//! else shows it.

use std::collections::BTreeMap;
use std::path::Path;

use super::TopicInfo;
use super::bag::BagFile;
use super::description;
use super::{Loss, LossReason};

/// Topics that are named one by one.
const NAMED: usize = 3;

/// What a recording lacks of what its recorder wrote, where the files are whole; `None`: nothing, or the recorder wrote no count. One file
/// that was opened by itself may be one of several.
pub(super) fn of(
    path: &Path,
    is_folder: bool,
    files: &[BagFile],
    topics: &[TopicInfo],
) -> Option<Loss> {
    let recorded: Vec<(u64, &BagFile)> = files
        .iter()
        .filter_map(|file| Some((count(file)?, file)))
        .collect();
    let (_, last) = *recorded.first()?;
    let counts = text(last, "rosbag2", "serialized_metadata").and_then(description::counts);
    if !is_folder && counts.as_ref().is_some_and(|counts| counts.n_files > 1) {
        return None;
    }
    let in_all: u64 = recorded.iter().map(|(messages, _)| messages).sum();
    let held: u64 = topics.iter().map(|topic| topic.message_count).sum();
    let of_topics = counts
        .filter(|counts| recorded.len() == 1 && counts.messages == in_all)
        .map_or_else(String::new, |counts| in_words(&counts.topics, topics));
    (held < in_all).then(|| Loss {
        file: path.to_owned(),
        at_byte: 0,
        reason: LossReason::Fewer {
            recorded: in_all,
            held,
            of_topics,
        },
        messages_read: held,
    })
}

fn text<'f>(file: &'f BagFile, record: &str, key: &str) -> Option<&'f str> {
    let mut records = file.index.metadata.iter();
    let (_, found) = records.find(|(name, _)| name == record)?;
    found.get(key).map(String::as_str)
}

/// How many messages the recorder of a file has written in all.
fn count(file: &BagFile) -> Option<u64> {
    text(file, "abbe.recording", "messages")?.parse().ok()
}

/// The topics with fewer messages than were recorded.
fn in_words(recorded: &BTreeMap<String, u64>, topics: &[TopicInfo]) -> String {
    let held = |name: &str| -> u64 {
        let of_name = topics.iter().filter(|topic| topic.topic == name);
        of_name.map(|topic| topic.message_count).sum()
    };
    let fewer: Vec<String> = recorded
        .iter()
        .filter(|(name, n)| held(name) < **n)
        .map(|(name, n)| format!("{name} {} of {n}", held(name)))
        .collect();
    let more = match fewer.len().saturating_sub(NAMED) {
        0 => String::new(),
        more => format!(", and {more} more topics"),
    };
    let named: Vec<String> = fewer.into_iter().take(NAMED).collect();
    if named.is_empty() {
        return String::new();
    }
    format!(" ({}{more})", named.join(", "))
}
