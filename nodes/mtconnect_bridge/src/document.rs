//! What an agent answers: XML documents of MTConnect 1.2 to 2.x.
//!
//! The namespace differs with the version (`urn:mtconnect.org:MTConnectStreams:1.3`); elements are taken by
//! their local names, so that a version that this bridge has not met is read as well. A document type
//! declaration is refused: no agent sends one, and entities are a known trap.
//!
//! # References
//! \[1\] MTConnect information model, version 2.4: DeviceInformationModel, ObservationInformationModel, and the
//! header and error documents of its fundamentals. \[2\] See [`crate::observation`].

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
    let items = root.descendants().filter(|node| is(node, "DataItem"));
    items.map(|node| data_item(&node)).collect()
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
        coordinates: attribute(node, "coordinateSystem"),
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
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn streams_of(version: &str) -> String {
        format!(
            r#"<?xml version="1.0" encoding="UTF-8"?>
<MTConnectStreams xmlns:m="urn:mtconnect.org:MTConnectStreams:{version}" xmlns="urn:mtconnect.org:MTConnectStreams:{version}">
 <Header creationTime="2016-11-29T10:00:00Z" sender="shop" instanceId="77" bufferSize="131072" firstSequence="5" lastSequence="12" nextSequence="13"/>
 <Streams><DeviceStream name="mill" uuid="m1">
  <ComponentStream component="Linear" name="X" componentId="x1">
   <Samples><Position dataItemId="xp" name="Xabs" timestamp="2016-11-29T10:00:00.5Z" sequence="11" subType="ACTUAL">12.5</Position>
    <Position dataItemId="xc" timestamp="2016-11-29T10:00:00.5Z" sequence="9">UNAVAILABLE</Position>
    <TemperatureTimeSeries dataItemId="t" timestamp="2016-11-29T10:00:01Z" sequence="12" sampleRate="10" sampleCount="3">20.5 20.6 20.7</TemperatureTimeSeries></Samples>
   <Events><Execution dataItemId="e" timestamp="2016-11-29T10:00:00Z" sequence="10">ACTIVE</Execution>
    <VariableDataSet dataItemId="v" timestamp="2016-11-29T10:00:00Z" sequence="8"><Entry key="a">1</Entry><Entry key="b">2</Entry></VariableDataSet>
    <Execution dataItemId="e" timestamp="yesterday" sequence="7">READY</Execution>
    <Execution timestamp="2016-11-29T10:00:00Z" sequence="7">READY</Execution></Events>
   <Condition><Fault dataItemId="c" timestamp="2016-11-29T10:00:00Z" sequence="6" type="TEMPERATURE" nativeCode="417" qualifier="HIGH">hot</Fault></Condition>
  </ComponentStream></DeviceStream></Streams>
</MTConnectStreams>"#
        )
    }

    #[test]
    fn an_answer_that_is_no_xml_is_refused_in_own_words() {
        for (bytes, words) in [
            (&b"<!DOCTYPE a><a/>"[..], "a document type"),
            (b"", "no element stands there"),
            (
                b"<a>\n <b>",
                "no XML: 2:5: the text ends inside of an element",
            ),
            (b"<a></b>", "</b> closes <a>"),
            (b"<a>&c;</a>", "&c; is not defined"),
            (b"<a", "no XML: 1:1: no element stands there"),
        ] {
            let shown = read(bytes).unwrap_err().to_string();
            assert!(shown.contains(words), "{words}: {shown}");
        }
    }

    /// The string value of an element by XPath: its text, whatever comments, instructions and sections of data part it.
    #[test]
    fn a_value_that_comments_part_is_whole_and_one_with_elements_in_it_is_none() {
        let long = "<MTConnectStreams><Header instanceId=\"7\" firstSequence=\"1\" lastSequence=\"1\" nextSequence=\"2\"/><Streams><DeviceStream name=\"m\"><ComponentStream component=\"L\"><Samples><Position dataItemId=\"x\" timestamp=\"2016-11-29T10:00:00Z\" sequence=\"1\">TEXT</Position></Samples></ComponentStream></DeviceStream></Streams></MTConnectStreams>";
        for (text, wanted) in [
            ("5<!-- x -->.6", Some("5.6")),
            ("9<?pi x?>.75", Some("9.75")),
            ("<!-- 3 -->1.5", Some("1.5")),
            ("<![CDATA[12]]>.5", Some("12.5")),
            ("&#49;2", Some("12")),
            ("AVAIL<!-- x -->ABLE", Some("AVAILABLE")),
            ("1<b/>2", None),
            ("<b>7</b>", None),
        ] {
            let answer = read(long.replace("TEXT", text).as_bytes()).unwrap();
            let Answer::Streams {
                observations,
                malformed,
                ..
            } = answer
            else {
                panic!("{text}");
            };
            let found = observations.first().map(|one| one.observation.told.clone());
            assert_eq!(
                found,
                wanted.map(|value| Told::Value(value.to_owned())),
                "{text}"
            );
            assert_eq!(malformed, usize::from(wanted.is_none()), "{text}");
        }
    }

    #[test]
    fn an_agents_words_of_an_error_stand_once() {
        let text = "<MTConnectError><Header instanceId=\"7\"/><Errors><Error errorCode=\"INVALID_REQUEST\">from must be a number</Error></Errors></MTConnectError>";
        let Answer::Error { errors } = read(text.as_bytes()).unwrap() else {
            panic!("an error");
        };
        assert_eq!(
            errors,
            [(
                "INVALID_REQUEST".to_owned(),
                "from must be a number".to_owned()
            )]
        );
    }

    #[test]
    fn values_come_in_the_order_of_their_numbers_in_every_version() {
        for version in ["1.2", "1.3", "1.8", "2.0", "2.4"] {
            let answer = read(streams_of(version).as_bytes()).unwrap();
            let Answer::Streams {
                header,
                observations,
                malformed,
                unstamped,
                unread,
            } = answer
            else {
                panic!("{version}");
            };
            assert_eq!(unread, [7]);
            assert_eq!(
                (
                    header.instance_id,
                    header.first_sequence,
                    header.next_sequence
                ),
                (77, 5, 13)
            );
            let numbers: Vec<_> = observations.iter().map(|n| n.sequence).collect();
            assert_eq!(numbers, [6, 7, 8, 9, 10, 11, 12]);
            assert_eq!((malformed, unstamped), (1, 1));
            assert_eq!(observations[1].observation.time, MachineTime::Absent);
            let observations: Vec<_> = observations
                .iter()
                .filter(|numbered| numbered.sequence != 7)
                .collect();
            let told = |at: usize| &observations[at].observation.told;
            assert!(
                matches!(told(0), Told::Alarm(a) if a.level == AlarmLevel::Fault && a.code == "417")
            );
            assert_eq!(told(1), &Told::Value("a=1 b=2".to_owned()));
            assert_eq!(told(2), &Told::Unavailable);
            assert_eq!(told(4), &Told::Value("12.5".to_owned()));
            assert!(
                matches!(told(5), Told::Series { rate_hz: Some(_), values } if values.len() == 3)
            );
            assert_eq!(observations[4].observation.name.as_deref(), Some("Xabs"));
        }
    }

    #[test]
    fn an_error_and_the_devices_are_read() {
        let error = r#"<MTConnectError xmlns="urn:mtconnect.org:MTConnectError:1.3"><Header instanceId="7"/><Errors><Error errorCode="OUT_OF_RANGE">'from' must be greater than 5</Error></Errors></MTConnectError>"#;
        let Answer::Error { errors } = read(error.as_bytes()).unwrap() else {
            panic!("no error");
        };
        assert_eq!(errors[0].0, "OUT_OF_RANGE");
        let devices = r#"<MTConnectDevices xmlns="urn:mtconnect.org:MTConnectDevices:2.0"><Header instanceId="7"/><Devices><Device id="d" name="mill"><Components><Axes id="a" name="base"><Components><Linear id="x" name="X"><DataItems><DataItem id="xp" name="Xabs" category="SAMPLE" type="POSITION" subType="ACTUAL" units="MILLIMETER"/></DataItems></Linear></Components></Axes></Components></Device></Devices></MTConnectDevices>"#;
        let Answer::Devices { items, .. } = read(devices.as_bytes()).unwrap() else {
            panic!("no devices");
        };
        let item = &items[0];
        let seen = (
            item.device.as_str(),
            item.component.as_str(),
            item.kind.as_str(),
        );
        assert_eq!(seen, ("mill", "Linear X", "POSITION"));
    }

    #[test]
    fn what_no_agent_sends_is_refused() {
        let root = read(b"<html/>").unwrap_err();
        assert_eq!(
            root.to_string(),
            "root element \"html\" is none of MTConnect's"
        );
        let bomb = b"<!DOCTYPE a [<!ENTITY b \"c\">]><MTConnectError/>";
        assert!(matches!(read(bomb), Err(DocumentFlaw::NotXml { .. })));
        assert!(matches!(read(b"\xff"), Err(DocumentFlaw::NotXml { .. })));
        let header = b"<MTConnectStreams><Header instanceId=\"x\"/></MTConnectStreams>";
        assert!(matches!(read(header), Err(DocumentFlaw::Header { .. })));
    }

    #[test]
    fn a_byte_that_is_no_letter_costs_no_other_value() {
        for broken in [&b"\xf6"[..], b"\xff\xfe", b"\0", b"\x07"] {
            let whole = streams_of("1.3");
            let at = whole.find("ACTIVE").unwrap();
            let bytes = [&whole.as_bytes()[..at], broken, &whole.as_bytes()[at..]].concat();
            let Answer::Streams { observations, .. } = read(&bytes).unwrap() else {
                panic!("no streams");
            };
            assert_eq!(observations.len(), 7, "{broken:?}");
            let broken = |numbered: &Numbered| matches!(&numbered.observation.told, Told::Value(text) if text.contains(text::REPLACED));
            assert_eq!(observations.iter().filter(|one| broken(one)).count(), 1);
        }
    }

    proptest! {
        #[test]
        fn prop_a_cut_or_broken_answer_never_panics(at in 0_usize..1500, byte in any::<u8>()) {
            let mut bytes = streams_of("1.3").into_bytes();
            let place = at.min(bytes.len() - 1);
            let _ = read(&bytes[..place]);
            bytes[place] = byte;
            let _ = read(&bytes);
        }
    }
}
