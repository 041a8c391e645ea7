//! Lines of adapters with what the reference agent (`mtconnect/cppagent` 2.5) reads in them, and what is read here.
//!
//! The reference's side was read from its sources and its own tests (`shdr_tokenizer.hpp`, `shdr_token_mapper.cpp`,
//! `timestamp_extractor.hpp`, `shdr_adapter.cpp`, `connector.cpp`; `shdr_tokenizer_test.cpp`,
//! `data_item_mapping_test.cpp`, `adapter_test.cpp`, `agent_test.cpp`); it was not run.

use mtconnect_bridge::observation::{AlarmReport, MachineTime, Told, read_stamp};
use mtconnect_bridge::shdr::block::records;
use mtconnect_bridge::shdr::{Line, Record, Shape, read};
use proptest::prelude::*;

/// What is known of a key.
fn shape(key: &str) -> Option<Shape> {
    let plain = key.rsplit_once(':').map_or(key, |(_, key)| key);
    match plain {
        "t" | "n" | "prog" => Some(Shape::Value),
        "c" => Some(Shape::Condition),
        "m" => Some(Shape::Message),
        "v" => Some(Shape::Series),
        _ => None,
    }
}

fn words(told: &Told) -> String {
    match told {
        Told::Unavailable => "?".to_owned(),
        Told::Value(text) => text.clone(),
        Told::Series { rate_hz, values } => {
            format!(
                "{values:?}@{}",
                rate_hz.map_or_else(String::new, |hz| hz.to_string())
            )
        }
        Told::Alarm(report) => {
            let AlarmReport {
                level,
                code,
                severity,
                qualifier,
                text,
            } = report;
            format!("{level:?}/{code}/{severity}/{qualifier}/{text}")
        }
    }
}

/// What is read of the known keys in a text of one or several lines: `key=value` with a bar between; assets as `@`.
fn reading(text: &str) -> String {
    let (mut version, mut found) = (1, Vec::new());
    for record in records(text) {
        let reading = read(&record, version, shape);
        match reading.line {
            Line::Observations(all) => {
                let known = all
                    .iter()
                    .filter(|one| shape(&one.key).is_some() || matches!(one.told, Told::Alarm(_)));
                found.extend(known.map(|one| format!("{}={}", one.key, words(&one.told))));
            }
            Line::Version(said) => version = said,
            Line::Pong { period_ms } => found.push(format!("pong {period_ms}")),
            Line::Empty | Line::Command => {}
        }
        if reading.has_asset {
            found.push("@".to_owned());
        }
    }
    found.join(" | ")
}

