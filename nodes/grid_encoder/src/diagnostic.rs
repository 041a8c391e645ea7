//! What the stage has to say besides its model; each is in the bag and on `/diagnostics`.

use metrology::number::number;
use metrology::sample::TestPlane;

use crate::error::IdentifyError;

pub use metrology::Severity;

/// Why a recording is not used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(
    missing_docs,
    reason = "each sentence names its fields with their units"
)]
pub enum Refusal {
    #[error("zero {found} in a recording of zero {expected}: the grid was zeroed within it")]
    MixedZeroIds { expected: u32, found: u32 },
    #[error("readings of another plane than {expected:?}")]
    WrongPlane { expected: TestPlane },
    #[error("{found} stations found, {planned} planned, at least {least} needed")]
    TooFewStations {
        found: usize,
        planned: u32,
        least: usize,
    },
    #[error("{found} points found, at least {least} needed")]
    TooFewPoints { found: usize, least: usize },
    #[error("no reading for {longest_s:.3} s, {limit_s:.3} s allowed")]
    Gap { longest_s: f64, limit_s: f64 },
    #[error(
        "the recorded field reaches {reach_mm:.3} mm from its middle, the plate {plate_radius_mm:.3} mm"
    )]
    OffPlate { reach_mm: f64, plate_radius_mm: f64 },
    #[error("{n} of {of} readings are not finite")]
    NotFinite { n: usize, of: usize },
    #[error("{n_beyond} readings beyond the {limit} that are kept")]
    TooManyReadings { limit: usize, n_beyond: usize },
    #[error("no readings")]
    NoReadings,
    #[error("broken off before its end")]
    NotCompleted,
    #[error("run {next} began before this one ended")]
    NotEnded { next: u32 },
    #[error("ended, but its begin was not seen")]
    NotBegun,
    #[error("no plane is told")]
    NoPlane,
}

/// A condition worth reporting.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(
    missing_docs,
    reason = "each sentence names its fields with their units"
)]
pub enum Diagnostic {
    #[error("run {run} is not used: {refusal}")]
    Refused { run: u32, refusal: Refusal },
    #[error("run {run}: {n} readings are not finite and left out")]
    LeftOut { run: u32, n: usize },
    #[error("run {run}: {n} readings were told before, or a later one before them; left out")]
    ToldBefore { run: u32, n: usize },
    #[error(
        "run {run}: {points} points of {readings} readings, {outliers} outliers set aside, standard uncertainty {standard_uncertainty_um:.4} µm"
    )]
    Recorded {
        run: u32,
        points: usize,
        readings: usize,
        outliers: usize,
        standard_uncertainty_um: f64,
    },
    #[error("run {run}: {found} of {planned} stations found")]
    StationsMissing {
        run: u32,
        found: usize,
        planned: u32,
    },
    #[error(
        "fitted {recordings} recordings: rank {rank} of {unknowns} unknowns, {estimable} of {coefficients} coefficients estimable, residual {residual_um:.4} µm"
    )]
    Fitted {
        recordings: usize,
        rank: usize,
        unknowns: usize,
        estimable: usize,
        coefficients: usize,
        residual_um: f64,
    },
    #[error(
        "singular values {kept:.3e} counted and {dropped:.3e} not are close: the rank is a matter of opinion"
    )]
    NoGap { kept: f64, dropped: f64 },
    #[error(
        "the model lacks something: lack-of-fit p {lack_of_fit_p:.2e}, correlation of neighbouring residuals {correlation:.2}"
    )]
    LackOfFit {
        lack_of_fit_p: f64,
        correlation: f64,
    },
    #[error(
        "besides noise there is an error of the plate, {plate_um:.3} µm at a place, and from recording to recording a shift of {shift_um:.3} µm, a ramp of {ramp_um:.3} µm and a strain of {strain_um:.3} µm at the edge (standard deviations): the uncertainties hold them"
    )]
    Disturbed {
        plate_um: f64,
        shift_um: f64,
        ramp_um: f64,
        strain_um: f64,
    },
    #[error("{n} of {of} equations weighed down as outliers")]
    Outliers { n: usize, of: usize },
    #[error("not fitted: {reason}")]
    NotFitted { reason: IdentifyError },
    #[error("the oldest recording, run {run}, was dropped: {limit} are kept")]
    Dropped { run: u32, limit: usize },
    #[error("clock went back by {by_s} s: positions and open recordings dropped", by_s = number(*by_s))]
    ClockWentBack { by_s: f64 },
    #[error("{n} grid readings waited for positions in vain")]
    Unpaired { n: usize },
}

impl Diagnostic {
    /// How urgent it is.
    #[must_use]
    pub fn severity(&self) -> Severity {
        match self {
            Self::Recorded { .. } | Self::Fitted { .. } | Self::Disturbed { .. } => Severity::Info,
            Self::NotFitted { .. } | Self::ClockWentBack { .. } => Severity::Error,
            _ => Severity::Warn,
        }
    }

    /// The lasting condition to which it belongs: one of severity `Info` ends what others began.
    #[must_use]
    pub fn condition(&self) -> &'static str {
        match self {
            Self::Fitted { .. }
            | Self::NoGap { .. }
            | Self::LackOfFit { .. }
            | Self::Outliers { .. }
            | Self::NotFitted { .. } => "fit",
            Self::Disturbed { .. } => "disturbance",
            _ => "recording",
        }
    }
}
