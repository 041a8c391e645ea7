//! Planes, bores, bosses and spheres from the points of one run.
//!
//! # Model
//!
//! Circle and sphere are fitted to the ball's centres, which lie on a true circle or sphere even
//! where the approach misses the normal; the radius of the ball is added for a bore and taken off
//! for a boss or sphere. A plane is fitted to the surface points.
//!
//! ```text
//!   R = R_ball + r (bore),   R = R_ball − r (boss, sphere)                          (1)
//!   u²(R) = u²(R_ball) + u_common²,   plane: u² along the normal likewise           (2)
//! ```
//!
//! An error of the latency moves every ball centre of a feature by the same length along its
//! approach, that is, towards the centre or along the normal: it changes the radius or the place of
//! the plane, not the centre and not the direction.
//!
//! A bore or boss has no height of its own: z is the mean height at which it was touched, and its
//! variance is given as zero.
//!
//! A feature is touched at one pose of the rotary axes, and the mean of their positions goes with it;
//! touches at different poses are refused. Where a test visits a sphere at several poses, the numbers
//! of its points begin anew at each visit, and each visit is a feature of its own.
//!
//! # Holds when
//! Points are in the machine frame.

use machine::cycle::{FeatureId, artefact_id};
use machine::file::ArtefactEntry;
use metrology::fit::{ShapeError, fit_plane, fit_round};
use metrology::sample::{FeatureKind, ProbedFeature, TestKind};
use metrology::{Axis, AxisSet, PerAxis};
use nalgebra::{Matrix3, Vector3};

use crate::block::count;
use crate::diagnostic::Diagnostic;
use crate::run::{Run, RunTouch};
use crate::stage::Output;

/// Rotary positions that differ by no more are one pose, rad: 10", which servo and friction stay within.
const ONE_POSE_RAD: f64 = 4.85e-5;

/// Evaluates one artefact at the end of its run.
pub(crate) fn evaluate(run: &Run, artefact: &ArtefactEntry, radius_mm: f64, out: &mut Vec<Output>) {
    let id = artefact_id(artefact);
    let touches: Vec<&RunTouch> = run
        .touches_of(
            |feature| matches!(feature, FeatureId::Point { artefact, .. } if artefact == id),
        )
        .collect();
    if matches!(
        run.segment.kind,
        TestKind::Rotary | TestKind::RotaryVerification
    ) {
        for visit in visits(&touches) {
            evaluate_visit(run, artefact, visit, radius_mm, out);
        }
    } else {
        evaluate_visit(run, artefact, &touches, radius_mm, out);
    }
}

/// Touches from one beginning of the numbering to the next.
fn visits<'t, 'r>(touches: &'t [&'r RunTouch]) -> impl Iterator<Item = &'t [&'r RunTouch]> {
    touches.chunk_by(|before, after| point_index(before) <= point_index(after))
}

fn point_index(touch: &RunTouch) -> u32 {
    match FeatureId::parse(&touch.point.feature_id) {
        Some(FeatureId::Point { index, .. }) => index,
        _ => 0,
    }
}

fn evaluate_visit(
    run: &Run,
    artefact: &ArtefactEntry,
    touches: &[&RunTouch],
    radius_mm: f64,
    out: &mut Vec<Output>,
) {
    let id = artefact_id(artefact);
    let usable: Vec<&RunTouch> = touches
        .iter()
        .copied()
        .filter(|touch| touch.is_usable())
        .collect();
    let n_rejected = count(touches.iter()) - count(usable.iter());
    let (rotary_axes, rotary_rad) = match rotary_pose(&usable) {
        Ok(pose) => pose,
        Err(spread) => {
            out.push(Output::Diagnostic(Diagnostic::MixedPoses {
                run: run.number(),
                feature: id.to_owned(),
                axis: spread.axis,
                least_rad: spread.least_rad,
                greatest_rad: spread.greatest_rad,
                limit_rad: ONE_POSE_RAD,
            }));
            return;
        }
    };
    let points = Points::new(&usable, radius_mm);
    let fitted = match artefact {
        ArtefactEntry::Plane { normal, .. } => plane(&points, &Vector3::from(*normal)),
        ArtefactEntry::Bore { .. } => circle(&points, FeatureKind::Bore, radius_mm),
        ArtefactEntry::Boss { .. } => circle(&points, FeatureKind::Boss, -radius_mm),
        ArtefactEntry::Sphere { .. } => sphere(&points, -radius_mm),
    };
    out.push(match fitted {
        Ok(shape) => Output::Feature(ProbedFeature {
            at: usable
                .last()
                .map_or(run.segment.at, |touch| touch.point.received_at),
            feature_id: id.to_owned(),
            n: count(usable.iter()),
            n_rejected,
            run: run.number(),
            rotary_axes,
            rotary_rad,
            ..shape
        }),
        Err(reason) => Output::Diagnostic(Diagnostic::ShapeNotEvaluated {
            run: run.number(),
            feature: id.to_owned(),
            rejected: n_rejected,
            reason,
        }),
    });
}

/// An axis that did not stand still.
struct Spread {
    axis: Axis,
    least_rad: f64,
    greatest_rad: f64,
}

