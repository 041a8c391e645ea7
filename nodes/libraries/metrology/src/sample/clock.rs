//! What two hosts say to each other of their clocks, and what follows from it.

use crate::ClockMap;
use crate::stamp::{Host, Reference, Span, Stamp};

/// A host asks what time it is.
#[derive(Clone, Debug, PartialEq)]
pub struct ClockQuestion {
    /// When it asked, by its own clock.
    pub asked_at: Stamp<Host>,
    /// Who asks.
    pub host: String,
    /// Counts its questions.
    pub sequence: u32,
}

/// The reference's answer.
#[derive(Clone, Debug, PartialEq)]
pub struct ClockAnswer {
    /// When the answer was sent.
    pub answered_at: Stamp<Reference>,
    /// When the question came.
    pub received_at: Stamp<Reference>,
    /// Who answers.
    pub reference: String,
    /// Who asked.
    pub host: String,
    /// As in the question.
    pub sequence: u32,
    /// As in the question.
    pub asked_at: Stamp<Host>,
}

/// The four stamps of one question and its answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClockExchange {
    /// When the question left.
    pub asked_at: Stamp<Host>,
    /// When it came to the reference.
    pub received_at: Stamp<Reference>,
    /// When the answer left.
    pub answered_at: Stamp<Reference>,
    /// When it came back.
    pub returned_at: Stamp<Host>,
}

impl ClockExchange {
    /// Time that question and answer were on their way together.
    #[must_use]
    pub fn round_trip(&self) -> Span {
        let away = (self.returned_at - self.asked_at).nanos();
        let there = (self.answered_at - self.received_at).nanos();
        Span::from_nanos(away.saturating_sub(there))
    }
}

/// How a host's clock stands to the reference's.
#[derive(Clone, Debug, PartialEq)]
pub struct HostClock {
    /// Whose clock.
    pub host: String,
    /// By whose clock the cell goes.
    pub reference: String,
    /// The way from the one to the other.
    pub map: ClockMap<Host, Reference>,
    /// Standard uncertainty of the offset at `map.at()`, the unequal length of the two ways included, s.
    pub standard_uncertainty_s: f64,
    /// Standard uncertainty of the drift.
    pub drift_standard_uncertainty: f64,
    /// What the offset can be off at most, however unequal the two ways are, s.
    pub bound_s: f64,
    /// The shortest time that a question and its answer were on their way, s.
    pub least_round_trip_s: f64,
    /// Exchanges behind it.
    pub n: u32,
    /// Time that they cover, s.
    pub span_s: f64,
    /// Steps of one of the clocks since the node started.
    pub steps: u32,
    /// The newest exchange.
    pub newest: ClockExchange,
}

impl HostClock {
    /// Standard uncertainty of the offset when the host's clock shows `at`, s: it grows with the age of the estimate.
    #[must_use]
    pub fn standard_uncertainty_at_s(&self, at: Stamp<Host>) -> f64 {
        let age_s = (at - self.map.at()).as_secs_f64();
        self.standard_uncertainty_s
            .hypot(self.drift_standard_uncertainty * age_s)
    }
}
