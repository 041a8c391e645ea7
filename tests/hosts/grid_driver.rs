//! A grid encoder on a host of its own: the readings that the fake machine told, stamped again as a driver there would have.
//!
//! The fake machine's readings come as `instrument/position`, with the time at which they were taken. A driver that had taken
//! them here would have stamped them with what the node's clock showed at that time. Both clocks are on one computer, so what
//! lies between them is seen: with each reading that comes, the node's time less the computer's.
#![expect(
    clippy::disallowed_methods,
    reason = "the computer's clock is the truth here"
)]

use std::collections::VecDeque;
use std::convert::Infallible;
use std::process::ExitCode;
use std::time::{SystemTime, UNIX_EPOCH};

use abbe_msgs::msg::GridSample;
use abbe_msgs::topics::{GRID_POSITION, Topic};
use metrology::Stage;
use metrology::sample::GridSample as Reading;
use metrology::stamp::{Host, Span, Stamp};
use node_runtime::Wiring;

/// What the fake machine's readings are renamed to.
const INSTRUMENT: Topic<GridSample> = {
    let mut renamed = GRID_POSITION;
    renamed.name = "instrument/position";
    renamed
};
/// Over how many readings the clocks are compared: between a look at the one and at the other time passes, sometimes much.
const COMPARED: usize = 200;

/// Readings in, the same readings with this host's stamps out.
#[derive(Default)]
struct Driver {
    /// The node's time less the computer's, at the newest readings.
    seen: VecDeque<Span>,
}

impl Stage for Driver {
    type Input = Reading;
    type Output = Reading;
    type Error = Infallible;

    fn step(
        &mut self,
        at: Stamp<Host>,
        reading: Reading,
        out: &mut Vec<Reading>,
    ) -> Result<(), Infallible> {
        let since_epoch = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .unwrap_or_default();
        let nanos = i64::try_from(since_epoch.as_nanos()).unwrap_or(i64::MAX);
        if self.seen.len() == COMPARED {
            self.seen.pop_front();
        }
        self.seen.push_back(at - Stamp::from_nanos(nanos));
        // The computer's clock is looked at last: the greatest difference waited least.
        let ahead = self.seen.iter().max().copied().unwrap_or_default();
        out.push(Reading {
            at: reading.at + ahead,
            ..reading
        });
        Ok(())
    }
}

fn main() -> ExitCode {
    node_runtime::run("grid_driver", |setup| {
        let wiring = Wiring::new(setup.name(), vec![], Driver::default());
        Ok(wiring
            .on(&INSTRUMENT, |reading| reading)
            .publish(&GRID_POSITION, |reading| Some(reading))
            .node())
    })
}
