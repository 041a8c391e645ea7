//! Conditions worth reporting: what was found, and what spoils it.

use metrology::Axis;
use metrology::number::number;

use crate::error::EstimateError;
use crate::expectation::Reason;

pub use metrology::Severity;

/// Something that a person should know; `Display` says it in one line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Diagnostic {
    /// Location errors were estimated.
    #[error(
        "run {run}: {visits} visits of {}, merit of the poses {merit:.2}; spatial standard deviation {:.2} µm, with the model {:.2} µm",
        counted(*spheres), before_mm * 1e3, after_mm * 1e3
    )]
    Calibrated {
        /// Run.
        run: u32,
        /// Visits used.
        visits: usize,
        /// Spheres.
        spheres: usize,
        /// Merit of the poses.
        merit: f64,
        /// Spatial standard deviation of the nominal machine, mm.
        before_mm: f64,
        /// The same with the model, mm.
        after_mm: f64,
        /// Pairs of harmonics that were needed.
        harmonics: usize,
        /// p value of lack of fit.
        lack_of_fit_p: f64,
    },
    /// A model was held against other poses.
    #[error(
        "run {run}: {visits} visits, {:.2} µm rms without the model, {:.2} µm with it ({:.2} µm at most); expected {:.2} µm by scatter, model and allowances, of which the stated noise is {:.2} µm",
        before_mm * 1e3, after_mm * 1e3, greatest_mm * 1e3, allowed_mm * 1e3, expected_mm * 1e3
    )]
    Verified {
        /// Run.
        run: u32,
        /// Visits.
        visits: usize,
        /// Root mean square without the model, mm.
        before_mm: f64,
        /// Root mean square with it, mm.
        after_mm: f64,
        /// Greatest with it, mm.
        greatest_mm: f64,
        /// What the stated noise would leave, mm.
        expected_mm: f64,
        /// What scatter, model and allowances would leave, mm.
        allowed_mm: f64,
        /// p value of more than that.
        allowed_p: f64,
        /// Whether the sphere's place is that of the calibration.
        same_places: bool,
    },
    /// A verification left more than its uncertainties explain.
    #[error(
        "run {run}: {:.2} µm rms are left where {:.2} µm are expected (p = {p:.1e}); {}{}",
        after_mm * 1e3, allowed_mm * 1e3, advice(reason),
        if *has_allowance { "" } else { "; no allowance is stated: state what the linear axes and error motions may add" }
    )]
    BeyondExpected {
        /// Run.
        run: u32,
        /// Root mean square that is left, mm.
        after_mm: f64,
        /// What was expected, mm.
        allowed_mm: f64,
        /// p value.
        p: f64,
        /// The likely reason.
        reason: Reason,
        /// Whether allowances are stated.
        has_allowance: bool,
    },
    /// What the poses cannot see.
    #[error("run {run}: {names} cannot be told apart by these poses")]
    NotEstimable {
        /// Run.
        run: u32,
        /// Names of the components.
        names: String,
    },
    /// Nothing is stated of what is alike in all visits.
    #[error(
        "run {run}: no allowance is stated for set-up, linear axes and error motions: uncertainties are those of the noise alone"
    )]
    NoAllowance {
        /// Run.
        run: u32,
    },
    /// The poses tell too little.
    #[error("run {run}: merit of the poses is {merit:.3}, at least {least} is wanted", least = number(*least))]
    LowMerit {
        /// Run.
        run: u32,
        /// Merit.
        merit: f64,
        /// What is wanted.
        least: f64,
    },
    /// A visit was left out of the fit.
    #[error("run {run}: sphere {sphere} at {} is {:.1} µm off, which chance does not explain; left out", in_words(pose), off_mm * 1e3)]
    Doubtful {
        /// Run.
        run: u32,
        /// Sphere.
        sphere: String,
        /// Rotary positions, deg.
        pose: Vec<(Axis, f64)>,
        /// Size of its residual, mm.
        off_mm: f64,
    },
    /// The model does not describe the machine to within the noise.
    #[error("run {run}: lack of fit, p = {p:.2e}; uncertainties enlarged {enlargement:.2} times")]
    LackOfFit {
        /// Run.
        run: u32,
        /// p value.
        p: f64,
        /// Factor on the standard uncertainties.
        enlargement: f64,
    },
    /// A sphere was found less often at one pose than elsewhere.
    #[error(
        "run {run}: sphere {sphere} at {} was found {found} times, {expected} times elsewhere",
        in_words(pose)
    )]
    VisitMissing {
        /// Run.
        run: u32,
        /// Sphere.
        sphere: String,
        /// Rotary positions, deg.
        pose: Vec<(Axis, f64)>,
        /// How often it was found.
        found: u32,
        /// How often it was found at other poses.
        expected: u32,
    },
    /// A sphere that the test does not name.
    #[error("run {run}: sphere {sphere} is not the one that the test names; not used")]
    OtherSphere {
        /// Run.
        run: u32,
        /// Sphere.
        sphere: String,
    },
    /// A sphere that the machine file does not have.
    #[error("run {run}: the machine file has no sphere \"{sphere}\"; not used")]
    UnknownSphere {
        /// Run.
        run: u32,
        /// Sphere.
        sphere: String,
    },
    /// A sphere that was told again.
    #[error("run {run}: sphere {sphere} was told before; not used")]
    ToldBefore {
        /// Run.
        run: u32,
        /// Sphere.
        sphere: String,
    },
    /// A sphere of a run that is evaluated.
    #[error(
        "run {run}: a visit of sphere {sphere} came after the run was evaluated; not used: raise hold_ms"
    )]
    TooLate {
        /// Run.
        run: u32,
        /// Sphere.
        sphere: String,
    },
    /// A run of more visits than are held.
    #[error(
        "run {run}: {held} visits are held already, the most there may be; one of {sphere} is not used"
    )]
    TooManyVisits {
        /// Run.
        run: u32,
        /// Visits that are held.
        held: usize,
        /// Sphere.
        sphere: String,
    },
    /// A sphere that was found before its run began.
    #[error("run {run}: sphere {sphere} was found {before_s:.1} s before the run began; not used")]
    OfAnotherTime {
        /// Run.
        run: u32,
        /// Sphere.
        sphere: String,
        /// How long before, s.
        before_s: f64,
    },
    /// A centre, covariance or pose that is none.
    #[error("run {run}: centre, covariance or pose of sphere {sphere} is not usable; not used")]
    NotFinite {
        /// Run.
        run: u32,
        /// Sphere.
        sphere: String,
    },
    /// A pose that the machine cannot have.
    #[error("run {run}: sphere {sphere} was found with axis {axis} at {position_deg:.4} deg, travel is [{}, {}] deg; not used", travel_deg[0], travel_deg[1])]
    OutsideTravel {
        /// Run.
        run: u32,
        /// Sphere.
        sphere: String,
        /// Axis.
        axis: Axis,
        /// Position, deg.
        position_deg: f64,
        /// Travel, deg.
        travel_deg: [f64; 2],
    },
    /// There is no estimate.
    #[error("run {run}: {reason}")]
    NotEstimated {
        /// Run.
        run: u32,
        /// Why.
        reason: EstimateError,
    },
    /// A verification without anything to verify.
    #[error("run {run}: there is no model to verify")]
    NothingToVerify {
        /// Run.
        run: u32,
    },
    /// A test that did not run to its end.
    #[error("run {run} did not run to its end; not evaluated")]
    NotCompleted {
        /// Run.
        run: u32,
    },
    /// A test that ended without having begun, or began twice.
    #[error("run {run}: its begin and end do not belong together")]
    NotBracketed {
        /// Run.
        run: u32,
    },
    /// The model of the linear axes has no value at a pose.
    #[error("run {run}: the model of the linear axes is not used: {reason}")]
    LinearModelRefused {
        /// Run; 0: none.
        run: u32,
        /// Why.
        reason: LinearRefusal,
    },
}

