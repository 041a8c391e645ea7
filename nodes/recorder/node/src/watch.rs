//! Watches a recording that goes on and says when something is lost.

use std::convert::Infallible;

use metrology::{Host, Stage, Stamp};
use node_runtime::{Diagnostic, Level};

use crate::capture::Capture;

pub(crate) enum Input {
    Tick,
    Shutdown,
}

pub(crate) enum Output {
    Condition(Diagnostic),
    Stopped,
}

pub(crate) struct Watch {
    capture: Option<Capture>,
    lost: (u64, u64),
}

impl Watch {
    pub fn new(capture: Capture) -> Self {
        Self {
            capture: Some(capture),
            lost: (0, 0),
        }
    }

    fn look(&mut self, out: &mut Vec<Output>) {
        let Some(capture) = &self.capture else {
            return;
        };
        let stats = capture.stats();
        if let Some(reason) = &stats.failure {
            out.push(failure(reason));
        }
        let lost = (stats.messages_lost, capture.lost_on_network());
        if lost != self.lost {
            self.lost = lost;
            let message = format!(
                "{} messages found no room, {} were lost on the network",
                lost.0, lost.1
            );
            let diagnostic = Diagnostic::new(Level::Warn, "messages_lost", message)
                .with("queue", lost.0)
                .with("network", lost.1);
            out.push(Output::Condition(diagnostic));
        }
        for message in capture.unrecorded() {
            let diagnostic = Diagnostic::new(Level::Error, "topic_not_recorded", message);
            out.push(Output::Condition(diagnostic));
        }
    }

    /// Leaving the network waits, which the runtime's own threads must not: a thread for it.
    fn close(&mut self, out: &mut Vec<Output>) {
        let Some(capture) = self.capture.take() else {
            return;
        };
        match std::thread::spawn(move || capture.finish()).join() {
            Ok(Ok(captured)) => {
                if let Err(error) = captured.bag {
                    out.push(failure(&error.to_string()));
                }
            }
            Ok(Err(error)) => out.push(failure(&format!("{error:#}"))),
            Err(_) => out.push(failure("the bag's thread panicked")),
        }
    }
}

fn failure(reason: &str) -> Output {
    Output::Condition(Diagnostic::new(
        Level::Error,
        "recording",
        reason.to_owned(),
    ))
}

impl Stage for Watch {
    type Input = Input;
    type Output = Output;
    type Error = Infallible;

    fn step(
        &mut self,
        _at: Stamp<Host>,
        input: Input,
        out: &mut Vec<Output>,
    ) -> Result<(), Infallible> {
        self.look(out);
        if matches!(input, Input::Shutdown) {
            self.close(out);
            out.push(Output::Stopped);
        }
        Ok(())
    }
}
