//! Parameters that are refused.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use fake_cnc::{Cnc, Config, Plant, PlantFile};
use machine::MachineFile;

const MACHINE: &str = include_str!("../../../../launch_configs/first_run/machine.yaml");
const PLANT: &str = include_str!("../../../../launch_configs/first_run/plant.yaml");

fn refusal(config: &Config) -> String {
    let machine = MachineFile::parse(MACHINE, "machine.yaml").unwrap();
    let plant = Plant::new(&machine, &PlantFile::from_yaml(PLANT).unwrap()).unwrap();
    Cnc::new(config, &machine, plant)
        .map(|_| ())
        .unwrap_err()
        .to_string()
}

#[test]
fn values_out_of_range_and_unknown_keys_are_refused_by_name() {
    let config = Config {
        settle_s: f64::NAN,
        ..Config::default()
    };
    assert_eq!(refusal(&config), "settle_s = NaN s: must be from 0 to 10 s");
    let config = Config {
        state_rate_hz: 300.0,
        ..Config::default()
    };
    assert_eq!(
        refusal(&config),
        "state_rate_hz = 300 Hz: must be a whole part of the servo rate"
    );
    let mut config = Config::default();
    config.start_mm.insert(metrology::Axis::X, 500.0);
    assert_eq!(
        refusal(&config),
        "start_mm.X = 500 mm: must be within the travel of X, -320 to 320 mm"
    );
    let mut config = Config::default();
    config.start_mm.insert(metrology::Axis::A, 1.0);
    assert!(refusal(&config).starts_with("start_mm.A = 1: must be of an axis of this kind"));
    let mut config = Config::default();
    let scale = fake_cnc::config::FeedbackSource::Scale;
    config.feedback.insert(metrology::Axis::Z, scale);
    assert_eq!(
        refusal(&config),
        "feedback.Z = scale: the machine file has no scale_resolution_um for this axis"
    );
    let config = Config {
        tool_lengths_mm: vec![80.0, 1e4],
        ..Config::default()
    };
    assert_eq!(
        refusal(&config),
        "tool_lengths_mm = 10000 mm: must be from -1000 to 1000 mm"
    );
    let config = Config {
        tool_lengths_mm: vec![80.0; 1001],
        ..Config::default()
    };
    assert_eq!(
        refusal(&config),
        "tool_lengths_mm: 1001 tools: must be at most 1000"
    );
    let unknown = serde_json::from_str::<Config>("{\"settle_ms\": 3}").unwrap_err();
    assert!(unknown.to_string().contains("unknown field `settle_ms`"));
}
