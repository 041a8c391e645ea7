//! Location errors of the rotary axes with their uncertainty, from all visits.
//!
//! The fit is repeated while the spheres' places move, since the effect of a tilt depends on where
//! the sphere is. A visit whose residual is too great for chance is left out and named. Where the fit
//! is then still worse than the noise, harmonics of the axes' error motions are tried, one pair of
//! cosine and sine at a time:
//!
//! ```text
//!   F = ((chi0^2 - chi1^2)/2) / (chi1^2/nu1),   p(F) < limit / number of pairs tried          (1)
//! ```
//!
//! A pair is taken only if it is estimable, leaves every estimable unknown so, and does not make
//! the standard uncertainty of any location error more than three times as great.
//!
//! Noise is told from lack of fit by repeated visits where there are any (F test), else by the stated
//! uncertainties (chi-square test). If lack of fit remains, the covariance is enlarged by the mean
//! square of lack of fit, and where repeats scatter more than stated, by chi^2/nu: what is the same at each visit of a pose is not averaged out by repeats.
//! What is alike at every pose, such as a squareness of the linear axes, is in no residual: `allowance` says what
//! it adds to the uncertainties.
//!
//! The *spatial standard deviation* is what a single centre is off, in all three directions together:
//! sqrt(sum |r|^2 3/nu), once with the nominal machine (the sphere's place free) and once with the
//! estimate.
//!
//! # Agreement
//! `coverage_of_95_percent_intervals_over_a_thousand_machines` in `tests/coverage.rs`.

use machine::SphereDesign;
use machine::poses::{Merit, merit};
use metrology::fit::lack_of_fit;
use nalgebra::{DMatrix, Matrix3, Vector3};

use crate::allowance::{Known, common_covariance};
use crate::error::EstimateError;
use crate::fit::{SphereFit, fit};
use crate::unknown::Unknown;
use crate::visit::SphereVisit;

/// Fits until the places stand still, at most.
const PLACE_STEPS: usize = 6;
/// Places that move less stand still, mm.
const STILL_MM: f64 = 1e-7;
/// Greatest share of the visits that may be left out.
const GREATEST_DOUBTFUL_SHARE: f64 = 0.2;
/// Pairs of harmonics at most.
const MOST_PAIRS: usize = 4;
/// Factor by which a pair may enlarge the uncertainty of a location error.
const GREATEST_LOSS: f64 = 3.0;
/// Degrees of freedom that a pair must leave.
const LEAST_FREEDOM: usize = 6;
/// Median of chi-square with three degrees of freedom.
const MEDIAN_OF_THREE: f64 = 2.366;

/// What decides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EstimateRules {
    /// Greatest order of the harmonics that are tried; 0: none.
    pub harmonic_orders: u8,
    /// A visit is doubtful if residuals as great happen by chance with less than this probability
    /// in the whole set.
    pub doubtful_p: f64,
    /// Lack of fit is taken for real below this p value.
    pub lack_of_fit_p: f64,
}

/// What a visit left.
#[derive(Clone, Debug, PartialEq)]
pub struct VisitResidual {
    /// The visit.
    pub visit: SphereVisit,
    /// Read less predicted, machine frame, mm.
    pub residual_mm: Vector3<f64>,
    /// Whether it was left out.
    pub doubtful: bool,
}

/// The estimate and what it rests on.
#[derive(Clone, Debug, PartialEq)]
pub struct RotaryEstimate {
    /// What was estimated.
    pub unknowns: Vec<Unknown>,
    /// The last fit; its covariance includes `enlargement`.
    pub fit: SphereFit,
    /// Spheres and their places, workpiece frame, mm.
    pub spheres: Vec<(String, Vector3<f64>)>,
    /// Every visit.
    pub residuals: Vec<VisitResidual>,
    /// p value of lack of fit; NaN where it cannot be formed.
    pub lack_of_fit_p: f64,
    /// Whether noise was known from repeated visits.
    pub has_repeats: bool,
    /// Factor on the stated standard uncertainties; 1 where the fit is as good as they say.
    pub enlargement: f64,
    /// What is alike in all visits adds to the covariance of the fit; zero until it is asked for.
    pub common_covariance: DMatrix<f64>,
    /// Spatial standard deviation of the nominal machine, mm.
    pub spatial_before_mm: f64,
    /// The same with the estimate, mm.
    pub spatial_after_mm: f64,
    /// What the poses could tell.
    pub merit: Merit,
}