/// Lines that both read alike.
const ALIKE: [(&str, &str); 57] = [
    // Pairs.
    ("2026-01-05T08:00:00Z|t|21.5", "t=21.5"),
    ("2026-01-05T08:00:00Z|t|21.5|n|1200", "t=21.5 | n=1200"),
    ("|t|1|t|2", "t=1 | t=2"),
    ("|t|1|n|2|", "t=1 | n=2"),
    ("|prog||n|2", "prog= | n=2"),
    ("|prog|A|n|", "prog=A | n="),
    ("  |  t  | 21.5 | n |\t2 ", "t=21.5 | n=2"),
    ("|t|unavailable|n|Unavailable", "t=? | n=?"),
    ("|mill:t|5|mill:n|6", "mill:t=5 | mill:n=6"),
    ("|t|1\r", "t=1"),
    // A key without its value is not known.
    ("|t", "t=?"),
    ("|t|1|n", "t=1 | n=?"),
    // Keys that nobody described: they and one field behind them are passed over.
    ("|bad|ignore|dummy|1244|n|204", "n=204"),
    ("|d|normal|f|bad|g|also_bad|t|1", "t=1"),
    ("|avail|UNAVAILABLE|t|30.5|n|1300", "t=30.5 | n=1300"),
    (
        "|avail|UNAVAILABLE|t|UNAVAILABLE|n|UNAVAILABLE",
        "t=? | n=?",
    ),
    ("|pmode|NORMAL|t|44|prog|ACTIVE", "t=44 | prog=ACTIVE"),
    ("|x||t|1", "t=1"),
    ("|x", ""),
    // With version 2 the key alone is passed over.
    ("* shdrVersion: 2\n|bad|t|1", "t=1"),
    ("* shdrVersion: 2.0\n|bad|ignore|t|1", "t=1"),
    (
        "*shdrversion:2\n|a|b|c|NORMAL||||\n|t|1",
        "c=Normal//// | t=1",
    ),
    // Quotes and escapes.
    (r#"|prog|"O1000 \| op 20""#, "prog=O1000 | op 20"),
    (r#"|prog|"O2000""#, "prog=O2000"),
    (r#"|prog|"a\|b"|t|1"#, "prog=a|b | t=1"),
    (
        r#"|prog|x={b="12345", c="x"}|t|1"#,
        r#"prog=x={b="12345", c="x"} | t=1"#,
    ),
    (r"|prog|C:\NC\|t|1", r"prog=C:\NC\ | t=1"),
    (r#"|prog|"a"#, "prog=a"),
    (r#"|prog|"say \"hi\"""#, r#"prog=say "hi""#),
    // Conditions.
    (
        "|c|fault|A123|bad|HIGH|Something Bad",
        "c=Fault/A123/bad/HIGH/Something Bad",
    ),
    ("|c|normal||||", "c=Normal////"),
    ("|c|normal", "c=Normal////"),
    ("|c|NORMAL||||words", "c=Normal////words"),
    ("|c|NORMAL|2218|||", "c=Normal/2218///"),
    ("|c|UNAVAILABLE||||", "c=Unavailable////"),
    ("|c|WARNING|17|2|LOW|cold", "c=Warning/17/2/LOW/cold"),
    // What follows a condition on its line is let go, a bar in its text too; with version 2 it is read.
    (
        "|c|FAULT|A1|1|HIGH|axis X | limit",
        "c=Fault/A1/1/HIGH/axis X",
    ),
    (
        "|c|WARNING|HT-1|HTEMP|1|HIGH|Oil Temperature High",
        "c=Warning/HT-1/HTEMP/1/HIGH",
    ),
    ("|t|1|c|FAULT|A1|1|HIGH|x|n|2", "t=1 | c=Fault/A1/1/HIGH/x"),
    ("|c|normal|||||t|1|m|code|message", "c=Normal////"),
    (
        "* shdrVersion: 2\n|c|normal|||||t|1|m|code|message",
        "c=Normal//// | t=1 | m=message",
    ),
    ("|t|1|c|BROKEN||||", "t=1"),
    // Messages and time series.
    ("|m|A123|some text", "m=some text"),
    ("|m|A123|UNAVAILABLE", "m=?"),
    ("|m|A123", "m=?"),
    (
        "|v|5|100|1.1 1.2 1.3 1.4 1.5",
        "v=[1.1, 1.2, 1.3, 1.4, 1.5]@100",
    ),
    ("|v|UNAVAILABLE", "v=?"),
    // Times: a date, milliseconds, a duration behind; an invalid one is the present.
    ("0|t|1", "t=1"),
    ("5000|t|1|n|2", "t=1 | n=2"),
    ("2016-11-29T09:29:02Z@10.5|t|1", "t=1"),
    ("TIME1|t|1", "t=1"),
    // Blocks of several lines and assets.
    (
        "|prog|--multiline--A1\none\ntwo\n--multiline--A1\n|t|2",
        "prog=one\ntwo | t=2",
    ),
    (
        "|prog|first --multiline--A1\nx\n--multiline--A-\n--multiline--A1",
        "prog=first\nx\n--multiline--A-",
    ),
    (
        "|@ASSET@|T12|CuttingTool|--multiline--AB\n<T>\n</T>\n--multiline--AB\n|t|22",
        "@ | t=22",
    ),
    (
        "|@ASSET@|7|CuttingTool|<x/>\n|@REMOVE_ASSET@|7\n|@REMOVE_ALL_ASSETS@|",
        "@ | @ | @",
    ),
    // Commands.
    (
        "* PONG 10000\n* device: mill\n* PONG\n* PONG nan\n* manufacturer: x",
        "pong 10000",
    ),
    (
        "* deviceModel: --multiline--A1\n<Device/>\n|t|9\n--multiline--A1\n|t|1",
        "t=1",
    ),
];

/// Lines that are read otherwise on purpose: the reference's reading, the one here, and why.
const OTHERWISE: [(&str, &str, &str, &str); 6] = [
    (
        "|door|FAULT|3|||open\n|door|NORMAL||||",
        "",
        "door=Fault/3///open",
        "an alarm is told although the mapping has not its key",
    ),
    (
        r#"|prog|"a" b|t|1"#,
        "prog=a",
        r#"prog="a" b | t=1"#,
        "a quote that ends early makes two fields there, and shifts what follows",
    ),
    (
        "|@ASSET@|T|C|--multiline--A\n<T>\n2026-01-05T08:00:00Z|t|99\n</T>\n--multiline--A",
        "@",
        "@",
        "a bar in a block cuts its field there; here a block is one field",
    ),
    (
        "|prog|--multiline--A\na|t|99\n--multiline--A",
        "prog=a | t=99",
        "prog=a|t|99",
        "a bar in a block cuts its field there; here a block is one field",
    ),
    (
        "|prog|--multiline--A\n|t|1\n|n|2",
        "",
        "prog=? | t=1 | n=2",
        "a block that never ends takes all that follows there; here, in a log, none",
    ),
    (
        "|m|UNAVAILABLE|",
        "m=",
        "m=?",
        "adapters that do not know a message send it so",
    ),
];

#[test]
fn val_cppagent_a_table_of_lines_is_read_as_the_reference_agent_reads_it() {
    for (line, wanted) in ALIKE {
        assert_eq!(reading(line), wanted, "{line}");
    }
    for (line, reference, here, why) in OTHERWISE {
        assert_eq!(reading(line), here, "{line}: {why}");
        assert!(!why.is_empty() && !reference.contains('\r'));
    }
}

/// A stamp's offset is heeded and a leap second read; the reference passes over the one and takes the present for the
/// other.
#[test]
fn times_of_lines_are_dates_milliseconds_or_nothing() {
    let time = |line: &str| match read(&Record::plain(line), 1, shape).line {
        Line::Observations(found) => found.first().map(|one| one.time),
        _ => None,
    };
    let date = |text: &str| read_stamp(text).map(MachineTime::Absolute);
    for (line, wanted) in [
        (
            "2016-11-29T10:29:02+01:00|t|1",
            date("2016-11-29T09:29:02Z"),
        ),
        ("2016-12-31T23:59:60Z|t|1", date("2017-01-01T00:00:00Z")),
        ("2038-01-19T03:14:08Z|t|1", date("2038-01-19T03:14:08Z")),
        ("1250.5@3|t|1", Some(MachineTime::Relative(1250.5))),
        (
            "1767600000123|t|1",
            Some(MachineTime::Relative(1_767_600_000_123.0)),
        ),
        ("|t|1", Some(MachineTime::Absent)),
        ("-5|t|1", Some(MachineTime::Absent)),
        ("NaN|t|1", Some(MachineTime::Absent)),
        ("1e300|t|1", Some(MachineTime::Absent)),
        ("1969-12-31T23:59:59Z|t|1", Some(MachineTime::Absent)),
        ("2107-01-01T00:00:00Z|t|1", Some(MachineTime::Absent)),
    ] {
        assert_eq!(time(line), wanted, "{line}");
    }
}

#[test]
fn what_was_read_before_a_flaw_is_kept_and_the_flaw_is_said() {
    for (line, kept, said) in [
        ("garbage", "", "no bar in it: left out"),
        (
            "|t|1|c|BROKEN||||",
            "t=1",
            "key \"c\": level \"BROKEN\": must be NORMAL, WARNING, FAULT or UNAVAILABLE: left out",
        ),
        (
            "|t|1|n",
            "t=1 | n=?",
            "key \"n\": 0 fields behind it, needs 1: taken as not known",
        ),
        (
            "|t|1|v|4|100|1 -2.5 3",
            "t=1",
            "key \"v\": time series of \"4\" values, with other values or rate: left out",
        ),
        (
            "yesterday|t|1",
            "t=1",
            "stamp \"yesterday\": must be a date of 1970 to 2106, milliseconds or empty; published with the time of receipt, in a log with the stamp of the line beside it",
        ),
        (
            "|c|FAULT|A1|1|HIGH|axis X | limit",
            "c=Fault/A1/1/HIGH/axis X",
            "1 fields behind those of \"c\" left out: a bar in its text, or `* shdrVersion: 2` is missing",
        ),
    ] {
        assert_eq!(reading(line), kept, "{line}");
        let flaws = read(&Record::plain(line), 1, shape).flaws;
        let words: Vec<String> = flaws.iter().map(ToString::to_string).collect();
        assert_eq!(words, [said], "{line}");
    }
}

proptest! {
    /// Pairs among unknown keys: every known value is read, whatever stands before it.
    #[test]
    fn prop_unknown_keys_cost_no_known_value(
        pairs in proptest::collection::vec((0_usize..5, "(UNAVAILABLE|NORMAL|FAULT|WARNING|[a-z0-9.]{0,6})"), 1..12),
    ) {
        let keys = ["t", "n", "prog", "avail", "pmode"];
        let line: String = pairs.iter().map(|(key, value)| format!("|{}|{value}", keys[*key])).collect();
        let wanted: Vec<String> = pairs
            .iter()
            .filter(|(key, _)| *key < 3)
            .map(|(key, value)| {
                let value = if value == "UNAVAILABLE" { "?" } else { value };
                format!("{}={value}", keys[*key])
            })
            .collect();
        prop_assert_eq!(reading(&line), wanted.join(" | "));
    }

    /// Whatever a text holds behind its bars, the alarm is read.
    #[test]
    fn prop_no_bar_in_its_text_loses_an_alarm(text in "[a-zA-Z |\\\\\"]{0,30}", level in "(FAULT|WARNING|fault)") {
        let found = reading(&format!("|t|1|c|{level}|17|2|HIGH|{text}"));
        prop_assert!(found.starts_with("t=1 | c=Fault/17/2/HIGH/") || found.starts_with("t=1 | c=Warning/17/2/HIGH/"), "{}", found);
    }

    #[test]
    fn prop_no_line_panics(line in "[\\|\\*\\\\@\"a-zA-Z0-9 .:\\-é\n]{0,60}", kind in 0_usize..5, version in 0_u32..3) {
        let shapes = [Shape::Value, Shape::Condition, Shape::Message, Shape::Series];
        for record in records(&line) {
            let _ = read(&record, version, |_| shapes.get(kind).copied());
        }
    }
}
