//! What the control refuses: a configuration, an input that breaks the contract, or a program.

use metrology::Axis;
use metrology::bound::{BoundError, NAME_BYTES};
use metrology::number::{number, quantity};

use crate::diagnostic::Diagnostic;

/// Why a control cannot be built, or an event cannot be handled.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CncError {
    /// A parameter outside its limits.
    #[error(transparent)]
    Bound(#[from] BoundError),
    /// A parameter that breaks a rule.
    #[error("{name} = {value}: must be {rule}", value = quantity(name, *value))]
    Parameter {
        /// Name of the parameter.
        name: &'static str,
        /// The value given.
        value: f64,
        /// The rule, with its unit.
        rule: &'static str,
    },
    /// A start that no axis can have.
    #[error("{name}.{axis} = {value}: must be within the travel of {axis}, {least} to {greatest}", value = quantity(name, *value), least = number(*least), greatest = quantity(name, *greatest))]
    StartOutsideTravel {
        /// Name of the parameter, which has the unit.
        name: &'static str,
        /// The axis.
        axis: Axis,
        /// The value given.
        value: f64,
        /// Least position of the machine file.
        least: f64,
        /// Greatest position of the machine file.
        greatest: f64,
    },
    /// A start of an axis that is none of this kind.
    #[error("{name}.{axis} = {value}: must be of an axis of this kind that the machine has", value = number(*value))]
    StartOfNoAxis {
        /// Name of the parameter.
        name: &'static str,
        /// The axis.
        axis: Axis,
        /// The value given.
        value: f64,
    },
    /// A value of the machine file that a control cannot work with.
    #[error("axes.{axis}.{name} = {value}: must be {rule}", value = quantity(name, *value))]
    MachineAxis {
        /// The axis.
        axis: Axis,
        /// Key in the machine file.
        name: &'static str,
        /// The value given.
        value: f64,
        /// The range that is allowed.
        rule: &'static str,
    },
    /// A linear letter with rotary keys, or the reverse.
    #[error("axes.{axis}: keys of the other kind of axis; X Y Z take mm, A B C take deg")]
    AxisKind {
        /// The axis.
        axis: Axis,
    },
    /// A full-closed loop without a scale.
    #[error("feedback.{axis} = scale: the machine file has no scale_resolution_um for this axis")]
    NoScale {
        /// The axis.
        axis: Axis,
    },
    /// A table of tools that no machine has.
    #[error("tool_lengths_mm: {count} tools: must be at most {limit}")]
    TooManyTools {
        /// How many it has.
        count: usize,
        /// How many it may have.
        limit: usize,
    },
    /// A machine without axes.
    #[error("axes: the machine has none")]
    NoAxes,
}

/// Where in a program something stands, both counted from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Line.
    pub line: u32,
    /// Column, in characters.
    pub column: u32,
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "line {}, column {}", self.line, self.column)
    }
}

