//! Parameters that are refused.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use linuxcnc_bridge::config::{CompensationConfig, ConnectionConfig, Prepare};
use linuxcnc_bridge::{BridgeConfig, BridgeError, Settings};
use machine::MachineFile;
use metrology::Axis;

const MACHINE: &str = include_str!("../../../../launch_configs/linuxcnc_latency/machine.yaml");

fn config() -> BridgeConfig {
    BridgeConfig {
        machine_file: "machine.yaml".to_owned(),
        joints: Axis::LINEAR.to_vec(),
        prepare: Prepare::Observe,
        autostart: true,
        start_ini: None,
        user: "nobody".to_owned(),
        connection: ConnectionConfig::default(),
        compensation: CompensationConfig {
            limit_um: 200.0,
            limit_arcsec: 60.0,
            stale_after_ms: 1000.0,
        },
    }
}

fn refusal(config: &BridgeConfig) -> String {
    let machine = MachineFile::parse(MACHINE, "machine.yaml").unwrap();
    Settings::new(config, &machine).unwrap_err().to_string()
}

#[test]
fn wrong_values_are_refused_by_name() {
    let mut wrong = config();
    wrong.connection.poll_period_ms = f64::NAN;
    assert_eq!(
        refusal(&wrong),
        "connection.poll_period_ms = NaN ms: must be from 1 to 1000 ms"
    );
    let mut wrong = config();
    wrong.connection.enable_password = "a\r\nset estop off".to_owned();
    assert!(refusal(&wrong).starts_with("connection.enable_password = "));
    let mut wrong = config();
    wrong.joints = vec![Axis::X, Axis::Y, Axis::A];
    assert_eq!(
        refusal(&wrong),
        "joints = [X, Y, A]: the machine file has the axes [X, Y, Z]"
    );
    wrong.joints = vec![Axis::X, Axis::X, Axis::Y, Axis::Z];
    assert!(refusal(&wrong).starts_with("joints = [X, X, Y, Z]"));
}

#[test]
fn a_hardware_latch_is_not_what_linuxcnc_has() {
    let machine = MachineFile::parse(
        &MACHINE.replace("latch: polled", "latch: hardware"),
        "machine.yaml",
    )
    .unwrap();
    let error = Settings::new(&config(), &machine).unwrap_err();
    assert!(matches!(error, BridgeError::LatchIsPolled));
}

#[test]
fn unknown_keys_are_refused_by_name() {
    let text = "machine_file: m\njoints: [X]\nprepare: observe\npol_period_ms: 3\n";
    let error = serde_saphyr::from_str::<BridgeConfig>(text)
        .unwrap_err()
        .to_string();
    assert!(error.contains("pol_period_ms"), "{error}");
}
