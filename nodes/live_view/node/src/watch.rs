//! The node's own part on the graph: where the page is, who looks, and what was refused.

use std::convert::Infallible;

use live_view::io::Account;
use metrology::Stage;
use metrology::stamp::{Host, Stamp};
use node_runtime::{Diagnostic, Level, RawTap};

use crate::view::View;

/// What the watch is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Input {
    /// Time has passed.
    Tick,
    /// The node is to stop.
    Shutdown,
}

/// What it says.
#[derive(Debug)]
pub(crate) enum Output {
    /// Where the page is, and how many look.
    Serving { sentence: String, browsers: usize },
    /// Requests that were refused since the last word on it, by reason.
    Refused(Vec<(&'static str, u64)>),
    /// Nothing was refused since.
    NoneRefused,
    /// The tap ended badly.
    TapFailed(String),
    /// Everything is closed.
    Stopped,
}

impl Output {
    /// Its condition on `/diagnostics`.
    pub fn diagnostic(&self) -> Option<Diagnostic> {
        let refused = "requests_refused";
        Some(match self {
            Self::Serving { sentence, browsers } => {
                Diagnostic::new(Level::Ok, "serving", sentence.clone())
                    .with("browsers", browsers)
                    .staying()
            }
            Self::Refused(reasons) => {
                let one = |(reason, count): &(&str, u64)| format!("{count} ({reason})");
                let all: Vec<String> = reasons.iter().map(one).collect();
                let message = format!("requests refused: {}", all.join(", "));
                Diagnostic::new(Level::Warn, refused, message)
            }
            Self::NoneRefused => Diagnostic::new(Level::Ok, refused, "none any more".to_owned()),
            Self::TapFailed(reason) => Diagnostic::new(Level::Error, "tap", reason.clone()),
            Self::Stopped => return None,
        })
    }
}

/// Looks at the server's account.
pub(crate) struct Watch {
    view: Option<View>,
    tap: Option<RawTap>,
    told: Account,
    told_at: Option<Stamp<Host>>,
}

/// A refusal stands for so long.
const REFUSAL_STANDS_S: f64 = 10.0;

impl Watch {
    pub const fn new(view: View, tap: RawTap) -> Self {
        Self {
            view: Some(view),
            tap: Some(tap),
            told: Account {
                browsers: 0,
                refused: std::collections::BTreeMap::new(),
            },
            told_at: None,
        }
    }

    fn look(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        let Some(view) = &self.view else {
            return;
        };
        let account = view.account();
        out.push(Output::Serving {
            sentence: view.sentence(),
            browsers: account.browsers,
        });
        let more = account.refused.iter().filter_map(|(reason, count)| {
            let before = self.told.refused.get(reason).copied().unwrap_or_default();
            (*count > before).then_some((*reason, count - before))
        });
        let more: Vec<_> = more.collect();
        if !more.is_empty() {
            out.push(Output::Refused(more));
            self.told_at = Some(at);
        } else if self
            .told_at
            .is_some_and(|told| (at - told).as_secs_f64() >= REFUSAL_STANDS_S)
        {
            out.push(Output::NoneRefused);
            self.told_at = None;
        }
        self.told = account;
    }
}

impl Stage for Watch {
    type Input = Input;
    type Output = Output;
    type Error = Infallible;

    fn step(
        &mut self,
        at: Stamp<Host>,
        input: Input,
        out: &mut Vec<Output>,
    ) -> Result<(), Infallible> {
        match input {
            Input::Tick => self.look(at, out),
            Input::Shutdown => {
                self.view = None;
                if let Some(Err(error)) = self.tap.take().map(RawTap::stop) {
                    out.push(Output::TapFailed(format!("{error:#}")));
                }
                out.push(Output::Stopped);
            }
        }
        Ok(())
    }
}