/// Why a program is refused before anything moves.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(
    missing_docs,
    reason = "the sentence of each variant is its documentation"
)]
pub enum ProgramError {
    #[error("{at}: character {character:?} has no meaning here")]
    Character { at: Place, character: char },
    #[error("{at}: comment is not closed on its line")]
    CommentOpen { at: Place },
    #[error("{at}: comment within a comment")]
    CommentNested { at: Place },
    #[error("{at}: word {letter} has no number")]
    NumberMissing { at: Place, letter: char },
    #[error("{at}: number of word {letter} is malformed: {text:?}")]
    NumberMalformed {
        at: Place,
        letter: char,
        text: String,
    },
    #[error(
        "{at}: number of word {letter} is no finite number that this control can hold: {text:?}, limit {limit}",
        limit = number(*limit)
    )]
    NumberTooLarge {
        at: Place,
        letter: char,
        text: String,
        limit: f64,
    },
    #[error("{at}: {word} is not executed by this control: {remedy}")]
    NotExecuted {
        at: Place,
        word: String,
        remedy: &'static str,
    },
    #[error(
        "{at}: spindle speed S{speed_rpm} is beyond the machine's {limit_rpm} 1/min (spindle.max_speed_rpm of the machine file)",
        speed_rpm = number(*speed_rpm),
        limit_rpm = number(*limit_rpm)
    )]
    SpindleSpeed {
        at: Place,
        speed_rpm: f64,
        limit_rpm: f64,
    },
    #[error(
        "{at}: spindle speed S{speed_rpm}: the machine file has no spindle; add spindle: {{max_speed_rpm: ...}} to it",
        speed_rpm = number(*speed_rpm)
    )]
    NoSpindle { at: Place, speed_rpm: f64 },
    #[error(
        "{at}: H{number}: the control knows the tools H0 to H{greatest} (tool_lengths_mm of its parameters)",
        number = metrology::number::number(*number)
    )]
    NoSuchTool {
        at: Place,
        number: f64,
        greatest: usize,
    },
    #[error(
        "{at}: {word} starts from where a touch ended, which is not known before the program runs; move to a known point first"
    )]
    PositionUnknown { at: Place, word: String },
    #[error(
        "{at}: {word} changes the coordinates, and the program is in machine coordinates by (frame: machine)"
    )]
    FixedFrame { at: Place, word: String },
    #[error(
        "{at}: (frame: machine): the offset {offset} by G92 or G52 is in effect; clear it by G92.1, or by {zeros}"
    )]
    ShiftInEffect {
        at: Place,
        offset: String,
        zeros: String,
    },
    #[error(
        "{at}: (frame: machine): every work system has an offset, and none is overwritten: {systems}; clear one of them, such as by G10 L2 P9 X0 Y0 Z0 A0 B0 C0 R0 for G59.3 with the machine's axes"
    )]
    NoZeroSystem { at: Place, systems: String },
    #[error("{at}: word {word} is not known to this control")]
    UnknownWord { at: Place, word: String },
    #[error("{at}: the machine has no axis {axis}")]
    NoSuchAxis { at: Place, axis: Axis },
    #[error("{at}: word {word} is given twice in one block")]
    DuplicateWord { at: Place, word: String },
    #[error("{at}: {word} and {other} exclude each other in one block")]
    Conflict {
        at: Place,
        word: String,
        other: String,
    },
    #[error("{at}: word {word} has nothing to act on in this block")]
    UnusedWord { at: Place, word: String },
    #[error("{at}: word {word} = {value}: must be {rule}", value = number(*value))]
    Value {
        at: Place,
        word: char,
        value: f64,
        rule: &'static str,
    },
    #[error("{at}: {word} needs {needs}")]
    Needs {
        at: Place,
        word: String,
        needs: &'static str,
    },
    #[error("{at}: {word} needs a feed, F is {feed}: must be above 0", feed = number(*feed))]
    Feed { at: Place, word: String, feed: f64 },
    #[error("{at}: {word} at {feed} {unit}: the axes together reach {limit} {unit} at most", feed = number(*feed), limit = number(*limit))]
    FeedTooFast {
        at: Place,
        word: String,
        feed: f64,
        limit: f64,
        unit: &'static str,
    },
    #[error("{at}: axis {axis} would go to {value} {unit}, limit {limit} {unit}", value = number(*value), limit = number(*limit))]
    Travel {
        at: Place,
        axis: Axis,
        value: f64,
        limit: f64,
        unit: &'static str,
    },
    #[error(
        "{at}: radius at the end of the arc {end_mm} mm, at its start {start_mm} mm, difference limit {limit_mm} mm", start_mm = number(*start_mm), end_mm = number(*end_mm), limit_mm = number(*limit_mm))]
    ArcRadiusMismatch {
        at: Place,
        start_mm: f64,
        end_mm: f64,
        limit_mm: f64,
    },
    #[error("{at}: arc radius {radius_mm} mm, must be at least {limit_mm} mm", radius_mm = number(*radius_mm), limit_mm = number(*limit_mm))]
    ArcRadiusTooSmall {
        at: Place,
        radius_mm: f64,
        limit_mm: f64,
    },
    #[error(
        "{at}: absolute arc starts where a touch ended, which is not known before the program runs; move to a known point first"
    )]
    ArcAfterTouch { at: Place },
    #[error("{at}: touch moves axis {axis}, only X Y Z have a direction of approach")]
    RotaryTouch { at: Place, axis: Axis },
    #[error("{at}: touch ends where it starts")]
    TouchWithoutLength { at: Place },
    #[error("{at}: word {word} follows M2, nothing may")]
    AfterEnd { at: Place, word: String },
    #[error("line {line}: program ends without M2")]
    EndMissing { line: u32 },
    #[error("{at}: {what} comment {text:?}: must be {rule}")]
    CommentValue {
        at: Place,
        what: &'static str,
        text: String,
        rule: &'static str,
    },
    #[error(
        "{at}: the name in the {what} comment has {bytes} bytes, at most {NAME_BYTES}: shorten it"
    )]
    NameTooLong {
        at: Place,
        what: &'static str,
        bytes: usize,
    },
    #[error("line {line} touches: {why}")]
    Contested { line: u32, why: Box<Diagnostic> },
    #[error("line {line}: more than {limit} lines")]
    TooLong { line: u32, limit: u32 },
    #[error("line {line}: longer than {limit} characters")]
    LineTooLong { line: u32, limit: usize },
    #[error("line {line}: more than {limit} {what}")]
    TooMany {
        line: u32,
        what: &'static str,
        limit: usize,
    },
}

impl ProgramError {
    /// Line of the program, from 1.
    #[must_use]
    pub const fn line(&self) -> u32 {
        match self {
            Self::EndMissing { line }
            | Self::Contested { line, .. }
            | Self::TooLong { line, .. }
            | Self::LineTooLong { line, .. }
            | Self::TooMany { line, .. } => *line,
            Self::Character { at, .. }
            | Self::CommentOpen { at }
            | Self::CommentNested { at }
            | Self::NumberMissing { at, .. }
            | Self::NumberMalformed { at, .. }
            | Self::NumberTooLarge { at, .. }
            | Self::NotExecuted { at, .. }
            | Self::SpindleSpeed { at, .. }
            | Self::NoSpindle { at, .. }
            | Self::NoSuchTool { at, .. }
            | Self::PositionUnknown { at, .. }
            | Self::FixedFrame { at, .. }
            | Self::ShiftInEffect { at, .. }
            | Self::NoZeroSystem { at, .. }
            | Self::FeedTooFast { at, .. }
            | Self::UnknownWord { at, .. }
            | Self::NoSuchAxis { at, .. }
            | Self::DuplicateWord { at, .. }
            | Self::Conflict { at, .. }
            | Self::UnusedWord { at, .. }
            | Self::Value { at, .. }
            | Self::Needs { at, .. }
            | Self::Feed { at, .. }
            | Self::Travel { at, .. }
            | Self::ArcRadiusMismatch { at, .. }
            | Self::ArcRadiusTooSmall { at, .. }
            | Self::ArcAfterTouch { at }
            | Self::RotaryTouch { at, .. }
            | Self::TouchWithoutLength { at }
            | Self::AfterEnd { at, .. }
            | Self::NameTooLong { at, .. }
            | Self::CommentValue { at, .. } => at.line,
        }
    }
}
