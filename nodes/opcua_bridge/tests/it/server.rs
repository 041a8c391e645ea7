//! PyPI `asyncua` as the machine (tests/peers/opcua_server.py): values, bad qualities, cuts, restarts, security, floods.

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use machine_report::MapFile;
use metrology::Stage;
use metrology::sample::MachineValue;
use opcua_bridge::config::{ConnectionConfig, SecurityConfig, SubscriptionConfig};
use opcua_bridge::io::Credentials;
use opcua_bridge::live::{LiveBridge, LiveInput};
use opcua_bridge::{BridgeConfig, Output, Settings};
use serde_json::json;

mod breaks;
mod companion;
mod peer;
mod security;

use peer::{Machine, free_port, host_now, interpreter};

/// Nothing that is waited for takes longer.
const PATIENCE: Duration = Duration::from_secs(60);

const MAP: &str = "values:
  nsu=urn:abbe:machine;s=T: {is: temperature, name: spindle, unit: CELSIUS}
  /Machine/X: {is: position, axis: X, unit: MILLIMETER}
";

fn config(port: u16) -> BridgeConfig {
    BridgeConfig {
        endpoint: format!("opc.tcp://127.0.0.1:{port}/"),
        map_file: String::new(),
        security: SecurityConfig::default(),
        subscription: SubscriptionConfig::default(),
        connection: ConnectionConfig {
            reconnect_first_s: 0.1,
            reconnect_longest_s: 0.5,
            ..ConnectionConfig::default()
        },
    }
}

fn open(config: &BridgeConfig, map: &str) -> LiveBridge {
    open_as(config, map, None)
}

/// A bridge with the password of its user.
fn open_as(config: &BridgeConfig, map: &str, password: Option<&str>) -> LiveBridge {
    let settings = Settings::new(config, &MapFile::from_yaml(map).unwrap()).unwrap();
    let pki_folder = Some(&config.security.pki_folder).filter(|folder| !folder.is_empty());
    let credentials = Credentials {
        pki_folder: pki_folder.map(Into::into),
        password: password.map(str::to_owned),
    };
    LiveBridge::open(&settings, credentials).unwrap()
}

