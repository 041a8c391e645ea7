//! The host clock's whole computation: questions, answers and ticks in, questions, answers and maps out.
//!
//! The reference answers every question as it comes. Every other host asks at each tick, and tells its map once a
//! second. It asks with its computer's clock as it is: a clock that was corrected by the map would hide the drift.

use std::collections::VecDeque;
use std::convert::Infallible;

use metrology::sample::{ClockAnswer, ClockExchange, ClockQuestion, HostClock};
use metrology::stamp::Span;
use metrology::{Host, Reference, Stage, Stamp};

use crate::config::HostClockConfig;
use crate::diagnostic::Diagnostic;
use crate::error::HostClockError;
use crate::estimate::{Estimator, Taken};

/// Answers that are remembered, so that none counts twice.
const REMEMBERED: usize = 256;
/// How long no exchange must be senseless until they agree again.
const AGREED: Span = Span::from_nanos(10_000_000_000);

/// What the node is told.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// It is time to ask.
    Ask,
    /// It is time to tell the map.
    Tell,
    /// Somebody asks.
    Question(ClockQuestion),
    /// Somebody is answered.
    Answer(ClockAnswer),
}

/// What the node says.
#[derive(Clone, Debug, PartialEq)]
pub enum Output {
    /// What time is it?
    Question(ClockQuestion),
    /// It is.
    Answer(ClockAnswer),
    /// How the clocks stand to each other.
    Map(HostClock),
    /// A condition worth reporting.
    Diagnostic(Diagnostic),
}

/// The host clock's computation.
#[derive(Clone, Debug)]
pub struct HostClockStage {
    config: HostClockConfig,
    estimator: Estimator,
    answered: VecDeque<(u32, Stamp<Host>)>,
    sequence: u32,
    steps: u32,
    heard_at: Option<Stamp<Host>>,
    is_silent: bool,
    disagreed_at: Option<Stamp<Host>>,
}

impl HostClockStage {
    /// From parameters.
    ///
    /// # Errors
    /// Parameters that cannot work.
    pub fn new(config: &HostClockConfig) -> Result<Self, HostClockError> {
        config.check()?;
        Ok(Self {
            estimator: Estimator::new(config.rules()),
            answered: VecDeque::new(),
            sequence: 0,
            steps: 0,
            heard_at: None,
            is_silent: false,
            disagreed_at: None,
            config: config.clone(),
        })
    }

    fn ask(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        if self.config.is_reference() {
            return;
        }
        self.heard_at.get_or_insert(at);
        self.sequence = self.sequence.wrapping_add(1);
        out.push(Output::Question(ClockQuestion {
            asked_at: at,
            host: self.config.host.clone(),
            sequence: self.sequence,
        }));
    }

    fn answer(&self, at: Stamp<Host>, question: ClockQuestion, out: &mut Vec<Output>) {
        if !self.config.is_reference() {
            return;
        }
        // This host's clock is the one by which the others go.
        let now = Stamp::<Reference>::from_nanos(at.nanos());
        out.push(Output::Answer(ClockAnswer {
            answered_at: now,
            received_at: now,
            reference: self.config.reference.clone(),
            host: question.host,
            sequence: question.sequence,
            asked_at: question.asked_at,
        }));
    }

    fn take_answer(&mut self, at: Stamp<Host>, answer: &ClockAnswer, out: &mut Vec<Output>) {
        if answer.host != self.config.host || self.config.is_reference() {
            return;
        }
        let mut say = |diagnostic| out.push(Output::Diagnostic(diagnostic));
        if answer.reference != self.config.reference {
            self.disagreed_at = Some(at);
            return say(Diagnostic::OtherReference {
                found: answer.reference.clone(),
                expected: self.config.reference.clone(),
            });
        }
        // The answer says when it was asked, so no list of questions is kept: a replay puts an answer in before the tick of the
        // same instant at which it was asked.
        let asked = (answer.sequence, answer.asked_at);
        if self.answered.contains(&asked) {
            return;
        }
        if self.answered.len() == REMEMBERED {
            self.answered.pop_front();
        }
        self.answered.push_back(asked);
        self.heard_at = Some(at);
        let reference = || self.config.reference.clone();
        if std::mem::take(&mut self.is_silent) {
            say(Diagnostic::Heard {
                reference: reference(),
            });
        }
        let exchange = ClockExchange {
            asked_at: answer.asked_at,
            received_at: answer.received_at,
            answered_at: answer.answered_at,
            returned_at: at,
        };
        let taken = self.estimator.take(exchange);
        if !matches!(taken, Ok(Taken::Used | Taken::Doubted { .. })) {
            self.disagreed_at = Some(at);
        }
        match taken {
            Ok(Taken::Stepped { by_s }) => {
                self.steps += 1;
                say(Diagnostic::Stepped {
                    reference: reference(),
                    by_s,
                });
            }
            Ok(Taken::Used | Taken::Doubted { .. }) => {}
            Err(impossible) => say(Diagnostic::Refused(impossible)),
        }
    }

    fn tell(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        if self.config.is_reference() {
            return;
        }
        // A clock that was set back must not make a silence look short.
        self.heard_at = self.heard_at.map(|heard_at| heard_at.min(at));
        self.disagreed_at = self.disagreed_at.map(|since| since.min(at));
        if self.disagreed_at.is_some_and(|since| at - since > AGREED) {
            self.disagreed_at = None;
            out.push(Output::Diagnostic(Diagnostic::Agreed));
        }
        let silence = self.heard_at.map(|heard_at| at - heard_at);
        if let Some(silence) = silence.filter(|silence| *silence > self.config.silence()) {
            self.is_silent = true;
            out.push(Output::Diagnostic(Diagnostic::Silent {
                reference: self.config.reference.clone(),
                silence_s: silence.as_secs_f64(),
            }));
        }
        let Some(estimate) = self.estimator.estimate() else {
            return;
        };
        out.push(Output::Map(HostClock {
            host: self.config.host.clone(),
            reference: self.config.reference.clone(),
            map: estimate.map,
            standard_uncertainty_s: estimate.standard_uncertainty_s,
            drift_standard_uncertainty: estimate.drift_standard_uncertainty,
            bound_s: estimate.bound_s,
            least_round_trip_s: estimate.least_round_trip_s,
            n: u32::try_from(estimate.n).unwrap_or(u32::MAX),
            span_s: estimate.span_s,
            steps: self.steps,
            newest: estimate.newest,
        }));
    }
}

impl Stage for HostClockStage {
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
            Input::Ask => self.ask(at, out),
            Input::Tell => self.tell(at, out),
            Input::Question(question) => self.answer(at, question, out),
            Input::Answer(answer) => self.take_answer(at, &answer, out),
        }
        Ok(())
    }
}
