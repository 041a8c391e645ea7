//! The table of parameters, the configuration and the README say the same.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::BTreeMap;

use mtconnect_bridge::config::{AgentConfig, ConnectionConfig, Source};
use mtconnect_bridge::mapping::MapFile;
use mtconnect_bridge::{BridgeConfig, PARAMETERS, Settings};
use serde_json::Value;

const README: &str = include_str!("../../README.md");

fn config() -> BridgeConfig {
    BridgeConfig {
        source: Source::Shdr,
        host: "127.0.0.1".to_owned(),
        port: 7878,
        log_file: None,
        log_longest_pause_s: BridgeConfig::default_longest_pause_s(),
        map_file: "map.yaml".to_owned(),
        connection: ConnectionConfig::default(),
        agent: AgentConfig::default(),
    }
}

fn refusal(config: &BridgeConfig) -> String {
    let values = BTreeMap::new();
    let refused = Settings::new(config, &MapFile { values });
    refused.unwrap_err().to_string()
}

/// Names of all leaves, nested keys joined by dots, with their values.
fn leaves(prefix: &str, value: &Value, found: &mut BTreeMap<String, String>) {
    let Value::Object(fields) = value else {
        let text = match value {
            Value::Number(number) => number.as_f64().unwrap().to_string(),
            other => other.to_string(),
        };
        found.insert(prefix.to_owned(), text);
        return;
    };
    for (key, field) in fields {
        let name = match prefix {
            "" => key.clone(),
            prefix => format!("{prefix}.{key}"),
        };
        leaves(&name, field, found);
    }
}

#[test]
fn readme_table_defaults_and_configuration_agree() {
    let mut given = BTreeMap::new();
    leaves("", &serde_json::to_value(config()).unwrap(), &mut given);
    for doc in PARAMETERS {
        let default = match doc.name {
            "log_file" => " none ".to_owned(),
            "source" | "map_file" => "  ".to_owned(),
            name => format!(" {} ", given[name]),
        };
        let (name, unit, meaning) = (doc.name, doc.unit, doc.description);
        let row = format!("| `{name}` | {unit} |{default}| {meaning} |");
        assert!(README.contains(&row), "{row}");
    }
    let mut documented: Vec<_> = PARAMETERS.iter().map(|doc| doc.name.to_owned()).collect();
    documented.sort();
    assert_eq!(given.into_keys().collect::<Vec<_>>(), documented);
}

#[test]
fn wrong_values_are_refused_by_name() {
    let mut wrong = config();
    wrong.connection.reconnect_first_s = f64::NAN;
    let said = "connection.reconnect_first_s = NaN s: must be from 0.05 to 3600 s";
    assert_eq!(refusal(&wrong), said);
    let mut wrong = config();
    wrong.connection.reconnect_longest_s = 0.25;
    let said = "connection.reconnect_longest_s = 0.25 s: must be from 0.5 to 86400 s";
    assert_eq!(refusal(&wrong), said);
    let mut wrong = config();
    wrong.agent.device = "a/b HTTP/1.1\r\n".to_owned();
    assert!(refusal(&wrong).starts_with("agent.device = "));
    let mut wrong = config();
    wrong.log_file = Some("day.shdr".to_owned());
    let said = "log_file: belongs to source = log, and to no other";
    assert_eq!(refusal(&wrong), said);
    let mut wrong = config();
    wrong.port = 0;
    assert_eq!(refusal(&wrong), "port = 0: must be from 1 to 65535");
}

#[test]
fn a_mapping_of_more_keys_than_a_machine_has_is_refused() {
    let map = |n: u32| {
        let keys: String = (0..n)
            .map(|n| format!("  k{n}: {{is: ignored}}\n"))
            .collect();
        let map = MapFile::from_yaml(&format!("values:\n{keys}")).unwrap();
        Settings::new(&config(), &map).map(|settings| settings.mapping.uses().count())
    };
    assert_eq!(map(4_000).unwrap(), 4_000);
    let refused = map(4_001).unwrap_err().to_string();
    assert_eq!(refused, "values: 4001 keys: at most 4000");
}

#[test]
fn the_mapping_of_the_readme_is_one() {
    let text = README.split("```yaml\n").nth(1).unwrap();
    let text = text.split("```").next().unwrap();
    let map = MapFile::from_yaml(text).unwrap();
    let settings = Settings::new(&config(), &map).unwrap();
    assert_eq!(settings.mapping.uses().count(), 8);
}