/// Estimates the location errors; `spheres` are the nominal places, workpiece frame, mm.
///
/// # Errors
/// Too few visits, or one that cannot be used.
pub fn estimate(
    design: &SphereDesign,
    visits: &[SphereVisit],
    spheres: &[(String, Vector3<f64>)],
    rules: &EstimateRules,
) -> Result<RotaryEstimate, EstimateError> {
    let mut unknowns = Unknown::locations(design);
    check(design, visits, spheres, unknowns.len())?;
    let mut used: Vec<usize> = (0..visits.len()).collect();
    let mut best = settled(design, &of(visits, &used), spheres, &unknowns)?;
    drop_doubtful(design, visits, &mut used, &unknowns, &mut best, rules)?;
    let first = lacking(design, visits, &used, &best.0);
    if first.p < rules.lack_of_fit_p {
        add_harmonics(design, &of(visits, &used), &mut unknowns, &mut best, rules)?;
        drop_doubtful(design, visits, &mut used, &unknowns, &mut best, rules)?;
    }
    let Lacking {
        has_repeats,
        p: lack_of_fit_p,
        mean_square,
    } = lacking(design, visits, &used, &best.0);
    let (mut found, places) = best;
    let enlargement = if lack_of_fit_p < rules.lack_of_fit_p {
        mean_square.sqrt().max(1.0)
    } else if found.p() < rules.lack_of_fit_p {
        // Repeats scatter more than the stated uncertainties: heat between them, or a servo's rest.
        (found.chi_square / found.degrees_of_freedom as f64).sqrt()
    } else {
        1.0
    };
    enlarge(&mut found, enlargement);
    let nominal = settled(design, &of(visits, &used), &places, &[])?.0;
    Ok(RotaryEstimate {
        spatial_before_mm: spatial_mm(&nominal),
        spatial_after_mm: spatial_mm(&found),
        merit: merit(design, &poses_by_sphere(visits, &used, &places)),
        residuals: residuals(design, visits, &used, (&found, &unknowns), &places),
        common_covariance: DMatrix::zeros(unknowns.len(), unknowns.len()),
        fit: found,
        unknowns,
        spheres: places,
        lack_of_fit_p,
        has_repeats,
        enlargement,
    })
}

impl RotaryEstimate {
    /// The same with what is alike in all visits.
    #[must_use]
    pub fn with_common(mut self, design: &SphereDesign, known: Known<'_>) -> Self {
        self.common_covariance = common_covariance(design, &self, known);
        self
    }

    /// Covariance of the unknowns: noise and what is alike in all visits.
    #[must_use]
    pub fn covariance(&self) -> DMatrix<f64> {
        &self.fit.covariance + &self.common_covariance
    }

    /// Where a sphere at `place_mm` is read at a pose according to the estimate, machine frame, mm.
    #[must_use]
    pub fn predicted_mm(
        &self,
        design: &SphereDesign,
        place_mm: &Vector3<f64>,
        visit: &SphereVisit,
    ) -> Vector3<f64> {
        predicted_mm(design, (&self.fit, &self.unknowns), place_mm, visit)
    }
}

fn predicted_mm(
    design: &SphereDesign,
    (fit, unknowns): (&SphereFit, &[Unknown]),
    place_mm: &Vector3<f64>,
    visit: &SphereVisit,
) -> Vector3<f64> {
    let row = design.row(place_mm, &visit.pose_rad);
    let effects = unknowns.iter().zip(fit.values.iter());
    let off: Vector3<f64> = effects
        .map(|(unknown, value)| unknown.effect(design, &row, &visit.pose_rad) * *value)
        .sum();
    row.centre_mm + visit.known_mm + off
}

/// Fit and places.
type Settled = (SphereFit, Vec<(String, Vector3<f64>)>);

fn check(
    design: &SphereDesign,
    visits: &[SphereVisit],
    spheres: &[(String, Vector3<f64>)],
    unknowns: usize,
) -> Result<(), EstimateError> {
    for (index, visit) in visits.iter().enumerate() {
        let finite = design
            .rotary_axes()
            .iter()
            .all(|&axis| visit.pose_rad[axis].is_finite())
            && visit.centre_mm.iter().all(|value| value.is_finite())
            && visit.known_mm.iter().all(|value| value.is_finite())
            && visit.covariance_mm2.iter().all(|value| value.is_finite());
        if !finite {
            return Err(EstimateError::UnusableVisit {
                index,
                sphere: visit.sphere.clone(),
            });
        }
    }
    let least = (unknowns + 3 * spheres.len()).div_ceil(3);
    if visits.len() < least || spheres.is_empty() {
        return Err(EstimateError::TooFewVisits {
            visits: visits.len(),
            spheres: spheres.len(),
            unknowns,
            least,
        });
    }
    Ok(())
}

fn of(visits: &[SphereVisit], used: &[usize]) -> Vec<SphereVisit> {
    used.iter().map(|&k| visits[k].clone()).collect()
}

