//! PyPI `asyncua` as the machine (tests/peers/opcua_server.py): values, bad qualities, cuts, restarts, security, floods.

use std::collections::BTreeSet;
use std::path::Path;
use std::time::{Duration, Instant};

use machine_report::MapFile;
use metrology::Stage;
use metrology::sample::MachineValue;
use opcua_bridge::config::{ConnectionConfig, Mode, SecurityConfig, SubscriptionConfig};
use opcua_bridge::io::Credentials;
use opcua_bridge::live::{LiveBridge, LiveInput};
use opcua_bridge::{BridgeConfig, Condition, Output, Settings};
use serde_json::json;

mod peer;

use peer::{Machine, Proxy, free_port, host_now, interpreter};

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

fn open(config: &BridgeConfig, map: &str, pki: Option<&Path>) -> LiveBridge {
    let settings = Settings::new(config, &MapFile::from_yaml(map).unwrap()).unwrap();
    let credentials = Credentials {
        pki_folder: pki.map(Path::to_owned),
        password: None,
    };
    LiveBridge::open(&settings, credentials).unwrap()
}

/// What the bridge says until `until` holds for one of its outputs.
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
    let mut machine = Machine::start(&python, port, &["urn:abbe:machine"], None);
    let mut bridge = open(&config(port), MAP, None);
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

#[test]
fn a_link_that_is_cut_is_absence_and_comes_back_with_what_was_missed() {
    let Some(python) = interpreter("opcua cut") else {
        return;
    };
    let port = free_port();
    let mut machine = Machine::start(&python, port, &["urn:abbe:machine"], None);
    let proxy = Proxy::start(port);
    let mut bridge = open(&config(proxy.port()), MAP, None);
    heard(&mut bridge, |output| is_text(output, "20"));
    proxy.cut();
    heard(&mut bridge, |output| {
        is_condition(output, "unavailable/spindle", "since")
    });
    machine.tell(&json!({"write": "T", "value": 22.5, "at_s": 1_480_411_729}));
    proxy.mend();
    let said = heard(&mut bridge, |output| is_text(output, "22.5"));
    let is_back = |one: &Output| {
        matches!(
            one,
            Output::Condition(Condition::Resumed { .. } | Condition::Connected { .. })
        )
    };
    assert!(said.iter().any(is_back), "{said:?}");
    let lost = |one: &&Output| matches!(one, Output::Condition(Condition::SequenceGap { .. }));
    assert_eq!(said.iter().find(lost), None);
}

#[test]
fn a_server_that_begins_anew_with_other_indices_is_understood() {
    let Some(python) = interpreter("opcua restart") else {
        return;
    };
    let port = free_port();
    let machine = Machine::start(&python, port, &["urn:abbe:machine"], None);
    let mut bridge = open(&config(port), MAP, None);
    heard(&mut bridge, |output| is_text(output, "20"));
    drop(machine);
    heard(&mut bridge, |output| {
        is_condition(output, "unavailable/spindle", "since")
    });
    // What was the index of the machine is that of another namespace now.
    let others = ["urn:new", "urn:other", "urn:abbe:machine"];
    let mut machine = Machine::start(&python, port, &others, None);
    heard(&mut bridge, |output| is_text(output, "20"));
    machine.tell(&json!({"write": "T", "value": 23.5, "at_s": 1_480_411_729}));
    heard(&mut bridge, |output| is_text(output, "23.5"));
}

#[test]
fn a_signed_and_encrypted_connection_needs_trust_and_then_carries_values() {
    let Some(python) = interpreter("opcua security") else {
        return;
    };
    let (folder, pki) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let port = free_port();
    let mut machine = Machine::start(&python, port, &["urn:abbe:machine"], Some(folder.path()));
    // Unsecured, it is refused with what there is.
    let mut bridge = open(&config(port), MAP, None);
    heard(&mut bridge, |output| {
        is_condition(
            output,
            "connection",
            "the server offers Basic256Sha256 SignAndEncrypt",
        )
    });
    drop(bridge);
    let mut secured = config(port);
    secured.security.mode = Mode::SignAndEncrypt;
    secured.security.pki_folder = pki.path().display().to_string();
    let mut bridge = open(&secured, MAP, Some(pki.path()));
    heard(&mut bridge, |output| {
        is_condition(output, "connection", "is refused")
    });
    assert!(pki.path().join("own/cert.der").is_file());
    let rejected: Vec<_> = std::fs::read_dir(pki.path().join("rejected"))
        .unwrap()
        .map(|entry| entry.unwrap())
        .collect();
    assert_eq!(rejected.len(), 1, "{rejected:?}");
    let trusted = pki.path().join("trusted").join(rejected[0].file_name());
    std::fs::rename(rejected[0].path(), trusted).unwrap();
    let said = heard(&mut bridge, |output| is_text(output, "20"));
    assert!(said.iter().any(|one| is_condition(
        one,
        "connection",
        "Basic256Sha256 SignAndEncrypt"
    )));
    machine.tell(&json!({"write": "T", "value": 24.5, "at_s": 1_480_411_729}));
    heard(&mut bridge, |output| is_text(output, "24.5"));
}

/// Ten thousand values, as fast as the server writes them, of ten nodes.
#[test]
fn ten_thousand_values_arrive_each_once_and_none_is_lost() {
    const COUNT: usize = 10_000;
    let Some(python) = interpreter("opcua flood") else {
        return;
    };
    let names: Vec<String> = (0..10).map(|n| format!("V{n}")).collect();
    let mut map = "values:\n".to_owned();
    for name in &names {
        let lower = name.to_lowercase();
        map.push_str(&format!(
            "  nsu=urn:abbe:machine;s={name}: {{is: text, name: {lower}}}\n"
        ));
    }
    let port = free_port();
    let mut machine = Machine::start(&python, port, &["urn:abbe:machine"], None);
    let mut flooded = config(port);
    flooded.subscription.queue = 10_000;
    let mut bridge = open(&flooded, &map, None);
    let mut begun = BTreeSet::new();
    heard(&mut bridge, |output| {
        begun.extend(value(output).map(|value| value.name.clone()));
        begun.len() == names.len()
    });
    machine.ask(&json!({"burst": COUNT, "names": names}));
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
    let is_loss = |one: &&Output| {
        ["sequence_gap", "queue_overflow", "refused_value"]
            .iter()
            .any(|name| is_condition(one, name, ""))
    };
    assert_eq!(said.iter().find(is_loss), None);
}

#[test]
fn a_proposal_is_made_by_browsing_and_is_a_mapping() {
    let Some(python) = interpreter("opcua survey") else {
        return;
    };
    let port = free_port();
    let _machine = Machine::start(&python, port, &["urn:abbe:machine"], None);
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
