//! Squareness of two linear axes between reference lines, as ISO 230-1 defines it.
//!
//! # Model
//!
//! A model states squareness between the tangents of the trajectories where its curves have their origin: there straightness
//! has no linear term (`basis`). ISO 230-1 states the angle between reference straight lines of the trajectories that the
//! functional point was measured on. Both are one only where trajectories are straight. With e_v(u) the deviation along v of
//! the functional point while u moves, lines by least squares over evenly spaced points, and s of
//! [`metrology::squareness::opening`]:
//!
//! ```text
//!   m_v = slope of e_v over u,   m_u = slope of e_u over v                              (1)
//!   θ = 90° − m_u − m_v = 90° + s E,   E = −s (m_u + m_v)                                (2)
//!   E = gᵀβ,   u² = gᵀ cov(β) g                                                         (3)
//! ```
//!
//! (1) is linear in the coefficients β of the model, so g follows from `machine::volumetric::sensitivity`.
//! Turns of the axes are in e at the place of the lines (Abbe): E depends on where the trajectories lie.
//! E is determined where g is a sum of what the recordings determine; elsewhere nothing is stated.
//!
//! # Holds when
//! First order in the errors; the lines lie where the machine was recorded.
//!
//! # Agreement
//! `val_squareness_between_lines_off_the_origin`: numpy's polyfit on trajectories written out for the chain, below 1e-9 rad.
//!
//! # References
//! \[1\] ISO 230-1:2012, straightness and squareness about reference straight lines; from the literature, the text was not at hand.

use machine::Kinematics;
use machine::volumetric::sensitivity;
use metrology::sample::{CurveForm, ErrorCurve, GeometryModel, TestPlane};
use metrology::squareness::{between, opening};
use metrology::{Axis, ErrorComponent, PerAxis};
use nalgebra::{DMatrix, DVector, Vector3};

use crate::basis::Basis;
use crate::recording::plane_axes;

/// Points of a line.
const POINTS: u32 = 101;
/// Share of g that no determined sum explains, above which E is not determined: rounding of published weights.
const UNEXPLAINED: f64 = 1e-4;

/// Share of the greatest singular value of the sums below which one counts as zero.
const NO_SINGULAR_VALUE: f64 = 1e-7;

/// Two trajectories in a plane, one along each axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Lines {
    /// The plane.
    pub plane: TestPlane,
    /// Axis positions where they cross, mm.
    pub through_mm: Vector3<f64>,
    /// From the point that the axis positions name to the functional point, mm.
    pub tool_offset_mm: Vector3<f64>,
    /// Least and greatest position along the first and the second axis of the plane, mm.
    pub spans_mm: [(f64, f64); 2],
}

/// Squareness between the least-squares lines of two trajectories.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinesSquareness {
    /// Its component.
    pub component: ErrorComponent,
    /// E of (2), rad.
    pub value_rad: f64,
    /// Its standard uncertainty (3), rad.
    pub standard_uncertainty_rad: f64,
}

/// The squareness (2) of a model; none where the recordings do not determine it or a line has no length.
#[must_use]
pub fn squareness(
    kinematics: &Kinematics,
    model: &GeometryModel,
    lines: &Lines,
) -> Option<LinesSquareness> {
    let [first, second] = plane_axes(lines.plane)?;
    let component = between(first, second)?;
    let g = weights(kinematics, model, lines, opening(component))?;
    if model.covariance.nrows() != g.len() || !is_determined(model, &g) {
        return None;
    }
    let coefficients = model.curves.iter().flat_map(|curve| &curve.coefficient);
    let beta = DVector::from_iterator(g.len(), coefficients.copied());
    let variance = g.dot(&(&model.covariance * &g)); // (3)
    let found = LinesSquareness {
        component,
        value_rad: g.dot(&beta),
        standard_uncertainty_rad: variance.max(0.0).sqrt(),
    };
    (found.value_rad.is_finite() && variance.is_finite()).then_some(found)
}

