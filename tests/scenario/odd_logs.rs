//! Logs of adapters that are odd in one way each, replayed by a run: what is in its bag, and what the run says at its end.

use abbe_msgs::{Wire, from_cdr, msg};
use abbe_tests::scenario::Scenario;
use recorder::{Bag, Event, Order};

const MAP: &str = "values:
  Srpm: {is: spindle_speed, name: spindle_speed, unit: REVOLUTION/MINUTE}
  Stemp: {is: temperature, name: spindle, unit: CELSIUS}
  execution: {is: execution}
  program: {is: text}
  logic: {is: condition}
";

const LAUNCH: &str = r#"<launch>
  <node pkg="abbe" exec="fake_cnc"><param from="$(dirname)/fake_cnc.yaml"/></node>
  <node pkg="abbe" exec="mtconnect_bridge"><param from="$(dirname)/mtconnect_bridge.yaml"/></node>
  <node pkg="abbe" exec="sequencer"><param from="$(dirname)/sequencer.yaml"/></node>
</launch>
"#;

/// A log of bytes, the values published from it (`name=text`, in order), and the words that the run prints.
struct Case {
    what: &'static str,
    log: &'static [u8],
    told: &'static [&'static str],
    said: &'static [&'static str],
}

const CASES: [Case; 13] = [
    Case {
        what: "a first line without a date",
        log: b"* shdrVersion: 2.0\n2016-01-05T08:00:00Z|Stemp|21.5\n2016-01-05T08:00:05Z|Stemp|21.7\n",
        told: &["spindle=21.5", "spindle=21.7"],
        said: &[],
    },
    Case {
        what: "one stamp in 2035",
        log: b"2016-01-05T08:00:00Z|Stemp|21.5\n2035-01-05T08:00:01Z|Stemp|21.6\n2016-01-05T08:00:05Z|Stemp|21.7\n2016-01-05T08:00:06Z|Stemp|21.8\n",
        told: &["spindle=21.5", "spindle=21.6", "spindle=21.7", "spindle=21.8"],
        said: &["machine clock"],
    },
    Case {
        what: "keys that the mapping has not",
        log: b"2026-01-05T08:00:00Z|Stemp|21.5|Srpm|1200\n2026-01-05T08:00:05Z|avail|UNAVAILABLE|Stemp|30.5|Srpm|1300\n2026-01-05T08:00:20Z|pmode|NORMAL|Stemp|44|execution|ACTIVE\n",
        told: &[
            "spindle=21.5",
            "spindle_speed=1200",
            "spindle=30.5",
            "spindle_speed=1300",
            "spindle=44",
            "execution=ACTIVE",
        ],
        said: &[],
    },
    Case {
        what: "values in quotes",
        log: b"2026-01-05T08:00:00Z|program|\"O1000 \\| op 20\"\n2026-01-05T08:00:01Z|program|\"O2000\"\n",
        told: &["program=O1000 | op 20", "program=O2000"],
        said: &[],
    },
    Case {
        what: "a bar in the text of an alarm",
        log: b"2026-01-05T08:00:00Z|logic|FAULT|A1|1|HIGH|axis X | limit\n2026-01-05T08:00:05Z|Stemp|21.5|Srpm\n",
        told: &["spindle=21.5"],
        said: &["alarm", "FAULT A1 1 (HIGH): axis X", "1 fields behind a condition (first in line 1)"],
    },
    Case {
        what: "blocks of several lines",
        log: b"2026-01-05T08:00:00Z|@ASSET@|T12|CuttingTool|--multiline--AB12\n<CuttingTool>\n2026-01-05T08:00:00Z|Stemp|99\n</CuttingTool>\n--multiline--AB12\n2026-01-05T08:00:01Z|Stemp|22\n2026-01-05T08:00:02Z|program|--multiline--AB13\nline one\nline two\n--multiline--AB13\n",
        told: &["spindle=22", "program=line one\nline two"],
        said: &[],
    },
    Case {
        what: "letters of another encoding",
        log: b"2026-01-05T08:00:00Z|program|\xd6l\n2026-01-05T08:00:01Z|Stemp|22\n",
        told: &["program=\u{fffd}l", "spindle=22"],
        said: &["1 letters replaced that were no UTF-8 or may not stand there"],
    },
    Case {
        what: "an empty log",
        log: b"",
        told: &[],
        said: &["0 lines taken, 0 values published", "nothing is published: no key with a value was read"],
    },
    Case {
        what: "a log of keys that the mapping has not",
        log: b"2026-01-05T08:00:00Z|Xact|1.5|avail|AVAILABLE\n2026-01-05T08:00:01Z|Xact|1.6\n",
        told: &[],
        said: &["2 lines taken", "the mapping has none of the keys Xact, avail; name them in map_file"],
    },
    Case {
        what: "a quote that does not end",
        log: b"2026-01-05T08:00:00Z|Stemp|22|program|\"O1000 \\| op 20|Srpm|1200\n",
        told: &["spindle=22", "program=\"O1000 \\"],
        said: &["1 quotes that do not end (first in line 1)"],
    },
    Case {
        what: "a block without its end",
        log: b"2026-01-05T08:00:00Z|Stemp|22\n2026-01-05T08:00:01Z|program|--multiline--A\n2026-01-05T08:00:02Z|Stemp|23\n",
        told: &["spindle=22", "spindle=23"],
        said: &["1 blocks without their end (first in line 2)"],
    },
    Case {
        what: "a value without a key",
        log: b"2026-01-05T08:00:00Z|Stemp|22\n2026-01-05T08:00:01Z||30.5\n",
        told: &["spindle=22"],
        said: &["log line 2: value \"30.5\" without a key"],
    },
    Case {
        what: "a log that is longer than the run",
        log: b"2026-01-05T08:00:00Z|Stemp|22\n2026-01-05T09:00:00Z|Stemp|23\n|Stemp|24\n",
        told: &["spindle=22"],
        said: &["2 lines of the log were not replayed"],
    },
];

