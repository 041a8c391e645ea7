//! What to ask an agent next, by the numbers of what it told.
//!
//! ```text
//!   probe ── what there is ──> current ── what holds now, and n, the next number ──> sample from n, for ever
//! ```
//!
//! Each part of the stream says the next number n'. Observations are lost when
//!
//! ```text
//!   first > n            the oldest that the agent still has, by the head of an answer          (1)
//!   s_1 > n              the first of a part, when all of the agent is asked                     (2)
//!   OUT_OF_RANGE         the agent's own word for n < first                                      (3)
//! ```
//!
//! After a loss, `current` says what holds now, so that no old value stays. After a cut line nothing is lost
//! while the agent still has n: `current` tells again what was told up to n, and the stream goes on from n. An
//! agent with another `instanceId` has started anew and counts from 1.
//!
//! # References
//! \[1\] MTConnect standard, part 1 (fundamentals): request `sample` with `from`, `count`, `interval` and
//! `heartbeat`; buffer and sequence numbers of an agent.

use metrology::stamp::Span;

use crate::condition::{Condition, Lost};
use crate::config::AgentConfig;
use crate::document::{Answer, DataItem, Header, Numbered, read};
use crate::mapping::{Mapping, Use};
use crate::multipart::{PART_LIMIT, PartFlaw, Parts, boundary};
use crate::observation::Observation;
use crate::stage::IoCommand;

/// What the agent was asked last.
#[derive(Clone, Debug)]
enum Asked {
    Nothing,
    Probe,
    Current,
    Sample { parts: Option<Parts>, body: Vec<u8> },
}

/// What follows from an answer.
#[derive(Clone, Debug, PartialEq)]
pub enum Heard {
    /// The machine told something.
    Observation(Observation),
    /// Something worth reporting.
    Condition(Condition),
    /// Something to be done outside.
    Io(IoCommand),
}

/// The conversation with one agent.
#[derive(Clone, Debug)]
pub struct AgentLink {
    config: AgentConfig,
    wanted: Vec<String>,
    asked: Asked,
    instance: Option<u64>,
    next: Option<u64>,
    gap_from: Option<u64>,
    resumes: bool,
    lost: u64,
}

impl AgentLink {
    /// With an agent that has not been asked yet.
    #[must_use]
    pub fn new(config: &AgentConfig, mapping: &Mapping) -> Self {
        let wanted = mapping.uses().filter(|(_, used)| **used != Use::Nothing);
        Self {
            config: config.clone(),
            wanted: wanted.map(|(key, _)| key.to_owned()).collect(),
            asked: Asked::Nothing,
            instance: None,
            next: None,
            gap_from: None,
            resumes: false,
            lost: 0,
        }
    }

    /// A stream is silent for no longer than this.
    #[must_use]
    pub fn silence_limit(&self) -> Option<Span> {
        let is_streaming = matches!(self.asked, Asked::Sample { .. });
        let heartbeat_s = f64::from(self.config.heartbeat_ms) * 1e-3;
        is_streaming.then(|| Span::from_secs_f64(2.0 * heartbeat_s + 1.0))
    }

    fn path(&self, what: &str) -> String {
        match self.config.device.as_str() {
            "" => format!("/{what}"),
            device => format!("/{device}/{what}"),
        }
    }

    fn asked_path(&self) -> String {
        self.path(match self.asked {
            Asked::Nothing => "",
            Asked::Probe => "probe",
            Asked::Current => "current",
            Asked::Sample { .. } => "sample",
        })
    }

    /// Begins, or begins again after the connection was lost.
    pub fn begin(&mut self) -> IoCommand {
        self.asked = Asked::Probe;
        self.resumes = self.next.is_some();
        let path = self.path("probe");
        IoCommand::Get { path }
    }

    fn ask_current(&mut self, out: &mut Vec<Heard>) {
        self.asked = Asked::Current;
        let path = self.path("current");
        out.push(Heard::Io(IoCommand::Get { path }));
    }

    fn ask_sample(&mut self, from: u64, out: &mut Vec<Heard>) {
        self.asked = Asked::Sample {
            parts: None,
            body: Vec::new(),
        };
        let (config, path) = (&self.config, self.path("sample"));
        let (interval, heartbeat, count) = (config.interval_ms, config.heartbeat_ms, config.count);
        let path =
            format!("{path}?from={from}&interval={interval}&heartbeat={heartbeat}&count={count}");
        out.push(Heard::Io(IoCommand::Stream { path }));
    }

    /// Takes a whole answer.
    ///
    /// # Errors
    /// When it is of no use; the conversation begins again.
    pub fn answered(&mut self, status: u16, body: &[u8], out: &mut Vec<Heard>) -> Result<(), Lost> {
        let path = self.asked_path();
        let answer = match read(body) {
            Ok(answer) => answer,
            Err(_) if status != 200 => return Err(Lost::Status { path, status }),
            Err(flaw) => return Err(Lost::Document { path, flaw }),
        };
        match (answer, &self.asked) {
            (Answer::Devices { instance_id, items }, Asked::Probe) => {
                self.meet(instance_id, out);
                self.compare(&items, out);
                self.ask_current(out);
                Ok(())
            }
            (
                Answer::Streams {
                    header,
                    observations,
                    malformed,
                },
                Asked::Current,
            ) => {
                report_malformed(malformed, out);
                self.holds_now(header, observations, out);
                Ok(())
            }
            (
                Answer::Streams {
                    header,
                    observations,
                    malformed,
                },
                Asked::Sample { .. },
            ) => {
                report_malformed(malformed, out);
                self.happened(header, observations, out);
                Ok(())
            }
            (Answer::Error { errors }, Asked::Sample { .. }) if is_out_of_range(&errors) => {
                self.gap_from = self.next.take();
                out.push(Heard::Io(IoCommand::Disconnect));
                self.ask_current(out);
                Ok(())
            }
            (Answer::Error { errors }, _) => {
                let (code, text) = errors.into_iter().next().unwrap_or_default();
                Err(Lost::Refused { path, code, text })
            }
            _ => Err(Lost::AnotherAnswer { path }),
        }
    }

