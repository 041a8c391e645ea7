//! What of a recording could not be used, counted.

use std::collections::BTreeMap;

/// Counts of what was read and of what was left out.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Account {
    /// Runs with readings.
    pub runs: usize,
    /// Readings that the diagnosis gets.
    pub readings: usize,
    /// Segments that began.
    pub segments: usize,
    /// Samples that were left out, by reason.
    pub left_out: BTreeMap<Reason, usize>,
}

/// Why something was left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Reason {
    /// A sample with a value that is no number.
    NotFinite,
    /// An axis state with other axes, or outside of the travel: another machine's.
    OtherMachine,
    /// A sample older than one before it.
    WentBack,
    /// A touch that was told again, or after a later one.
    ToldBefore,
    /// A touch whose number is left out between two of one run.
    TouchMissing,
    /// A touch that came when its run was closed.
    TouchLate,
    /// The recording's clock jumped back by more than two seconds, or ahead by more than a week.
    ClockJump,
    /// A reading between two axis states that lie too far apart.
    InGap,
    /// A reading between two axis states that are no further apart than others, between which the acceleration changes too much for a
    /// path that is known to 0.1 µm.
    TooUneven,
    /// A reading of a circle on the very point where an axis turns round.
    OnReversal,
    /// A run with a hole in the axis states while they moved.
    HoleInMotion,
    /// A reading that is further from its nominal value than any machine is.
    Beyond,
    /// A reading under another zero than its segment's.
    OtherZero,
    /// A reading that stood while the axes moved.
    Stuck,
    /// A reading of which one coordinate stood while it was to move, as at the end of a range.
    StuckInPart,
    /// A grid or length reading with a turned rotary axis.
    RotaryTurned,
    /// A touch of something that the machine file does not have.
    UnknownFeature,
    /// A segment that did not run to its end.
    Failed,
    /// A segment that the end of the recording, a jump of the clock or the next segment cut.
    Cut,
    /// An end without a begin.
    NotBegun,
    /// A segment that came long after its stamp.
    SegmentLate,
    /// Ticks beyond what a run may hold.
    TooLong,
    /// A sample after more than a month, or of one thermometer too many.
    TooMuch,
    /// A run during which the compensation's messages broke off; its last value was held.
    CompensationHeld,
}

impl Reason {
    /// Whether something could not be used that the recording should have had. What was not completed, no method
    /// uses or is used all the same is no loss: runs that the machine broke off, readings with a turned rotary axis or at a
    /// sharp turn of the path, segments and clocks that came otherwise, samples of a live run that came twice or behind a newer one.
    #[must_use]
    pub const fn is_loss(self) -> bool {
        match self {
            Self::NotFinite
            | Self::OtherMachine
            | Self::InGap
            | Self::HoleInMotion
            | Self::Beyond
            | Self::OtherZero
            | Self::Stuck
            | Self::StuckInPart
            | Self::UnknownFeature
            | Self::TouchMissing
            | Self::TouchLate
            | Self::Cut
            | Self::NotBegun
            | Self::TooLong
            | Self::TooMuch => true,
            Self::ClockJump
            | Self::WentBack
            | Self::ToldBefore
            | Self::TooUneven
            | Self::OnReversal
            | Self::RotaryTurned
            | Self::Failed
            | Self::SegmentLate
            | Self::CompensationHeld => false,
        }
    }

    /// What a person is told, after a number.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::NotFinite => "samples were no numbers",
            Self::OtherMachine => "axis states were of another machine",
            Self::WentBack => "samples were older than one before them",
            Self::ToldBefore => "touches were told before, or a later one before them",
            Self::TouchLate => {
                "touches came so long after their run that it was closed without them"
            }
            Self::TouchMissing => {
                "touches are not in the recording, as the numbers of those before and after say"
            }
            Self::ClockJump => "times the clock jumped back, or ahead by more than a week",
            Self::InGap => "readings lie in holes of the axis states",
            Self::TooUneven => {
                "readings lie where the acceleration changes too much for the rate of the axis states"
            }
            Self::OnReversal => {
                "readings lie on the point where an axis turns round, before or after its play"
            }
            Self::HoleInMotion => {
                "runs lack axis states in the midst of their motion and are left out"
            }
            Self::Beyond => "readings are more than 10 m or 10 rad from their nominal values",
            Self::OtherZero => "readings belong to another zero",
            Self::Stuck => "readings stood while the axes moved",
            Self::StuckInPart => {
                "readings stood in one coordinate that was to move, as at the end of a range; the other one is used"
            }
            Self::RotaryTurned => "readings were taken with a turned rotary axis",
            Self::UnknownFeature => "touches are of features that the machine file does not have",
            Self::Failed => "segments did not run to their end and are left out",
            Self::Cut => "segments were cut; they are used up to there",
            Self::NotBegun => "segments ended whose begin was not recorded",
            Self::SegmentLate => {
                "segments came more than 2 s after their stamp, or bear that of another clock; they begin and end when they came"
            }
            Self::TooLong => "samples were beyond what one run may hold",
            Self::TooMuch => {
                "samples came after more than 31 days, or of more than 200 thermometers, and are no part of the history"
            }
            Self::CompensationHeld => {
                "runs had a hole in the compensation; its last value was held"
            }
        }
    }
}

impl Account {
    pub(super) fn note(&mut self, reason: Reason) {
        self.note_many(reason, 1);
    }

    pub(super) fn note_many(&mut self, reason: Reason, n: usize) {
        if n > 0 {
            *self.left_out.entry(reason).or_default() += n;
        }
    }

    /// How often a reason came up.
    #[must_use]
    pub fn count(&self, reason: Reason) -> usize {
        self.left_out.get(&reason).copied().unwrap_or(0)
    }

    /// What was left out, in words.
    pub fn remarks(&self) -> impl Iterator<Item = String> {
        self.lines(|_| true)
    }

    /// The entries that are a loss of the recording, in words.
    pub fn losses(&self) -> impl Iterator<Item = String> {
        self.lines(Reason::is_loss)
    }

    /// The other entries, in words.
    pub fn notes(&self) -> impl Iterator<Item = String> {
        self.lines(|reason| !reason.is_loss())
    }

    fn lines(&self, is_wanted: fn(Reason) -> bool) -> impl Iterator<Item = String> {
        let wanted = self.left_out.iter();
        let wanted = wanted.filter(move |(reason, _)| is_wanted(**reason));
        wanted.map(|(reason, n)| format!("{n} {}", reason.text()))
    }
}
