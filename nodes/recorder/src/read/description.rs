//! Whether the description beside the files (`metadata.yaml`) says of them what is in them.
//!
//! Messages are read without it. One that is damaged or contradicts the files is reported all the same: other tools
//! believe it, and it may be the files that lost something.

use std::collections::BTreeMap;

use metrology::yaml;
use serde::Deserialize;

use super::TopicInfo;

/// The first version with a list of files and the name of the distribution at the end.
const VERSION_WITH_DISTRIBUTION: u64 = 9;

#[derive(Deserialize)]
struct Root {
    rosbag2_bagfile_information: Description,
}

/// What every version has, each part of it as far as it is there.
#[derive(Deserialize)]
struct Description {
    version: Option<u64>,
    storage_identifier: Option<String>,
    compression_format: Option<String>,
    compression_mode: Option<String>,
    message_count: Option<u64>,
    topics_with_message_count: Option<Vec<TopicCount>>,
    relative_file_paths: Option<Vec<String>>,
    ros_distro: Option<String>,
}

#[derive(Deserialize)]
struct TopicCount {
    topic_metadata: TopicName,
    message_count: u64,
}

#[derive(Deserialize)]
struct TopicName {
    name: String,
    #[serde(rename = "type")]
    type_name: String,
}

/// What a recorder wrote of its files into one of them.
#[derive(Debug)]
pub(super) struct Counts {
    /// Files.
    pub n_files: usize,
    /// Messages of all topics.
    pub messages: u64,
    /// The same by topic.
    pub topics: BTreeMap<String, u64>,
}

/// What the text of a file's own description says; `None`: it is no such text.
pub(super) fn counts(text: &str) -> Option<Counts> {
    let description: Description = yaml::read(text).ok()?;
    let mut topics = BTreeMap::new();
    for listed in description.topics_with_message_count? {
        *topics.entry(listed.topic_metadata.name).or_default() += listed.message_count;
    }
    Some(Counts {
        n_files: description
            .relative_file_paths
            .map_or(0, |names| names.len()),
        messages: description.message_count?,
        topics,
    })
}

/// What is wrong with a description: `text` is that of the file or why it cannot be read, `topics` what the files hold, `None` where they are
/// damaged themselves, so that their counts are not known.
pub(super) fn faults(text: Result<&str, &String>, topics: Option<&[TopicInfo]>) -> Vec<String> {
    let text = match text {
        Ok(text) => text,
        Err(reason) => return vec![reason.clone()],
    };
    let description = match yaml::read::<Root>(text) {
        Ok(root) => root.rosbag2_bagfile_information,
        Err(error) => return vec![format!("the description is damaged: {error}")],
    };
    let missing = missing(&description);
    let mut faults: Vec<String> = missing
        .iter()
        .map(|key| format!("the description is damaged: {key} is missing"))
        .collect();
    faults.extend(other_storage(&description));
    if let Some(topics) = topics {
        faults.extend(contradictions(&description, topics));
    }
    faults
}

/// Keys that every description of its version has.
fn missing(description: &Description) -> Vec<&'static str> {
    let is_new = |version: u64| version >= VERSION_WITH_DISTRIBUTION;
    let has_distribution = description.version.is_none_or(is_new);
    let keys = [
        ("version", description.version.is_some()),
        ("message_count", description.message_count.is_some()),
        (
            "topics_with_message_count",
            description.topics_with_message_count.is_some(),
        ),
        (
            "relative_file_paths",
            description.relative_file_paths.is_some(),
        ),
        (
            "ros_distro",
            description.ros_distro.is_some() || !has_distribution,
        ),
    ];
    let missing = keys.into_iter().filter(|(_, is_there)| !is_there);
    missing.map(|(key, _)| key).collect()
}

/// A storage or a compression that files that are read do not have: each is MCAP, compressed at most chunk by chunk.
fn other_storage(description: &Description) -> Vec<String> {
    let is_none = |said: &str| said.is_empty() || said.eq_ignore_ascii_case("none");
    let said = |key: &'static str, value: &Option<String>, is_right: &dyn Fn(&str) -> bool| {
        let value = value.as_deref().filter(|value| !is_right(value))?;
        Some((key, value.to_owned()))
    };
    let storage = said(
        "storage_identifier",
        &description.storage_identifier,
        &|it| it == "mcap",
    );
    let mode = said("compression_mode", &description.compression_mode, &is_none);
    let format = said(
        "compression_format",
        &description.compression_format,
        &is_none,
    );
    let fault = |(key, value): (&str, String)| match key {
        "storage_identifier" => format!("{key} = {value}: the files are mcap"),
        _ => format!("{key} = {value}: rosbag2 has compressed none of the files"),
    };
    [storage, mode, format]
        .into_iter()
        .flatten()
        .map(fault)
        .collect()
}

