//! Conditions worth reporting, each with the values that belong to it.

use metrology::number::number;
use metrology::{Author, Axis, OffsetFault};

use crate::fault::FaultKind;
use crate::latch::NoTouch;
use crate::protocol::JointLimit;
use crate::waiting::Wait;
use crate::watch::Trouble;

pub use metrology::Severity;

/// Why there is no connection.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Lost {
    /// Nobody listens.
    #[error("nobody listens: {reason}")]
    Refused {
        /// The system's word for it.
        reason: String,
    },
    /// LinuxCNC ended or dropped the connection.
    #[error("the controller closed the connection: {reason}")]
    Closed {
        /// The system's word for it.
        reason: String,
    },
    /// A password was wrong or a step of the greeting was refused.
    #[error("the greeting was refused at `{step}`")]
    GreetingRefused {
        /// Word of the step.
        step: String,
    },
    /// An answer did not come.
    #[error("no answer to `{request}` within {limit_s} s", limit_s = number(*limit_s))]
    Silent {
        /// The request.
        request: String,
        /// The limit, s.
        limit_s: f64,
    },
    /// What came is not the protocol.
    #[error("a line of more than {limit_bytes} bytes came")]
    Nonsense {
        /// The limit.
        limit_bytes: usize,
    },
}

/// A condition of the bridge or of the controller.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Condition {
    /// The connection stands.
    #[error("connected")]
    Connected,
    /// The connection does not stand; it is tried again.
    #[error("not connected: {0}")]
    Disconnected(Lost),
    /// The emergency stop was pressed or released.
    #[error("emergency stop {}", if *.on { "on" } else { "released" })]
    Estop {
        /// Whether it is on.
        on: bool,
    },
    /// The emergency stop is on at a machine that no axis of which is homed: it was never released.
    #[error("emergency stop on: the machine has not been switched on yet")]
    NotSwitchedOn,
    /// The drives were switched.
    #[error("drives {}", if *.on { "on" } else { "off" })]
    Drives {
        /// Whether they are on.
        on: bool,
    },
    /// Whether every joint knows where it is.
    #[error("{}", if *.homed { "all axes homed" } else { "not homed" })]
    Homed {
        /// Whether all are homed.
        homed: bool,
    },
    /// Homing took too long.
    #[error("homing was not over within {limit_s} s", limit_s = number(*limit_s))]
    HomingTimeout {
        /// The limit, s.
        limit_s: f64,
    },
    /// A joint stands on a limit, or has left it.
    #[error("axis {axis}: limit {limit:?}")]
    AxisLimit {
        /// Axis.
        axis: Axis,
        /// Which limit.
        limit: JointLimit,
    },
    /// The controller reported an error.
    #[error("controller: {message}")]
    ControllerError {
        /// What kind.
        kind: FaultKind,
        /// Its words.
        message: String,
    },
    /// A line that answers nothing.
    #[error("unexpected line from the controller: {line:?}")]
    UnexpectedLine {
        /// The line.
        line: String,
    },
    /// The controller refused a command.
    #[error("the controller refused `{request}`")]
    CommandRefused {
        /// The command.
        request: String,
    },
    /// Records come (again).
    #[error("positions come")]
    Sampling,
    /// The sampler ended or could not be started.
    #[error("no positions: {reason}")]
    SamplerEnded {
        /// Why.
        reason: String,
    },
    /// Nothing has come from the sampler.
    #[error("no positions for {silence_s} s", silence_s = number(*silence_s))]
    SamplerSilent {
        /// For how long, s.
        silence_s: f64,
    },
    /// The bridge itself was not at work.
    #[error(
        "the bridge stood still for {for_s} s (a busy or stopped computer): what came meanwhile is read now",
        for_s = number(*for_s)
    )]
    StoodStill {
        /// For how long, s.
        for_s: f64,
    },
    /// Records were lost.
    #[error("{lost} servo periods were not recorded")]
    SamplerOverrun {
        /// How many.
        lost: u32,
    },
    /// A line of the sampler is no record.
    #[error(
        "a record with {columns} columns came, the joints need {expected}, or a column is no number"
    )]
    MalformedSample {
        /// Columns that came.
        columns: usize,
        /// Columns that a record has.
        expected: usize,
    },
    /// The servo thread does not keep its period.
    #[error("the servo thread runs {:.2} % slow, limit {:.2} %", .slip * 100.0, .limit * 100.0)]
    ServoSlip {
        /// Relative slip; 1.
        slip: f64,
        /// From where on it is reported; 1.
        limit: f64,
    },
    /// The servo thread keeps its period again.
    #[error("the servo thread keeps its period")]
    ServoInTime,
    /// The probe input changed in a way that gives no touch.
    #[error("line {line}: probe changed {}", match .reason { NoTouch::AfterGap => "after a gap in the records", NoTouch::AtRest => "while nothing moved" })]
    TouchUnusable {
        /// Program line.
        line: u32,
        /// Why.
        reason: NoTouch,
    },
    /// The program does not go on by itself.
    #[error("{0}")]
    ProgramWaits(Wait),
    /// The program goes on, or has ended.
    #[error("the program does not wait")]
    ProgramGoesOn,
    /// The program was stopped.
    #[error("{0}")]
    Stopped(Trouble),
    /// The control's modal state is another one for a program of machine coordinates.
    #[error("machine coordinates: {changed}; it is put back at the end")]
    FrameSet {
        /// What was set and what was found.
        changed: String,
    },
    /// The modal state after a program is not the one that was found.
    #[error(
        "machine coordinates: the state that was found could not be put back: {left}: set it at the control"
    )]
    StateLeft {
        /// What is left.
        left: String,
    },
    /// Compensation was refused; the last good one stays.
    #[error("{fault}")]
    CompensationRefused {
        /// Why.
        fault: OffsetFault,
        /// How many were for this reason since the start.
        times: u64,
    },
    /// What was refused comes no more.
    #[error("no compensation was refused for {limit_s} s", limit_s = number(*limit_s))]
    CompensationRefusedNoMore {
        /// The limit, s.
        limit_s: f64,
    },
    /// Compensation has stopped coming; HAL fades it out.
    #[error("no compensation for {limit_s} s: fading out", limit_s = number(*limit_s))]
    CompensationStale {
        /// The limit, s.
        limit_s: f64,
    },
    /// Compensation comes.
    #[error("compensation is passed on")]
    CompensationFresh,
    /// Two publish compensation: nobody is followed.
    #[error(
        "two publishers of compensation are heard ({one} and {other}): offsets fade to zero and no program that touches runs; end one of them (`ros2 topic info --verbose /compensation` lists both)"
    )]
    CompensationContested {
        /// One of them.
        one: Author,
        /// The other.
        other: Author,
    },
    /// One has been alone for a while.
    #[error("one publisher of compensation is heard: it is followed")]
    CompensationUncontested,
    /// Compensation waits for homing; what HAL had of it fades.
    #[error("compensation is held back until every axis is homed")]
    CompensationHeld,
    /// Axes were homed again before what HAL had of an offset can have faded.
    #[error(
        "homed again {after_s:.1} s after offsets of up to {greatest_um:.1} um began to fade: where HAL takes longer the zero is off by what was left; home once more"
    )]
    HomedUnderOffset {
        /// Time between, s.
        after_s: f64,
        /// Greatest offset of a linear axis, um.
        greatest_um: f64,
    },
    /// Somebody publishes compensation, and none has come.
    #[error(
        "no compensation has come for {limit_s} s although {publishers} publish it: is the publisher active, and is its quality of service compatible?",
        limit_s = number(*limit_s)
    )]
    CompensationNeverCame {
        /// How many publish it.
        publishers: usize,
        /// The limit, s.
        limit_s: f64,
    },
    /// HAL refused a setting.
    #[error("HAL: {message}")]
    HalRefused {
        /// Its words.
        message: String,
    },
}

