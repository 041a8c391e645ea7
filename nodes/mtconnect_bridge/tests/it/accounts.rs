//! Logs and connections of which a part, or all, cannot be used: nothing is left out without a count, a reason and a line.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use metrology::stamp::{Host, NANOS_PER_S};
use metrology::{Severity, Stage, Stamp};
use mtconnect_bridge::condition::{Condition, ValueCondition};
use mtconnect_bridge::config::{AgentConfig, ConnectionConfig, Source};
use mtconnect_bridge::io::LogFile;
use mtconnect_bridge::live::{LiveBridge, LiveInput};
use mtconnect_bridge::mapping::MapFile;
use mtconnect_bridge::stage::IoEvent;
use mtconnect_bridge::{BridgeConfig, BridgeStage, Input, Output, Settings};

const MAP: &str = "values:
  t: {is: temperature, name: t, unit: CELSIUS}
  prog: {is: text}
  c: {is: condition}
  avail: {is: ignored}
";

fn settings(source: Source, map: &str) -> Settings {
    let config = BridgeConfig {
        source,
        host: "mill".to_owned(),
        port: 7878,
        log_file: (source == Source::Log).then(String::new),
        log_longest_pause_s: BridgeConfig::default_longest_pause_s(),
        map_file: String::new(),
        connection: ConnectionConfig::default(),
        agent: AgentConfig::default(),
    };
    Settings::new(&config, &MapFile::from_yaml(map).unwrap()).unwrap()
}

fn at(second: i64) -> Stamp<Host> {
    Stamp::from_nanos(1_767_600_000 * NANOS_PER_S + second * NANOS_PER_S)
}

/// The conditions of a log that is replayed as a file, for a minute.
fn replayed(map: &str, log: &str) -> Vec<Condition> {
    let bytes = std::io::Cursor::new(log.as_bytes().to_vec());
    let file = LogFile::new(bytes, log.len() as u64);
    let mut bridge = LiveBridge::of_log(&settings(Source::Log, map), file);
    let mut out = Vec::new();
    for second in 0..60 {
        bridge.step(at(second), LiveInput::Tick, &mut out).unwrap();
    }
    let shutdown = LiveInput::Shutdown;
    bridge.step(at(60), shutdown, &mut out).unwrap();
    conditions(out)
}

fn conditions(out: Vec<Output>) -> Vec<Condition> {
    let condition = |output| match output {
        Output::Condition(condition) => Some(condition),
        _ => None,
    };
    out.into_iter().filter_map(condition).collect()
}

/// How a log ends: how bad it is, and the account.
fn end(map: &str, log: &str) -> (Severity, String) {
    let said = replayed(map, log);
    let ends: Vec<_> = said
        .iter()
        .filter(|condition| matches!(condition, Condition::LogEnded { .. }))
        .collect();
    assert_eq!(ends.len(), 1, "{log:?}: {said:?}");
    (ends[0].severity(), ends[0].to_string())
}

const NONE: &str = "nothing is published: no key with a value was read";
const OF_KEYS: &str =
    "nothing is published: the mapping has none of the keys a, b; name them in map_file";

