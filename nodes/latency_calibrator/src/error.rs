//! Parameters that cannot work and inputs that break the stage's contract.

use machine::ChainError;
use metrology::Axis;
use metrology::bound::BoundError;
use metrology::number::number;

/// Why a stage is not built, or an event not taken.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LatencyCalibratorError {
    /// A parameter outside its limits.
    #[error(transparent)]
    Parameter(#[from] BoundError),
    /// The log forgets what a touch needs before it comes.
    #[error(
        "log_samples = {log_samples} at control.servo_period_ms = {servo_period_ms}: covers {covered_ms} ms, feed_window_ms + hold_ms need {needed_ms} ms", servo_period_ms = number(*servo_period_ms), covered_ms = number(*covered_ms), needed_ms = number(*needed_ms))]
    LogTooShort {
        /// Positions that the log holds.
        log_samples: usize,
        /// Time between them, ms.
        servo_period_ms: f64,
        /// Time that they cover, ms.
        covered_ms: f64,
        /// Time that is needed, ms.
        needed_ms: f64,
    },
    /// The machine file's chain cannot be read.
    #[error("chain: {error}")]
    Chain {
        /// Where and why.
        #[source]
        error: ChainError,
    },
    /// Without repeatability there is no uncertainty.
    #[error(
        "probe.repeatability_um = {repeatability_um} µm: must be from {least} to {greatest} µm, touches are weighted by it", repeatability_um = number(*repeatability_um), least = number(*machine::file::REPEATABILITY_UM.start()), greatest = number(*machine::file::REPEATABILITY_UM.end()))]
    NoRepeatability {
        /// Repeatability of the machine file, µm.
        repeatability_um: f64,
    },
    /// The approach of a trigger is no unit vector.
    #[error("trigger {sequence}: approach has length {length}, must be 1", length = number(*length))]
    ApproachNotUnit {
        /// Number of the trigger.
        sequence: u32,
        /// Length of the vector.
        length: f64,
    },
    /// A sample lacks an axis that the machine file has.
    #[error("{sample} lacks axis {axis} of the machine file")]
    AxisMissing {
        /// Which sample.
        sample: &'static str,
        /// The axis.
        axis: Axis,
    },
}
