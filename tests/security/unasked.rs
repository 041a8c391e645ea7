//! A participant that the authority admits and that does not hold itself to its permissions: the machine does.

use abbe_msgs::topics;
use abbe_tests::fast_dds::FastDds;
use abbe_tests::graph::now;
use abbe_tests::program::domain;
use abbe_tests::said::compensation;
use abbe_tests::scenario::Scenario;
use abbe_tests::security::{keystore, met_in_secret};

use crate::{BEAT, INJECTED_M};

/// How long it speaks: a machine that listens follows within the first second.
const BEATS: u32 = 50;

/// Lets a peer say compensations for some time; the furthest that a motor of X was from its command meanwhile, m.
fn moved_m(peer: &mut FastDds) -> f64 {
    let mut furthest_m = 0.0_f64;
    for _ in 0..BEATS {
        peer.write(&topics::COMPENSATION, &compensation(&now(), INJECTED_M));
        std::thread::sleep(BEAT);
        let state = peer.sample(&topics::AXES_STATE, |_| true);
        furthest_m = furthest_m.max((state.motor[0] - state.commanded[0]).abs());
    }
    furthest_m
}

#[test]
fn an_operator_that_does_not_ask_its_permissions_is_not_followed() {
    let test = "an operator on a Fast DDS that was changed";
    let (scenario, domain) = (Scenario::copy_of("short_cell"), domain(5));
    let keys = scenario.folder().join("keys");
    if !keystore(test, &keys, &scenario.folder()) {
        return;
    }
    let [operator, own] =
        ["operator", "axis_compensation"].map(|of| keys.join("enclaves").join(of));
    let cell = (&scenario, domain, keys.as_path());
    let met = met_in_secret(cell, || FastDds::start_unasked(test, domain, &operator));
    let Some((node, mut peer)) = met else {
        return;
    };
    peer.speak_to_nobody(&topics::COMPENSATION);
    let by_operator_m = moved_m(&mut peer);
    assert!(!peer.was_refused(&topics::COMPENSATION), "it asked");
    drop(peer);
    node.stop();

    let met = met_in_secret(cell, || FastDds::start_in(test, domain, &own));
    let (node, mut peer) = met.unwrap();
    peer.speak(&topics::COMPENSATION);
    let by_right_m = moved_m(&mut peer);
    node.stop();
    eprintln!(
        "a motor of X moved by {:.2} um for the operator, by {:.2} um for who may compensate",
        by_operator_m * 1e6,
        by_right_m * 1e6
    );
    assert!(by_operator_m < 0.1 * INJECTED_M, "{by_operator_m}");
    assert!(by_right_m > 0.5 * INJECTED_M, "{by_right_m}");
}
