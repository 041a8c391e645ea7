//! A conversation with an adapter, line by line, without sockets: what is said and sent, and when.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use metrology::sample::Verdict;
use metrology::stamp::{Host, Span};
use metrology::{Axis, Stage, Stamp};
use mtconnect_bridge::condition::Condition;
use mtconnect_bridge::config::{AgentConfig, ConnectionConfig, Source};
use mtconnect_bridge::mapping::MapFile;
use mtconnect_bridge::stage::{IoCommand, IoEvent};
use mtconnect_bridge::{BridgeConfig, BridgeStage, Input, Output, Settings};
use proptest::prelude::*;

const MAP: &str = "values:
  Xabs: {is: position, axis: X, unit: MILLIMETER}
  Xcom: {is: commanded_position, axis: X, unit: MILLIMETER}
  Bdeg: {is: position, axis: B, unit: DEGREE}
  Fact: {is: feed, name: feed, unit: MILLIMETER/MINUTE}
  Stemp: {is: temperature, name: spindle, unit: CELSIUS, change: {step: 1.0, rate_limit_per_s: 1.0, sample_period_s: 1.5}}
  vib: {is: load, name: vibration, unit: PERCENT, series: true}
  sc: {is: condition, name: spindle_heat}
  msg: {is: message, name: words}
  avail: {is: ignored}
";

/// A bridge and the host's clock.
struct Desk {
    stage: BridgeStage,
    at_s: f64,
}

impl Desk {
    fn new(source: Source) -> Self {
        let config = BridgeConfig {
            source,
            host: "mill".to_owned(),
            port: 7878,
            log_file: None,
            log_longest_pause_s: BridgeConfig::default_longest_pause_s(),
            map_file: String::new(),
            connection: ConnectionConfig {
                reconnect_longest_s: 1.5,
                line_limit_bytes: 64,
                ..ConnectionConfig::default()
            },
            agent: AgentConfig::default(),
        };
        let map = MapFile::from_yaml(MAP).unwrap();
        Self {
            stage: BridgeStage::new(&Settings::new(&config, &map).unwrap()),
            at_s: 1000.0,
        }
    }

    /// An adapter that has just been reached.
    fn connected() -> Self {
        let mut desk = Self::new(Source::Shdr);
        desk.tell(Input::Tick);
        desk.tell(Input::Io(IoEvent::Connected));
        desk
    }

    fn now(&self) -> Stamp<Host> {
        Stamp::from_nanos(Span::from_secs_f64(self.at_s).nanos())
    }

    fn tell(&mut self, input: Input) -> Vec<Output> {
        let (at, mut out) = (self.now(), Vec::new());
        self.stage.step(at, input, &mut out).unwrap();
        out
    }

    fn lines(&mut self, lines: &str) -> Vec<Output> {
        self.tell(Input::Io(IoEvent::Received(lines.as_bytes().to_vec())))
    }

    fn after(&mut self, time_s: f64) -> Vec<Output> {
        self.at_s += time_s;
        self.tell(Input::Tick)
    }
}

fn commands(said: &[Output]) -> Vec<&IoCommand> {
    let all = said.iter().filter_map(|output| match output {
        Output::Io(command) => Some(command),
        _ => None,
    });
    all.collect()
}

/// Conditions as `name: words`.
fn conditions(said: &[Output]) -> Vec<String> {
    let all = said.iter().filter_map(|output| match output {
        Output::Condition(condition) => Some(format!("{}: {condition}", condition.name())),
        _ => None,
    });
    all.collect()
}

fn values(said: &[Output]) -> Vec<(&str, Verdict, f64, &str)> {
    let all = said.iter().filter_map(|output| match output {
        Output::Value(v) => Some((v.name.as_str(), v.verdict, v.value, v.text.as_str())),
        _ => None,
    });
    all.collect()
}

fn closed() -> Input {
    Input::Io(IoEvent::Closed {
        reason: "reset".to_owned(),
        status: 0,
    })
}

