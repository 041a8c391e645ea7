//! Weights of readings by the arc that each stands for.
//!
//! Readings at a constant rate and feed are evenly spaced, and each counts as much as the others. Readings of a table may be dense
//! in one part of the circle and pull its centre there. Then a reading counts by its arc: half the way to both neighbours.

use std::f64::consts::TAU;

use nalgebra::Vector2;

/// Standard deviation of the arcs over their mean, above which the readings are unevenly spaced.
const UNEVEN: f64 = 0.3;
/// Least arc of a reading over the mean of all: readings at one angle have none.
const LEAST_ARC: f64 = 1e-6;

/// Relative standard uncertainties of readings, of which the weights of a fit follow; each 1 where they are evenly spaced.
pub(super) fn uncertainties(points_mm: &[Vector2<f64>]) -> Vec<f64> {
    let n = points_mm.len();
    let even = vec![1.0; n];
    // The middle of the extent: a mean would lie where the readings are dense.
    let Some((low_mm, high_mm)) = extent(points_mm) else {
        return even;
    };
    let centre_mm = (low_mm + high_mm) / 2.0;
    let mut angles: Vec<(f64, usize)> = { points_mm.iter().enumerate() }
        .map(|(place, point)| {
            let from_centre = point - centre_mm;
            (from_centre.y.atan2(from_centre.x), place)
        })
        .collect();
    angles.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    let Some(((first, _), (last, _))) = angles.first().zip(angles.last()) else {
        return even;
    };
    let mean_rad = TAU / n as f64;
    let (before_first, behind_last) = (last - TAU, first + TAU);
    let mut arcs: Vec<(usize, f64)> = Vec::with_capacity(n);
    for (at, (_, place)) in angles.iter().enumerate() {
        let before = at.checked_sub(1).and_then(|it| angles.get(it));
        let before = before.map_or(before_first, |(angle, _)| *angle);
        let behind = angles.get(at + 1).map_or(behind_last, |(angle, _)| *angle);
        arcs.push((*place, (behind - before) / 2.0 / mean_rad));
    }
    let variance = arcs.iter().map(|(_, arc)| (arc - 1.0).powi(2)).sum::<f64>() / n as f64;
    if variance.is_nan() || variance.sqrt() <= UNEVEN {
        return even;
    }
    arcs.sort_by_key(|(place, _)| *place);
    let by_arc = arcs
        .iter()
        .map(|(_, arc)| arc.max(LEAST_ARC).sqrt().recip());
    by_arc.collect()
}

/// Least and greatest coordinates.
fn extent(points_mm: &[Vector2<f64>]) -> Option<(Vector2<f64>, Vector2<f64>)> {
    let pairs = points_mm.iter().map(|point| (*point, *point));
    pairs.reduce(|(low, high), (point, _)| (low.inf(&point), high.sup(&point)))
}

#[cfg(test)]
mod tests {
    use metrology::fit::fit_round;

    use super::*;

    fn point(angle: f64) -> Vector2<f64> {
        let radius_mm = 100.0 + 0.005 * (2.0 * angle).cos() + 0.003 * (3.0 * angle).sin();
        Vector2::new(radius_mm * angle.cos(), radius_mm * angle.sin())
    }

    #[test]
    fn evenly_spaced_readings_count_alike() {
        let points: Vec<Vector2<f64>> = (0..360)
            .map(|deg| point(f64::from(deg).to_radians()))
            .collect();
        assert_eq!(uncertainties(&points), vec![1.0; 360]);
        assert_eq!(uncertainties(&[]), Vec::<f64>::new());
    }

    #[test]
    fn readings_that_are_dense_in_one_part_leave_the_centre_where_it_is() {
        let dense = (0..1800).map(|k| f64::from(k) * 0.05);
        let sparse = (45..180).map(|k| f64::from(k) * 2.0);
        let points: Vec<Vector2<f64>> = { dense.chain(sparse) }
            .map(|deg: f64| point(deg.to_radians()))
            .collect();
        let by_arc = fit_round(&points, &uncertainties(&points)).unwrap();
        let alike = fit_round(&points, &vec![1.0; points.len()]).unwrap();
        assert!(by_arc.centre_mm.norm() < 2e-4, "{}", by_arc.centre_mm);
        assert!(alike.centre_mm.norm() > 1e-3, "{}", alike.centre_mm);
    }
}
