use std::sync::mpsc::channel;
use std::time::Duration;

use metrology::stamp::Span;
use node_runtime::Event;
use node_runtime::node::Ports;

use super::puppet::{Puppet, environment, start, wait};

/// Its ticks wait by the hundred: the wish to stop comes before them.
#[test]
fn a_node_whose_ticks_take_longer_than_their_period_stops_before_those_that_wait() {
    let environment = environment(23);
    let ports = Ports {
        timers: vec![Span::from_nanos(1_000_000)],
        ..Ports::default()
    };
    let (sender, ticks) = channel();
    let puppet = Puppet::new("slow", ports, move |_, event, _| {
        if matches!(event, Event::Timer { .. }) {
            std::thread::sleep(Duration::from_millis(30));
            let _ = sender.send(());
        }
        Ok(())
    });
    let running = start(&environment, puppet);
    for _ in 0..30 {
        wait(&ticks, "a tick", Some);
    }
    running.stop().unwrap();
    let more = ticks.try_iter().count();
    assert!(more < 100, "{more} ticks after the wish to stop");
}
