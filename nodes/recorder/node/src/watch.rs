//! Watches a recording that goes on and says when something is lost, or was saved.

use std::convert::Infallible;

use abbe_msgs::std_srvs::srv::TriggerResponse;
use metrology::{Host, Stage, Stamp};
use node_runtime::{Diagnostic, Level};
use recorder::RecorderError;

use crate::capture::{Capture, Captured};
use crate::ring::{RingCapture, Saved};

pub(crate) enum Input {
    Tick,
    Save,
    Shutdown,
}

pub(crate) enum Output {
    Condition(Diagnostic),
    Answer(TriggerResponse),
    Stopped,
}

impl Output {
    pub fn diagnostic(&self) -> Option<Diagnostic> {
        match self {
            Self::Condition(diagnostic) => Some(diagnostic.clone()),
            _ => None,
        }
    }

    pub fn answer(&self) -> Option<TriggerResponse> {
        match self {
            Self::Answer(answer) => Some(answer.clone()),
            _ => None,
        }
    }
}

/// What is going on.
pub(crate) enum Work {
    Bag(Capture),
    Ring(Box<RingCapture>),
}

pub(crate) struct Watch {
    work: Option<Work>,
    lost: (u64, u64),
    is_short: bool,
    is_troubled: bool,
}

impl Watch {
    pub fn new(work: Work) -> Self {
        Self {
            work: Some(work),
            lost: (0, 0),
            is_short: false,
            is_troubled: false,
        }
    }

    fn look(&mut self, out: &mut Vec<Output>) {
        let (lost, unrecorded) = match &mut self.work {
            None => return,
            Some(Work::Bag(capture)) => {
                let stats = capture.stats();
                if let Some(reason) = &stats.failure {
                    out.push(failure(reason));
                }
                let is_troubled = stats.trouble.is_some();
                if is_troubled || self.is_troubled {
                    out.push(trouble(stats.trouble.as_deref()));
                }
                self.is_troubled = is_troubled;
                let lost = (stats.messages_lost, capture.lost_on_network());
                (lost, capture.unrecorded())
            }
            Some(Work::Ring(ring)) => {
                if ring.is_alarmed() {
                    save(ring, out);
                }
                out.extend(ring.ended(false).into_iter().map(told));
                let stats = ring.stats();
                let is_short = stats.messages_crowded_out > 0;
                if is_short && !self.is_short {
                    out.push(short(stats.reach_s, stats.bytes_kept));
                }
                self.is_short = is_short;
                let troubles = ring.troubles();
                ((0, troubles.lost_on_network()), troubles.unrecorded())
            }
        };
        self.report_losses(lost, unrecorded, out);
    }

    fn report_losses(&mut self, lost: (u64, u64), unrecorded: Vec<String>, out: &mut Vec<Output>) {
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
        for message in unrecorded {
            let diagnostic = Diagnostic::new(Level::Error, "topic_not_recorded", message);
            out.push(Output::Condition(diagnostic));
        }
    }

    /// Leaving the network waits, which the runtime's own threads must not: a thread for it.
    fn close(&mut self, out: &mut Vec<Output>) {
        let outcome = match self.work.take() {
            None => return,
            Some(Work::Bag(capture)) => {
                let finished = std::thread::spawn(move || capture.finish()).join();
                finished.map(|captured| captured.map(|captured| self.finished(captured, out)))
            }
            Some(Work::Ring(mut ring)) => {
                out.extend(ring.ended(true).into_iter().map(told));
                let finished = std::thread::spawn(move || ring.finish()).join();
                finished.map(|finished| {
                    finished.map(|unmatched| {
                        out.extend(unmatched.into_iter().map(odd_pattern));
                        None
                    })
                })
            }
        };
        match outcome {
            Ok(Ok(None)) => {}
            Ok(Ok(Some(error))) => out.push(failure(&error.to_string())),
            Ok(Err(error)) => out.push(failure(&format!("{error:#}"))),
            Err(_) => out.push(failure("the bag's thread panicked")),
        }
    }

    /// What was lost and not recorded since the last look; why the bag ended before.
    fn finished(&mut self, captured: Captured, out: &mut Vec<Output>) -> Option<RecorderError> {
        let lost = (captured.stats.messages_lost, captured.lost_on_network);
        self.report_losses(lost, captured.unrecorded, out);
        out.extend(captured.unmatched.into_iter().map(odd_pattern));
        captured.bag.err()
    }

    fn asked_to_save(&mut self, out: &mut Vec<Output>) {
        let answer = match &mut self.work {
            Some(Work::Ring(ring)) => save(ring, out),
            _ => TriggerResponse {
                success: false,
                message: "nothing is kept to be saved: everything is written (parameter ring)"
                    .to_owned(),
            },
        };
        out.push(Output::Answer(answer));
    }
}

fn odd_pattern(message: String) -> Output {
    Output::Condition(Diagnostic::new(Level::Warn, "pattern_unmatched", message))
}

/// Begins to save, and says where or why not.
fn save(ring: &mut RingCapture, out: &mut Vec<Output>) -> TriggerResponse {
    let reach_s = ring.stats().reach_s;
    match ring.save() {
        Ok((path, messages)) => TriggerResponse {
            success: true,
            message: format!(
                "{}: {messages} messages of {reach_s:.1} s are being written",
                path.display()
            ),
        },
        Err(error) => {
            let message = error.to_string();
            out.push(failure(&message));
            TriggerResponse {
                success: false,
                message,
            }
        }
    }
}

fn told((path, outcome): Saved) -> Output {
    let path = path.display();
    match outcome {
        Ok(messages) => Output::Condition(Diagnostic::new(
            Level::Ok,
            "recording",
            format!("{path}: {messages} messages are saved"),
        )),
        Err(reason) => failure(&format!("{path}: {reason}")),
    }
}

fn short(reach_s: f64, bytes: u64) -> Output {
    let message = format!("the last {reach_s:.1} s are kept: more needs more than {bytes} bytes");
    Output::Condition(Diagnostic::new(Level::Warn, "ring_short", message).with("reach_s", reach_s))
}

fn trouble(reason: Option<&str>) -> Output {
    let level = reason.map_or(Level::Ok, |_| Level::Warn);
    let message = reason
        .unwrap_or("metadata.yaml is written again")
        .to_owned();
    Output::Condition(Diagnostic::new(level, "recording_description", message))
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
        match input {
            Input::Tick => {}
            Input::Save => self.asked_to_save(out),
            Input::Shutdown => {
                self.close(out);
                out.push(Output::Stopped);
            }
        }
        Ok(())
    }
}
