//! Odd times at every entrance of the bridge: a line of an adapter, a log, an observation of an agent. Whatever the stamp
//! is, the value is published, its message has a stamp that ROS can carry, and the fault is reported.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use metrology::stamp::{Host, NANOS_PER_S};
use metrology::{Stage, Stamp, epoch};
use mtconnect_bridge::config::{AgentConfig, ConnectionConfig, Source};
use mtconnect_bridge::mapping::MapFile;
use mtconnect_bridge::stage::IoEvent;
use mtconnect_bridge::{BridgeConfig, BridgeStage, Input, Output, Settings};
use proptest::prelude::*;

const MAP: &str = "values:\n  t: {is: temperature, name: t, unit: CELSIUS}\n";
/// 2026-01-05T08:00:00Z.
const NOW: i64 = 1_767_600_000;

fn settings(source: Source) -> Settings {
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
    Settings::new(&config, &MapFile::from_yaml(MAP).unwrap()).unwrap()
}

fn at(second: i64) -> Stamp<Host> {
    Stamp::from_nanos(second * NANOS_PER_S)
}

fn step(stage: &mut BridgeStage, second: i64, input: Input) -> Vec<Output> {
    let mut out = Vec::new();
    stage.step(at(second), input, &mut out).unwrap();
    out
}

/// Values in their order with the machine's second, and the names of conditions that warn.
fn heard(said: &[Output]) -> (Vec<(String, i64)>, Vec<String>) {
    let (mut values, mut warnings) = (Vec::new(), Vec::new());
    for output in said {
        match output {
            Output::Value(value) => {
                assert!(epoch::holds(value.machine_at), "{value:?}");
                values.push((value.text.clone(), value.machine_at.nanos() / NANOS_PER_S));
            }
            Output::Condition(condition) if condition.severity() > metrology::Severity::Info => {
                warnings.push(condition.name());
            }
            _ => {}
        }
    }
    (values, warnings)
}

fn live(lines: &[String]) -> (Vec<(String, i64)>, Vec<String>) {
    let mut stage = BridgeStage::new(&settings(Source::Shdr));
    let mut said = step(&mut stage, NOW, Input::Tick);
    said.extend(step(&mut stage, NOW, Input::Io(IoEvent::Connected)));
    for (k, line) in (20..).zip(lines) {
        let bytes = format!("{line}\n").into_bytes();
        said.extend(step(
            &mut stage,
            NOW + k,
            Input::Io(IoEvent::Received(bytes)),
        ));
    }
    heard(&said)
}

/// A log, listened to for a minute.
fn logged(lines: &[String]) -> (Vec<(String, i64)>, Vec<String>) {
    let mut stage = BridgeStage::of_log(&settings(Source::Log), lines.join("\n").as_bytes());
    let mut said = Vec::new();
    for second in 0..60 {
        said.extend(step(&mut stage, NOW + second, Input::Tick));
    }
    said.extend(step(&mut stage, NOW + 60, Input::Shutdown));
    heard(&said)
}

