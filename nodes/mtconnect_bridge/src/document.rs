//! What an agent answers: XML documents of MTConnect 1.2 to 2.x.
//!
//! The namespace differs with the version (`urn:mtconnect.org:MTConnectStreams:1.3`); elements are taken by
//! their local names, so that a version that this bridge has not met is read as well. A document type
//! declaration is refused: no agent sends one, and entities are a known trap.
//!
//! # References
//! \[1\] MTConnect information model, version 2.4: DeviceInformationModel, ObservationInformationModel, and the
//! header and error documents of its fundamentals. \[2\] See [`crate::observation`].

use std::collections::BTreeSet;

use roxmltree::Node;

use crate::multipart::PART_LIMIT;
use crate::observation::{
    AlarmLevel, AlarmReport, MachineTime, Observation, Told, UNAVAILABLE, read_stamp,
};
use crate::shdr::read_series;
use crate::xml::XmlFlaw;
use crate::xml_bounds::Beyond;
use crate::{text, xml};

/// Errors of an answer that are read, texts of each, and letters of each text; more are no agent's.
const ERRORS: usize = 20;
const ERROR_TEXTS: usize = 20;
const ERROR_LETTERS: usize = 1_000;

/// What stands at the head of every document of values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Header {
    /// Changes when the agent starts anew.
    pub instance_id: u64,
    /// Least number that the agent still has.
    pub first_sequence: u64,
    /// Number from which to ask on.
    pub next_sequence: u64,
}

/// An observation with its number.
#[derive(Clone, Debug, PartialEq)]
pub struct Numbered {
    /// Number within the agent's instance.
    pub sequence: u64,
    /// What was told.
    pub observation: Observation,
}

/// A device that the agent describes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Device {
    /// Its name, else its uuid or id.
    pub name: String,
    /// Whether it is the agent itself.
    pub is_of_agent: bool,
}

/// Something that the agent can tell.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DataItem {
    /// Device it belongs to: its name, else its uuid.
    pub device: String,
    /// Whether it is the agent itself.
    pub is_of_agent: bool,
    /// Nearest component with a name: its kind and the name, e.g. `Linear X`.
    pub component: String,
    /// Key.
    pub id: String,
    /// Second name; empty: none.
    pub name: String,
    /// `SAMPLE`, `EVENT` or `CONDITION`.
    pub category: String,
    /// What it is, e.g. `POSITION`.
    pub kind: String,
    /// Which of them, e.g. `ACTUAL`; empty: not said.
    pub sub_kind: String,
    /// Unit in which the agent tells it; empty: none.
    pub units: String,
    /// `VALUE`, `TIME_SERIES`, …; empty: `VALUE`.
    pub representation: String,
    /// `MACHINE` or `WORK`; empty: not said, which for a position means `MACHINE`.
    pub coordinates: String,
    /// What is formed over an interval, e.g. `AVERAGE`; empty: nothing.
    pub statistic: String,
}

/// One answer.
#[derive(Clone, Debug, PartialEq)]
pub enum Answer {
    /// To `probe`.
    Devices {
        /// The agent's instance.
        instance_id: u64,
        /// Its devices, also those without data items.
        devices: Vec<Device>,
        /// All that it can tell.
        items: Vec<DataItem>,
    },
    /// To `current` and `sample`.
    Streams {
        /// Head.
        header: Header,
        /// Observations in the order of their numbers.
        observations: Vec<Numbered>,
        /// Observations that could not be read.
        malformed: usize,
        /// Observations without a stamp that has a place in a message.
        unstamped: usize,
        /// Numbers of those that could not be read, where they have one.
        unread: Vec<u64>,
    },
    /// The agent refuses.
    Error {
        /// Codes and words, in order.
        errors: Vec<(String, String)>,
    },
}

/// Why an answer cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DocumentFlaw {
    /// It is no XML.
    #[error("no XML: {reason}")]
    NotXml {
        /// The parser's words, with line and column.
        reason: String,
    },
    /// It is beyond a bound.
    #[error("{0}")]
    Beyond(Beyond),
    /// It is another document.
    #[error("root element {root:?} is none of MTConnect's")]
    AnotherRoot {
        /// Its root.
        root: String,
    },
    /// A number that must be there is not.
    #[error("Header: {attribute} = {value:?} is no whole number")]
    Header {
        /// Attribute.
        attribute: &'static str,
        /// What stands there.
        value: String,
    },
}

/// Reads one answer.
///
/// # Errors
/// When it is not an agent's answer.
pub fn read(bytes: &[u8]) -> Result<Answer, DocumentFlaw> {
    read_text(&text::decode(bytes).text)
}

