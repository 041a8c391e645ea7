//! Tells once that the machine has drifted, as a node on any host.

use std::convert::Infallible;
use std::process::ExitCode;

use abbe_msgs::topics::THERMAL_MODEL;
use abbe_tests::drift;
use abbe_tests::graph::now;
use metrology::Stage;
use metrology::stamp::{Host, Span, Stamp};
use node_runtime::Wiring;

/// Until the node is on the graph.
const BEGIN: Span = Span::from_nanos(1_000_000_000);

#[derive(Default)]
struct Teller {
    has_told: bool,
}

impl Stage for Teller {
    type Input = ();
    type Output = ();
    type Error = Infallible;

    fn step(&mut self, _: Stamp<Host>, (): (), out: &mut Vec<()>) -> Result<(), Infallible> {
        if !std::mem::replace(&mut self.has_told, true) {
            out.push(());
        }
        Ok(())
    }
}

fn main() -> ExitCode {
    node_runtime::run("drift_teller", |setup| {
        let wiring = Wiring::new(setup.name(), vec![], Teller::default());
        Ok(wiring
            .every(BEGIN, || ())
            .publish_message(&THERMAL_MODEL, |()| Some(drift::model(&now())))
            .node())
    })
}