/// g of (3), in the order of the coefficients of a model.
fn weights(
    kinematics: &Kinematics,
    model: &GeometryModel,
    lines: &Lines,
    sign: f64,
) -> Option<DVector<f64>> {
    let axes = plane_axes(lines.plane)?;
    let courses = [
        course(lines, axes[0], lines.spans_mm[0])?,
        course(lines, axes[1], lines.spans_mm[1])?,
    ];
    let mut g = Vec::new();
    for curve in &model.curves {
        let basis = basis(curve);
        let mut own = vec![0.0; curve.coefficient.len()];
        for (course, across) in courses.iter().zip([axes[1], axes[0]]) {
            for (positions, share) in course {
                let lever = sensitivity(
                    kinematics,
                    positions,
                    &lines.tool_offset_mm,
                    curve.component,
                );
                let mut values = Vec::new();
                basis.values(positions[curve.component.of], &mut values);
                for (sum, value) in own.iter_mut().zip(values) {
                    *sum -= sign * share * lever[across.index()] * value; // (1), (2)
                }
            }
        }
        g.extend(own);
    }
    Some(DVector::from_vec(g))
}

/// Positions along a line, each with its share in the slope of the least-squares line; none for a line without length.
fn course(lines: &Lines, along: Axis, span_mm: (f64, f64)) -> Option<Vec<(PerAxis<f64>, f64)>> {
    let (least, greatest) = span_mm;
    let step_mm = (greatest - least) / f64::from(POINTS - 1);
    if !step_mm.is_finite() || step_mm <= 0.0 {
        return None;
    }
    let middle_mm = f64::midpoint(least, greatest);
    let from_middle = |k: u32| least + step_mm * f64::from(k) - middle_mm;
    let sum_mm2: f64 = (0..POINTS).map(|k| from_middle(k).powi(2)).sum();
    let point = |k: u32| {
        let mut positions = PerAxis::default();
        for axis in Axis::LINEAR {
            positions[axis] = lines.through_mm[axis.index()];
        }
        positions[along] = middle_mm + from_middle(k);
        (positions, from_middle(k) / sum_mm2)
    };
    Some((0..POINTS).map(point).collect())
}

fn basis(curve: &ErrorCurve) -> Basis {
    match curve.form {
        CurveForm::Constant => Basis::Constant,
        CurveForm::Polynomial => Basis::Polynomial {
            origin: curve.origin,
            powers: curve.power.clone(),
        },
        CurveForm::Table => Basis::Table {
            free: (0..curve.position.len()).collect(),
            knots: curve.position.clone(),
        },
    }
}

/// Whether g is a sum of single coefficients that are known and of the model's combinations.
fn is_determined(model: &GeometryModel, g: &DVector<f64>) -> bool {
    let curves = model.curves.iter();
    let known: Vec<bool> = curves.flat_map(|curve| &curve.estimable).copied().collect();
    let mut combinations = DMatrix::zeros(g.len(), model.combinations.len());
    for (column, combination) in model.combinations.iter().enumerate() {
        for (idx, weight) in &combination.weights {
            let row = *idx as usize;
            if row < g.len() {
                combinations[(row, column)] = *weight;
            }
        }
    }
    let mut rest = g.clone();
    for row in 0..g.len() {
        let greatest = combinations.row(row).amax();
        if known.get(row).copied().unwrap_or(false) {
            combinations.row_mut(row).fill(0.0);
            rest[row] = 0.0;
        } else if greatest > 0.0 {
            combinations.row_mut(row).scale_mut(1.0 / greatest);
            rest[row] /= greatest;
        } else if rest[row].abs() > 0.0 {
            return false;
        }
    }
    if rest.amax() <= 0.0 {
        return true;
    }
    for mut column in combinations.column_iter_mut() {
        let norm = column.norm();
        if norm > 0.0 {
            column.scale_mut(1.0 / norm);
        }
    }
    let svd = combinations.clone().svd(true, true);
    let Ok(shares) = svd.solve(&rest, NO_SINGULAR_VALUE * svd.singular_values.amax()) else {
        return false;
    };
    (&combinations * shares - &rest).norm() <= UNEXPLAINED * rest.norm()
}
