//! Tells once that the machine has drifted, as a node on any host.

use std::convert::Infallible;
use std::process::ExitCode;

use abbe_msgs::builtin_interfaces::msg::Time;
use abbe_msgs::topics::THERMAL_MODEL;
use abbe_tests::drift;
use metrology::Stage;
use metrology::stamp::{Host, Span, Stamp};
use node_runtime::Wiring;

/// Until the node is on the graph, and its host's clock is related to the reference's.
const BEGIN: Span = Span::from_nanos(3_000_000_000);
const NANOS: i64 = 1_000_000_000;

#[derive(Default)]
struct Teller {
    has_told: bool,
}

impl Stage for Teller {
    type Input = ();
    type Output = Stamp<Host>;
    type Error = Infallible;

    fn step(
        &mut self,
        at: Stamp<Host>,
        (): (),
        out: &mut Vec<Stamp<Host>>,
    ) -> Result<(), Infallible> {
        if !std::mem::replace(&mut self.has_told, true) {
            out.push(at);
        }
        Ok(())
    }
}

fn time(at: Stamp<Host>) -> Option<Time> {
    Some(Time {
        sec: i32::try_from(at.nanos().div_euclid(NANOS)).ok()?,
        nanosec: u32::try_from(at.nanos().rem_euclid(NANOS)).ok()?,
    })
}

fn main() -> ExitCode {
    node_runtime::run("drift_teller", |setup| {
        let wiring = Wiring::new(setup.name(), vec![], Teller::default());
        Ok(wiring
            .every(BEGIN, || ())
            .publish_message(&THERMAL_MODEL, |at| Some(drift::model(&time(*at)?)))
            .node())
    })
}
