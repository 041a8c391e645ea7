//! Conditions worth reporting that are not measurements.

use metrology::fit::ShapeError;
use metrology::number::number;
use metrology::{Axis, Machine, Stamp};

use crate::queue::QueueMiss;

/// Something that a person should know; `Display` says it in one line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Diagnostic {
    /// The controller's stamps ran backwards; the queue was emptied.
    #[error(
        "controller time went back from {} to {} ns; queue emptied, {waiting} waiting touches rejected",
        from.nanos(), to.nanos()
    )]
    ClockWentBack {
        /// Newest stamp before.
        from: Stamp<Machine>,
        /// Stamp that came.
        to: Stamp<Machine>,
        /// Touches that waited for their positions.
        waiting: u32,
    },
    /// A position was not a finite number.
    #[error("position of axis {axis} at {} ns is {value}", at.nanos(), value = number(*value))]
    PositionNotFinite {
        /// The axis.
        axis: Axis,
        /// The controller's stamp.
        at: Stamp<Machine>,
        /// What it was.
        value: f64,
    },
    /// Touches were lost on the way.
    #[error("touches between {after} and {before} did not arrive")]
    TriggersLost {
        /// Last number that arrived.
        after: u32,
        /// Next number that arrived.
        before: u32,
    },
    /// A touch was told again, or after a later one.
    #[error("touch {sequence} was told before, or a later one before it; not used")]
    ToldBefore {
        /// Number of the touch.
        sequence: u32,
    },
    /// More than a node holds: a stream without an end, or two who speak at once.
    #[error("{held} {what} are held already, the most there may be; one more is not used")]
    TooMany {
        /// How many.
        held: usize,
        /// Of what.
        what: &'static str,
    },
    /// A touch was corrected with feed times latency, since the queue had no answer.
    #[error("touch {sequence} corrected with feed times latency: {miss}")]
    CorrectedByFeed {
        /// Number of the touch.
        sequence: u32,
        /// Why the queue had no answer.
        miss: QueueMiss,
    },
    /// A calibrated latency was refused.
    #[error(
        "latency of {latency_s} s with standard uncertainty {standard_uncertainty_s} s refused: must be finite and not significantly negative", latency_s = number(*latency_s), standard_uncertainty_s = number(*standard_uncertainty_s))]
    LatencyRefused {
        /// Latency, s.
        latency_s: f64,
        /// Standard uncertainty, s.
        standard_uncertainty_s: f64,
    },
    /// A latency was calibrated before the one in use.
    #[error("a latency that was calibrated {by_s:.1} s before the one in use is not used")]
    LatencyOlder {
        /// How long before, s.
        by_s: f64,
    },
    /// A face of a block was not measured.
    #[error(
        "run {run}: face {axis} of block {block} was not measured, {rejected} touches rejected"
    )]
    FaceMissing {
        /// Run.
        run: u32,
        /// Block.
        block: String,
        /// Face.
        axis: Axis,
        /// Touches of this face that were rejected.
        rejected: u32,
    },
    /// A face was touched other than along its own normal.
    #[error(
        "run {run}: touch {sequence} of face {axis} of block {block} came along [{:.4}, {:.4}, {:.4}], not along its normal",
        approach[0], approach[1], approach[2]
    )]
    FaceNotAlongNormal {
        /// Run.
        run: u32,
        /// Number of the touch.
        sequence: u32,
        /// Block.
        block: String,
        /// Face.
        axis: Axis,
        /// Approach.
        approach: [f64; 3],
    },
    /// A shape was not evaluated.
    #[error("run {run}: {feature} not evaluated, {rejected} points rejected: {reason}")]
    ShapeNotEvaluated {
        /// Run.
        run: u32,
        /// Artefact.
        feature: String,
        /// Points that were rejected.
        rejected: u32,
        /// Why.
        reason: ShapeError,
    },
    /// The touches of one feature were made at different poses of the rotary axes.
    #[error(
        "run {run}: {feature} was touched with axis {axis} from {:.5} to {:.5} deg, at most {:.5} deg apart is one pose; not evaluated",
        least_rad.to_degrees(), greatest_rad.to_degrees(), limit_rad.to_degrees()
    )]
    MixedPoses {
        /// Run.
        run: u32,
        /// Artefact.
        feature: String,
        /// The axis.
        axis: Axis,
        /// Its least position, rad.
        least_rad: f64,
        /// Its greatest position, rad.
        greatest_rad: f64,
        /// Greatest difference that is still one pose, rad.
        limit_rad: f64,
    },
    /// A feature that the machine file does not have.
    #[error("run {run}: the machine file has no feature \"{feature}\"")]
    UnknownFeature {
        /// Run.
        run: u32,
        /// Its name.
        feature: String,
    },
    /// A stylus that the machine file does not have; the run is not evaluated.
    #[error("run {run}: the machine file has no stylus \"{stylus}\"; the run is not evaluated")]
    UnknownStylus {
        /// Run.
        run: u32,
        /// Its name.
        stylus: String,
    },
    /// A run began before the last one ended; the last one is not evaluated.
    #[error("run {run} did not end before run {next} began; it is not evaluated")]
    RunNotEnded {
        /// The run that was open.
        run: u32,
        /// The run that began.
        next: u32,
    },
    /// A run ended that had not begun.
    #[error("run {run} ended, but its begin was not seen; it is not evaluated")]
    RunNotBegun {
        /// The run.
        run: u32,
    },
}