fn settled(
    design: &SphereDesign,
    visits: &[SphereVisit],
    spheres: &[(String, Vector3<f64>)],
    unknowns: &[Unknown],
) -> Result<Settled, EstimateError> {
    let mut places = spheres.to_vec();
    let mut found = fit(design, visits, &places, unknowns)?;
    for _ in 0..PLACE_STEPS {
        let farthest_mm = found
            .place_steps_mm
            .iter()
            .map(Vector3::norm)
            .fold(0.0, f64::max);
        for ((_, place), step) in places.iter_mut().zip(&found.place_steps_mm) {
            *place += step;
        }
        found = fit(design, visits, &places, unknowns)?;
        if farthest_mm < STILL_MM {
            break;
        }
    }
    for ((_, place), step) in places.iter_mut().zip(&found.place_steps_mm) {
        *place += step;
    }
    Ok((found, places))
}

/// Leaves out visits that chance does not explain, the worst first.
fn drop_doubtful(
    design: &SphereDesign,
    visits: &[SphereVisit],
    used: &mut Vec<usize>,
    unknowns: &[Unknown],
    best: &mut Settled,
    rules: &EstimateRules,
) -> Result<(), EstimateError> {
    let least = (unknowns.len() + 3 * best.1.len()).div_ceil(3) + 1;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a share of a count"
    )]
    let most = (visits.len() as f64 * GREATEST_DOUBTFUL_SHARE) as usize;
    while visits.len() - used.len() < most && used.len() > least {
        let squares: Vec<f64> = best
            .0
            .standardised
            .iter()
            .map(Vector3::norm_squared)
            .collect();
        let mut sorted = squares.clone();
        sorted.sort_by(f64::total_cmp);
        let median = sorted[sorted.len() / 2];
        // Never finer than the stated uncertainties, and fair where the model lacks something.
        let variance = (median / MEDIAN_OF_THREE).max(1.0);
        let Some((worst, square)) = squares
            .iter()
            .copied()
            .enumerate()
            .max_by(|a, b| a.1.total_cmp(&b.1))
        else {
            break;
        };
        let p = metrology::fit::chi_square_p(square / variance, 3);
        if p * used.len() as f64 >= rules.doubtful_p {
            break;
        }
        used.remove(worst);
        *best = settled(design, &of(visits, used), &best.1, unknowns)?;
    }
    Ok(())
}

/// How much worse the fit is than the noise.
struct Lacking {
    /// Whether noise is known from repeats.
    has_repeats: bool,
    /// p value; NaN where it cannot be formed.
    p: f64,
    /// Mean square of what is not noise, in units of the stated variances.
    mean_square: f64,
}

fn lacking(
    design: &SphereDesign,
    visits: &[SphereVisit],
    used: &[usize],
    found: &SphereFit,
) -> Lacking {
    let mut firsts: Vec<usize> = Vec::new();
    let mut levels = Vec::new();
    let mut residuals = Vec::new();
    for (&k, standardised) in used.iter().zip(&found.standardised) {
        let known = firsts
            .iter()
            .position(|&first| visits[first].repeats(&visits[k], design));
        let level = known.unwrap_or_else(|| {
            firsts.push(k);
            firsts.len() - 1
        });
        for direction in 0..3 {
            levels.push(3 * level + direction);
            residuals.push(standardised[direction]);
        }
    }
    let parted = lack_of_fit(&residuals, &vec![1.0; residuals.len()], &levels, found.rank);
    if parted.p.is_finite() {
        return Lacking {
            has_repeats: true,
            p: parted.p,
            mean_square: parted.lack_sum / parted.lack_freedom as f64,
        };
    }
    Lacking {
        has_repeats: false,
        p: if found.degrees_of_freedom == 0 {
            f64::NAN
        } else {
            found.p()
        },
        mean_square: found.chi_square / found.degrees_of_freedom.max(1) as f64,
    }
}

fn add_harmonics(
    design: &SphereDesign,
    visits: &[SphereVisit],
    unknowns: &mut Vec<Unknown>,
    best: &mut Settled,
    rules: &EstimateRules,
) -> Result<(), EstimateError> {
    let mut pairs = Unknown::harmonics(design, rules.harmonic_orders);
    let n_pairs = pairs.len().max(1) as f64;
    let n_locations = unknowns.len();
    let before = best.0.covariance.diagonal();
    for _ in 0..MOST_PAIRS {
        let mut chosen: Option<(usize, Settled)> = None;
        for (place, pair) in pairs.iter().enumerate() {
            let tried: Vec<Unknown> = unknowns.iter().chain(pair).copied().collect();
            let found = (fit(design, visits, &best.1, &tried)?, best.1.clone());
            let better = chosen
                .as_ref()
                .is_none_or(|(_, other)| found.0.chi_square < other.0.chi_square);
            if better && is_fair(&best.0, &found.0, &before, n_locations) {
                chosen = Some((place, found));
            }
        }
        let Some((place, found)) = chosen else { break };
        if gain_p(&best.0, &found.0) * n_pairs >= rules.lack_of_fit_p {
            break;
        }
        unknowns.extend(pairs.remove(place));
        *best = settled(design, visits, &found.1, unknowns)?;
    }
    Ok(())
}

