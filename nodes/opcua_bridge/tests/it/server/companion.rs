//! A machine by the published node sets, read with the ready mappings.

use opcua_bridge::{Output, ready};
use serde_json::json;

use super::peer::{Machine, free_port, interpreter, root};
use super::{config, heard, is_condition, open, value};

#[test]
fn ready_mappings_read_machines_of_the_published_node_sets() {
    let Some(python) = interpreter("opcua node sets") else {
        return;
    };
    let port = free_port();
    let more = json!({"nodesets": root().join("tests/peers/nodesets")});
    let _machine = Machine::start(&python, port, &["urn:abbe:machine"], &more);
    // Values that each mapping reads, and nodes that this machine lacks or leaves empty.
    let wanted = [
        (
            "ready:machine_tool",
            vec![
                ("execution", "ACTIVE"),
                ("controller_mode", "MANUAL_DATA_INPUT"),
                ("operation_mode", "AUTOMATIC"),
                ("rapid_override", "50"),
                ("spindle_override", "80"),
                ("spindle_is_rotating", "true"),
                ("program", "part_7"),
                ("program_state", "Running"),
            ],
        ),
        (
            "ready:cnc",
            vec![("spindle_speed", "1200"), ("execution", "READY")],
        ),
    ];
    for (name, mut values) in wanted {
        let mut bridge = open(&config(port), ready::of(name).unwrap().unwrap());
        let mut said = heard(&mut bridge, |output| {
            if let Some(one) = value(output) {
                values.retain(|(name, text)| *name != one.name || *text != one.text);
            }
            values.is_empty()
        });
        if name == "ready:cnc" {
            let is_whole = |output: &Output| match output {
                Output::State(state) => [
                    (metrology::Axis::X, 100.0),
                    (metrology::Axis::Y, 101.0),
                    (metrology::Axis::Z, 102.0),
                ]
                .iter()
                .all(|(axis, at)| {
                    (state.motor[*axis] - at).abs() < 1e-9
                        && (state.commanded[*axis] - at - 100.0).abs() < 1e-9
                }),
                _ => false,
            };
            if !said.iter().any(is_whole) {
                said.extend(heard(&mut bridge, is_whole));
            }
        }
        assert!(
            said.iter()
                .any(|one| is_condition(one, "connection", "connected to")),
            "{said:?}"
        );
    }
}