fn agent(stamps: &[String]) -> (Vec<(String, i64)>, Vec<String>) {
    let mut stage = BridgeStage::new(&settings(Source::Agent));
    let document = |first: usize, stamps: &[String]| {
        let values: String = (first..)
            .zip(stamps)
            .map(|(k, stamp)| format!(r#"<Temperature dataItemId="t" sequence="{k}" timestamp="{stamp}">{k}</Temperature>"#))
            .collect();
        let next = first + stamps.len();
        format!(
            r#"<MTConnectStreams><Header instanceId="1" firstSequence="1" nextSequence="{next}"/><Streams><DeviceStream><ComponentStream><Samples>{values}</Samples></ComponentStream></DeviceStream></Streams></MTConnectStreams>"#
        )
    };
    let probe = r#"<MTConnectDevices><Header instanceId="1"/><Devices><Device name="m"><DataItems><DataItem id="t" type="TEMPERATURE" units="CELSIUS"/></DataItems></Device></Devices></MTConnectDevices>"#;
    let whole = |body: String| {
        Input::Io(IoEvent::Answered {
            status: 200,
            body: body.into_bytes(),
        })
    };
    let mut said = step(&mut stage, NOW, Input::Tick);
    said.extend(step(&mut stage, NOW, whole(probe.to_owned())));
    said.extend(step(&mut stage, NOW, whole(document(1, &[]))));
    let content_type = "multipart/x-mixed-replace;boundary=b".to_owned();
    said.extend(step(
        &mut stage,
        NOW,
        Input::Io(IoEvent::Began { content_type }),
    ));
    for (k, stamp) in stamps.iter().enumerate() {
        let part = document(k + 1, std::slice::from_ref(stamp));
        let part = format!("--b\nContent-length: {}\n\n{part}", part.len());
        let second = NOW + 20 + i64::try_from(k).unwrap();
        said.extend(step(
            &mut stage,
            second,
            Input::Io(IoEvent::Received(part.into_bytes())),
        ));
    }
    heard(&said)
}

/// A stamp, the second that it means (`None`: none, so the instant of receipt stands), and whether it is reported.
const STAMPS: [(&str, Option<i64>, bool); 22] = [
    ("2026-01-05T08:00:01Z", Some(NOW + 1), false),
    ("2026-01-05T08:00:01.5Z", Some(NOW + 1), false),
    ("2026-01-05T08:00:01.123456789Z", Some(NOW + 1), false),
    ("2026-01-05T08:00:01", Some(NOW + 1), false),
    ("2026-01-05T09:00:01+01:00", Some(NOW + 1), false),
    ("2026-01-05T03:00:01-0500", Some(NOW + 1), false),
    ("2026-01-05T07:59:60Z", Some(NOW), false),
    ("1970-01-01T00:00:00Z", Some(0), true),
    ("1980-01-06T00:00:00Z", Some(315_964_800), true),
    ("2035-01-05T08:00:01Z", Some(2_051_596_801), true),
    ("2038-01-19T03:14:08Z", Some(2_147_483_648), true),
    ("2106-02-07T06:28:15Z", Some(4_294_967_295), true),
    ("2026-01-06T08:00:01Z", Some(NOW + 86_401), true),
    ("2026-01-05T10:00:01Z", Some(NOW + 7201), true),
    ("2026-01-05T06:00:01Z", Some(NOW - 7199), true),
    ("1969-12-31T23:59:59Z", None, true),
    ("2106-02-07T06:28:16Z", None, true),
    ("9999-12-31T23:59:59Z", None, true),
    ("2026-13-05T08:00:01Z", None, true),
    ("NaN", None, true),
    ("-5", None, true),
    ("inf", None, true),
];

/// One odd stamp between plain ones: at 0 s, 2 s and 3 s.
fn with(odd: &str) -> [String; 4] {
    let plain = |second: u32| format!("2026-01-05T08:00:0{second}Z");
    [plain(0), odd.to_owned(), plain(2), plain(3)]
}

#[test]
fn whatever_a_stamp_is_every_value_is_told_and_the_odd_one_said() {
    for (odd, means, is_said) in STAMPS {
        let stamps = with(odd);
        let lines: Vec<String> = (1..)
            .zip(&stamps)
            .map(|(k, stamp)| format!("{stamp}|t|{k}"))
            .collect();
        for (entrance, (values, warnings)) in [
            ("adapter", live(&lines)),
            ("log", logged(&lines)),
            ("agent", agent(&stamps)),
        ] {
            let texts: Vec<&str> = values.iter().map(|(text, _)| text.as_str()).collect();
            assert_eq!(
                texts,
                ["1", "2", "3", "4"],
                "{entrance}, {odd}: {warnings:?}"
            );
            let plain: Vec<i64> = [0, 2, 3].iter().map(|k| values[*k].1 - NOW).collect();
            assert_eq!(plain, [0, 2, 3], "{entrance}, {odd}");
            // Without a stamp: the instant of receipt, or in a log the stamp of the line before.
            let received = if entrance == "log" { NOW } else { NOW + 21 };
            assert_eq!(values[1].1, means.unwrap_or(received), "{entrance}, {odd}");
            let says = warnings
                .iter()
                .any(|name| name == "machine_clock" || name == "refused_line");
            assert_eq!(says, is_said, "{entrance}, {odd}: {warnings:?}");
        }
    }
}

/// Numbers are milliseconds since an instant of the adapter's: seconds, milliseconds, microseconds and nanoseconds
/// since 1970 among them.
#[test]
fn numbers_are_counts_whose_unit_is_milliseconds_or_refused() {
    for (first_ms, is_count) in [
        (0.0, true),
        (1_767_600_000.0, true),
        (1_767_600_000_123.0, true),
        (1e12, true),
        (1_767_600_000_123_000.0, false),
        (1.767_600_000_123e18, false),
    ] {
        let lines: Vec<String> = (0..3)
            .map(|k| format!("{}|t|{k}", first_ms + f64::from(k) * 1000.0))
            .collect();
        for (values, warnings) in [live(&lines), logged(&lines)] {
            assert_eq!(values.len(), 3, "{first_ms}: {warnings:?}");
            let steps: Vec<i64> = values.windows(2).map(|two| two[1].1 - two[0].1).collect();
            if is_count {
                assert_eq!((steps, warnings.len()), (vec![1, 1], 0), "{first_ms}");
            } else {
                let refused = warnings.iter().filter(|name| *name == "refused_line");
                assert_eq!(refused.count(), 3, "{first_ms}: {warnings:?}");
            }
        }
    }
}

/// What adapters begin with has no date and belongs to the first line that has one; what a log of a minute does not
/// reach is counted.
#[test]
fn a_log_is_told_from_its_first_line_and_what_is_not_told_is_counted() {
    for opening in [
        "* shdrVersion: 2.0",
        "* PONG 10000",
        "|avail|AVAILABLE",
        "0|x|1",
        "",
        "\u{feff}",
    ] {
        let log = format!(
            "{opening}\n2016-01-05T08:00:00Z|t|1\r\n2016-01-05T08:00:05Z|t|2\r\n2016-01-05T09:00:05Z|t|3\n|t|4"
        );
        let (values, warnings) = logged(&[log]);
        let wanted = [
            ("1".to_owned(), 1_451_980_800),
            ("2".to_owned(), 1_451_980_805),
        ];
        assert_eq!(
            (values, warnings),
            (wanted.to_vec(), vec!["log".to_owned()]),
            "{opening:?}"
        );
    }
    let mut stage = BridgeStage::of_log(
        &settings(Source::Log),
        b"2016-01-05T08:00:00Z|t|1\n2016-01-05T09:00:00Z|t|2\n|t|3",
    );
    step(&mut stage, NOW, Input::Tick);
    let said = step(&mut stage, NOW + 60, Input::Shutdown);
    let said: Vec<String> = said
        .iter()
        .filter_map(|output| match output {
            Output::Condition(condition) => Some(condition.to_string()),
            _ => None,
        })
        .collect();
    assert_eq!(
        said,
        [
            "2 lines of the log were not replayed: the next one is due in 3540 s; 1 lines taken, 1 values published"
        ]
    );
}

proptest! {
    /// Whatever the stamps of an adapter: every value is published once, in order, with a stamp that ROS can carry.
    #[test]
    fn prop_no_stamp_costs_a_value(
        stamps in proptest::collection::vec(
            prop_oneof![
                (0_i64..4_294_967_296).prop_map(|s| mtconnect_bridge::condition::words(at(s))),
                (-10.0_f64..1e19).prop_map(|ms| ms.to_string()),
                "[0-9TZ:.+@ -]{0,30}",
            ],
            1..20,
        ),
    ) {
        let lines: Vec<String> = (0..).zip(&stamps).map(|(k, stamp): (u32, &String)| format!("{stamp}|t|{k}")).collect();
        let wanted: Vec<String> = (0..lines.len()).map(|k| k.to_string()).collect();
        let texts = |values: Vec<(String, i64)>| values.into_iter().map(|(text, _)| text).collect::<Vec<_>>();
        prop_assert_eq!(texts(live(&lines).0), wanted.clone());
        let mut stage = BridgeStage::of_log(&settings(Source::Log), lines.join("\n").as_bytes());
        let mut said = step(&mut stage, NOW, Input::Tick);
        // Half a day is the longest pause, and there are fewer than twenty.
        said.extend(step(&mut stage, NOW + 20 * 43_200, Input::Tick));
        prop_assert_eq!(texts(heard(&said).0), wanted);
    }
}