#[test]
fn a_clock_that_is_set_back_keeps_the_bridge_neither_from_connecting_nor_from_noticing_silence() {
    let mut desk = Desk::new(Source::Shdr);
    desk.at_s = 7200.0;
    desk.tell(Input::Tick);
    desk.tell(closed());
    desk.at_s = 3600.0;
    assert_eq!(commands(&desk.tell(Input::Tick)), [&IoCommand::Connect]);
    desk.tell(Input::Io(IoEvent::Connected));
    desk.lines("* PONG 1000\n");
    desk.at_s = 0.0;
    assert!(commands(&desk.tell(Input::Tick)).is_empty());
    let said = desk.after(2.1);
    assert_eq!(
        commands(&said).first(),
        Some(&&IoCommand::Send("* PING\n".to_owned()))
    );
    let said = conditions(&said);
    assert!(said[0].contains("2 s"), "{said:?}");
}

#[test]
fn attempts_back_off_to_the_longest_wait_and_begin_anew_after_success() {
    let mut desk = Desk::new(Source::Shdr);
    let first = desk.tell(Input::Tick);
    assert_eq!(commands(&first), [&IoCommand::Connect]);
    // X has a commanded position.
    assert!(conditions(&first)[0].starts_with("uncommanded: no commanded position of B"));
    for wait_s in [0.5, 1.0, 1.5, 1.5] {
        let refused = IoEvent::NotConnected {
            reason: "refused".to_owned(),
        };
        let said = desk.tell(Input::Io(refused));
        let words =
            format!("connection: not connected to mill:7878: refused; next attempt in {wait_s} s");
        assert_eq!(conditions(&said), [words]);
        assert!(commands(&desk.after(wait_s - 0.01)).is_empty());
        assert_eq!(commands(&desk.after(0.02)), [&IoCommand::Connect]);
    }
    let said = desk.tell(Input::Io(IoEvent::Connected));
    assert_eq!(commands(&said), [&IoCommand::Send("* PING\n".to_owned())]);
    assert_eq!(conditions(&said), ["connection: connected to mill:7878"]);
    let said = desk.tell(closed());
    assert!(conditions(&said)[0].ends_with("closed: reset; next attempt in 0.5 s"));
}

#[test]
fn an_adapter_with_a_heartbeat_is_asked_and_given_up_when_it_is_silent_twice_as_long() {
    let mut desk = Desk::connected();
    desk.lines("* PONG 1000\n");
    assert!(commands(&desk.after(0.9)).is_empty());
    let ping = IoCommand::Send("* PING\n".to_owned());
    assert_eq!(commands(&desk.after(0.2)), [&ping]);
    desk.lines("* PONG 1000\n");
    assert_eq!(commands(&desk.after(1.0)), [&ping]);
    let said = desk.after(1.1);
    assert_eq!(commands(&said), [&ping, &IoCommand::Disconnect]);
    assert!(
        conditions(&said)[0].contains("silent for more than 2 s"),
        "{said:?}"
    );
    // One without, or with a senseless one, is not watched.
    for pong in ["", "* PONG 0.001\n", "* PONG 1e300\n"] {
        let mut desk = Desk::connected();
        desk.lines(pong);
        assert!(commands(&desk.after(3600.0)).is_empty(), "{pong}");
    }
}

