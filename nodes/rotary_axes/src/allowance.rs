//! What is alike in all visits, so that neither residuals nor repeats show it, and what it does to the estimate.
//!
//! # Model
//!
//! ```text
//!   b = G y,   cov(b) = cov_noise(b) + G C G^T                                            (1)
//!   C = D D^T + F                                                                         (2)
//!   D: a column for each cause, its standard uncertainty times what it does to each reading
//!     set-up:            the ball is off by the same at every visit, three directions     (3)
//!     scale, squareness: E(d)(d) = s q of X, Y, Z; EC0Y, EB0Z, EA0Z                       (4)
//!     rotary motions:    a (cos m q - 1) and b sin m q, m = 1, 2, of each motion          (5)
//!   F_kl = u^2 exp(-|p_k - p_l|^2/(2 l^2)) 1:  any smooth error of the linear axes        (6)
//!   known linear axes:   F = J cov(c) J^T instead of (4) and (6)                          (7)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | G | `SphereFit::gain`: change of the estimate per change of a reading | 1, rad/mm |
//! | p_k | linear positions at visit k | mm |
//! | u, l | `linear_error_um`, `linear_error_length_mm` | µm, mm |
//! | c, J | coefficients of the linear axes' model, their effect on the readings | |
//!
//! The sphere is where the linear axes say, so what they are wrong by is read as a displacement of a rotary
//! axis, and more visits do not average it out. (5): the first harmonic of an error motion and a location
//! error are alike at most poses; of each motion the allowance s is the root mean square over a turn, counted from its value
//! at q = 0, as (5) is: a coefficient c of either kind makes c² (3/2 + 1/2) together, so that shares of 0.63 and 0.32 of s
//! in each coefficient of both harmonics make 2 (0.63² + 0.32²) s² = s². A pair that was estimated is not allowed for.
//!
//! # Holds when
//! The allowances are standard uncertainties of their causes, independent of each other.
//!
//! # Agreement
//! `coverage_of_95_percent_intervals_over_machines_of_the_plant` in tests/scenario/rotary_coverage.rs: 95.5 % of 1,200
//! intervals hold the truth, 47.8 % with the noise alone.
//!
//! # References
//! \[1\] JCGM 100:2008, F.1.2 (correlation by common causes). \[2\] JCGM 102:2011, 6.2 (propagation to several
//! quantities).

use machine::SphereDesign;
use machine::poses::PoseRow;
use machine::volumetric::VolumetricModel;
use metrology::sample::GeometryModel;
use metrology::{Axis, ErrorComponent};
use nalgebra::{DMatrix, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::estimate::RotaryEstimate;
use crate::unknown::Unknown;
use crate::visit::SphereVisit;

/// Share of a motion's standard deviation in a coefficient of its first and second harmonic, (5).
const OF_HARMONIC: [f64; 2] = [0.63, 0.32];

/// Standard uncertainties of what is alike in all visits.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Allowance {
    /// Place of the probe's ball against the point that works, standard uncertainty in each direction.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub setup_um: f64,
    /// Scale of each linear axis, standard uncertainty; where no model of them is known.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub linear_scale_um_per_m: f64,
    /// Each squareness of the linear axes, standard uncertainty; where no model of them is known.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub linear_squareness_urad: f64,
    /// Any other error of the linear axes, standard uncertainty in each direction; where no model of them is known.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub linear_error_um: f64,
    /// Distance over which that error changes.
    #[schemars(range(min = 1.0, max = 100_000.0))]
    pub linear_error_length_mm: f64,
    /// Each error motion of a rotary axis, standard deviation over a turn.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub motion_um: f64,
    /// Each turning error motion of a rotary axis, standard deviation over a turn.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub motion_urad: f64,
}

/// What is known besides the visits.
#[derive(Clone, Copy, Debug, Default)]
pub struct Known<'a> {
    /// Allowances, where they are stated.
    pub allowance: Option<&'a Allowance>,
    /// The model of the linear axes that was taken off the readings.
    pub linear: Option<&'a GeometryModel>,
}

/// G C Gᵀ of (1) for an estimate; zero where nothing is known.
#[must_use]
pub fn common_covariance(
    design: &SphereDesign,
    found: &RotaryEstimate,
    known: Known<'_>,
) -> DMatrix<f64> {
    let rows = used_rows(design, found);
    through(design, &rows, &found.unknowns, known, &found.fit.gain)
}

/// The readings that an estimate was made from, each at its sphere's place.
pub(crate) fn used_rows<'a>(
    design: &SphereDesign,
    found: &'a RotaryEstimate,
) -> Vec<(PoseRow, &'a SphereVisit)> {
    let used = found.residuals.iter().filter(|left| !left.doubtful);
    used.filter_map(|left| {
        let place = found.spheres.iter().find(|s| s.0 == left.visit.sphere)?.1;
        Some((design.row(&place, &left.visit.pose_rad), &left.visit))
    })
    .collect()
}

/// T C Tᵀ for the readings `rows` and any linear map T of them; zero where nothing is known.
pub(crate) fn through(
    design: &SphereDesign,
    rows: &[(PoseRow, &SphereVisit)],
    estimated: &[Unknown],
    known: Known<'_>,
    map: &DMatrix<f64>,
) -> DMatrix<f64> {
    let p = map.nrows();
    let mut sum = DMatrix::zeros(p, p);
    if map.ncols() != 3 * rows.len() {
        return sum;
    }
    let readings = Readings { design, rows };
    let mut add = |columns: &DMatrix<f64>| {
        let effect = map * columns;
        sum += &effect * effect.transpose();
    };
    if let Some(allowance) = known.allowance {
        add(&readings.setup(allowance.setup_um / 1e3));
        add(&readings.motions(allowance, estimated));
        if known.linear.is_none() {
            add(&readings.scale_and_squareness(allowance));
            let smooth = readings.smooth(allowance);
            sum += map * smooth * map.transpose();
        }
    }
    if let Some(model) = known.linear {
        let effect = map * readings.coefficients(model);
        sum += &effect * &model.covariance * effect.transpose();
    }
    sum
}

