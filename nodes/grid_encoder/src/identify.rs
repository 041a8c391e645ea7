//! The geometric errors that a set of recordings determines, with covariance, and nothing beyond.
//!
//! # Model
//!
//! The rows of `equations`, weighted by their standard uncertainties, are folded into a triangle and
//! decomposed (`triangle`, `spectrum`):
//!
//! ```text
//!   β = X⁺ y,   s² = Σ w (r/u)² / (n − rank),   cov(β) = s² X⁺X⁺ᵀ                       (1)
//!   w = g⁻² for |r| <= k m u,   g⁻² (k m u / |r|)² beyond;   m = 1.4826 median|r/u|      (2)
//!   g = max(1, m) of the recording, or 1                                               (3)
//! ```
//!
//! (2) is repeated until no weight changes: a station that was bumped does not bend the curves, and is
//! counted. (3) keeps a fast trace, whose readings scatter little about a path that servos and structure
//! bent, from outweighing stations: what a recording leaves is its noise. Where residuals are more than noise, errors of the
//! plate and drift between recordings are separated from β with (4) to (6) of `disturbance`, weights are taken anew from what is left then, and β
//! and its covariance are those of generalised least squares. Every unknown is told to be estimable, mixed or unseen; what is estimable beyond single ones is
//! in `combinations`.
//!
//! *Gauge.* Straightness has no linear term: what is linear in it is squareness, or the direction that
//! a plate's rotation leaves open. Squareness is therefore the angle between the tangents where the curves have their
//! origin, wherever the circles lie; `reference_lines` states it between the lines of ISO 230-1.
//!
//! # Holds when
//! First order in the errors (1e-4 of 1 rad times 10 µm is 1 nm), plate flat, lost motion constant
//! along an axis. Not modelled: reversal spikes, which (2) weighs down. That the plate may be too long or not square as a whole nothing but
//! its certificate can tell: `certificate` adds it to the covariance.
//!
//! # Agreement
//! `val_coverage_of_a_thousand_machines`: 95.0 % of 51,000 intervals hold the truth. `val_coverage_where_the_plate_errs_and_the_machine_drifts`:
//! 93.1 % of 2,040, and estimates 3.3 times nearer to the truth (rms) than if nothing is done about them.
//!
//! # References
//! \[1\] P. J. Huber, E. M. Ronchetti, Robust Statistics, 2nd ed., Wiley 2009, 7.

mod certificate;
mod disturbance;
mod judge;
mod solved;

use machine::{Chain, Kinematics};
use metrology::sample::TestPlane;
use metrology::{Axis, ErrorComponent, PerAxis};
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeMap;

use crate::basis::{Basis, ModelComponent, is_straightness};
use crate::equations::Equations;
use crate::error::IdentifyError;
use crate::recording::Recording;
use crate::spectrum::{Gap, Visibility};
use crate::unknown::{Nuisances, Unknown, Unknowns};

pub use certificate::PlateCertificate;
pub use disturbance::{GROUPS, Told};
pub use judge::Judgement;
use solved::{Solved, Weighting};

/// Rounds of (2).
const SOLUTION_ROUNDS: usize = 12;

/// How to identify.
#[derive(Clone, Debug, PartialEq)]
pub struct IdentifyOptions {
    /// Components and their functions.
    pub components: Vec<ModelComponent>,
    /// What is unknown besides.
    pub nuisances: Nuisances,
    /// Only the radial part of each reading is used, as a ballbar would give it.
    pub radial_only: bool,
    /// Singular values below this share of the greatest count as zero.
    pub rank_tolerance: f64,
    /// k of (2); infinite: no re-weighting.
    pub outlier_limit: f64,
    /// Whether each recording has a noise of its own, (3).
    pub recording_noise: bool,
    /// Where s of (1) comes from.
    pub noise: Noise,
    /// What is done about the plate's error and drift.
    pub disturbed: Disturbed,
    /// What the plate's certificate leaves open.
    pub certificate: PlateCertificate,
}

/// What is done about errors of the plate and drift between recordings, `disturbance`; with `radial_only` nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Disturbed {
    /// Nothing.
    Ignored,
    /// Where residuals are more than noise, they are unknown, and how great they are is found.
    Found {
        /// Ratios of a similar fit to begin with, if there was one.
        start: Option<[f64; GROUPS]>,
    },
    /// They are unknown, and as great as given.
    Given {
        /// Their variances, as [`Told::ratios`].
        ratios: [f64; GROUPS],
    },
}