/// The machine's rotary axes and their mean positions during the touches, rad.
fn rotary_pose(touches: &[&RunTouch]) -> Result<(AxisSet, PerAxis<f64>), Spread> {
    let Some(first) = touches.first() else {
        return Ok((AxisSet::EMPTY, PerAxis::default()));
    };
    let of_machine = first.point.axes.iter().filter(|axis| !axis.is_linear());
    let axes: AxisSet = of_machine.collect();
    let mut mean_rad = PerAxis::default();
    for axis in axes.iter() {
        let positions = || {
            let touches = touches.iter();
            touches.map(|touch| touch.point.axes_at_contact[axis])
        };
        let least_rad = positions().fold(f64::INFINITY, f64::min);
        let greatest_rad = positions().fold(f64::NEG_INFINITY, f64::max);
        if greatest_rad - least_rad > ONE_POSE_RAD {
            return Err(Spread {
                axis,
                least_rad,
                greatest_rad,
            });
        }
        mean_rad[axis] = positions().sum::<f64>() / touches.len() as f64;
    }
    Ok((axes, mean_rad))
}

/// Points of one feature with their uncertainties.
struct Points {
    surface_mm: Vec<Vector3<f64>>,
    ball_mm: Vec<Vector3<f64>>,
    independent_mm: Vec<f64>,
    /// Largest common standard uncertainty, mm.
    common_mm: f64,
}

impl Points {
    fn new(touches: &[&RunTouch], radius_mm: f64) -> Self {
        let surface = |touch: &&RunTouch| touch.point.point_in_machine_mm;
        let ball = |touch: &&RunTouch| surface(touch) - touch.point.approach * radius_mm;
        Self {
            surface_mm: touches.iter().map(surface).collect(),
            ball_mm: touches.iter().map(ball).collect(),
            // Touches of an older bag may have no uncertainty, and a weight has an end.
            independent_mm: touches
                .iter()
                .map(|touch| touch.uncertainty.independent_mm.max(LEAST_UNCERTAINTY_MM))
                .collect(),
            common_mm: touches
                .iter()
                .map(|touch| touch.uncertainty.common_mm)
                .fold(0.0, f64::max),
        }
    }
}

/// Weights are not finer than 1 nm.
const LEAST_UNCERTAINTY_MM: f64 = 1e-6;

fn plane(points: &Points, outward: &Vector3<f64>) -> Result<ProbedFeature, ShapeError> {
    let fit = fit_plane(&points.surface_mm, &points.independent_mm, outward)?;
    let u_mm = fit.offset_standard_uncertainty_mm.hypot(points.common_mm); // (2)
    Ok(ProbedFeature {
        centre_mm: fit.centroid_mm,
        centre_covariance_mm2: fit.normal * fit.normal.transpose() * u_mm.powi(2),
        normal: fit.normal,
        normal_standard_uncertainty_rad: fit.tilt_standard_uncertainty_rad,
        form_mm: fit.form_mm,
        ..unknown(FeatureKind::Plane)
    })
}

fn circle(
    points: &Points,
    kind: FeatureKind,
    radius_offset_mm: f64,
) -> Result<ProbedFeature, ShapeError> {
    let flat: Vec<_> = points.ball_mm.iter().map(|p| p.xy()).collect();
    let fit = fit_round(&flat, &points.independent_mm)?;
    let height_mm = points.ball_mm.iter().map(|p| p.z).sum::<f64>() / flat.len() as f64;
    let mut centre_covariance_mm2 = Matrix3::zeros();
    let plane_part = fit.covariance_mm2.view((0, 0), (2, 2));
    centre_covariance_mm2
        .view_mut((0, 0), (2, 2))
        .copy_from(&plane_part);
    Ok(ProbedFeature {
        centre_mm: Vector3::new(fit.centre_mm.x, fit.centre_mm.y, height_mm),
        centre_covariance_mm2,
        normal: Vector3::z(),
        radius_mm: fit.radius_mm + radius_offset_mm, // (1)
        radius_standard_uncertainty_mm: fit.covariance_mm2[(2, 2)].sqrt().hypot(points.common_mm),
        form_mm: fit.form_mm,
        ..unknown(kind)
    })
}

fn sphere(points: &Points, radius_offset_mm: f64) -> Result<ProbedFeature, ShapeError> {
    let fit = fit_round(&points.ball_mm, &points.independent_mm)?;
    Ok(ProbedFeature {
        centre_mm: fit.centre_mm,
        centre_covariance_mm2: fit.covariance_mm2.fixed_view::<3, 3>(0, 0).into(),
        radius_mm: fit.radius_mm + radius_offset_mm, // (1)
        radius_standard_uncertainty_mm: fit.covariance_mm2[(3, 3)].sqrt().hypot(points.common_mm),
        form_mm: fit.form_mm,
        ..unknown(FeatureKind::Sphere)
    })
}

/// A feature of which nothing is known yet.
fn unknown(kind: FeatureKind) -> ProbedFeature {
    ProbedFeature {
        at: metrology::Stamp::default(),
        feature_id: String::new(),
        kind,
        centre_mm: Vector3::zeros(),
        centre_covariance_mm2: Matrix3::zeros(),
        normal: Vector3::zeros(),
        normal_standard_uncertainty_rad: f64::NAN,
        radius_mm: f64::NAN,
        radius_standard_uncertainty_mm: f64::NAN,
        form_mm: f64::NAN,
        n: 0,
        n_rejected: 0,
        run: 0,
        rotary_axes: AxisSet::EMPTY,
        rotary_rad: PerAxis::default(),
    }
}
