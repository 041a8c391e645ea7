//! Why a breakdown is refused.

use metrology::Axis;
use metrology::fit::ShapeError;
use metrology::least_squares::FitError;
use metrology::number::{degrees, number, quantity};

/// Why a breakdown is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(
    missing_docs,
    reason = "each message names its fields; recordings and samples count from 0"
)]
pub enum BreakdownError {
    /// Nothing was given.
    #[error("no circular recording was given")]
    NoRecordings,
    /// Instruments of some recordings alone.
    #[error("{n} instruments for {recordings} recordings: state one for each, or none")]
    InstrumentCount { n: usize, recordings: usize },
    /// Too few samples.
    #[error("recording {recording}: {n} samples, at least {least} are needed")]
    TooFewSamples {
        recording: usize,
        n: usize,
        least: usize,
    },
    /// A length or feed is not above 0.
    #[error("recording {recording}: {quantity} = {value}: must be finite and above 0", value = metrology::number::quantity(quantity, *value))]
    NotPositive {
        recording: usize,
        quantity: &'static str,
        value: f64,
    },
    /// An uncertainty is below 0.
    #[error("recording {recording}: {quantity} = {value}: must be finite and not below 0", value = metrology::number::quantity(quantity, *value))]
    Negative {
        recording: usize,
        quantity: &'static str,
        value: f64,
    },
    /// The centre is not finite.
    #[error("recording {recording}: the centre is not finite")]
    CentreNotFinite { recording: usize },
    /// A sample is not finite.
    #[error("recording {recording}, sample {sample}: a number is not finite")]
    SampleNotFinite { recording: usize, sample: usize },
    /// A deviation is so large that it is none.
    #[error(
        "recording {recording}, sample {sample}: radial deviation {deviation_mm} mm is beyond {limit_mm} mm", deviation_mm = number(*deviation_mm), limit_mm = number(*limit_mm))]
    DeviationTooLarge {
        recording: usize,
        sample: usize,
        deviation_mm: f64,
        limit_mm: f64,
    },
    /// Samples are not in order of time.
    #[error("recording {recording}, sample {sample}: time {time_s} s after {previous_s} s", time_s = number(*time_s), previous_s = number(*previous_s))]
    TimeRunsBack {
        recording: usize,
        sample: usize,
        time_s: f64,
        previous_s: f64,
    },
    /// The angle runs against the stated sense.
    #[error("recording {recording}: angles sweep {}, against the stated sense", degrees(*swept_rad))]
    SenseContradicted { recording: usize, swept_rad: f64 },
    /// Fewer samples than parameters.
    #[error("{n} usable samples for {n_parameters} parameters in one plane")]
    TooFewForModel { n: usize, n_parameters: usize },
    /// A number of the configuration is out of its limits.
    #[error("{key} = {value}: must be above {above} and below {below}", value = quantity(key, *value), above = number(*above), below = quantity(key, *below))]
    Config {
        key: &'static str,
        value: f64,
        above: f64,
        below: f64,
    },
    /// An axis has its pitch stated twice.
    #[error("pitches: axis {axis} is given twice")]
    PitchTwice { axis: Axis },
    /// An axis has no pitch to search among.
    #[error("pitches: axis {axis} has no candidate")]
    NoCandidate { axis: Axis },
    /// The linear fit failed.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// The circle for the circularity failed.
    #[error(transparent)]
    Shape(#[from] ShapeError),
}
