//! The estimate as it is published: curves of ISO 230-1 components with one covariance.
//!
//! A location error is a constant. The harmonics of an error motion are published as a table of their
//! sum, with a knot every 10° (a chord of the second harmonic is then off by at most 1.5 % of its
//! amplitude):
//!
//! ```text
//!   t = H b,   cov(t) = H cov(b) H^T                                                  (1)
//! ```
//!
//! The table of an axis that was visited all round spans its whole travel, since harmonics repeat.

use std::f64::consts::TAU;

use machine::{MachineFile, SphereDesign};
use metrology::sample::{CurveForm, ErrorCurve, EstimableCombination, GeometryModel};
use metrology::{Axis, ErrorComponent, Host, Stamp};
use nalgebra::DMatrix;

use crate::estimate::RotaryEstimate;
use crate::unknown::Unknown;

/// Distance of knots, rad.
const KNOTS_RAD: f64 = TAU / 36.0;
/// Share of a turn from which an axis counts as visited all round.
const ALL_ROUND: f64 = 0.8;

/// One published coefficient: weights of the unknowns in it.
type Weights = Vec<(usize, f64)>;

/// The message for an estimate.
#[must_use]
pub fn published(
    at: Stamp<Host>,
    sequence: u32,
    file: &MachineFile,
    design: &SphereDesign,
    found: &RotaryEstimate,
) -> GeometryModel {
    let covariance = found.covariance();
    let mut curves = Vec::new();
    let mut coefficients: Vec<Weights> = Vec::new();
    let mut place_of: Vec<Option<usize>> = vec![None; found.unknowns.len()];
    for (j, unknown) in found.unknowns.iter().enumerate() {
        if let Unknown::Location(component) = *unknown {
            place_of[j] = Some(coefficients.len());
            let weights = vec![vec![(j, 1.0)]];
            curves.push(curve(
                (found, &covariance),
                component,
                &weights,
                visited(found, component.of),
            ));
            coefficients.extend(weights);
        }
    }
    for motion in motions(found) {
        let span = table_span(file, motion.of, visited(found, motion.of));
        let position = knots(span);
        let weights: Vec<Weights> = position
            .iter()
            .map(|&q| at_knot(found, motion, q))
            .collect();
        let mut table = curve((found, &covariance), motion, &weights, span);
        table.form = CurveForm::Table;
        table.position = position;
        curves.push(table);
        coefficients.extend(weights);
    }
    let spread = DMatrix::from_fn(coefficients.len(), found.unknowns.len(), |row, j| {
        let own = coefficients[row]
            .iter()
            .filter(|(unknown, _)| *unknown == j);
        own.map(|(_, weight)| weight).sum()
    });
    GeometryModel {
        at,
        chain: design.kinematics().chain().to_string(),
        curves,
        covariance: &spread * &covariance * spread.transpose(), // (1)
        combinations: combinations(found, &place_of),
        n_samples: count(found.residuals.iter().filter(|left| !left.doubtful).count()),
        n_unknowns: count(found.unknowns.len() + 3 * found.spheres.len()),
        rank: count(found.fit.rank),
        residual_standard_deviation_mm: found.spatial_after_mm / 3.0_f64.sqrt(),
        sequence,
    }
}

fn curve(
    (found, covariance): (&RotaryEstimate, &DMatrix<f64>),
    component: ErrorComponent,
    weights: &[Weights],
    span: (f64, f64),
) -> ErrorCurve {
    let value = |weights: &Weights| weights.iter().map(|(j, w)| w * found.fit.values[*j]).sum();
    let uncertainty = |weights: &Weights| {
        let mut variance = 0.0;
        for (i, a) in weights {
            for (j, b) in weights {
                variance += a * b * covariance[(*i, *j)];
            }
        }
        f64::max(variance, 0.0).sqrt()
    };
    let seen: Vec<bool> = weights
        .iter()
        .map(|weights| weights.iter().all(|(j, _)| found.fit.estimable[*j]))
        .collect();
    ErrorCurve {
        component,
        form: CurveForm::Constant,
        origin: 0.0,
        power: Vec::new(),
        position: Vec::new(),
        coefficient: weights.iter().map(value).collect(),
        standard_uncertainty: weights
            .iter()
            .zip(&seen)
            .map(|(weights, seen)| {
                if *seen {
                    uncertainty(weights)
                } else {
                    f64::NAN
                }
            })
            .collect(),
        estimable: seen,
        span,
    }
}

/// Error motions of which harmonics were estimated, each once.
fn motions(found: &RotaryEstimate) -> Vec<ErrorComponent> {
    let mut motions = Vec::new();
    for unknown in &found.unknowns {
        if !matches!(unknown, Unknown::Location(_)) && !motions.contains(&unknown.component()) {
            motions.push(unknown.component());
        }
    }
    motions
}

fn at_knot(found: &RotaryEstimate, motion: ErrorComponent, position_rad: f64) -> Weights {
    let own = found.unknowns.iter().enumerate().filter(|(_, unknown)| {
        !matches!(unknown, Unknown::Location(_)) && unknown.component() == motion
    });
    own.map(|(j, unknown)| (j, unknown.share(position_rad)))
        .collect()
}

/// Least and greatest visited position of an axis, rad.
fn visited(found: &RotaryEstimate, axis: Axis) -> (f64, f64) {
    let used = found.residuals.iter().filter(|left| !left.doubtful);
    used.map(|left| left.visit.pose_rad[axis]).fold(
        (f64::INFINITY, f64::NEG_INFINITY),
        |(least, greatest), q| (least.min(q), greatest.max(q)),
    )
}

fn table_span(file: &MachineFile, axis: Axis, visited: (f64, f64)) -> (f64, f64) {
    match file.rotary_axis(axis) {
        Some(entry) if visited.1 - visited.0 >= ALL_ROUND * TAU => {
            let [least, greatest] = entry.travel_deg.map(f64::to_radians);
            (least, greatest)
        }
        _ => visited,
    }
}

fn knots((least, greatest): (f64, f64)) -> Vec<f64> {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a number of knots"
    )]
    let cells = ((greatest - least) / KNOTS_RAD).ceil().max(1.0) as usize;
    (0..=cells)
        .map(|k| least + (greatest - least) * k as f64 / cells as f64)
        .collect()
}

/// Combinations whose members are all published as constants.
fn combinations(found: &RotaryEstimate, place_of: &[Option<usize>]) -> Vec<EstimableCombination> {
    let published = found.fit.combinations.iter().map(|combination| {
        let weights = combination
            .weights
            .iter()
            .map(|&(j, weight)| place_of[j].map(|place| (count(place), weight)));
        let members = combination.weights.iter();
        let common = members.clone().flat_map(|&(i, a)| {
            members
                .clone()
                .map(move |&(j, b)| a * b * found.common_covariance[(i, j)])
        });
        let variance = combination.standard_uncertainty_mm.powi(2) + common.sum::<f64>();
        Some(EstimableCombination {
            weights: weights.collect::<Option<Vec<_>>>()?,
            value_mm: combination.value_mm,
            standard_uncertainty_mm: variance.max(0.0).sqrt(),
        })
    });
    published.flatten().collect()
}

fn count(n: usize) -> u32 {
    u32::try_from(n).unwrap_or(u32::MAX)
}