/// A log of the mapping, and what its account must have; all of these warn.
const WARNED: [(&str, &[&str]); 22] = [
    ("", &["0 lines taken, 0 values published", NONE]),
    ("\n\n\r\n", &["0 lines taken", NONE]),
    ("\u{feff}", &["0 lines taken", NONE]),
    ("* PONG 10000\n* shdrVersion: 1\n", &["2 lines taken", NONE]),
    (
        "|a|1\n|b|2|a|3\n",
        &["2 lines taken", "3 values of keys", OF_KEYS],
    ),
    ("|avail|AVAILABLE\n", &["1 lines taken", NONE]),
    (
        "|a|1\n|b",
        &["1 keys without a value (first in line 2)", OF_KEYS],
    ),
    (
        "|t|1\n|t",
        &[
            "1 values published",
            "1 keys without a value (first in line 2)",
        ],
    ),
    (
        "|t|1|a\n",
        &[
            "1 values published",
            "1 keys without a value (first in line 1)",
        ],
    ),
    (
        "|t|1|prog\n|t|2|c\n",
        &["2 keys without a value (first in line 1)"],
    ),
    (
        "|t|1\n||30.5\n",
        &[
            "1 values published",
            "1 values without a key (first in line 2)",
        ],
    ),
    (
        "|t|1||30.5|t|2\n",
        &[
            "2 values published",
            "1 values without a key (first in line 1)",
        ],
    ),
    ("|t|\n", &["1 values that are no numbers"]),
    (
        "|t|1\nhello\n",
        &["1 lines without a bar (first in line 2)"],
    ),
    (
        "|t|1\n|prog|\"O1000|t|2\n",
        &["1 quotes that do not end (first in line 2)"],
    ),
    (
        "|t|1\n|prog|\"O1000 \\| op 20|t|2\n",
        &[
            "1 quotes that do not end (first in line 2)",
            "2 values of keys that are not",
        ],
    ),
    (
        "|c|FAULT|A1|1|HIGH|\"axis X\n",
        &["1 quotes that do not end (first in line 1)"],
    ),
    (
        "|t|1\n|prog|--multiline--A\n",
        &["1 blocks without their end (first in line 2)"],
    ),
    (
        "|t|1\n|prog|--multiline--A\n|t|2\n|prog|--multiline--B\n|t|3",
        &["2 blocks without their end (first in line 2)"],
    ),
    (
        "|t|1\n--multiline--A\n",
        &["1 blocks without their end (first in line 2)"],
    ),
    (
        "2026-01-05T08:00:00Z|t|1\n2026-01-05T08:00:01Z|t|2\n2035-01-01T00:00:00Z|t|3\n2026-01-05T08:00:02Z|t|4\n",
        &[
            "4 lines taken, 4 values published",
            "2 leaps of the machine's clock (first in line 3)",
        ],
    ),
    (
        "yesterday|t|1\n",
        &["1 stamps that are none (first in line 1)"],
    ),
];

#[test]
fn no_log_ends_silently_of_which_a_part_or_all_was_left_out() {
    for (log, wanted) in WARNED {
        let (severity, words) = end(MAP, log);
        assert_eq!(severity, Severity::Warn, "{log:?}: {words}");
        for wanted in wanted {
            assert!(words.contains(wanted), "{log:?}: {words}");
        }
    }
    // With an empty mapping every key is unknown.
    let (severity, words) = end("values: {}\n", "|a|1\n|b|2\n");
    assert_eq!(severity, Severity::Warn);
    assert!(words.contains(OF_KEYS), "{words}");
    let many: String = (0..100).map(|n| format!("|k{n}|1\n")).collect();
    let (_, words) = end(MAP, &many);
    assert!(
        words.contains("k0, k1") && words.contains("and perhaps more"),
        "{words}"
    );
}

#[test]
fn a_log_that_is_whole_ends_without_a_warning() {
    for log in [
        "|t|1\n",
        "|t|1|a|2\n",
        "|avail|AVAILABLE|t|1|\n",
        "|t|1\n|prog|\"O1000 \\| op 20\"\n",
        "|t|1\n|prog|--multiline--A\none\ntwo\n--multiline--A\n",
        "* shdrVersion: 2\n|a|t|1\n",
    ] {
        let (severity, words) = end(MAP, log);
        assert_eq!(severity, Severity::Info, "{log:?}: {words}");
        assert!(
            replayed(MAP, log)
                .iter()
                .all(|one| one.severity() == Severity::Info),
            "{log:?}"
        );
    }
}

