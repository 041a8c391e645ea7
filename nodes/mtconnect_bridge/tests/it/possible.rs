//! Numbers out of range are refused with key, value and range, and never published.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use metrology::{Host, Stage, Stamp};
use mtconnect_bridge::condition::{Condition, ValueCondition};
use mtconnect_bridge::config::{AgentConfig, ConnectionConfig, Source};
use mtconnect_bridge::mapping::MapFile;
use mtconnect_bridge::stage::IoEvent;
use mtconnect_bridge::{BridgeConfig, BridgeStage, Input, Output, Settings};

const MAP: &str = "values:
  Sc: {is: temperature, name: spindle, unit: CELSIUS}
  Sf: {is: temperature, name: bed, unit: FAHRENHEIT}
";

fn stage(map: &str) -> BridgeStage {
    let config = BridgeConfig {
        source: Source::Shdr,
        host: "mill".to_owned(),
        port: 7878,
        log_file: None,
        log_longest_pause_s: BridgeConfig::default_longest_pause_s(),
        map_file: String::new(),
        connection: ConnectionConfig::default(),
        agent: AgentConfig::default(),
    };
    let map = MapFile::from_yaml(map).unwrap();
    BridgeStage::new(&Settings::new(&config, &map).unwrap())
}

/// What a line of an adapter makes.
fn heard(map: &str, line: &str) -> Vec<Output> {
    let (mut stage, mut out) = (stage(map), Vec::new());
    let at = Stamp::<Host>::from_nanos(1_000_000_000_000);
    let events = [
        Input::Tick,
        Input::Io(IoEvent::Connected),
        Input::Io(IoEvent::Received(line.as_bytes().to_vec())),
    ];
    for event in events {
        stage.step(at, event, &mut out).unwrap();
    }
    out
}

#[test]
fn a_temperature_is_published_within_its_range_alone() {
    let long = format!("1{}", "0".repeat(300));
    for (key, text, is_taken) in [
        ("Sc", "21.5", true),
        ("Sc", "-200", true),
        ("Sc", "1600", true),
        ("Sc", "-500", false),
        ("Sc", "-200.1", false),
        ("Sc", "1e308", false),
        ("Sc", "32767", false),
        ("Sc", "-1e300", false),
        ("Sc", long.as_str(), false),
        ("Sf", "70.7", true),
        ("Sf", "2912", true),
        ("Sf", "3000", false),
        ("Sf", "-460", false),
        ("Sf", "1e308", false),
    ] {
        let out = heard(MAP, &format!("2026-11-26T10:00:00.0Z|{key}|{text}\n"));
        let published = out.iter().filter_map(|output| match output {
            Output::Temperature(sample) => Some(sample.temperature_degc),
            _ => None,
        });
        let published: Vec<f64> = published.collect();
        assert_eq!(published.len(), usize::from(is_taken), "{key} {text}");
        let refused = out.iter().find_map(|output| match output {
            Output::Condition(wrong @ Condition::Value(ValueCondition::OutOfRange { .. })) => {
                Some(wrong.to_string())
            }
            _ => None,
        });
        assert_eq!(refused.is_none(), is_taken, "{key} {text}: {refused:?}");
        if let Some(words) = refused {
            let range = "a temperature must be from -200 to 1600 °C; 1 so far";
            assert!(
                words.contains(&format!("{key}: ")) && words.ends_with(range),
                "{words}"
            );
            assert!(words.len() < 150, "{words}");
        }
    }
}

#[test]
fn every_number_is_published_within_the_range_of_its_quantity_alone() {
    const MAP: &str = "values:
  F: {is: feed, name: feed, unit: MILLIMETER/MINUTE}
  Fi: {is: feed, name: feed_in, unit: INCH/MINUTE}
  S: {is: spindle_speed, name: spindle, unit: REVOLUTION/MINUTE}
  L: {is: load, name: load, unit: PERCENT}
  O: {is: override, name: override, unit: PERCENT}
  X: {is: position, axis: X, unit: MILLIMETER}
  A: {is: position, axis: A, unit: DEGREE}
";
    const PATH: &str = "values:\n  P: {is: path_position, unit: MILLIMETER}\n";
    let range = |what: &str, least: &str, greatest: &str| {
        format!("{what} must be from {least} to {greatest}; 1 so far")
    };
    let feed = range("a feed", "-1000000", "1000000 mm/min");
    let length = range("a position", "-1000000", "1000000 mm");
    for (key, good, bad, words) in [
        ("F", "120000", "1e7", &feed),
        ("Fi", "4000", "-40000", &feed),
        (
            "S",
            "300000",
            "1e300",
            &range("a spindle speed", "-1000000", "1000000 1/min"),
        ),
        ("L", "-250", "-32768", &range("a load", "-10000", "10000 %")),
        ("O", "120", "-1", &range("an override", "0", "10000 %")),
        ("X", "-1250.5", "2147483647", &length),
        (
            "A",
            "36000",
            "1e12",
            &range("a position", "-360000000", "360000000 deg"),
        ),
        ("P", "1 2 3", "1 2 -1e9", &length),
    ] {
        for (text, is_taken) in [(good, true), (bad, false)] {
            let map = if key == "P" { PATH } else { MAP };
            let out = heard(map, &format!("2026-11-26T10:00:00.0Z|{key}|{text}\n"));
            let refused = out.iter().find_map(|output| match output {
                Output::Condition(wrong @ Condition::Value(ValueCondition::OutOfRange { .. })) => {
                    Some(wrong.to_string())
                }
                _ => None,
            });
            let wanted = (!is_taken).then(|| format!("{key}: {text}: {words}"));
            assert_eq!(refused, wanted, "{key} {text}");
            let is_published = out
                .iter()
                .any(|output| matches!(output, Output::Value(_) | Output::State(_)));
            assert!(is_taken || !is_published, "{key} {text}");
        }
    }
}
