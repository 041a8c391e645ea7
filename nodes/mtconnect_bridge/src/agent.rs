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
//!   s_k+1 > s_k + 1      within a part, when all of the agent is asked                           (4)
//! ```
//!
//! What (4) shows is asked again once (`sample` from s_k + 1 without an interval), and what came behind it is taken from that
//! answer; a number that is missing there too is lost. While losses follow each other nothing is asked so.
//!
//! The numbers count the observations of all devices. Where one is asked for, the number of its own observations in a gap
//! is unknown: the condition has no number of losses.
//!
//! After a loss, `current` lists all that holds now, so no old value stays. What was published is not published again.
//! An agent that loses again is asked after pauses that double, until a part follows on the one before it. A part that
//! cannot be read is left out: the next one says by (2), or by its head, what was lost. After such a part or a cut line
//! nothing else is lost while the agent still has n: `current` repeats the values up to n, and the stream goes on from n.
//! An agent with another `instanceId` has started anew and counts from 1; one whose numbers go back without it as well:
//! that is reported, and all that holds is taken anew. What comes with a number of before is left out and counted.
//!
//! Its `probe` is compared with the mapping: what is not there, units that differ, positions in work coordinates.
//!
//! # References
//! \[1\] MTConnect standard, part 1 (fundamentals): request `sample` with `from`, `count`, `interval` and
//! `heartbeat`; buffer and sequence numbers of an agent.

use std::collections::BTreeMap;

use metrology::stamp::{Host, Span, Stamp};

use crate::condition::{Condition, Lost};
use crate::config::{AgentConfig, Settings};
use crate::document::{Answer, DocumentFlaw, Header, Numbered, read_mended};
use crate::multipart::{PART_LIMIT, PartFlaw, Parts, boundary};
use crate::observation::{Observation, Told};
use crate::offer::Wanted;
use crate::stage::IoCommand;
use crate::text;

mod happened;

/// Keys whose last number is remembered; more are no machine's.
const KEY_LIMIT: usize = 100_000;

/// What the agent was asked last.
#[derive(Clone, Debug)]
enum Asked {
    Nothing,
    Probe,
    Current,
    Sample {
        parts: Option<Parts>,
        body: Vec<u8>,
    },
    /// What is missing within a part, once.
    Again,
    /// Nothing; `current` is asked then.
    Pausing {
        until: Stamp<Host>,
    },
}

/// What follows from an answer.
#[derive(Clone, Debug, PartialEq)]
pub enum Heard {
    /// The machine told something.
    Observation(Observation),
    /// Something that the machine told before, maybe long ago, and that still holds.
    Held(Observation),
    /// A document was read.
    Read {
        /// Invalid letters that were replaced.
        replaced: usize,
        /// Observations that could not be read.
        left: usize,
    },
    /// A part of a stream cannot be read and is left out.
    PartLeftOut {
        /// What was asked.
        path: String,
        /// Why.
        flaw: DocumentFlaw,
    },
    /// Observations of a part that came before are left out.
    Repeated {
        /// How many.
        count: u64,
    },
    /// Something worth reporting.
    Condition(Condition),
    /// Something to be done outside.
    Io(IoCommand),
}

/// Parts in a row that cannot be read before no value counts as known any more.
const MOST_UNREADABLE: u32 = 3;

/// Numbers in a row that an agent may call out of range; beyond, it refuses.
const MOST_OUT_OF_RANGE: u8 = 2;

/// The conversation with one agent.
#[derive(Clone, Debug)]
pub struct AgentLink {
    config: AgentConfig,
    wanted: Wanted,
    /// First and longest pause before `current` is asked after repeated losses.
    pauses: (Span, Span),
    pause: Span,
    asked: Asked,
    instance: Option<u64>,
    next: Option<u64>,
    gap_from: Option<u64>,
    passes_over: bool,
    /// Numbers in a row that the agent called out of range.
    out_of_range: u8,
    resumes: bool,
    lost: u64,
    /// Gaps in the numbers of all devices, where one is asked for.
    gaps: u64,
    /// How often the numbers went back.
    backs: u64,
    told: BTreeMap<String, u64>,
    progress: bool,
    /// Parts of the stream that could not be read, since the last that could.
    unreadable: u32,
}

impl AgentLink {
    /// With an agent that has not been asked yet.
    #[must_use]
    pub fn new(settings: &Settings) -> Self {
        Self {
            config: settings.agent.clone(),
            wanted: Wanted::new(&settings.mapping),
            pauses: (settings.reconnect_first, settings.reconnect_longest),
            pause: Span::default(),
            asked: Asked::Nothing,
            instance: None,
            next: None,
            gap_from: None,
            passes_over: false,
            out_of_range: 0,
            resumes: false,
            lost: 0,
            gaps: 0,
            backs: 0,
            told: BTreeMap::new(),
            progress: false,
            unreadable: 0,
        }
    }