/// 65,536 bytes is the limit of `abbe_msgs/MachineValue`, whose `text` no node publishes longer.
#[test]
fn a_block_with_a_line_over_the_limit_is_no_value_and_all_its_lines_are_in_the_account() {
    let long = "x".repeat((1 << 20) + 1);
    let log = format!("|t|1\n|prog|--multiline--A\none\n{long}\n--multiline--A\n|t|2\n");
    let (severity, words) = end(MAP, &log);
    assert_eq!(severity, Severity::Warn);
    for wanted in [
        "6 lines taken, 2 values published",
        "1 lines over the limit (first in line 2)",
    ] {
        assert!(words.contains(wanted), "{words}");
    }
    let whole = "|t|1\n|prog|--multiline--A\none\ntwo\n--multiline--A\n";
    assert!(
        end(MAP, whole)
            .1
            .contains("5 lines taken, 2 values published")
    );
}

#[test]
fn conditions_of_more_keys_or_codes_than_are_kept_are_in_the_account() {
    let of_keys = |n: u32| format!("|k{n}|FAULT|A1|1|HIGH|hot\n");
    // The mapping has four keys.
    let log: String = (0..4100).map(of_keys).collect();
    let (severity, words) = end(MAP, &log);
    assert_eq!(severity, Severity::Warn);
    assert!(
        words.contains("4092 values published; 8 conditions over the limit (first in line 4093)"),
        "{words}"
    );
    // What is kept ends all the same.
    let said = replayed(MAP, &(log + "|k0|NORMAL||||\n"));
    let is_over = |one: &Condition| one.name() == "alarm/k0" && one.severity() == Severity::Info;
    assert!(said.iter().any(is_over));
    let of_codes = |n: u32| format!("|c|FAULT|A{n}|1|HIGH|hot\n");
    let log: String = (0..300).map(of_codes).collect();
    let (_, words) = end(MAP, &log);
    assert!(
        words.contains("256 values published; 44 conditions over the limit (first in line 257)"),
        "{words}"
    );
}

#[test]
fn a_value_that_no_message_holds_is_left_out_by_its_line_and_not_known() {
    let log = |length: usize| format!("|t|1|prog|A\n|prog|{}\n|t|2\n", "x".repeat(length));
    assert_eq!(end(MAP, &log(65_536)).0, Severity::Info);
    let (severity, words) = end(MAP, &log(65_537));
    assert_eq!(severity, Severity::Warn);
    assert!(
        words.contains("3 values published; 1 values over the limit (first in line 2)"),
        "{words}"
    );
    let said = replayed(MAP, &log(65_537));
    let words: Vec<String> = said.iter().map(ToString::to_string).collect();
    let wanted = "log line 2: prog: a value of 65537 bytes, limit 65536: left out; 1 so far";
    assert!(words.contains(&wanted.to_owned()), "{words:?}");
    assert!(said.iter().any(
        |one| matches!(one, Condition::Value(ValueCondition::Absent { name, .. }) if name == "prog")
    ));
}

#[test]
fn a_refused_value_of_a_log_has_its_line() {
    let words: Vec<String> = replayed(MAP, "|t|1\n|t|warm\n|t|-300\n")
        .iter()
        .map(ToString::to_string)
        .collect();
    for wanted in [
        "log line 2: t: \"warm\" is no finite number; 1 so far",
        "log line 3: t: -300: ",
    ] {
        assert!(words.iter().any(|one| one.starts_with(wanted)), "{words:?}");
    }
}

#[test]
fn a_line_of_a_log_ends_with_cr_with_lf_or_with_both() {
    for end in ["\r", "\n", "\r\n"] {
        let log =
            format!("2026-01-05T08:00:00Z|t|20{end}2026-01-05T08:00:01Z|t|21{end}|prog|A{end}");
        let (severity, words) = self::end(MAP, &log);
        assert_eq!(severity, Severity::Info, "{end:?}");
        assert!(
            words.contains("3 lines taken, 3 values published"),
            "{end:?}: {words}"
        );
    }
}

