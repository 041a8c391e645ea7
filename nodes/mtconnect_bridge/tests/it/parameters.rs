//! Parameters that are refused.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::BTreeMap;

use mtconnect_bridge::config::{AgentConfig, ConnectionConfig, Source};
use mtconnect_bridge::mapping::MapFile;
use mtconnect_bridge::{BridgeConfig, Settings};

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
