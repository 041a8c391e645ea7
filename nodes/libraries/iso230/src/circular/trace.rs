//! One recorded path round a circle, as points or as radial deviations over an angle.

use std::f64::consts::TAU;

use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

use crate::Iso230Error;
use crate::extent::{check_finite, check_length, check_points};

/// Longest angle without a point in a full circle, rad: 10 degrees.
pub const LONGEST_GAP_RAD: f64 = TAU / 36.0;
/// Points that a full circle with such gaps has at least.
const LEAST_POINTS: usize = 36;

/// A path round the nominal centre.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum CircularTrace {
    /// Points (u, v) from the nominal centre, as a grid encoder gives them, mm.
    PointsMm(Vec<[f64; 2]>),
    /// Radial deviations over the angle, as a ballbar gives them.
    Radial {
        /// Angles from the u axis towards the v axis, rad.
        angles_rad: Vec<f64>,
        /// Measured minus nominal radius, mm.
        deviations_mm: Vec<f64>,
    },
}

impl CircularTrace {
    /// The points, once they are known to go all round.
    pub(super) fn points(
        &self,
        nominal_radius_mm: f64,
        place: &'static str,
    ) -> Result<Vec<Vector2<f64>>, Iso230Error> {
        let points: Vec<Vector2<f64>> = match self {
            Self::PointsMm(points) => points.iter().map(|p| Vector2::from(*p)).collect(),
            Self::Radial {
                angles_rad,
                deviations_mm,
            } => {
                check_length(place, 0, deviations_mm.len(), angles_rad.len())?;
                check_finite(place, 0, angles_rad)?;
                check_finite(place, 0, deviations_mm)?;
                let rows = angles_rad.iter().zip(deviations_mm);
                let point = |(angle, deviation): (&f64, &f64)| {
                    (nominal_radius_mm + deviation) * Vector2::new(angle.cos(), angle.sin())
                };
                rows.map(point).collect()
            }
        };
        check_points(place, points.len(), LEAST_POINTS)?;
        for (row, point) in points.iter().enumerate() {
            check_finite(place, row, point.as_slice())?;
        }
        check_full(&points, place)?;
        Ok(points)
    }
}

/// Refuses a path that leaves out more than [`LONGEST_GAP_RAD`].
fn check_full(points: &[Vector2<f64>], place: &'static str) -> Result<(), Iso230Error> {
    let mut angles: Vec<f64> = points.iter().map(|p| p.y.atan2(p.x)).collect();
    angles.sort_unstable_by(f64::total_cmp);
    let next = angles.iter().skip(1).copied();
    let round = next.chain(angles.first().map(|first| first + TAU));
    for (&at, next) in angles.iter().zip(round) {
        // Half a percent: stations at exactly 10 degrees round to either side.
        if next - at > 1.005 * LONGEST_GAP_RAD {
            return Err(Iso230Error::AngularGap {
                place,
                gap_rad: next - at,
                at_rad: at,
                limit_rad: LONGEST_GAP_RAD,
            });
        }
    }
    Ok(())
}

/// A path as radius over angle, read between its points by straight lines.
pub(super) struct Polar {
    angles_rad: Vec<f64>,
    radii_mm: Vec<f64>,
}

/// The path about `centre_mm`.
pub(super) fn polar(points_mm: &[Vector2<f64>], centre_mm: &Vector2<f64>) -> Polar {
    let place = |point: &Vector2<f64>| {
        let arm = point - centre_mm;
        (arm.y.atan2(arm.x), arm.norm())
    };
    let mut places: Vec<(f64, f64)> = points_mm.iter().map(place).collect();
    places.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (angles_rad, radii_mm) = places.into_iter().unzip();
    Polar {
        angles_rad,
        radii_mm,
    }
}

impl Polar {
    /// Angles of the points in (−π, π], ascending.
    pub(super) fn angles_rad(&self) -> &[f64] {
        &self.angles_rad
    }

    /// Radius at an angle in (−π, π], mm.
    pub(super) fn radius_at(&self, angle_rad: f64) -> f64 {
        let n = self.angles_rad.len();
        let after = self.angles_rad.partition_point(|a| *a <= angle_rad);
        let before = (after + n - 1) % n;
        let turn = |k: usize, from: f64| (self.angles_rad[k] - from).rem_euclid(TAU);
        let from = self.angles_rad[before];
        let (step, aside) = (turn(after % n, from), (angle_rad - from).rem_euclid(TAU));
        let share = if step > 0.0 { aside / step } else { 0.0 };
        let (here, there) = (self.radii_mm[before], self.radii_mm[after % n]);
        here + share * (there - here)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn a_path_is_read_between_its_points_and_across_the_seam() {
        let points: Vec<_> = (0..8)
            .map(|k| {
                let angle = TAU * f64::from(k) / 8.0 + 0.1;
                (10.0 + f64::from(k)) * Vector2::new(angle.cos(), angle.sin())
            })
            .collect();
        let path = polar(&points, &Vector2::zeros());
        assert!((path.radius_at(0.1) - 10.0).abs() < 1e-12);
        assert!((path.radius_at(0.1 + TAU / 16.0) - 10.5).abs() < 1e-12);
        // Between the last point (17) and the first (10).
        assert!((path.radius_at(0.1 - TAU / 16.0) - 13.5).abs() < 1e-12);
        let seam = [PI, 1e-9 - PI].map(|angle| path.radius_at(angle));
        assert!((seam[0] - seam[1]).abs() < 1e-6);
    }

    #[test]
    fn a_half_circle_names_its_gap() {
        let half = CircularTrace::Radial {
            angles_rad: (0..100).map(|k| f64::from(k) * 0.0314).collect(),
            deviations_mm: vec![0.0; 100],
        };
        let error = half.points(50.0, "clockwise").unwrap_err();
        assert!(
            matches!(error, Iso230Error::AngularGap { gap_rad, at_rad, .. } if gap_rad > 3.1 && (at_rad - 3.1086).abs() < 1e-9),
            "{error}"
        );
    }
}