/// Counts and types of the description that are not those of the files.
fn contradictions(description: &Description, topics: &[TopicInfo]) -> Vec<String> {
    let mut faults = Vec::new();
    let all: u64 = topics.iter().map(|topic| topic.message_count).sum();
    if let Some(said) = description.message_count.filter(|said| *said != all) {
        faults.push(format!(
            "message_count = {said}: the files hold {all} messages"
        ));
    }
    let Some(listed) = &description.topics_with_message_count else {
        return faults;
    };
    let mut held: BTreeMap<&str, u64> = BTreeMap::new();
    for topic in topics {
        *held.entry(&topic.topic).or_default() += topic.message_count;
    }
    for TopicCount {
        topic_metadata: TopicName { name, type_name },
        message_count,
    } in listed
    {
        let n = held.remove(name.as_str()).unwrap_or(0);
        if n != *message_count {
            faults.push(format!(
                "{name}: message_count = {message_count}: the files hold {n} messages"
            ));
        }
        let of_name = |topic: &&TopicInfo| topic.topic == *name;
        let mut types = topics.iter().filter(of_name).map(|topic| &topic.type_name);
        if let Some(other) = types.next().filter(|other| *other != type_name)
            && !types.any(|other| other == type_name)
        {
            faults.push(format!("{name}: type = {type_name}: the files say {other}"));
        }
    }
    for (name, n) in held.into_iter().filter(|(_, n)| *n > 0) {
        faults.push(format!(
            "{name}: is missing in topics_with_message_count: the files hold {n} messages"
        ));
    }
    faults
}

#[cfg(test)]
mod tests {
    use super::*;

    fn topic(name: &str, message_count: u64) -> TopicInfo {
        TopicInfo {
            topic: name.to_owned(),
            type_name: "std_msgs/msg/Float64".to_owned(),
            type_hash: String::new(),
            definition_encoding: String::new(),
            definition: String::new(),
            message_encoding: "cdr".to_owned(),
            qos_yaml: String::new(),
            message_count,
        }
    }

    const TEXT: &str = "rosbag2_bagfile_information:
  version: 9
  storage_identifier: mcap
  message_count: 5
  topics_with_message_count:
    - topic_metadata:
        name: /a
        type: std_msgs/msg/Float64
        offered_qos_profiles: []
      message_count: 3
    - topic_metadata:
        name: /b
        type: std_msgs/msg/Float64
      message_count: 2
  compression_format: \"\"
  relative_file_paths:
    - bag_0.mcap
  custom_data: ~
  ros_distro: jazzy
";

    fn of(text: &str) -> Vec<String> {
        faults(Ok(text), Some(&[topic("/a", 3), topic("/b", 2)]))
    }

    #[test]
    fn a_description_that_says_what_the_files_hold_has_no_fault() {
        assert_eq!(of(TEXT), Vec::<String>::new());
        let old = TEXT
            .replace("version: 9", "version: 4")
            .replace("  ros_distro: jazzy\n", "");
        assert_eq!(of(&old), Vec::<String>::new());
        let plain = TEXT.replace(
            "compression_format: \"\"",
            "compression_format: none\n  compression_mode: NONE",
        );
        assert_eq!(of(&plain), Vec::<String>::new());
        // Where the files are damaged their counts are not known.
        assert_eq!(faults(Ok(TEXT), None), Vec::<String>::new());
    }

    #[test]
    fn counts_topics_and_types_that_contradict_the_files_are_named() {
        for (from, to, words) in [
            (
                "message_count: 5",
                "message_count: 6",
                "message_count = 6: the files hold 5",
            ),
            (
                "message_count: 3",
                "message_count: 4",
                "/a: message_count = 4: the files hold 3",
            ),
            (
                "message_count: 2",
                "message_count: 0",
                "/b: message_count = 0: the files hold 2",
            ),
            (
                "name: /a",
                "name: /c",
                "/c: message_count = 3: the files hold 0",
            ),
            (
                "name: /a",
                "name: /c",
                "/a: is missing in topics_with_message_count",
            ),
            (
                "type: std_msgs/msg/Float64",
                "type: x/msg/Y",
                "/a: type = x/msg/Y: the files say std",
            ),
            (
                "identifier: mcap",
                "identifier: sqlite3",
                "storage_identifier = sqlite3: the files are mcap",
            ),
            (
                "compression_format: \"\"",
                "compression_format: zstd",
                "compression_format = zstd: rosbag2 has compressed none",
            ),
            (
                "compression_format: \"\"",
                "compression_mode: FILE",
                "compression_mode = FILE: rosbag2 has compressed none",
            ),
        ] {
            let text = TEXT.replacen(from, to, 1);
            let faults = of(&text);
            assert!(
                faults.iter().any(|it| it.contains(words)),
                "{words}: {faults:?}"
            );
        }
    }

    #[test]
    fn a_description_that_is_cut_or_no_yaml_is_named() {
        let unreadable = "is a folder".to_owned();
        assert_eq!(
            faults(Err(&unreadable), None),
            std::slice::from_ref(&unreadable)
        );
        for text in [
            "",
            "{",
            "- a\n- b\n",
            "\t: [",
            "rosbag2_bagfile_information: 5\n",
        ] {
            let faults = of(text);
            assert_eq!(faults.len(), 1, "{text:?}: {faults:?}");
            assert!(faults[0].contains("damaged"), "{text:?}: {faults:?}");
        }
        // Behind the key of the last line nothing can be seen to be missing.
        let end = TEXT.len() - " jazzy\n".len();
        for length in 0..end - "ros_distro:".len() {
            assert!(!of(&TEXT[..length]).is_empty(), "{:?}", &TEXT[..length]);
        }
    }
}