/// Why a model of the linear axes is not used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LinearRefusal {
    /// It is not one of this machine.
    #[error("{0}")]
    Model(#[from] machine::volumetric::VolumetricError),
    /// A pose has no value.
    #[error("{0}")]
    Pose(#[from] machine::volumetric::PoseRefusal),
}

/// The likely reason of a residual, and what to do.
fn advice(reason: &Reason) -> String {
    let um = |shift_mm: &nalgebra::Vector3<f64>| {
        let [x, y, z] = [shift_mm.x, shift_mm.y, shift_mm.z].map(|mm| mm * 1e3);
        format!("X {x:+.1}, Y {y:+.1}, Z {z:+.1} µm")
    };
    match reason {
        Reason::MachineShift(shift_mm) => format!(
            "all centres are shifted alike since the calibration, by {} along the machine's axes, as by heat or another seat of the probe: let the machine warm up and calibrate again",
            um(shift_mm)
        ),
        Reason::WorkpieceShift(shift_mm) => format!(
            "all centres are shifted alike since the calibration, by {} along the workpiece's axes, as by a sphere or a table that moved: fasten the sphere and calibrate again",
            um(shift_mm)
        ),
        Reason::Poses => "no common shift explains it, the poses differ: error motions, reversal errors or linear axes are worse than stated; calibrate at more poses, or state greater allowances".to_owned(),
    }
}

fn counted(spheres: usize) -> String {
    match spheres {
        1 => "1 sphere".to_owned(),
        n => format!("{n} spheres"),
    }
}

/// Rotary positions in degrees.
fn in_words(pose: &[(Axis, f64)]) -> String {
    let words: Vec<String> = pose
        .iter()
        .map(|(axis, position_deg)| format!("{axis} {position_deg:.2} deg"))
        .collect();
    words.join(", ")
}

impl Diagnostic {
    /// How bad it is.
    #[must_use]
    pub const fn severity(&self) -> Severity {
        match self {
            Self::Calibrated { .. } | Self::Verified { .. } => Severity::Info,
            Self::NotEstimable { .. }
            | Self::NoAllowance { .. }
            | Self::LowMerit { .. }
            | Self::Doubtful { .. }
            | Self::LackOfFit { .. }
            | Self::BeyondExpected { .. }
            | Self::VisitMissing { .. }
            | Self::ToldBefore { .. } => Severity::Warn,
            Self::OtherSphere { .. }
            | Self::UnknownSphere { .. }
            | Self::OfAnotherTime { .. }
            | Self::TooLate { .. }
            | Self::TooManyVisits { .. }
            | Self::NotFinite { .. }
            | Self::OutsideTravel { .. }
            | Self::NotEstimated { .. }
            | Self::NothingToVerify { .. }
            | Self::NotCompleted { .. }
            | Self::NotBracketed { .. }
            | Self::LinearModelRefused { .. } => Severity::Error,
        }
    }

    /// Its name on `/diagnostics`.
    #[must_use]
    pub const fn condition(&self) -> &'static str {
        match self {
            Self::Calibrated { .. } => "calibrated",
            Self::Verified { .. } => "verified",
            Self::BeyondExpected { .. } => "beyond_expected",
            Self::NotEstimable { .. } => "not_estimable",
            Self::NoAllowance { .. } => "no_allowance",
            Self::LowMerit { .. } => "low_merit",
            Self::Doubtful { .. } => "doubtful_visit",
            Self::LackOfFit { .. } => "lack_of_fit",
            Self::VisitMissing { .. } => "visit_missing",
            Self::OtherSphere { .. } => "other_sphere",
            Self::UnknownSphere { .. } => "unknown_sphere",
            Self::ToldBefore { .. } => "told_before",
            Self::OfAnotherTime { .. } => "of_another_time",
            Self::TooLate { .. } => "too_late",
            Self::TooManyVisits { .. } => "too_many_visits",
            Self::NotFinite { .. } => "not_finite",
            Self::OutsideTravel { .. } => "outside_travel",
            Self::NotEstimated { .. } => "not_estimated",
            Self::NothingToVerify { .. } => "nothing_to_verify",
            Self::NotCompleted { .. } => "not_completed",
            Self::NotBracketed { .. } => "not_bracketed",
            Self::LinearModelRefused { .. } => "linear_model_refused",
        }
    }
}