#[test]
fn what_stands_before_and_behind_a_block_without_its_end_is_read() {
    let log = "|t|1|prog|--multiline--A\n|t|2\n|c|FAULT|A1|1|HIGH|--multiline--B\n|t|3\n";
    let (_, words) = end(MAP, log);
    assert!(
        words.contains("4 lines taken, 4 values published"),
        "{words}"
    );
    assert!(
        words.contains("2 blocks without their end (first in line 1)"),
        "{words}"
    );
    let alarm = replayed(MAP, log)
        .into_iter()
        .any(|one| matches!(one, Condition::Value(ValueCondition::Alarm { .. })));
    assert!(alarm);
}

#[test]
fn what_the_end_of_a_connection_cuts_is_counted() {
    for (bytes, reason) in [
        (
            "|t|1\n|prog|--multiline--A\none\n",
            "block \"--multiline--A\" without its end",
        ),
        (
            "|t|1\n|t|2",
            "line cut after 4 bytes by the end of the connection",
        ),
    ] {
        for by_machine in [true, false] {
            let mut stage = BridgeStage::new(&settings(Source::Shdr, MAP));
            let mut out = Vec::new();
            let received = IoEvent::Received(bytes.as_bytes().to_vec());
            let end = if by_machine {
                Input::Io(IoEvent::Closed {
                    reason: "end of stream".to_owned(),
                    status: 0,
                })
            } else {
                Input::Shutdown
            };
            for input in [
                Input::Tick,
                Input::Io(IoEvent::Connected),
                Input::Io(received),
                end,
            ] {
                stage.step(at(0), input, &mut out).unwrap();
            }
            let found: Vec<String> = conditions(out).iter().map(ToString::to_string).collect();
            assert!(found.iter().any(|one| one.contains(reason)), "{found:?}");
        }
    }
}

/// A file that fails after its first bytes.
struct Failing(bool);

impl std::io::Read for Failing {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        if std::mem::replace(&mut self.0, true) {
            return Err(std::io::Error::other("input/output error"));
        }
        let line = b"|t|1\n";
        bytes[..line.len()].copy_from_slice(line);
        Ok(line.len())
    }
}

#[test]
fn a_log_that_cannot_be_read_on_is_an_error_with_its_place() {
    let file = LogFile::new(Failing(false), 1 << 40);
    let mut bridge = LiveBridge::of_log(&settings(Source::Log, MAP), file);
    let mut out = Vec::new();
    bridge.step(at(0), LiveInput::Tick, &mut out).unwrap();
    let found = conditions(out);
    let failed = found.iter().find(|one| one.severity() == Severity::Error);
    let words = failed.unwrap().to_string();
    assert!(
        words.contains("from byte 5 on: input/output error"),
        "{words}"
    );
    assert!(
        found
            .iter()
            .any(|one| one.to_string().contains("1 values published"))
    );
}

#[test]
fn a_log_longer_than_what_waits_is_replayed_whole() {
    let line = "2026-01-05T08:00:00Z|t|21.5\n";
    let lines = 200_000;
    let log = line.repeat(lines);
    let bytes = std::io::Cursor::new(log.clone().into_bytes());
    let mut bridge = LiveBridge::of_log(
        &settings(Source::Log, MAP),
        LogFile::new(bytes, log.len() as u64),
    );
    let (mut told, mut ticks) = (0, 0);
    loop {
        let mut out = Vec::new();
        bridge.step(at(ticks), LiveInput::Tick, &mut out).unwrap();
        ticks += 1;
        told += out
            .iter()
            .filter(|one| matches!(one, Output::Value(_)))
            .count();
        let ended = conditions(out)
            .iter()
            .any(|one| matches!(one, Condition::LogEnded { .. }));
        if ended {
            break;
        }
        assert!(ticks < 1000, "{told} values after {ticks} ticks");
    }
    assert_eq!(told, lines);
}