/// Readings and what causes do to them.
struct Readings<'a> {
    design: &'a SphereDesign,
    rows: &'a [(PoseRow, &'a SphereVisit)],
}

impl Readings<'_> {
    /// One column from what a cause does to each reading.
    fn column(&self, effect: impl Fn(&PoseRow, &SphereVisit) -> Vector3<f64>) -> Vec<f64> {
        let effects = self.rows.iter().map(|(row, visit)| effect(row, visit));
        effects
            .flat_map(|effect| [effect.x, effect.y, effect.z])
            .collect()
    }

    fn matrix(&self, columns: &[Vec<f64>]) -> DMatrix<f64> {
        DMatrix::from_fn(3 * self.rows.len(), columns.len(), |i, j| columns[j][i])
    }

    /// (3).
    fn setup(&self, uncertainty_mm: f64) -> DMatrix<f64> {
        let along = |direction: usize| self.column(|_, _| Vector3::ith(direction, uncertainty_mm));
        self.matrix(&[along(0), along(1), along(2)])
    }

    /// (4).
    fn scale_and_squareness(&self, allowance: &Allowance) -> DMatrix<f64> {
        let scales = Axis::LINEAR.map(|axis| {
            let component = ErrorComponent::motion(axis, axis);
            let per_mm = allowance.linear_scale_um_per_m / 1e6;
            self.column(|row, _| {
                self.design.effect(row, component) * (per_mm * row.positions[axis])
            })
        });
        let turns = ErrorComponent::SQUARENESS.map(|component| {
            let by_rad = allowance.linear_squareness_urad / 1e6;
            self.column(|row, _| self.design.effect(row, component) * by_rad)
        });
        self.matrix(&[scales, turns].concat())
    }

    /// (5).
    fn motions(&self, allowance: &Allowance, estimated: &[Unknown]) -> DMatrix<f64> {
        let orders = u8::try_from(OF_HARMONIC.len()).expect("two harmonics");
        let harmonics = Unknown::harmonics(self.design, orders);
        let open = harmonics
            .into_iter()
            .flatten()
            .filter(|unknown| !estimated.contains(unknown));
        let columns: Vec<Vec<f64>> = open
            .map(|unknown| {
                let whole = if unknown.is_angular() {
                    allowance.motion_urad / 1e6
                } else {
                    allowance.motion_um / 1e3
                };
                let share = match unknown {
                    Unknown::Cosine { order, .. } | Unknown::Sine { order, .. } => {
                        OF_HARMONIC[usize::from(order) - 1]
                    }
                    Unknown::Location(_) => 0.0,
                };
                self.column(|row, visit| {
                    unknown.effect(self.design, row, &visit.pose_rad) * (whole * share)
                })
            })
            .collect();
        self.matrix(&columns)
    }

    /// (6).
    fn smooth(&self, allowance: &Allowance) -> DMatrix<f64> {
        let variance = (allowance.linear_error_um / 1e3).powi(2);
        let at = |k: usize| self.rows[k].0.positions.xyz();
        DMatrix::from_fn(3 * self.rows.len(), 3 * self.rows.len(), |i, j| {
            if i % 3 != j % 3 {
                return 0.0;
            }
            let apart = (at(i / 3) - at(j / 3)).norm() / allowance.linear_error_length_mm;
            variance * (-0.5 * apart * apart).exp()
        })
    }

    /// J of (7): a column for each coefficient of the model.
    fn coefficients(&self, model: &GeometryModel) -> DMatrix<f64> {
        let mut columns = Vec::new();
        for curve in &model.curves {
            for place in 0..curve.coefficient.len() {
                let mut unit = curve.clone();
                unit.coefficient.fill(0.0);
                unit.coefficient[place] = 1.0;
                let alone = GeometryModel {
                    curves: vec![unit],
                    ..model.clone()
                };
                let share = VolumetricModel::new(self.design.kinematics(), &alone);
                columns.push(self.column(|row, _| {
                    let at = row.positions[curve.component.of];
                    let value = share.as_ref().ok();
                    let value = value.and_then(|m| m.component_value(curve.component, at));
                    self.design.effect(row, curve.component) * value.unwrap_or(0.0)
                }));
            }
        }
        self.matrix(&columns)
    }
}

#[cfg(test)]
mod tests {
    use super::OF_HARMONIC;
    use std::f64::consts::TAU;

    #[test]
    fn eq5_shares_make_the_allowance_over_a_turn_counted_from_zero() {
        let n = 3600;
        let square = |share: f64, order: f64| {
            let at = (0..n).map(|k| order * TAU * f64::from(k) / f64::from(n));
            let sum: f64 = at.map(|q| (q.cos() - 1.0).powi(2) + q.sin().powi(2)).sum();
            share * share * sum / f64::from(n)
        };
        let [first, second] = OF_HARMONIC;
        let whole = square(first, 1.0) + square(second, 2.0);
        assert!((whole - 1.0).abs() < 0.01, "{whole}");
    }
}