    /// Time has passed: asks what a pause has kept back.
    pub fn tick(&mut self, now: Stamp<Host>, out: &mut Vec<Heard>) {
        if let Asked::Pausing { until } = self.asked
            && now >= until
        {
            self.ask_current(out);
        }
    }

    /// Whether a part of a stream has been read since this was asked.
    pub fn take_progress(&mut self) -> bool {
        std::mem::take(&mut self.progress)
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
            Asked::Nothing | Asked::Pausing { .. } => "",
            Asked::Probe => "probe",
            Asked::Current => "current",
            Asked::Sample { .. } | Asked::Again => "sample",
        })
    }

    /// Begins, or begins again after the connection was lost.
    pub fn begin(&mut self) -> IoCommand {
        self.asked = Asked::Probe;
        self.unreadable = 0;
        self.resumes = self.next.is_some();
        // No value is known any more, so all that hold are published again.
        self.told.clear();
        let path = self.path("probe");
        IoCommand::Get { path }
    }

    fn ask_current(&mut self, out: &mut Vec<Heard>) {
        self.asked = Asked::Current;
        let path = self.path("current");
        out.push(Heard::Io(IoCommand::Get { path }));
    }

    /// After a loss: at once, and after doubling pauses where losses follow each other.
    fn ask_again(&mut self, at: Stamp<Host>, out: &mut Vec<Heard>) {
        out.push(Heard::Io(IoCommand::Disconnect));
        let (first, longest) = self.pauses;
        let pause = self.pause;
        let twice = Span::from_nanos(pause.nanos().saturating_mul(2));
        self.pause = twice.max(first).min(longest);
        if pause == Span::default() {
            return self.ask_current(out);
        }
        self.asked = Asked::Pausing { until: at + pause };
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

    /// Takes a whole answer that came at `at`.
    ///
    /// # Errors
    /// When it is of no use; the conversation begins again.
    pub fn answered(
        &mut self,
        at: Stamp<Host>,
        status: u16,
        body: &[u8],
        out: &mut Vec<Heard>,
    ) -> Result<(), Lost> {
        let path = self.asked_path();
        let body = text::decode(body);
        let (answer, mended) = match read_mended(&body.text) {
            Ok(read) => read,
            Err(_) if status != 200 => return Err(Lost::Status { path, status }),
            Err(flaw) => {
                self.pass_over();
                return Err(Lost::Document { path, flaw });
            }
        };
        let left = match &answer {
            Answer::Streams { malformed, .. } => *malformed,
            _ => 0,
        };
        let replaced = body.replaced + mended;
        out.push(Heard::Read { replaced, left });
        self.understood(at, path, answer, out)
    }

    fn understood(
        &mut self,
        at: Stamp<Host>,
        path: String,
        answer: Answer,
        out: &mut Vec<Heard>,
    ) -> Result<(), Lost> {
        match (answer, &self.asked) {
            (
                Answer::Devices {
                    instance_id, items, ..
                },
                Asked::Probe,
            ) => {
                self.meet(instance_id, out);
                let compared = self.wanted.compare(&items);
                out.extend(compared.into_iter().map(Heard::Condition));
                self.ask_current(out);
                Ok(())
            }
            (
                Answer::Streams {
                    header,
                    observations,
                    malformed,
                    unstamped,
                    unread,
                },
                Asked::Current | Asked::Sample { .. } | Asked::Again,
            ) => {
                report(malformed, unstamped, out);
                match self.asked {
                    Asked::Current => self.holds_now(header, observations, out),
                    _ => self.happened(at, header, (observations, &unread), out),
                }
                Ok(())
            }
            (Answer::Error { errors }, Asked::Sample { .. } | Asked::Again)
                if is_out_of_range(&errors) && self.out_of_range < MOST_OUT_OF_RANGE =>
            {
                self.out_of_range += 1;
                self.gap_from = self.next.take();
                self.ask_again(at, out);
                Ok(())
            }
            (Answer::Error { errors }, _) => {
                let (code, text) = errors.into_iter().next().unwrap_or_default();
                Err(Lost::Refused { path, code, text })
            }
            _ => Err(Lost::AnotherAnswer { path }),
        }
    }

    /// A part that cannot be read would be sent again and again: the stream goes on behind it.
    fn pass_over(&mut self) {
        if matches!(self.asked, Asked::Sample { .. }) {
            self.passes_over = true;
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
    pub fn received(
        &mut self,
        at: Stamp<Host>,
        bytes: &[u8],
        out: &mut Vec<Heard>,
    ) -> Result<(), Lost> {
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
        for part in whole {
            // A part may end the stream: what comes behind it belongs to nobody.
            if !matches!(self.asked, Asked::Sample { .. }) {
                break;
            }
            match self.answered(at, 200, &part, out) {
                // The next part may be good.
                Err(Lost::Document { path, flaw }) if self.unreadable < MOST_UNREADABLE => {
                    self.unreadable += 1;
                    out.push(Heard::PartLeftOut { path, flaw });
                }
                taken => taken?,
            }
        }
        match cut {
            Err(flaw) if matches!(self.asked, Asked::Sample { .. }) => {
                self.pass_over();
                Err(Lost::Parts(flaw))
            }
            _ => Ok(()),
        }
    }

    /// The stream has ended; an agent answers so when it refuses.
    ///
    /// # Errors
    /// As [`Self::answered`]; [`Lost::Closed`] where the end says nothing.
    pub fn ended(
        &mut self,
        at: Stamp<Host>,
        reason: &str,
        status: u16,
        out: &mut Vec<Heard>,
    ) -> Result<(), Lost> {
        // Only a stream ends so: this one was given up before.
        if !matches!(self.asked, Asked::Sample { .. }) {
            return Ok(());
        }
        if let Asked::Sample { parts: None, body } = &mut self.asked
            && !body.is_empty()
        {
            let body = std::mem::take(body);
            return self.answered(at, status, &body, out);
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
                // An agent that always starts anew is asked after growing pauses as well.
                self.passes_over = false;
                self.told.clear();
                true
            }
            None => false,
        }
    }

    /// The agent counts anew without saying so: its numbers say nothing of what was told.
    fn went_back(&mut self, from: u64, to: u64, out: &mut Vec<Heard>) {
        self.backs += 1;
        let count = self.backs;
        out.push(Heard::Condition(Condition::SequenceBack {
            from,
            to,
            count,
        }));
        (self.next, self.gap_from, self.resumes) = (None, None, false);
        self.passes_over = false;
        self.told.clear();
    }

    fn gap(&mut self, from: u64, to: u64, out: &mut Vec<Heard>) {
        let lost = to.saturating_sub(from);
        if lost == 0 {
            return;
        }
        let condition = match self.config.device.as_str() {
            "" => {
                // An agent may name any number up to the greatest.
                self.lost = self.lost.saturating_add(lost);
                let total = self.lost;
                Condition::SequenceGap {
                    from,
                    to,
                    lost,
                    total,
                }
            }
            device => {
                self.gaps += 1;
                Condition::DeviceGap {
                    device: device.to_owned(),
                    from,
                    to,
                    count: self.gaps,
                }
            }
        };
        out.push(Heard::Condition(condition));
    }

    /// `current`: everything that holds; after a cut line only what was told before it, for the rest comes again.
    fn holds_now(&mut self, header: Header, observations: Vec<Numbered>, out: &mut Vec<Heard>) {
        self.meet(header.instance_id, out);
        if let Some(from) = self.gap_from.filter(|from| header.next_sequence < *from) {
            self.went_back(from, header.next_sequence, out);
        }
        let resumed = self.next.filter(|_| self.resumes);
        self.resumes = false;
        let passes_over = std::mem::take(&mut self.passes_over);
        let until = match (self.gap_from.take(), resumed) {
            (None, Some(next))
                if !passes_over
                    && (header.first_sequence..=header.next_sequence).contains(&next) =>
            {
                next
            }
            (from, resumed) => {
                if let Some(from) = from.or(resumed) {
                    let to = if passes_over {
                        header.next_sequence
                    } else {
                        header.first_sequence
                    };
                    self.gap(from, to.max(from), out);
                }
                // What was told is not asked again, also of an agent whose `current` stays behind its stream.
                header.next_sequence.max(self.next.unwrap_or_default())
            }
        };
        for numbered in observations {
            let is_news = self.is_news(&numbered);
            if numbered.sequence < until && is_news {
                self.note(&numbered);
                out.push(Heard::Held(numbered.observation));
            }
        }
        self.next = Some(until);
        self.ask_sample(until, out);
    }

    /// Whether it was not published before. Of a condition several may be active, and each report is one of them.
    fn is_news(&self, numbered: &Numbered) -> bool {
        let last = self.told.get(&numbered.observation.key);
        let is_alarm = matches!(numbered.observation.told, Told::Alarm(_));
        is_alarm || last.is_none_or(|last| numbered.sequence > *last)
    }

    fn note(&mut self, numbered: &Numbered) {
        let key = &numbered.observation.key;
        if let Some(last) = self.told.get_mut(key) {
            *last = numbered.sequence;
        } else if self.told.len() < KEY_LIMIT {
            self.told.insert(key.clone(), numbered.sequence);
        }
    }
}

fn is_out_of_range(errors: &[(String, String)]) -> bool {
    errors.iter().any(|(code, _)| code == "OUT_OF_RANGE")
}

fn report(malformed: usize, unstamped: usize, out: &mut Vec<Heard>) {
    if malformed > 0 {
        let count = malformed;
        out.push(Heard::Condition(Condition::MalformedObservations { count }));
    }
    if unstamped > 0 {
        let count = unstamped;
        out.push(Heard::Condition(Condition::Unstamped { count }));
    }
}
