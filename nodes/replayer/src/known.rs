//! Which topics of a bag are ours, and whether their messages are of the types that are read here.
//!
//! A topic is known by its name in whatever namespace. Its type, its type hash and its definition are compared: where
//! they are another type's or another version's, the same bytes would mean something else. A hash says of itself what
//! is laid out how; of a bag without hashes (rosbag2 before Iron) the definition tells it, whatever its comments are.

use abbe_msgs::Description;
use abbe_msgs::topics::{self, Entry};
use recorder::{Reflector, TopicInfo};

use crate::account::Reason;

/// The topic of ours that `name` is, in whatever namespace; the longest name where several fit.
#[must_use]
pub fn entry_in_any_namespace(name: &str) -> Option<&'static Entry> {
    let fits = |entry: &&Entry| namespace(name, entry).is_some();
    let entries = topics::all().iter().filter(fits);
    entries.max_by_key(|entry| entry.name.len())
}

/// What stands before a topic of ours in `name`, without the slash at its end; `None`: it is not this topic.
#[must_use]
pub(crate) fn namespace<'n>(name: &'n str, entry: &Entry) -> Option<&'n str> {
    let known = entry.name.trim_start_matches('/');
    let place = if entry.is_family {
        name.rfind(known)
            .filter(|at| is_member(&name[at + known.len()..]))
    } else {
        name.strip_suffix(known).map(str::len)
    };
    let before = &name[..place?];
    (before.is_empty() || before.ends_with('/')).then(|| before.trim_end_matches('/'))
}

/// A name behind that of a family: the last one.
fn is_member(name: &str) -> bool {
    !name.is_empty() && !name.contains('/')
}

/// Why no message of a topic can be read as `ours`, and what is wrong; `None`: they can.
#[must_use]
pub fn unreadable(info: &TopicInfo, ours: &Description) -> Option<(Reason, String)> {
    let (theirs, own) = (info.type_name.as_str(), ours.type_name);
    if theirs != own {
        let theirs = if theirs.is_empty() {
            "not said"
        } else {
            theirs
        };
        let what = format!("its type is {theirs}, {own} is read");
        return Some((Reason::ForeignType, what));
    }
    if !["", "cdr"].contains(&info.message_encoding.as_str()) {
        let what = format!("its messages are {}, cdr is read", info.message_encoding);
        return Some((Reason::Encoding, what));
    }
    if !info.type_hash.is_empty() && info.type_hash != ours.type_hash {
        let what = format!(
            "{own} has the hash {} in the bag, {} here",
            info.type_hash, ours.type_hash
        );
        return Some((Reason::OtherVersion, what));
    }
    let what = other_definition(info, ours)?;
    Some((Reason::OtherVersion, format!("{own}: {what}")))
}

fn other_definition(info: &TopicInfo, ours: &Description) -> Option<String> {
    // Of what the bag does not define, or not in this language, the hash alone tells.
    let is_silent = info.definition.is_empty() || info.definition_encoding != "ros2msg";
    if is_silent || info.definition == ours.definition {
        return None;
    }
    let own = Reflector::new(ours.type_name, "ros2msg", ours.definition).ok()?;
    match Reflector::new(&info.type_name, "ros2msg", &info.definition) {
        Ok(theirs) => {
            let field = own.first_difference(&theirs)?;
            Some(format!(
                "the bag's definition differs from ours at field {field}"
            ))
        }
        // Its own text cannot be read, but its hash is ours.
        Err(_) if !info.type_hash.is_empty() => None,
        Err(error) => Some(format!("the bag's definition cannot be read: {error}")),
    }
}

#[cfg(test)]
mod tests {
    use abbe_msgs::Message as _;
    use abbe_msgs::msg::AxisState;

    use super::*;

    fn info() -> TopicInfo {
        TopicInfo {
            topic: "/axes/state".to_owned(),
            type_name: AxisState::TYPE_NAME.to_owned(),
            type_hash: AxisState::TYPE_HASH.to_owned(),
            definition_encoding: "ros2msg".to_owned(),
            definition: AxisState::DEFINITION.to_owned(),
            message_encoding: "cdr".to_owned(),
            qos_yaml: String::new(),
            message_count: 1,
        }
    }

    #[test]
    fn a_topic_is_ours_in_any_namespace_and_by_its_whole_name() {
        let name = |topic: &str| entry_in_any_namespace(topic).map(|entry| entry.name);
        assert_eq!(name("axes/state"), Some("axes/state"));
        assert_eq!(name("/mill/axes/state"), Some("axes/state"));
        assert_eq!(name("/temperature/bed"), Some("temperature/"));
        assert_eq!(name("/mill/temperature/bed"), Some("temperature/"));
        assert_eq!(name("/diagnostics"), Some("/diagnostics"));
        for foreign in [
            "/maxes/state",
            "/temperature/",
            "/temperature/a/b",
            "/x",
            "",
            "/",
        ] {
            assert_eq!(name(foreign), None, "{foreign}");
        }
    }

    #[test]
    fn type_hash_definition_and_encoding_each_tell_what_is_not_ours() {
        type Spoil = fn(&mut TopicInfo);
        let spoils: [(Spoil, Option<(Reason, &str)>); 11] = [
            (|_| (), None),
            (|i| i.definition += "# another comment\n", None),
            (|i| i.type_hash.clear(), None),
            (|i| i.definition.clear(), None),
            (|i| i.message_encoding.clear(), None),
            (
                |i| i.type_name = "std_msgs/msg/Float64".to_owned(),
                Some((
                    Reason::ForeignType,
                    "std_msgs/msg/Float64, abbe_msgs/msg/AxisState is read",
                )),
            ),
            (
                |i| i.type_hash = format!("RIHS01_{}", "1".repeat(64)),
                Some((Reason::OtherVersion, "RIHS01_1111")),
            ),
            (
                |i| {
                    i.type_hash.clear();
                    i.definition = i
                        .definition
                        .replace("float64[] velocity", "float32[] velocity");
                },
                Some((Reason::OtherVersion, "at field velocity")),
            ),
            (
                |i| {
                    i.definition = i
                        .definition
                        .replace("float64[] velocity", "float64[] speed")
                },
                Some((Reason::OtherVersion, "at field velocity")),
            ),
            (
                |i| {
                    i.type_hash.clear();
                    i.definition = "float64".to_owned();
                },
                Some((Reason::OtherVersion, "cannot be read")),
            ),
            (
                |i| i.message_encoding = "json".to_owned(),
                Some((Reason::Encoding, "its messages are json, cdr is read")),
            ),
        ];
        for (place, (spoil, expected)) in spoils.into_iter().enumerate() {
            let mut spoiled = info();
            spoil(&mut spoiled);
            let found = unreadable(&spoiled, &AxisState::DESCRIPTION);
            match (&found, expected) {
                (None, None) => {}
                (Some((reason, what)), Some((wanted, words))) => {
                    assert_eq!(*reason, wanted, "{place}: {what}");
                    assert!(what.contains(words), "{place}: {what}");
                }
                _ => panic!("{place}: {found:?} {expected:?}"),
            }
        }
    }
}
