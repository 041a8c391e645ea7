//! When the bridge tries to connect again.

use opcua_bridge::stage::{IoCommand, IoEvent};
use opcua_bridge::{Condition, Input, Output};

use crate::stage::{Bridge, conditions, up};

#[test]
fn a_clock_that_is_set_back_does_not_keep_the_bridge_from_connecting() {
    let mut bridge = Bridge::up();
    bridge.now_s = 3600.0;
    let reason = "BadTimeout".to_owned();
    bridge.io(IoEvent::Ended { reason });
    bridge.now_s = 0.0;
    let said = bridge.step(Input::Tick);
    assert!(said.contains(&Output::Io(IoCommand::Connect)), "{said:?}");
}

#[test]
fn attempts_come_after_pauses_that_double_up_to_the_longest() {
    let mut bridge = Bridge::up();
    let mut pauses = Vec::new();
    for _ in 0..9 {
        let reason = "BadTimeout".to_owned();
        let said = bridge.io(IoEvent::Ended { reason });
        pauses.extend(said.iter().find_map(|output| match output {
            Output::Condition(Condition::Disconnected { retry_s, .. }) => Some(*retry_s),
            _ => None,
        }));
        assert!(
            !bridge
                .step(Input::Tick)
                .contains(&Output::Io(IoCommand::Connect))
        );
        bridge.now_s += 31.0;
        assert!(
            bridge
                .step(Input::Tick)
                .contains(&Output::Io(IoCommand::Connect))
        );
    }
    assert_eq!(pauses, [0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 30.0, 30.0, 30.0]);
    // A session that stands begins anew with the shortest.
    bridge.io(up());
    let reason = "BadTimeout".to_owned();
    let said = conditions(&bridge.io(IoEvent::Ended { reason }));
    assert!(said[0].ends_with("next attempt in 0.5 s"), "{said:?}");
}
