//! The node's own part on the graph: the page's address, its browsers, and refused requests.

use std::convert::Infallible;

use live_view::io::Account;
use metrology::Stage;
use metrology::stamp::{Host, Stamp};
use node_runtime::{Diagnostic, Level, RawTap};

use crate::view::View;

/// Inputs of the watch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Input {
    /// Time has passed.
    Tick,
    /// The node stops.
    Shutdown,
}

/// Outputs of the watch.
#[derive(Debug)]
pub(crate) enum Output {
    /// The page's address, browsers and refused requests.
    Serving { sentence: String, account: Account },
    /// The tap ended with an error.
    TapFailed(String),
    /// Everything is closed.
    Stopped,
}

impl Output {
    /// Its condition on `/diagnostics`.
    pub fn diagnostic(&self) -> Option<Diagnostic> {
        Some(match self {
            Self::Serving { sentence, account } => {
                let serving = Diagnostic::new(Level::Ok, "serving", sentence.clone())
                    .with("browsers", account.browsers);
                let refused = account.refused.iter();
                refused
                    .fold(serving, |all, (reason, count)| all.with(reason, count))
                    .staying()
            }
            Self::TapFailed(reason) => Diagnostic::new(Level::Error, "tap", reason.clone()),
            Self::Stopped => return None,
        })
    }
}

/// Reads the server's account at each tick; closes server and tap at the end.
pub(crate) struct Watch {
    view: Option<View>,
    tap: Option<RawTap>,
}

impl Watch {
    pub const fn new(view: View, tap: RawTap) -> Self {
        Self {
            view: Some(view),
            tap: Some(tap),
        }
    }
}

impl Stage for Watch {
    type Input = Input;
    type Output = Output;
    type Error = Infallible;

    fn step(
        &mut self,
        _: Stamp<Host>,
        input: Input,
        out: &mut Vec<Output>,
    ) -> Result<(), Infallible> {
        match input {
            Input::Tick => out.extend(self.view.as_ref().map(|view| Output::Serving {
                sentence: view.sentence(),
                account: view.account(),
            })),
            Input::Shutdown => {
                self.view = None;
                // A tap has a runtime of its own, which cannot stop on a thread of the node's.
                let stop = |tap: RawTap| std::thread::spawn(move || tap.stop()).join();
                match self.tap.take().map(stop) {
                    Some(Ok(Err(error))) => out.push(Output::TapFailed(format!("{error:#}"))),
                    Some(Err(_)) => out.push(Output::TapFailed("its thread panicked".to_owned())),
                    Some(Ok(Ok(()))) | None => {}
                }
                out.push(Output::Stopped);
            }
        }
        Ok(())
    }
}