/// Where the size of the noise comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Noise {
    /// From the residuals, where at least [`LEAST_FREEDOM`] equations are left over.
    FromResiduals,
    /// The stated uncertainties are right: s = 1.
    AsStated,
}

/// Equations beyond the rank that a noise from residuals needs.
pub const LEAST_FREEDOM: usize = 6;

impl IdentifyOptions {
    /// All components of a chain's linear axes, powers up to `greatest_power` about `origin`.
    #[must_use]
    pub fn of_chain(chain: &Chain, origin: &PerAxis<f64>, greatest_power: u8) -> Self {
        let components = machine::volumetric::components_of(chain)
            .into_iter()
            .filter(|component| component.of.is_linear())
            .map(|component| ModelComponent {
                component,
                basis: default_basis(component, origin[component.of], greatest_power),
            })
            .collect();
        Self {
            components,
            nuisances: Nuisances::PLATE,
            radial_only: false,
            rank_tolerance: 1e-6,
            outlier_limit: 4.5,
            recording_noise: false,
            noise: Noise::FromResiduals,
            disturbed: Disturbed::Found { start: None },
            certificate: PlateCertificate::EXACT,
        }
    }
}

/// Powers of a component in the gauge used throughout.
#[must_use]
pub fn default_basis(component: ErrorComponent, origin: f64, greatest_power: u8) -> Basis {
    if component.is_location {
        Basis::Constant
    } else {
        let first = if is_straightness(component) { 2 } else { 1 };
        Basis::powers(origin, first, greatest_power)
    }
}

/// A sum of coefficients that is determined although its members are not.
#[derive(Clone, Debug, PartialEq)]
pub struct Combination {
    /// (coefficient, weight in mm per unit of the coefficient).
    pub weights: Vec<(usize, f64)>,
    /// Its value, mm at the edge of the first member's span.
    pub value_mm: f64,
    /// Its standard uncertainty, mm.
    pub standard_uncertainty_mm: f64,
}

/// What recordings determine.
#[derive(Clone, Debug, PartialEq)]
pub struct Identification {
    /// Components as they were asked for.
    pub components: Vec<ModelComponent>,
    /// All unknowns, coefficients first.
    pub unknowns: Vec<Unknown>,
    /// How many of them are coefficients.
    pub n_coefficients: usize,
    /// β of (1), minimum norm in units of the span; own units. Turns of plates and offsets include what was taken out.
    pub values: DVector<f64>,
    /// cov(β) of (1), times `variance_inflation`, with what the plate's certificate leaves open.
    pub covariance: DMatrix<f64>,
    /// Verdict per unknown.
    pub visibility: Vec<Visibility>,
    /// Own unit per mm at the edge of the span, per unknown.
    pub scale: Vec<f64>,
    /// What is determined beyond single coefficients.
    pub combinations: Vec<Combination>,
    /// Rank of the equations.
    pub rank: usize,
    /// Where the singular values stop counting.
    pub gap: Gap,
    /// Singular values in units of the span, greatest first.
    pub singular_values: DVector<f64>,
    /// Greatest over least singular value that counts.
    pub condition: f64,
    /// s of (1): 1 where the stated uncertainties are right.
    pub noise_ratio: f64,
    /// Root of the mean square residual per degree of freedom, mm; zero without one.
    pub residual_standard_deviation_mm: f64,
    /// Equations less rank.
    pub degrees_of_freedom: usize,
    /// Equations.
    pub n_equations: usize,
    /// Readings behind them.
    pub n_readings: usize,
    /// Equations weighed down by (2).
    pub n_outliers: usize,
    /// Whether what is left is noise.
    pub judgement: Judgement,
    /// By what the covariance is greater than if residuals were independent: (3) of `judge`, 1 where they are, or where the
    /// stated uncertainties are taken as right.
    pub variance_inflation: f64,
    /// How great errors of the plate and drift are; none where residuals are noise or nothing is done about them.
    pub disturbances: Option<Told>,
    /// Least and greatest recorded position per axis.
    pub spans: PerAxis<(f64, f64)>,
    /// Weight of each equation to 1/u², by recording and point.
    pub weights: Vec<Vec<[f64; 2]>>,
    /// g of (3) by recording.
    pub recording_noise: Vec<f64>,
    /// Residuals along u and v (or the radius and 0), mm, by recording and point.
    pub residuals_mm: Vec<Vec<[f64; 2]>>,
}