/// Whether two more unknowns leave the others as they were.
fn is_fair(
    before: &SphereFit,
    after: &SphereFit,
    variances: &nalgebra::DVector<f64>,
    n_locations: usize,
) -> bool {
    let kept = before
        .estimable
        .iter()
        .zip(&after.estimable)
        .all(|(was, is)| *is || !was);
    let new = after
        .estimable
        .iter()
        .skip(before.estimable.len())
        .all(|is| *is);
    let precise = (0..n_locations)
        .filter(|&j| before.estimable[j])
        .all(|j| after.covariance[(j, j)] <= variances[j] * GREATEST_LOSS.powi(2));
    kept && new && precise && after.degrees_of_freedom >= LEAST_FREEDOM
}

/// p value of (1).
fn gain_p(before: &SphereFit, after: &SphereFit) -> f64 {
    let freedom = after.degrees_of_freedom;
    let gained = before.degrees_of_freedom - freedom;
    // The F test of a sum gained against the sum left is that of lack of fit against pure error.
    metrology::fit::f_test_p(
        (before.chi_square - after.chi_square).max(0.0),
        gained,
        after.chi_square,
        freedom,
    )
}

fn enlarge(found: &mut SphereFit, factor: f64) {
    let variance = factor * factor;
    found.covariance *= variance;
    for covariance in &mut found.place_covariances_mm2 {
        *covariance *= variance;
    }
    for combination in &mut found.combinations {
        combination.standard_uncertainty_mm *= factor;
    }
}

fn spatial_mm(found: &SphereFit) -> f64 {
    let squares: f64 = found.residuals_mm.iter().map(Vector3::norm_squared).sum();
    (3.0 * squares / found.degrees_of_freedom.max(1) as f64).sqrt()
}

fn poses_by_sphere(
    visits: &[SphereVisit],
    used: &[usize],
    places: &[(String, Vector3<f64>)],
) -> Vec<(Vector3<f64>, Vec<metrology::PerAxis<f64>>)> {
    let poses = |name: &str| {
        let own = used
            .iter()
            .map(|&k| &visits[k])
            .filter(|visit| visit.sphere == name);
        own.map(|visit| visit.pose_rad).collect()
    };
    places
        .iter()
        .map(|(name, place)| (*place, poses(name)))
        .collect()
}

fn residuals(
    design: &SphereDesign,
    visits: &[SphereVisit],
    used: &[usize],
    model: (&SphereFit, &[Unknown]),
    places: &[(String, Vector3<f64>)],
) -> Vec<VisitResidual> {
    let of_visit = |(k, visit): (usize, &SphereVisit)| {
        let (_, place) = places.iter().find(|(name, _)| *name == visit.sphere)?;
        Some(VisitResidual {
            residual_mm: visit.centre_mm - predicted_mm(design, model, place, visit),
            visit: visit.clone(),
            doubtful: !used.contains(&k),
        })
    };
    visits.iter().enumerate().filter_map(of_visit).collect()
}

/// Covariance of [`RotaryEstimate::predicted_mm`] for one of the estimate's own spheres, whose place
/// is known from the same visits, mm²; `None` for another one.
#[must_use]
pub fn prediction_covariance_mm2(
    design: &SphereDesign,
    found: &RotaryEstimate,
    visit: &SphereVisit,
) -> Option<Matrix3<f64>> {
    let sphere = found
        .spheres
        .iter()
        .position(|(name, _)| *name == visit.sphere)?;
    let row = design.row(&found.spheres[sphere].1, &visit.pose_rad);
    let turn = row.machine_from_workpiece;
    let p = found.unknowns.len();
    let mut effects = DMatrix::zeros(3, p);
    for (j, unknown) in found.unknowns.iter().enumerate() {
        let with_place = turn * found.fit.place_per_unknown[sphere][j];
        let effect = unknown.effect(design, &row, &visit.pose_rad) - with_place;
        effects.fixed_view_mut::<3, 1>(0, j).copy_from(&effect);
    }
    let of_unknowns = &effects * &found.fit.covariance * effects.transpose();
    let of_place = turn * found.fit.place_covariances_mm2[sphere] * turn.transpose();
    Some(Matrix3::from_fn(|i, j| {
        of_unknowns[(i, j)] + of_place[(i, j)]
    }))
}
