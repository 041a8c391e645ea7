//! How the steps of a managed node are taken.

use metrology::Stage;
use metrology::stamp::{Host, Stamp};

use super::{Managed, calls};
use crate::diagnostic::{Diagnostic, Level};
use crate::lifecycle::{Ending, State, Transition};
use crate::node::{Emission, Event, Node as _};
use crate::wiring::encode;

/// The condition that a managed node does nothing.
const NOT_ACTIVE: &str = "not_active";
/// The condition that a step went wrong.
const STEP_FAILED: &str = "lifecycle_step_failed";

fn condition(level: Level, name: &'static str, message: String) -> Emission {
    Emission::Diagnostic(Diagnostic::new(level, name, message))
}

impl<S> Managed<S>
where
    S: Stage + Send + 'static,
    S::Input: Send + 'static,
    S::Output: Send + 'static,
{
    /// The first event: configures and activates, where that is wanted.
    pub(super) fn start(&mut self, at: Stamp<Host>, out: &mut Vec<Emission>) {
        if !self.lifecycle.autostart {
            self.tell_state(out);
            return;
        }
        for goal in [State::Configuring, State::Activating] {
            let mut steps = Transition::of(self.standing.state);
            if let Some(step) = steps.find(|step| step.goal == goal) {
                self.begin(at, *step, out);
            }
        }
    }

    pub(super) fn take(&mut self, at: Stamp<Host>, step: Transition, out: &mut Vec<Emission>) {
        self.standing.state = step.goal;
        out.push(Emission::Publish {
            publication: self.ports.publications.len() - 1,
            bytes: encode(&step.event(at)),
        });
    }

    /// Takes a step that was asked for, to its end where that does not take time.
    pub(super) fn begin(&mut self, at: Stamp<Host>, step: Transition, out: &mut Vec<Emission>) {
        let was_active = step.start == State::Active;
        self.take(at, step, out);
        let outcome = match step.goal {
            State::Configuring => (self.lifecycle.configure)(&mut self.wiring.stage),
            State::CleaningUp => (self.lifecycle.cleanup)(&mut self.wiring.stage),
            State::Activating => self.tell_activity(at, true, out),
            State::Deactivating | State::ShuttingDown if was_active => {
                self.standing.since = Some(at);
                match self.tell_activity(at, false, out) {
                    Ok(()) => self.look_whether_at_rest(at, out),
                    Err(reason) => self.err(at, step.label, &reason, out),
                }
                return;
            }
            _ => Ok(()),
        };
        match outcome {
            Ok(()) => self.end(at, Ending::Success, out),
            Err(reason) => {
                self.say_failed(step.label, &reason, out);
                self.end(at, Ending::Failure, out);
            }
        }
        if step.goal == State::Configuring && self.standing.state == State::Inactive {
            self.hand_latched(at, out);
        }
    }

    /// Ends the step that is under way, and answers who asked for it.
    pub(super) fn end(&mut self, at: Stamp<Host>, ending: Ending, out: &mut Vec<Emission>) {
        let passed = self.standing.state;
        let Some(step) = Transition::end(passed, ending) else {
            return;
        };
        self.take(at, step, out);
        self.standing.since = None;
        match ending {
            Ending::Success => {
                if std::mem::take(&mut self.standing.failed) {
                    let message =
                        format!("{} is {}", self.wiring.name, self.standing.state.label());
                    out.push(condition(Level::Ok, STEP_FAILED, message));
                }
            }
            Ending::Failure => {}
            Ending::Error => self.put_in_order(at, out),
        }
        // A node that is configured at its start is about to be activated.
        if passed != State::Configuring && !self.standing.leaving {
            self.tell_state(out);
        }
        if let Some((service, id)) = self.standing.waiting.take() {
            out.push(Emission::Respond {
                service,
                id,
                bytes: calls::changed(ending == Ending::Success),
            });
        }
    }

    fn tell_state(&mut self, out: &mut Vec<Emission>) {
        let label = self.standing.state.label();
        if self.standing.state != State::Active {
            self.standing.told = true;
            let message = format!("{label}: nothing is done here");
            out.push(condition(Level::Warn, NOT_ACTIVE, message));
        } else if std::mem::take(&mut self.standing.told) {
            out.push(condition(Level::Ok, NOT_ACTIVE, label.to_owned()));
        }
    }

    fn say_failed(&mut self, step: &str, reason: &str, out: &mut Vec<Emission>) {
        self.standing.failed = true;
        out.push(condition(
            Level::Error,
            STEP_FAILED,
            format!("{step}: {reason}"),
        ));
    }

    fn err(&mut self, at: Stamp<Host>, step: &str, reason: &str, out: &mut Vec<Emission>) {
        self.say_failed(step, reason, out);
        self.end(at, Ending::Error, out);
    }

    /// After an error: as if nothing had ever been configured.
    fn put_in_order(&mut self, at: Stamp<Host>, out: &mut Vec<Emission>) {
        let ending = match (self.lifecycle.cleanup)(&mut self.wiring.stage) {
            Ok(()) => Ending::Success,
            Err(reason) => {
                self.say_failed("error processing", &reason, out);
                Ending::Failure
            }
        };
        if let Some(step) = Transition::end(State::ErrorProcessing, ending) {
            self.take(at, step, out);
        }
    }

    fn tell_activity(
        &mut self,
        at: Stamp<Host>,
        active: bool,
        out: &mut Vec<Emission>,
    ) -> Result<(), String> {
        let input = (self.lifecycle.activity)(active);
        let told = self.wiring.step(at, Ok(input), out);
        told.map_err(|refusal| refusal.reason)
    }

    /// Whether the stage has just said that it is at rest, or has had its time.
    pub(super) fn look_whether_at_rest(&mut self, at: Stamp<Host>, out: &mut Vec<Emission>) {
        let Some(since) = self.standing.since else {
            return;
        };
        if self.wiring.outputs.iter().any(&self.lifecycle.at_rest) {
            self.end(at, Ending::Success, out);
        } else if at - since > self.lifecycle.within {
            let within_s = self.lifecycle.within.as_secs_f64();
            let reason = format!("not at rest after {within_s} s");
            self.err(at, self.standing.state.label(), &reason, out);
        }
    }

    /// What latched topics said while nobody listened.
    fn hand_latched(&mut self, at: Stamp<Host>, out: &mut Vec<Emission>) {
        for subscription in 0..self.standing.latched.len() {
            for bytes in self.standing.latched[subscription].clone() {
                let event = Event::Message {
                    subscription,
                    bytes: &bytes,
                };
                if let Err(fault) = self.wiring.handle(at, event, out) {
                    let message = fault.to_string();
                    out.push(condition(Level::Error, "input_refused", message));
                }
            }
        }
    }
}
