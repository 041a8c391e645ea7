//! Tests of the parser on answers of agents that were written by hand.

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

#[test]
fn a_coordinate_system_that_is_named_by_its_id_is_looked_up() {
    let document = |reference: &str| {
        format!(
            r#"<MTConnectDevices xmlns="urn:mtconnect.org:MTConnectDevices:2.0"><Header instanceId="7"/><Devices><Device id="d" name="mill"><Configuration><CoordinateSystems><CoordinateSystem id="m" type="MACHINE"/><CoordinateSystem id="o" type="OBJECT"/></CoordinateSystems></Configuration><DataItems><DataItem id="xp" category="SAMPLE" type="POSITION" {reference}/></DataItems></Device></Devices></MTConnectDevices>"#
        )
    };
    for (reference, wanted) in [
        ("", ""),
        ("coordinateSystem=\"WORK\"", "WORK"),
        ("coordinateSystem=\"work\"", "WORK"),
        ("coordinateSystem=\" Work \"", "WORK"),
        ("coordinateSystem=\"part\"", "WORK"),
        ("coordinateSystem=\"machine\"", "MACHINE"),
        ("coordinateSystem=\"\"", ""),
        ("coordinateSystemIdRef=\"m\"", "MACHINE"),
        ("coordinateSystemIdRef=\"o\"", "WORK"),
        ("coordinateSystemIdRef=\"nobody\"", "WORK"),
        (
            "coordinateSystem=\"MACHINE\" coordinateSystemIdRef=\"\"",
            "MACHINE",
        ),
    ] {
        let Answer::Devices { items, .. } = read(document(reference).as_bytes()).unwrap() else {
            panic!("{reference}");
        };
        assert_eq!(items[0].coordinates, wanted, "{reference}");
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
        assert!(matches!(told(5), Told::Series { rate_hz: Some(_), values } if values.len() == 3));
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