/// Reads one answer, whose invalid letters have been replaced.
///
/// # Errors
/// When it is not an agent's answer.
pub fn read_text(text: &str) -> Result<Answer, DocumentFlaw> {
    // A byte order mark and white space before the declaration are no XML, and seen.
    let text = text.trim_start_matches(|c: char| c == '\u{feff}' || c.is_whitespace());
    let xml = xml::parse(text, PART_LIMIT).map_err(|flaw| match flaw {
        XmlFlaw::Beyond(beyond) => DocumentFlaw::Beyond(beyond),
        XmlFlaw::NotXml(reason) => DocumentFlaw::NotXml { reason },
    })?;
    let root = xml.root_element();
    match root.tag_name().name() {
        "MTConnectDevices" => Ok(Answer::Devices {
            instance_id: header_number(&root, "instanceId")?,
            devices: root.descendants().filter(is_device).map(device).collect(),
            items: data_items(&root),
        }),
        "MTConnectStreams" => streams(&root),
        "MTConnectError" => Ok(Answer::Error {
            errors: errors(&root),
        }),
        other => Err(DocumentFlaw::AnotherRoot {
            root: other.to_owned(),
        }),
    }
}

/// Reads one answer. Letters that XML does not allow are replaced by U+FFFD; the second value is their number.
///
/// # Errors
/// When it is not an agent's answer.
pub fn read_mended(text: &str) -> Result<(Answer, usize), DocumentFlaw> {
    match read_text(text) {
        Err(flaw @ DocumentFlaw::NotXml { .. }) => {
            let (mended, replaced) = xml::mended(text);
            match read_text(&mended) {
                Ok(answer) if replaced > 0 => Ok((answer, replaced)),
                _ => Err(flaw),
            }
        }
        read => read.map(|answer| (answer, 0)),
    }
}

fn is(node: &Node<'_, '_>, name: &str) -> bool {
    node.is_element() && node.tag_name().name() == name
}

fn header_number(root: &Node<'_, '_>, attribute: &'static str) -> Result<u64, DocumentFlaw> {
    let header = root.children().find(|node| is(node, "Header"));
    let value = header.and_then(|header| header.attribute(attribute));
    let value = value.unwrap_or_default();
    value.parse().map_err(|_| DocumentFlaw::Header {
        attribute,
        value: value.to_owned(),
    })
}

fn errors(root: &Node<'_, '_>) -> Vec<(String, String)> {
    // From 2.6 on the code is the element's own name in some agents; the attribute stays.
    let all = root.descendants().filter(Node::is_element);
    let all = all.filter_map(|node| {
        let code = node.attribute("errorCode")?;
        let said = node.descendants().filter(Node::is_text);
        let said = said.filter_map(|below| below.text());
        let words = said.map(str::trim).filter(|text| !text.is_empty());
        let words: Vec<_> = words.take(ERROR_TEXTS).map(begin).collect();
        Some((begin(code).to_owned(), words.join(" ")))
    });
    all.take(ERRORS).collect()
}

/// The begin of an agent's word.
fn begin(text: &str) -> &str {
    let end = text.char_indices().nth(ERROR_LETTERS);
    &text[..end.map_or(text.len(), |(at, _)| at)]
}

fn attribute(node: &Node<'_, '_>, name: &str) -> String {
    node.attribute(name).unwrap_or_default().to_owned()
}

fn data_items(root: &Node<'_, '_>) -> Vec<DataItem> {
    let systems = root
        .descendants()
        .filter(|node| is(node, "CoordinateSystem"));
    let of_machine = systems.filter(|node| {
        let kind = node.attribute("type").unwrap_or_default();
        ["MACHINE", "BASE"]
            .iter()
            .any(|it| it.eq_ignore_ascii_case(kind.trim()))
    });
    let of_machine: BTreeSet<&str> = of_machine.filter_map(|node| node.attribute("id")).collect();
    let items = root.descendants().filter(|node| is(node, "DataItem"));
    items
        .map(|node| DataItem {
            coordinates: coordinates(&node, &of_machine),
            ..data_item(&node)
        })
        .collect()
}

/// `MACHINE`, `WORK`, or none; a system with another name or id is that of the machine, or moves against it as `WORK` does.
fn coordinates(node: &Node<'_, '_>, of_machine: &BTreeSet<&str>) -> String {
    match node.attribute("coordinateSystemIdRef") {
        Some(id) if of_machine.contains(id) => "MACHINE".to_owned(),
        Some(id) if !id.is_empty() => "WORK".to_owned(),
        _ => match node.attribute("coordinateSystem").map(str::trim) {
            None | Some("") => String::new(),
            Some(word) if word.eq_ignore_ascii_case("MACHINE") => "MACHINE".to_owned(),
            Some(_) => "WORK".to_owned(),
        },
    }
}

/// `Device`, or `Agent`, which is a device that describes the agent itself.
fn is_device(node: &Node<'_, '_>) -> bool {
    let parent = node.parent_element();
    node.is_element() && parent.is_some_and(|parent| is(&parent, "Devices"))
}

fn device(node: Node<'_, '_>) -> Device {
    let name = node.attribute("name").filter(|name| !name.is_empty());
    let other = node.attribute("uuid").or(node.attribute("id"));
    Device {
        name: name.or(other).unwrap_or_default().to_owned(),
        is_of_agent: is(&node, "Agent"),
    }
}