impl Condition {
    /// Which condition it is, snake case; the same name with [`Severity::Info`] clears it.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Connected | Self::Disconnected(_) => "connection",
            Self::Estop { .. } | Self::NotSwitchedOn => "emergency_stop",
            Self::Drives { .. } => "drives",
            Self::Homed { .. } | Self::HomingTimeout { .. } => "homing",
            Self::AxisLimit { .. } => "axis_limit",
            Self::ControllerError { .. } => "controller_error",
            Self::UnexpectedLine { .. } => "unexpected_line",
            Self::CommandRefused { .. } => "command_refused",
            Self::Sampling | Self::SamplerEnded { .. } | Self::SamplerSilent { .. } => "sampler",
            Self::StoodStill { .. } => "stood_still",
            Self::SamplerOverrun { .. } => "sampler_overrun",
            Self::MalformedSample { .. } => "malformed_sample",
            Self::ServoSlip { .. } | Self::ServoInTime => "servo_period",
            Self::TouchUnusable { .. } => "touch_unusable",
            Self::CompensationRefused { .. } | Self::CompensationRefusedNoMore { .. } => {
                "compensation_refused"
            }
            Self::CompensationContested { .. } | Self::CompensationUncontested => {
                "compensation_publishers"
            }
            Self::ProgramWaits(_) | Self::ProgramGoesOn => "program_waits",
            Self::Stopped(Trouble::Tripped { .. }) => "probe_tripped",
            Self::Stopped(Trouble::Astray { .. }) => "axis_astray",
            Self::FrameSet { .. } => "machine_frame",
            Self::StateLeft { .. } => "modal_state",
            Self::HomedUnderOffset { .. } => "homed_under_offset",
            Self::CompensationStale { .. }
            | Self::CompensationFresh
            | Self::CompensationHeld
            | Self::CompensationNeverCame { .. } => "compensation",
            Self::HalRefused { .. } => "hal",
        }
    }

    /// How bad it is.
    #[must_use]
    pub const fn severity(&self) -> Severity {
        match self {
            Self::Connected
            | Self::Sampling
            | Self::ServoInTime
            | Self::CompensationFresh
            | Self::CompensationHeld
            | Self::CompensationRefusedNoMore { .. }
            | Self::CompensationUncontested
            | Self::ProgramGoesOn
            | Self::FrameSet { .. }
            | Self::Estop { on: false }
            | Self::Drives { on: true }
            | Self::Homed { homed: true }
            | Self::AxisLimit {
                limit: JointLimit::Free,
                ..
            } => Severity::Info,
            Self::NotSwitchedOn
            | Self::Drives { on: false }
            | Self::ProgramWaits(_)
            | Self::StateLeft { .. }
            | Self::HomedUnderOffset { .. }
            | Self::CompensationNeverCame { .. }
            | Self::Homed { homed: false }
            | Self::AxisLimit {
                limit: JointLimit::MinSoft | JointLimit::MaxSoft,
                ..
            }
            | Self::UnexpectedLine { .. }
            | Self::ControllerError {
                kind: FaultKind::RealtimeDelay,
                ..
            }
            | Self::ServoSlip { .. }
            | Self::StoodStill { .. }
            | Self::TouchUnusable { .. }
            | Self::CompensationRefused { .. }
            | Self::CompensationStale { .. } => Severity::Warn,
            _ => Severity::Error,
        }
    }
}