    /// The stream has begun.
    pub fn began(&mut self, content_type: &str) {
        if let Asked::Sample { parts, body } = &mut self.asked {
            *parts = boundary(content_type).map(Parts::new);
            body.clear();
        }
    }

    /// Bytes of the stream have come.
    ///
    /// # Errors
    /// As [`Self::answered`].
    pub fn received(&mut self, bytes: &[u8], out: &mut Vec<Heard>) -> Result<(), Lost> {
        let Asked::Sample { parts, body } = &mut self.asked else {
            return Ok(());
        };
        let Some(stream) = parts else {
            body.extend_from_slice(bytes);
            let length = body.len();
            return if length > PART_LIMIT {
                Err(Lost::Parts(PartFlaw::TooLong { length }))
            } else {
                Ok(())
            };
        };
        let mut whole = Vec::new();
        let cut = stream.receive(bytes, |part| whole.push(part.to_vec()));
        cut.map_err(Lost::Parts)?;
        for part in whole {
            // A part may end the stream: what comes behind it belongs to nobody.
            if !matches!(self.asked, Asked::Sample { .. }) {
                break;
            }
            self.answered(200, &part, out)?;
        }
        Ok(())
    }

    /// The stream has ended; an agent answers so when it refuses.
    ///
    /// # Errors
    /// As [`Self::answered`]; [`Lost::Closed`] where the end says nothing.
    pub fn ended(&mut self, reason: &str, status: u16, out: &mut Vec<Heard>) -> Result<(), Lost> {
        if let Asked::Sample { parts: None, body } = &mut self.asked
            && !body.is_empty()
        {
            let body = std::mem::take(body);
            return self.answered(status, &body, out);
        }
        Err(Lost::Closed {
            reason: reason.to_owned(),
        })
    }

    /// Notes the agent's instance; whether it is another one than before.
    fn meet(&mut self, instance: u64, out: &mut Vec<Heard>) -> bool {
        let before = self.instance.replace(instance);
        match before.filter(|before| *before != instance) {
            Some(before) => {
                let now = instance;
                out.push(Heard::Condition(Condition::AgentRestarted { before, now }));
                (self.next, self.gap_from, self.resumes) = (None, None, false);
                true
            }
            None => false,
        }
    }

    fn compare(&self, items: &[DataItem], out: &mut Vec<Heard>) {
        let has = |key: &String| {
            items
                .iter()
                .any(|item| item.id == *key || item.name == *key)
        };
        let missing = self.wanted.iter().filter(|key| !has(key));
        let keys: Vec<_> = missing.map(String::as_str).collect();
        out.push(Heard::Condition(if keys.is_empty() {
            Condition::Offered
        } else {
            let keys = keys.join(", ");
            Condition::NotOffered { keys }
        }));
    }

    fn gap(&mut self, from: u64, to: u64, out: &mut Vec<Heard>) {
        let lost = to.saturating_sub(from);
        if lost == 0 {
            return;
        }
        self.lost += lost;
        out.push(Heard::Condition(Condition::SequenceGap {
            from,
            to,
            lost,
            total: self.lost,
        }));
    }

    /// `current`: everything that holds; after a cut line only what was told before it, for the rest comes again.
    fn holds_now(&mut self, header: Header, observations: Vec<Numbered>, out: &mut Vec<Heard>) {
        self.meet(header.instance_id, out);
        let resumed = self.next.filter(|_| self.resumes);
        self.resumes = false;
        let until = match (self.gap_from.take(), resumed) {
            (None, Some(next))
                if (header.first_sequence..=header.next_sequence).contains(&next) =>
            {
                next
            }
            (from, resumed) => {
                if let Some(from) = from.or(resumed) {
                    self.gap(from, header.first_sequence.max(from), out);
                }
                header.next_sequence
            }
        };
        let held = observations
            .into_iter()
            .filter(|numbered| numbered.sequence < until);
        out.extend(held.map(|numbered| Heard::Observation(numbered.observation)));
        self.next = Some(until);
        self.ask_sample(until, out);
    }

    /// A part of the stream.
    fn happened(&mut self, header: Header, observations: Vec<Numbered>, out: &mut Vec<Heard>) {
        if self.meet(header.instance_id, out) {
            out.push(Heard::Io(IoCommand::Disconnect));
            return self.ask_current(out);
        }
        let next = self.next.unwrap_or(header.next_sequence);
        let begins = observations.first().map(|numbered| numbered.sequence);
        let is_whole = self.config.device.is_empty();
        let hole = begins.filter(|begins| is_whole && *begins > next);
        let lost_to = match header.first_sequence > next {
            true => Some(header.first_sequence),
            false => hole,
        };
        let new = observations
            .into_iter()
            .filter(|numbered| numbered.sequence >= next);
        out.extend(new.map(|numbered| Heard::Observation(numbered.observation)));
        self.next = Some(header.next_sequence);
        if let Some(to) = lost_to {
            self.gap(next, to, out);
            out.push(Heard::Io(IoCommand::Disconnect));
            self.ask_current(out);
        }
    }
}

fn is_out_of_range(errors: &[(String, String)]) -> bool {
    errors.iter().any(|(code, _)| code == "OUT_OF_RANGE")
}

fn report_malformed(count: usize, out: &mut Vec<Heard>) {
    if count > 0 {
        out.push(Heard::Condition(Condition::MalformedObservations { count }));
    }
}
