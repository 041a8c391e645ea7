//! Hosts that are named (`ROS_STATIC_PEERS`) meet where no multicast passes.

use std::time::{Duration, Instant};

use abbe_msgs::topics;
use abbe_tests::cyclone::{Cyclone, end};
use abbe_tests::hosts::network::{Multicast, Network};
use abbe_tests::python::interpreter;

use crate::cuts::{Cell, met_in};

/// How long a cell works, and how many of the controller's states must come to the other host in it, at 1 kHz.
const WORK: Duration = Duration::from_secs(5);
const LEAST_STATES: usize = 4_500;

/// A controller on one host is compensated from the other, by nodes of ours in both; a peer on Cyclone DDS meets it too.
fn meet(multicast: Multicast, domain: u16) {
    let Some(mut network) = Network::of(&["controller", "models"], domain, 6) else {
        return;
    };
    network.name_hosts_without(multicast);
    let cell = Cell::start(&network);
    let began = Instant::now();
    std::thread::sleep(WORK);
    let states = cell.models.since(&topics::AXES_STATE, began).len();
    eprintln!(
        "{multicast:?}: {states} states in {WORK:?}; {:?}",
        network.counts()
    );
    assert!(states >= LEAST_STATES, "{states} states");
    if let Some(python) = interpreter("named hosts with Cyclone DDS") {
        let [hears, says] = [end(&topics::JOINT_STATES), end(&topics::PLAN_STATUS)];
        let mut cyclone = network.on("models", |_| {
            Cyclone::among(&python, domain, &["10.77.0.1"], &[hears], &[says])
        });
        let met = met_in(&cell.controller, &mut cyclone);
        eprintln!(
            "{multicast:?}: Cyclone DDS hears after {:.1} s and is heard after {:.1} s",
            met[0], met[1]
        );
        cyclone.stop();
    }
    cell.stop();
}

#[test]
fn named_hosts_meet_where_the_network_drops_multicast() {
    meet(Multicast::Dropped, 66);
}

#[test]
fn named_hosts_meet_where_no_interface_has_multicast() {
    meet(Multicast::NotOffered, 67);
}