fn data_item(node: &Node<'_, '_>) -> DataItem {
    let is_component = |above: &Node<'_, '_>| {
        let plumbing = ["DataItems", "Components"].contains(&above.tag_name().name());
        above.is_element() && !plumbing && above.has_attribute("name")
    };
    let mut above = node.ancestors().skip(1);
    let component = above.find(is_component).map(|component| {
        let kind = component.tag_name().name();
        format!("{kind} {}", attribute(&component, "name"))
    });
    let found = node.ancestors().find(is_device).map(device);
    let Device { name, is_of_agent } = found.unwrap_or_default();
    DataItem {
        device: name,
        is_of_agent,
        component: component.unwrap_or_default(),
        id: attribute(node, "id"),
        name: attribute(node, "name"),
        category: attribute(node, "category"),
        kind: attribute(node, "type"),
        sub_kind: attribute(node, "subType"),
        units: attribute(node, "units"),
        representation: attribute(node, "representation"),
        coordinates: String::new(),
        statistic: attribute(node, "statistic"),
    }
}

fn streams(root: &Node<'_, '_>) -> Result<Answer, DocumentFlaw> {
    let header = Header {
        instance_id: header_number(root, "instanceId")?,
        first_sequence: header_number(root, "firstSequence")?,
        next_sequence: header_number(root, "nextSequence")?,
    };
    let groups = ["Samples", "Events", "Condition"];
    let is_group = |node: &Node<'_, '_>| {
        let name = node.tag_name().name();
        node.is_element()
            && groups.contains(&name)
            && node
                .parent_element()
                .is_some_and(|above| is(&above, "ComponentStream"))
    };
    let (mut observations, mut malformed, mut unstamped) = (Vec::new(), 0, 0);
    let mut unread = Vec::new();
    for group in root.descendants().filter(is_group) {
        let is_condition = is(&group, "Condition");
        for node in group.children().filter(Node::is_element) {
            match numbered(&node, is_condition) {
                Some(found) => {
                    unstamped += usize::from(found.observation.time == MachineTime::Absent);
                    observations.push(found);
                }
                None => {
                    malformed += 1;
                    let number = node.attribute("sequence");
                    unread.extend(number.and_then(|number| number.parse::<u64>().ok()));
                }
            }
        }
    }
    // The document groups them by component; they happened in the order of their numbers.
    observations.sort_by_key(|numbered| numbered.sequence);
    Ok(Answer::Streams {
        header,
        observations,
        malformed,
        unstamped,
        unread,
    })
}

fn numbered(node: &Node<'_, '_>, is_condition: bool) -> Option<Numbered> {
    let sequence = node.attribute("sequence")?.parse().ok()?;
    // A value is not lost for its stamp.
    let stamp = node.attribute("timestamp").and_then(read_stamp);
    let time = stamp.map_or(MachineTime::Absent, MachineTime::Absolute);
    let key = node.attribute("dataItemId")?.to_owned();
    let told = if is_condition {
        Told::Alarm(alarm(node)?)
    } else {
        told(node)?
    };
    Some(Numbered {
        sequence,
        observation: Observation {
            time,
            key,
            name: node.attribute("name").map(str::to_owned),
            told,
        },
    })
}

fn alarm(node: &Node<'_, '_>) -> Option<AlarmReport> {
    Some(AlarmReport {
        level: AlarmLevel::read(node.tag_name().name())?,
        code: attribute(node, "nativeCode"),
        severity: attribute(node, "nativeSeverity"),
        qualifier: attribute(node, "qualifier"),
        text: words(node)?,
    })
}

/// What stands between the tags of an element, whatever comments and instructions part it; `None` where elements stand in it.
fn words(node: &Node<'_, '_>) -> Option<String> {
    if node.children().any(|below| below.is_element()) {
        return None;
    }
    let parts = node.children().filter(Node::is_text);
    let text: String = parts.filter_map(|part| part.text()).collect();
    Some(text.trim().to_owned())
}

fn told(node: &Node<'_, '_>) -> Option<Told> {
    let mut entries = node
        .children()
        .filter(|below| is(below, "Entry"))
        .peekable();
    if entries.peek().is_some() {
        let of =
            |entry: Node<'_, '_>| Some(format!("{}={}", attribute(&entry, "key"), words(&entry)?));
        return Some(Told::Value(
            entries.map(of).collect::<Option<Vec<_>>>()?.join(" "),
        ));
    }
    let text = words(node)?;
    if text.eq_ignore_ascii_case(UNAVAILABLE) {
        return Some(Told::Unavailable);
    }
    if let Some(count) = node.attribute("sampleCount") {
        let rate = node.attribute("sampleRate").unwrap_or_default();
        return read_series(Some(count.parse().ok()?), rate, &text);
    }
    Some(Told::Value(text))
}

#[cfg(test)]
mod tests;
