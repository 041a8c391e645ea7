//! The stage alone: qualities, breaks, counts, and any input.

use machine_report::MapFile;
use machine_report::mapping::Use;
use metrology::Stage;
use metrology::sample::Verdict;
use metrology::stamp::{Host, Machine, Span, Stamp};
use opcua_bridge::config::{ConnectionConfig, Mode, SecurityConfig, SubscriptionConfig};
use opcua_bridge::engineering_unit::ShownUnit;
use opcua_bridge::stage::{IoCommand, IoEvent};
use opcua_bridge::status::Status;
use opcua_bridge::value::{Change, Payload};
use opcua_bridge::{BridgeConfig, BridgeStage, Input, Output, Settings};
use proptest::prelude::*;

const MAP: &str = "values:
  nsu=urn:m;s=C: {is: condition, name: coolant}
  nsu=urn:m;s=E: {is: execution, name: execution, words: {\"0\": ACTIVE, \"1\": READY}}
  nsu=urn:m;s=P: {is: path_position, unit: MILLIMETER}
  nsu=urn:m;s=T: {is: temperature, name: spindle, unit: CELSIUS}
  nsu=urn:m;s=Z: {is: ignored}
";
/// Items of the mapping, in the order of its keys.
const COOLANT: usize = 0;
const EXECUTION: usize = 1;
const PATH: usize = 2;
const SPINDLE: usize = 3;

const BAD_SENSOR: Status = Status(0x808C_0000);
const UNCERTAIN: Status = Status(0x4093_0000);

fn config() -> BridgeConfig {
    BridgeConfig {
        endpoint: "opc.tcp://127.0.0.1:4840/".to_owned(),
        map_file: String::new(),
        security: SecurityConfig::default(),
        subscription: SubscriptionConfig::default(),
        connection: ConnectionConfig::default(),
    }
}

fn settings() -> Settings {
    Settings::new(&config(), &MapFile::from_yaml(MAP).unwrap()).unwrap()
}

fn host(s: f64) -> Stamp<Host> {
    Stamp::from_nanos(Span::from_secs_f64(1_767_600_000.0 + s).nanos())
}

fn machine(s: f64) -> Stamp<Machine> {
    Stamp::from_nanos(Span::from_secs_f64(1_767_500_000.0 + s).nanos())
}

fn change(item: usize, payload: Payload, status: Status, at_s: f64) -> Change {
    Change {
        item,
        payload,
        status,
        machine_at: Some(machine(at_s)),
        is_held: false,
    }
}

/// A bridge that is connected, and what steps say.
pub struct Bridge {
    stage: BridgeStage,
    pub now_s: f64,
}

impl Bridge {
    pub fn up() -> Self {
        let mut bridge = Self {
            stage: BridgeStage::new(&settings()),
            now_s: 0.0,
        };
        let said = bridge.step(Input::Tick);
        assert!(said.contains(&Output::Io(IoCommand::Connect)));
        bridge.io(up());
        bridge
    }

    pub fn step(&mut self, input: Input) -> Vec<Output> {
        self.now_s += 0.01;
        let mut said = Vec::new();
        let Ok(()) = self.stage.step(host(self.now_s), input, &mut said);
        said
    }

    pub fn io(&mut self, event: IoEvent) -> Vec<Output> {
        self.step(Input::Io(event))
    }

    fn changed(&mut self, changes: Vec<Change>) -> Vec<Output> {
        self.io(IoEvent::Changed(changes))
    }
}

pub fn up() -> IoEvent {
    IoEvent::Up {
        security: "None None".to_owned(),
        user: "anonymous".to_owned(),
        missing: Vec::new(),
        units: Vec::new(),
        given_ms: Some(100.0),
        given_queue: 100,
    }
}

/// Texts of the values.
fn values(said: &[Output]) -> Vec<&str> {
    said.iter()
        .filter_map(|output| match output {
            Output::Value(value) => Some(value.text.as_str()),
            _ => None,
        })
        .collect()
}

/// Names and words of the conditions.
pub fn conditions(said: &[Output]) -> Vec<String> {
    said.iter()
        .filter_map(|output| match output {
            Output::Condition(one) => Some(format!("{}: {one}", one.name())),
            _ => None,
        })
        .collect()
}

#[test]
fn the_items_are_the_keys_that_are_wanted_in_their_order() {
    let keys: Vec<String> = settings().items.into_iter().map(|item| item.key).collect();
    let wanted = ["C", "E", "P", "T"].map(|id| format!("nsu=urn:m;s={id}"));
    assert_eq!(keys, wanted);
    assert!(
        settings()
            .mapping
            .uses()
            .any(|(_, used)| *used == Use::Nothing)
    );
}

#[test]
fn a_value_keeps_its_sources_stamp_and_both_clocks() {
    let mut bridge = Bridge::up();
    let said = bridge.changed(vec![change(SPINDLE, Payload::Float(31.5), Status(0), 5.0)]);
    let Some(Output::Value(value)) = said.iter().find(|one| matches!(one, Output::Value(_))) else {
        panic!("{said:?}");
    };
    assert_eq!(value.name, "spindle");
    assert_eq!(
        (value.machine_at, value.verdict),
        (machine(5.0), Verdict::Good)
    );
    assert_eq!(value.received_at, host(bridge.now_s));
    assert!((value.value - 31.5).abs() < 1e-12);
    assert!(said.iter().any(|one| matches!(one, Output::Temperature(_))));
}

#[test]
fn a_bad_status_is_absence_whatever_value_stands_beside_it() {
    let mut bridge = Bridge::up();
    bridge.changed(vec![change(SPINDLE, Payload::Double(31.5), Status(0), 5.0)]);
    let said = bridge.changed(vec![change(SPINDLE, Payload::Double(0.0), BAD_SENSOR, 6.0)]);
    assert!(values(&said).is_empty(), "{said:?}");
    assert_eq!(
        conditions(&said),
        [
            "quality/spindle: BadSensorFailure; 1 values so far that were not good",
            "unavailable/spindle: unavailable since 2026-01-04T04:13:26Z",
        ]
    );
    // The same again is no news, and a good value clears both.
    let again = bridge.changed(vec![change(SPINDLE, Payload::Double(0.0), BAD_SENSOR, 7.0)]);
    assert!(again.is_empty(), "{again:?}");
    let good = bridge.changed(vec![change(SPINDLE, Payload::Double(32.0), Status(0), 8.0)]);
    assert_eq!(values(&good), ["32"]);
    assert_eq!(
        conditions(&good),
        [
            "quality/spindle: Good; 2 values so far that were not good",
            "unavailable/spindle: known",
        ]
    );
}

#[test]
fn an_uncertain_value_is_published_and_counted() {
    let mut bridge = Bridge::up();
    let said = bridge.changed(vec![
        change(SPINDLE, Payload::Double(31.0), UNCERTAIN, 1.0),
        change(SPINDLE, Payload::Double(31.5), UNCERTAIN, 2.0),
    ]);
    assert_eq!(values(&said), ["31", "31.5"]);
    assert_eq!(
        conditions(&said),
        ["quality/spindle: UncertainSensorNotAccurate; 1 values so far that were not good"]
    );
    let account = conditions(&bridge.step(Input::Tick));
    assert!(
        account[0].contains("2 values of uncertain quality, published"),
        "{account:?}"
    );
}

#[test]
fn a_good_status_without_a_value_and_a_structure_are_absent() {
    let mut bridge = Bridge::up();
    let said = bridge.changed(vec![
        change(EXECUTION, Payload::Null, Status(0), 1.0),
        change(
            SPINDLE,
            Payload::Refused("a structure has no meaning here".to_owned()),
            Status(0),
            1.0,
        ),
    ]);
    assert!(values(&said).is_empty());
    let said = conditions(&said);
    assert!(said[0].starts_with("unavailable/execution"), "{said:?}");
    assert_eq!(
        said[1],
        "refused_value: nsu=urn:m;s=T: a structure has no meaning here: left out; 1 so far"
    );
}

#[test]
fn numbers_of_an_enumeration_are_told_by_their_words() {
    let mut bridge = Bridge::up();
    let said = bridge.changed(
        [0, 1, 7]
            .map(|number| change(EXECUTION, Payload::Integer(number), Status(0), 1.0))
            .to_vec(),
    );
    assert_eq!(values(&said), ["ACTIVE", "READY", "7"]);
}

#[test]
fn three_numbers_in_one_value_are_a_position_and_two_are_none() {
    let mut bridge = Bridge::up();
    let of =
        |numbers: &[f64], at_s| change(PATH, Payload::Numbers(numbers.to_vec()), Status(0), at_s);
    bridge.changed(vec![of(&[1.0, 2.0, 3.0], 1.0)]);
    let said = bridge.changed(vec![of(&[1.5, 2.0, 3.0], 2.0)]);
    let state = said.iter().find_map(|output| match output {
        Output::State(state) => Some(state),
        _ => None,
    });
    assert_eq!(state.unwrap().axes.len(), 3);
    let said = conditions(&bridge.changed(vec![of(&[1.0, 2.0], 3.0)]));
    assert!(said[0].contains("is not 3 finite numbers"), "{said:?}");
}

#[test]
fn truth_values_numbers_and_texts_are_conditions() {
    let mut bridge = Bridge::up();
    for (payload, severity) in [
        (Payload::Boolean(true), "Error"),
        (Payload::Boolean(false), "Info"),
        (Payload::Integer(700_014), "Error"),
        (Payload::Integer(0), "Info"),
        (Payload::Text("Coolant low".to_owned()), "Error"),
        (Payload::Text(" ".to_owned()), "Info"),
    ] {
        let said = bridge.changed(vec![change(COOLANT, payload.clone(), Status(0), 1.0)]);
        let alarm = said.iter().find_map(|output| match output {
            Output::Condition(one) if one.name() == "alarm/coolant" => Some(one.severity()),
            _ => None,
        });
        assert_eq!(format!("{:?}", alarm.unwrap()), severity, "{payload:?}");
    }
    let said =
        conditions(&bridge.changed(vec![change(COOLANT, Payload::Double(1.0), Status(0), 2.0)]));
    assert!(
        said[0].contains("a condition must be a truth value"),
        "{said:?}"
    );
}

#[test]
fn another_number_of_a_condition_takes_the_place_of_the_one_before() {
    let mut bridge = Bridge::up();
    for (payload, words) in [
        (Payload::Integer(5), "alarm/coolant: FAULT: 5"),
        (Payload::Integer(7), "alarm/coolant: FAULT: 7"),
        (Payload::Text("low".to_owned()), "alarm/coolant: FAULT: low"),
        (Payload::Boolean(true), "alarm/coolant: FAULT"),
        (Payload::Integer(0), "alarm/coolant: normal"),
    ] {
        let said = bridge.changed(vec![change(COOLANT, payload, Status(0), 1.0)]);
        assert_eq!(conditions(&said), [words]);
    }
}

#[test]
fn positions_of_one_stamp_are_one_state_though_the_server_sends_node_by_node() {
    let map = "values:
  nsu=urn:m;s=X: {is: position, axis: X, unit: MILLIMETER}
  nsu=urn:m;s=Y: {is: position, axis: Y, unit: MILLIMETER}
";
    let settings = Settings::new(&config(), &MapFile::from_yaml(map).unwrap()).unwrap();
    let mut bridge = Bridge {
        stage: BridgeStage::new(&settings),
        now_s: 0.0,
    };
    bridge.step(Input::Tick);
    bridge.io(up());
    let at = |item, value, s| change(item, Payload::Double(value), Status(0), s);
    let mut said = bridge.changed(vec![
        at(0, 1.0, 1.0),
        at(0, 2.0, 2.0),
        at(0, 3.0, 3.0),
        at(1, 10.0, 1.0),
        at(1, 20.0, 2.0),
        at(1, 30.0, 3.0),
    ]);
    bridge.now_s += 1.0;
    said.extend(bridge.step(Input::Tick));
    let states = said.iter().filter_map(|output| match output {
        Output::State(state) => Some((
            state.controller_at,
            state.motor[metrology::Axis::X],
            state.motor[metrology::Axis::Y],
        )),
        _ => None,
    });
    let wanted = [1.0, 2.0, 3.0].map(|s| (machine(s), s, 10.0 * s));
    let states: Vec<_> = states.collect();
    assert_eq!(states, wanted);
}

#[test]
fn a_break_makes_everything_absent_and_what_holds_comes_back() {
    let mut bridge = Bridge::up();
    bridge.changed(vec![change(SPINDLE, Payload::Double(31.5), Status(0), 1.0)]);
    let reason = || "BadConnectionClosed".to_owned();
    let said = conditions(&bridge.io(IoEvent::Broken { reason: reason() }));
    assert!(said[0].starts_with("unavailable/spindle"), "{said:?}");
    assert!(
        said[1].starts_with("connection: the connection to opc.tcp"),
        "{said:?}"
    );
    let said = conditions(&bridge.io(IoEvent::Resumed { republished: 3 }));
    assert!(
        said[0].contains("3 messages of the break were sent again"),
        "{said:?}"
    );
    let held = Change {
        is_held: true,
        ..change(SPINDLE, Payload::Double(31.5), Status(0), 1.0)
    };
    let said = bridge.changed(vec![held]);
    assert_eq!(values(&said), ["31.5"]);
    assert_eq!(conditions(&said), ["unavailable/spindle: known"]);
}

#[test]
fn what_is_left_out_is_counted_and_said() {
    let mut bridge = Bridge::up();
    let said = conditions(&bridge.io(IoEvent::Lost { from: 7, count: 2 }));
    assert_eq!(
        said,
        [
            "sequence_gap: 2 messages of the server lost, from number 7 on; 2 so far. Every node is read again; changes between are missing"
        ]
    );
    let said = conditions(&bridge.io(IoEvent::Dropped { count: 4 }));
    assert!(said[0].contains("4 messages came faster"), "{said:?}");
    let overflow = Status(0x0480);
    let said =
        conditions(&bridge.changed(vec![change(SPINDLE, Payload::Double(1.0), overflow, 1.0)]));
    assert!(
        said[0].starts_with("queue_overflow: nsu=urn:m;s=T: the server's queue ran over"),
        "{said:?}"
    );
    let account = conditions(&bridge.step(Input::Tick));
    assert!(
        account[0].contains("1 overflows of the server's queues"),
        "{account:?}"
    );
}

#[test]
fn nodes_that_are_not_there_and_a_slower_server_are_named() {
    let mut bridge = Bridge::up();
    bridge.io(IoEvent::Ended {
        reason: String::new(),
    });
    bridge.now_s += 31.0;
    bridge.step(Input::Tick);
    let said = conditions(&bridge.io(IoEvent::Up {
        security: "Basic256Sha256 SignAndEncrypt".to_owned(),
        user: "operator".to_owned(),
        missing: vec![(1, "no namespace urn:m".to_owned())],
        units: Vec::new(),
        given_ms: Some(1000.0),
        given_queue: 1,
    }));
    assert_eq!(
        said,
        [
            "connection: connected to opc.tcp://127.0.0.1:4840/: Basic256Sha256 SignAndEncrypt, user operator",
            "not_offered: in the mapping, and the server has it not: nsu=urn:m;s=E (no namespace urn:m)",
            "sampling: asked to look every 100 ms and to keep 100 changes, the server looks every 1000 ms at some nodes and keeps 1",
        ]
    );
}

#[test]
fn settings_that_cannot_be_are_refused_with_key_value_and_remedy() {
    let map = |text: &str| MapFile::from_yaml(text).unwrap();
    let refused = |config: &BridgeConfig, text: &str| {
        Settings::new(config, &map(text)).unwrap_err().to_string()
    };
    let mut one = config();
    one.endpoint = "http://127.0.0.1:4840".to_owned();
    assert!(refused(&one, MAP).contains("must be opc.tcp://HOST:PORT"));
    let mut one = config();
    one.security.mode = Mode::Sign;
    assert!(refused(&one, MAP).contains("security.pki_folder is empty"));
    let mut one = config();
    one.security.user = "operator".to_owned();
    assert!(refused(&one, MAP).contains("belong together"));
    one.security.password_file = "password".to_owned();
    assert!(refused(&one, MAP).contains("could be read on the wire"));
    let mut one = config();
    one.subscription.queue = 0;
    assert!(refused(&one, MAP).contains("subscription.queue = 0: must be from 1 to 10000"));
    let mut one = config();
    one.connection.reconnect_longest_s = 0.25;
    let shortest = "connection.reconnect_longest_s = 0.25 s: must be from 0.5 to 86400 s";
    assert_eq!(refused(&one, MAP), shortest);
    let indexed = "values:\n  ns=2;s=X: {is: text, name: x}\n";
    assert!(refused(&config(), indexed).contains("write nsu=URI;s=X"));
}

#[cfg(not(feature = "opcua"))]
#[test]
fn a_program_without_the_client_says_how_it_is_built() {
    use opcua_bridge::io::Credentials;
    use opcua_bridge::live::LiveBridge;
    let refused = LiveBridge::open(&settings(), Credentials::default()).unwrap_err();
    assert!(
        refused.to_string().contains("--features opcua"),
        "{refused}"
    );
    let refused = opcua_bridge::io::survey("opc.tcp://127.0.0.1:4840/").unwrap_err();
    assert!(
        refused.to_string().contains("--features opcua"),
        "{refused}"
    );
}

fn payloads() -> impl Strategy<Value = Payload> {
    prop_oneof![
        Just(Payload::Null),
        any::<bool>().prop_map(Payload::Boolean),
        any::<i64>().prop_map(|number| Payload::Integer(number.into())),
        any::<f32>().prop_map(Payload::Float),
        any::<f64>().prop_map(Payload::Double),
        ".{0,20}".prop_map(Payload::Text),
        prop::collection::vec(any::<f64>(), 0..70).prop_map(Payload::Numbers),
        Just(Payload::Refused("a structure".to_owned())),
    ]
}

proptest! {
    /// Whatever a server sends, nothing of bad quality becomes a value, and every number that does can be.
    #[test]
    fn any_changes_in_any_order_give_values_that_can_be(
        changes in prop::collection::vec(
            (0..6_usize, payloads(), any::<u32>(), any::<i64>(), any::<bool>()), 0..60,
        ),
        broken_after in 0..60_usize,
    ) {
        let mut bridge = Bridge::up();
        for (at, (item, payload, status, nanos, is_held)) in changes.into_iter().enumerate() {
            if at == broken_after {
                bridge.io(IoEvent::Broken { reason: "cut".to_owned() });
                bridge.io(IoEvent::Resumed { republished: 0 });
            }
            let status = Status(status);
            let is_bad = status.0 >= 0x8000_0000;
            let machine_at = Some(Stamp::from_nanos(nanos));
            let said = bridge.changed(vec![Change { item, payload, status, machine_at, is_held }]);
            for output in &said {
                if let Output::Value(value) = output {
                    prop_assert!(!is_bad, "{value:?}");
                    prop_assert!(value.name != "spindle" || value.value.is_finite());
                    prop_assert!(value.machine_at.nanos() >= 0);
                }
            }
        }
        let said = bridge.step(Input::Shutdown);
        prop_assert!(said.contains(&Output::Stopped));
        prop_assert!(bridge.step(Input::Tick).is_empty());
    }
}

#[test]
fn a_server_that_shows_another_unit_than_the_mapping_is_named_until_it_agrees() {
    let mut bridge = Bridge::up();
    let mut again = |shown: &[(usize, &str, i32)]| {
        let reason = String::new();
        bridge.io(IoEvent::Ended { reason });
        bridge.now_s += 31.0;
        bridge.step(Input::Tick);
        let mut event = up();
        if let IoEvent::Up { units, .. } = &mut event {
            units.extend(shown.iter().map(|(item, text, code)| {
                let (text, code) = ((*text).to_owned(), *code);
                (*item, ShownUnit { text, code })
            }));
        }
        let mut said = conditions(&bridge.io(event));
        said.retain(|line| line.starts_with("unit/"));
        said
    };
    assert!(again(&[(SPINDLE, "°C", 4_408_652), (PATH, "mm", -1)]).is_empty());
    let said = again(&[(SPINDLE, "°F", 4_604_232), (PATH, "inch", 0)]);
    assert_eq!(said.len(), 2, "{said:?}");
    assert!(
        said[1].ends_with("nsu=urn:m;s=T: the mapping has CELSIUS, the server's EngineeringUnits \"°F\": published as the mapping says; correct the mapping or the server"),
        "{said:?}"
    );
    assert_eq!(again(&[(PATH, "µm", 0), (EXECUTION, "mm", 0)]).len(), 2);
    let said = again(&[]);
    assert_eq!(said.len(), 1, "{said:?}");
    assert!(said[0].ends_with("are the mapping's unit"), "{said:?}");
}

#[test]
fn an_endpoint_has_a_host_and_a_port_and_no_user() {
    let tried = |endpoint: &str| {
        let config = BridgeConfig {
            endpoint: endpoint.to_owned(),
            ..config()
        };
        let settings = Settings::new(&config, &MapFile::from_yaml(MAP).unwrap());
        settings.err().map(|error| error.to_string())
    };
    for good in [
        "opc.tcp://mill:4840",
        "opc.tcp://[::1]:4840/a/b",
        "opc.tcp://mill",
        "opc.tcp://[::1]/",
    ] {
        assert_eq!(tried(good), None, "{good}");
    }
    for bad in [
        "opc.tcp://mill:99999",
        "opc.tcp://mill:0/",
        "opc.tcp://mill:",
        "opc.tcp://:4840",
        "http://mill:80",
    ] {
        let said = tried(bad).unwrap();
        assert!(said.contains(bad) && said.contains("1 to 65535"), "{said}");
    }
    for bad in [
        "opc.tcp://anna:secret@mill:4840/",
        "opc.tcp://anna:sec/secret@mill:4840",
        "http://anna:secret@mill",
    ] {
        let said = tried(bad).unwrap();
        let is_shown = said.contains("anna") || said.contains("secret@");
        assert!(said.contains("security.user") && !is_shown, "{said}");
    }
}