#[test]
fn values_of_one_stamp_are_one_state_and_absent_ones_are_in_none() {
    let mut desk = Desk::connected();
    let stamp = "2016-11-29T10:00:00";
    let said = desk.lines(&format!(
        "{stamp}.1Z|Xabs|10|Bdeg|90\n{stamp}.1Z|Xcom|10.5\n{stamp}.6Z|Xabs|20\n"
    ));
    let states: Vec<_> = said
        .iter()
        .filter_map(|output| match output {
            Output::State(state) => Some(state),
            _ => None,
        })
        .collect();
    assert_eq!((states.len(), states[0].axes.len()), (1, 2));
    assert!((states[0].motor[Axis::B] - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
    assert!((states[0].commanded[Axis::X] - 10.5).abs() < 1e-12);
    let said = desk.lines(&format!("{stamp}.9Z|Xabs|UNAVAILABLE\n"));
    let Output::State(state) = &said[0] else {
        panic!("{said:?}");
    };
    assert!((state.velocity[Axis::X] - 20.0).abs() < 1e-9, "{state:?}");
    assert_eq!(
        conditions(&said),
        ["unavailable/xabs: unavailable since 2016-11-29T10:00:00.900Z"]
    );
    desk.lines(&format!("{stamp}.95Z|Bdeg|0\n"));
    let said = desk.after(0.2);
    assert!(matches!(&said[0], Output::State(state) if !state.axes.contains(Axis::X)));
    // Again absent is no news; known again is.
    assert!(conditions(&desk.lines(&format!("{stamp}.96Z|Xabs|UNAVAILABLE\n"))).is_empty());
    assert_eq!(
        conditions(&desk.lines(&format!("{stamp}.97Z|Xabs|1\n"))),
        ["unavailable/xabs: known"]
    );
}

#[test]
fn a_reading_that_cannot_be_is_told_as_such_and_is_no_temperature() {
    let mut desk = Desk::connected();
    let mut lines = String::new();
    for (second, value) in [(0, 43), (5, 43), (20, 0), (21, 44)] {
        lines.push_str(&format!("2016-11-29T10:00:{second:02}Z|Stemp|{value}\n"));
    }
    let said = desk.lines(&lines);
    let verdicts: Vec<_> = values(&said)
        .into_iter()
        .map(|(_, verdict, _, text)| (verdict, text))
        .collect();
    let (good, impossible) = (Verdict::Good, Verdict::Impossible);
    assert_eq!(
        verdicts,
        [(good, "43"), (good, "43"), (impossible, "0"), (good, "44")]
    );
    let temperatures = said
        .iter()
        .filter(|output| matches!(output, Output::Temperature(_)));
    assert_eq!(temperatures.count(), 3);
    let words = "impossible/spindle: 0 at 2016-11-29T10:00:20Z between 43 and 44 cannot be: at most 2.5 may lie between two; 1 so far";
    assert_eq!(conditions(&said), [words]);
}

#[test]
fn conditions_are_told_one_by_one_and_also_where_nobody_described_them() {
    let mut desk = Desk::connected();
    let said = desk.lines("|sc|FAULT|17|2|HIGH|hot\n|door|WARNING|3|||open\n|sc|NORMAL||||\n");
    let wanted = [
        "alarm/spindle_heat: FAULT 17 2 (HIGH): hot",
        "alarm/door: WARNING 3: open",
        "alarm/spindle_heat: normal",
    ];
    assert_eq!(conditions(&said), wanted);
    let said = desk.tell(closed());
    let absent = conditions(&said)
        .into_iter()
        .filter(|said| said.starts_with("alarm/"));
    assert_eq!(absent.count(), 2);
}

#[test]
fn a_series_ends_at_its_stamp_and_a_message_is_a_text() {
    let mut desk = Desk::connected();
    let said = desk.lines("2016-11-29T10:00:01Z|vib|3|10|1 2 4\n|msg|17|refill oil\n");
    let series: Vec<_> = said
        .iter()
        .filter_map(|output| match output {
            Output::Value(v) if v.name == "vibration" => {
                Some((v.machine_at.nanos() % 1_000_000_000, v.value))
            }
            _ => None,
        })
        .collect();
    assert_eq!(
        series,
        [(800_000_000, 0.01), (900_000_000, 0.02), (0, 0.04)]
    );
    assert_eq!(values(&said)[3].3, "refill oil");
}

#[test]
fn what_cannot_be_read_is_refused_with_its_reason_and_the_rest_goes_on() {
    let mut desk = Desk::connected();
    let long = "x".repeat(100);
    let said = desk.lines(&format!(
        "{long}\nyesterday|Fact|60\n|Fact|fast\n|Fact|nan\n|Xabs|1 2\n|new|5\n|Fact|600\n"
    ));
    let first = [
        "refused_line: line of 100 bytes refused, limit 64; 1 so far",
        "refused_line: stamp \"yesterday\": must be a date of 1970 to 2106, milliseconds or empty; published with the time of receipt, in a log with the stamp of the line beside it; 2 so far",
        "refused_value: Fact: \"fast\" is no finite number; 1 so far",
        // What it is instead nobody knows.
        "unavailable/feed: unavailable since 1970-01-01T00:16:40Z",
        "refused_value: Fact: \"nan\" is no finite number; 2 so far",
        "refused_value: Xabs: \"1 2\" is no finite number; 3 so far",
        "unavailable/xabs: unavailable since 1970-01-01T00:16:40Z",
        "unmapped: reported, and not in the mapping: new",
        "unavailable/feed: known",
    ];
    assert_eq!(conditions(&said), first);
    let feeds: Vec<f64> = values(&said).iter().map(|value| value.2).collect();
    assert_eq!(feeds, [1.0, 10.0]);
    let said = desk.after(61.0);
    let account = "account: 7 lines taken, 2 values published; 1 values of keys that are not in the mapping; 1 lines over the limit; 1 stamps that are none; 3 values that are no numbers";
    assert_eq!(conditions(&said), [account]);
}

#[test]
fn what_is_no_letter_is_replaced_and_the_line_told() {
    let mut desk = Desk::connected();
    let said = desk.tell(Input::Io(IoEvent::Received(
        b"|msg|1|\xd6l fehlt\n|Fact|60\n".to_vec(),
    )));
    let wanted = [
        "replaced_letters: 1 letters that are no UTF-8 or may not stand there are replaced by U+FFFD; 1 so far",
    ];
    assert_eq!(conditions(&said), wanted);
    let texts: Vec<&str> = values(&said).iter().map(|value| value.3).collect();
    assert_eq!(texts, ["\u{fffd}l fehlt", "60"]);
}

#[test]
fn a_block_of_several_lines_is_one_value_and_an_asset_none() {
    let mut desk = Desk::connected();
    let said = desk.lines("|@ASSET@|T12|CuttingTool|--multiline--A\n<T>\n|Fact|99\n");
    assert!(said.is_empty(), "{said:?}");
    let said =
        desk.lines("</T>\n--multiline--A\n|msg|1|--multiline--B\none\ntwo\n--multiline--B\n");
    assert_eq!(
        values(&said)
            .iter()
            .map(|value| value.3)
            .collect::<Vec<_>>(),
        ["one\ntwo"]
    );
    // A block without its end is reported when the connection ends.
    desk.lines("|msg|1|--multiline--C\none\n");
    let said = desk.tell(closed());
    assert!(
        conditions(&said)[0]
            .starts_with("refused_line: block \"--multiline--C\" without its end after 2 lines"),
        "{said:?}"
    );
}

#[test]
fn a_block_with_a_line_over_the_limit_is_no_value_and_its_lines_are_counted() {
    let mut desk = Desk::connected();
    let long = "x".repeat(100);
    let said = desk.lines(&format!(
        "|msg|1|--multiline--A\none\n{long}\n--multiline--A\n|Fact|60\n"
    ));
    let texts: Vec<&str> = values(&said).iter().map(|value| value.3).collect();
    assert_eq!(texts, ["60"]);
    let refused = "refused_line: line of 100 bytes refused, limit 64: left out; 1 so far";
    assert_eq!(conditions(&said)[0], refused);
    // One that stays open is given up with its lines.
    desk.lines("|msg|1|--multiline--B\none\ntwo\n");
    desk.at_s += 11.0;
    desk.lines("|Fact|61\n");
    let said = desk.after(61.0);
    let said = conditions(&said);
    let account = said.iter().find(|one| one.starts_with("account")).unwrap();
    assert!(
        account.contains("account: 9 lines taken, 2 values"),
        "{account}"
    );
    assert!(account.contains("1 lines over the limit"), "{account}");
}

#[test]
fn a_clock_that_leaps_is_said_with_both_stamps_and_every_value_told() {
    let mut desk = Desk::connected();
    desk.lines("2026-01-05T08:00:00Z|Fact|1\n");
    desk.at_s += 20.0;
    let said = desk.lines("2035-01-05T08:00:20Z|Fact|2\n");
    let wanted = "machine_clock: the machine's clock leaps by 283996820 s, from 2026-01-05T08:00:00Z to 2035-01-05T08:00:20Z, while 20 s passed here; 1 so far";
    assert_eq!(conditions(&said), [wanted]);
    desk.at_s += 1.0;
    let said = desk.lines("2026-01-05T08:00:21Z|Fact|3\n");
    assert!(
        conditions(&said)[0].contains(
            "from 2035-01-05T08:00:20Z to 2026-01-05T08:00:21Z, while 1 s passed here; 2 so far"
        ),
        "{said:?}"
    );
    assert_eq!(values(&said).len(), 1);
}

#[test]
fn a_clock_that_steps_back_is_said_and_the_value_told() {
    let mut desk = Desk::connected();
    let said = desk.lines("2016-11-29T10:00:05Z|Fact|1\n2016-11-29T10:00:03.5Z|Fact|2\n");
    let wanted =
        "machine_clock: Fact: the stamp went back by 1.5 s, to 2016-11-29T10:00:03.500Z; 1 so far";
    assert_eq!(conditions(&said), [wanted]);
    assert_eq!(values(&said).len(), 2);
}

#[test]
fn nothing_is_said_of_a_connection_that_was_given_up() {
    let mut desk = Desk::connected();
    desk.tell(closed());
    assert!(desk.lines("|Fact|1\n").is_empty());
    let said = desk.tell(Input::Shutdown);
    assert_eq!(said.last(), Some(&Output::Stopped));
    assert!(desk.after(100.0).is_empty());
}

fn piece() -> impl Strategy<Value = Vec<u8>> {
    prop_oneof![
        proptest::collection::vec(any::<u8>(), 0..80),
        "(2016-11-29T10:00:0[0-9](\\.[0-9]{1,3})?Z|[0-9]{1,5}|)\\|(Xabs|Stemp|Fact|vib|sc|msg|q)\\|(UNAVAILABLE|FAULT|-?[0-9]{1,4}|[a-z| ]{0,12})\n"
            .prop_map(String::into_bytes),
        Just(b"* PONG 20\n".to_vec()),
    ]
}

fn input() -> impl Strategy<Value = (f64, Input)> {
    let text = "[a-z/;= ]{0,30}(multipart/mixed;boundary=b)?";
    let event = prop_oneof![
        6 => piece().prop_map(IoEvent::Received),
        1 => Just(IoEvent::Connected),
        1 => (200_u16..505, piece()).prop_map(|(status, body)| IoEvent::Answered { status, body }),
        1 => text.prop_map(|content_type| IoEvent::Began { content_type }),
        1 => "[a-z]{0,5}".prop_map(|reason| IoEvent::NotConnected { reason }),
        1 => any::<u16>().prop_map(|status| IoEvent::Closed { reason: String::new(), status }),
    ];
    let input = prop_oneof![event.prop_map(Input::Io), Just(Input::Tick)];
    (0.0..2.0_f64, input)
}

proptest! {
    /// Whatever comes, in whatever order: no panic, every number is finite, and an absent value is never a zero.
    #[test]
    fn prop_whatever_comes_is_answered(
        inputs in proptest::collection::vec(input(), 0..60),
        is_agent in any::<bool>(),
    ) {
        let mut desk = Desk::new(if is_agent { Source::Agent } else { Source::Shdr });
        for (passed_s, input) in inputs {
            desk.at_s += passed_s;
            for output in desk.tell(input) {
                match output {
                    Output::Value(value) => {
                        prop_assert_eq!(value.value.is_finite(), value.quantity.is_number());
                        prop_assert_ne!(value.text, "UNAVAILABLE");
                    }
                    Output::State(state) => {
                        prop_assert!(state.axes.iter().all(|axis| state.motor[axis].is_finite()));
                        prop_assert!(state.axes.iter().all(|axis| state.velocity[axis].is_finite()));
                    }
                    Output::Temperature(sample) => prop_assert!(sample.temperature_degc.is_finite()),
                    Output::Condition(Condition::Disconnected { retry_s, .. }) => {
                        prop_assert!((0.5..=1.5).contains(&retry_s));
                    }
                    Output::Condition(_) | Output::Io(_) | Output::Stopped => {}
                }
            }
        }
    }
}