/// Values of the machine in a bag, in their order.
fn told(bag: &Bag) -> Vec<String> {
    let mut messages = bag.messages(Order::LogTime);
    let mut found = Vec::new();
    while let Some(event) = messages.next_event() {
        let Event::Message(message) = event else {
            panic!("the bag has a loss");
        };
        let topic = &bag.topic(message.topic).topic;
        if let Some(name) = topic.strip_prefix("/machine/") {
            let value: msg::MachineValue = from_cdr(message.data).unwrap();
            let value = value.into_inner().unwrap();
            found.push(format!("{name}={}", value.text));
        }
    }
    found
}

#[test]
fn odd_logs_are_told_whole_and_what_is_odd_is_said() {
    for Case {
        what,
        log,
        told: wanted,
        said,
    } in CASES
    {
        let scenario = Scenario::copy_of("cold_reference");
        std::fs::remove_file(scenario.path("cold_reference.launch.xml")).unwrap();
        scenario.write("listen.launch.xml", LAUNCH);
        scenario.write(
            "plan.yaml",
            "title: listen\nsteps:\n  - {do: wait, seconds: 30}\n",
        );
        scenario.write("map.yaml", MAP);
        scenario.write("mtconnect_bridge.yaml", "/**:\n  ros__parameters:\n    source: log\n    log_file: log.shdr\n    map_file: map.yaml\n");
        std::fs::write(scenario.path("log.shdr"), log).unwrap();
        let ended = scenario.run_to_end(&[]);
        assert_eq!(ended.status.code(), Some(0), "{what}: {}", ended.said);
        for words in said {
            assert!(
                ended.said.contains(words),
                "{what}: {words:?} is not in {}",
                ended.said
            );
        }
        if said.is_empty() {
            assert!(
                !ended.said.contains("mtconnect_bridge"),
                "{what}: {}",
                ended.said
            );
        }
        let bag = Bag::open(scenario.new_run(&[]).join("bag")).unwrap();
        assert_eq!(told(&bag), wanted, "{what}");
    }
}
