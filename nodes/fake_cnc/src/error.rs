//! What the control refuses: a configuration, an input that breaks the contract, or a program.

use metrology::Axis;

/// Why a control cannot be built, or an event cannot be handled.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CncError {
    /// A parameter outside its range.
    #[error("{name} = {value}: must be from {least} to {greatest}")]
    Range {
        /// Name of the parameter.
        name: &'static str,
        /// The value given.
        value: f64,
        /// Least value allowed.
        least: f64,
        /// Greatest value allowed.
        greatest: f64,
    },
    /// A parameter that breaks a rule.
    #[error("{name} = {value}: must be {rule}")]
    Parameter {
        /// Name of the parameter.
        name: &'static str,
        /// The value given.
        value: f64,
        /// The rule, with its unit.
        rule: &'static str,
    },
    /// A start that no axis can have.
    #[error("{name}.{axis} = {value}: must be within the travel of {axis}, {least} to {greatest}")]
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
    #[error("{name}.{axis} = {value}: must be of an axis of this kind that the machine has")]
    StartOfNoAxis {
        /// Name of the parameter.
        name: &'static str,
        /// The axis.
        axis: Axis,
        /// The value given.
        value: f64,
    },
    /// A value of the machine file that a control cannot work with.
    #[error("axes.{axis}.{name} = {value}: must be {rule}")]
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
    #[error("{at}: word {word} = {value}: must be {rule}")]
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
    #[error("{at}: {word} needs a feed, F is {feed}: must be above 0")]
    Feed { at: Place, word: String, feed: f64 },
    #[error("{at}: axis {axis} would go to {value} {unit}, limit {limit} {unit}")]
    Travel {
        at: Place,
        axis: Axis,
        value: f64,
        limit: f64,
        unit: &'static str,
    },
    #[error(
        "{at}: radius at the end of the arc {end_mm} mm, at its start {start_mm} mm, difference limit {limit_mm} mm"
    )]
    ArcRadiusMismatch {
        at: Place,
        start_mm: f64,
        end_mm: f64,
        limit_mm: f64,
    },
    #[error("{at}: arc radius {radius_mm} mm, must be at least {limit_mm} mm")]
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
    #[error("line {line}: more than {limit} lines")]
    TooLong { line: u32, limit: u32 },
}

impl ProgramError {
    /// Line of the program, from 1.
    #[must_use]
    pub const fn line(&self) -> u32 {
        match self {
            Self::EndMissing { line } | Self::TooLong { line, .. } => *line,
            Self::Character { at, .. }
            | Self::CommentOpen { at }
            | Self::CommentNested { at }
            | Self::NumberMissing { at, .. }
            | Self::NumberMalformed { at, .. }
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
            | Self::CommentValue { at, .. } => at.line,
        }
    }
}