/// Outputs of the bridge until `until` holds for one of its outputs.
fn heard(bridge: &mut LiveBridge, mut until: impl FnMut(&Output) -> bool) -> Vec<Output> {
    let (mut said, end) = (Vec::new(), Instant::now() + PATIENCE);
    let mut looked = 0;
    loop {
        let Ok(()) = bridge.step(host_now(), LiveInput::Tick, &mut said);
        if said[looked..].iter().any(&mut until) {
            return said;
        }
        looked = said.len();
        assert!(Instant::now() < end, "not heard: {said:#?}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

fn value(output: &Output) -> Option<&MachineValue> {
    match output {
        Output::Value(value) => Some(value),
        _ => None,
    }
}

fn is_text(output: &Output, text: &str) -> bool {
    value(output).is_some_and(|value| value.text == text)
}

fn is_condition(output: &Output, name: &str, word: &str) -> bool {
    matches!(output, Output::Condition(one) if one.name() == name && one.to_string().contains(word))
}

#[test]
fn values_arrive_by_identifier_and_by_path_and_a_bad_status_is_absence() {
    let Some(python) = interpreter("opcua values") else {
        return;
    };
    let port = free_port();
    let mut machine = Machine::start(&python, port, &["urn:abbe:machine"], &json!({}));
    let mut bridge = open(&config(port), MAP);
    let said = heard(&mut bridge, |output| is_text(output, "20"));
    assert!(
        said.iter()
            .any(|one| is_condition(one, "not_offered", "all of the mapping"))
    );
    machine.tell(&json!({"write": "T", "value": 31.5, "at_s": 1_480_411_729}));
    let said = heard(&mut bridge, |output| is_text(output, "31.5"));
    let told = said
        .iter()
        .filter_map(value)
        .find(|value| value.text == "31.5");
    assert_eq!(told.unwrap().machine_at.nanos(), 1_480_411_729_000_000_000);
    machine.tell(
        &json!({"write": "T", "value": 0.0, "status": 0x808C_0000_u32, "at_s": 1_480_411_730}),
    );
    let said = heard(&mut bridge, |output| {
        is_condition(output, "unavailable/spindle", "since")
    });
    assert!(said.iter().filter_map(value).next().is_none(), "{said:?}");
    assert!(
        said.iter()
            .any(|one| is_condition(one, "quality/spindle", "BadSensorFailure"))
    );
    machine.tell(&json!({"write": "X", "value": 12.5, "at_s": 1_480_411_731}));
    heard(
        &mut bridge,
        |output| matches!(output, Output::State(state) if (state.motor[metrology::Axis::X] - 12.5).abs() < 1e-9),
    );
}

/// A text of 2 MiB comes with other values: it is refused, and they are published.
#[test]
fn a_text_that_is_too_long_takes_no_other_value_with_it() {
    let Some(python) = interpreter("opcua long text") else {
        return;
    };
    let port = free_port();
    let values = json!({"values": {"X": 0.0, "T": 20.0, "L": "short"}});
    let mut machine = Machine::start(&python, port, &["urn:abbe:machine"], &values);
    let map = format!("{MAP}  /Machine/L: {{is: text, name: note}}\n");
    let mut bridge = open(&config(port), &map);
    let mut begun = BTreeSet::new();
    heard(&mut bridge, |output| {
        begun.extend(value(output).map(|value| value.text.clone()));
        ["20", "short"].iter().all(|text| begun.contains(*text))
    });
    let at = 1_480_411_730_000_000_000_i64;
    let long = "n".repeat(2 << 20);
    machine.tell(&json!({"rows": [["L", long, at], ["T", 33.5, at], ["X", 12.5, at]]}));
    let (mut is_refused, mut is_heard) = (false, false);
    heard(&mut bridge, |output| {
        is_refused |= is_condition(output, "refused_value", "/Machine/L");
        is_heard |= is_text(output, "33.5");
        is_refused && is_heard
    });
    machine.tell(&json!({"rows": [["L", "m".repeat(60_000), at + 1_000_000]]}));
    heard(&mut bridge, |output| {
        value(output).is_some_and(|value| value.text.len() == 60_000)
    });
}

/// Names of ten nodes, and a mapping of them.
fn flood() -> (Vec<String>, String) {
    let names: Vec<String> = (0..10).map(|n| format!("V{n}")).collect();
    let mut map = "values:\n".to_owned();
    for name in &names {
        let lower = name.to_lowercase();
        map.push_str(&format!(
            "  nsu=urn:abbe:machine;s={name}: {{is: text, name: {lower}}}\n"
        ));
    }
    (names, map)
}

/// Whether something was lost, refused or came in another order.
fn is_loss(output: &&Output) -> bool {
    let names = [
        "sequence_gap",
        "queue_overflow",
        "refused_value",
        "machine_clock",
    ];
    names.iter().any(|name| is_condition(output, name, ""))
}

/// Ten thousand values of ten nodes within a second, or as fast as the server writes them.
#[test]
fn ten_thousand_values_a_second_arrive_each_once_and_none_is_lost() {
    const COUNT: usize = 10_000;
    let Some(python) = interpreter("opcua flood") else {
        return;
    };
    let (names, map) = flood();
    let port = free_port();
    let mut machine = Machine::start(&python, port, &["urn:abbe:machine"], &json!({}));
    let mut flooded = config(port);
    flooded.subscription.queue = 10_000;
    let mut bridge = open(&flooded, &map);
    let mut begun = BTreeSet::new();
    heard(&mut bridge, |output| {
        begun.extend(value(output).map(|value| value.name.clone()));
        begun.len() == names.len()
    });
    machine.ask(&json!({"burst": COUNT, "names": names, "per_s": COUNT}));
    let mut numbers = BTreeSet::new();
    let mut n_values = 0;
    let said = heard(&mut bridge, |output| {
        if let Some(value) = value(output) {
            n_values += 1;
            numbers.insert(value.text.clone());
        }
        numbers.len() == COUNT
    });
    assert_eq!((n_values, numbers.len()), (COUNT, COUNT));
    assert_eq!(said.iter().find(is_loss), None);
    let took = machine.hear("done");
    eprintln!("{COUNT} values, written in {} s, all heard", took["took_s"]);
}

#[test]
fn a_proposal_is_made_by_browsing_and_is_a_mapping() {
    let Some(python) = interpreter("opcua survey") else {
        return;
    };
    let port = free_port();
    let _machine = Machine::start(&python, port, &["urn:abbe:machine"], &json!({}));
    let survey = opcua_bridge::io::survey(&format!("opc.tcp://127.0.0.1:{port}/")).unwrap();
    assert_eq!(survey.stopped, None);
    let keys: Vec<String> = survey.variables.iter().map(|one| one.node.text()).collect();
    assert!(
        keys.contains(&"nsu=urn:abbe:machine;s=T".to_owned()),
        "{keys:?}"
    );
    let nobody = opcua_bridge::io::survey(&format!("opc.tcp://127.0.0.1:{}/", free_port()));
    assert!(nobody.is_err());
}