impl Identification {
    /// Index of an unknown by its printed name.
    #[must_use]
    pub fn find(&self, name: &str) -> Option<usize> {
        self.unknowns
            .iter()
            .position(|unknown| unknown.to_string() == name)
    }

    /// Value and standard uncertainty of an unknown that is estimable by itself.
    #[must_use]
    pub fn estimate(&self, idx: usize) -> Option<(f64, f64)> {
        let estimable = self.visibility.get(idx) == Some(&Visibility::Estimable);
        estimable.then(|| {
            (
                self.values[idx],
                self.covariance[(idx, idx)].max(0.0).sqrt(),
            )
        })
    }

    /// The members of a combination, e.g. `EXY2|ECY1`.
    #[must_use]
    pub fn name_of(&self, combination: &Combination) -> String {
        let names = combination
            .weights
            .iter()
            .filter_map(|(idx, _)| self.unknowns.get(*idx));
        names.map(ToString::to_string).collect::<Vec<_>>().join("|")
    }
}

/// Identifies the components from recordings.
///
/// # Errors
/// When there is nothing to fit, a number is not finite, or two recordings contradict each other about
/// their zero; never because the data cannot see something.
pub fn identify(
    kinematics: &Kinematics,
    recordings: &[Recording],
    options: &IdentifyOptions,
) -> Result<Identification, IdentifyError> {
    check(recordings, options)?;
    let unknowns = Unknowns::of(&options.components, recordings, &options.nuisances);
    let equations = Equations::new(
        kinematics,
        &options.components,
        recordings,
        unknowns,
        options.radial_only,
    );
    let mut weighting = Weighting::even(recordings);
    let mut solved = Solved::new(&equations, &weighting, options)?;
    for _ in 0..SOLUTION_ROUNDS {
        if !solved.reweigh(&mut weighting, options) {
            break;
        }
        solved = Solved::new(&equations, &weighting, options)?;
    }
    let judgement = solved.judgement(&equations, &weighting);
    match options.disturbed {
        _ if options.radial_only => {}
        Disturbed::Ignored => {}
        Disturbed::Given { .. } => solved.separate(&equations, &weighting, &options.disturbed),
        Disturbed::Found { .. } if judgement.is_disturbed() => {
            // Weights that the disturbances bent, then those of what is left besides them.
            solved.separate(&equations, &weighting, &options.disturbed);
            solved.reweigh(&mut weighting, options);
            solved.weigh_neighbours(&mut weighting);
            solved = Solved::new(&equations, &weighting, options)?;
            solved.separate(&equations, &weighting, &options.disturbed);
        }
        Disturbed::Found { .. } => {}
    }
    Ok(solved.into_identification(&equations, weighting, options, judgement))
}

fn check(recordings: &[Recording], options: &IdentifyOptions) -> Result<(), IdentifyError> {
    if options
        .components
        .iter()
        .all(|model| model.basis.is_empty())
    {
        return Err(IdentifyError::NothingAsked);
    }
    if recordings
        .iter()
        .all(|recording| recording.points.is_empty())
    {
        return Err(IdentifyError::NoPoints);
    }
    let mut fixtures: BTreeMap<u32, (TestPlane, u32)> = BTreeMap::new();
    for recording in recordings {
        let (place, run) = (&recording.place, recording.run);
        let zero_id = place.fixture.zero_id;
        let seen = *fixtures
            .entry(zero_id)
            .or_insert((place.plane, place.fixture.setup_id));
        if seen != (place.plane, place.fixture.setup_id) {
            return Err(IdentifyError::ZeroUsedTwice { zero_id, run });
        }
        if place.plane == TestPlane::None {
            return Err(IdentifyError::NoPlane { run });
        }
        if options.radial_only && !place.is_round() {
            return Err(IdentifyError::NotRound {
                run,
                kind: place.kind,
            });
        }
        let usable = |point: &crate::recording::GridPoint| {
            Axis::ALL
                .into_iter()
                .all(|axis| point.positions[axis].is_finite())
                && point.reading_mm.iter().all(|x| x.is_finite())
                && point
                    .standard_uncertainty_mm
                    .iter()
                    .all(|u| u.is_finite() && *u > 0.0)
        };
        if let Some(point) = recording.points.iter().position(|point| !usable(point)) {
            return Err(IdentifyError::NotUsable { run, point });
        }
    }
    Ok(())
}
