//! What touches of one feature are of: one place again and again, a sphere, or a ring.

use metrology::fit::fit_round;
use metrology::number::number;
use nalgebra::{Matrix3, SymmetricEigen, Vector2, Vector3};

/// Touches that are no farther apart are of one place, and of one plane, mm: an evaluation takes them so too.
pub const SAME_PLACE_MM: f64 = 0.5;
/// Greatest form error by which a shape is known, mm.
const GREATEST_FORM_MM: f64 = 0.5;
/// Fewest touches of one place, of a ring and of a sphere.
const LEAST_OF_A_PLACE: usize = 5;
const LEAST_OF_A_RING: usize = 4;
const LEAST_OF_A_SPHERE: usize = 6;
/// Touches beyond the unknowns of a shape with which one of something else is found.
const TO_FIND_ONE: usize = 3;
/// Most touches of one shape: a slip is looked for by leaving out each.
const MOST_OF_A_SHAPE: usize = 1_000;
/// Touches of a ring and of a sphere lie at least so far round, deg.
const LEAST_ARC_OF_A_RING_DEG: f64 = 120.0;
const LEAST_CAP_OF_A_SPHERE_DEG: f64 = 90.0;
/// A ring nearer to a plane of two axes is in it, rad: its diameter differs by less than 1e-6 of it.
const IN_PLANE_RAD: f64 = 1e-3;
/// Part of the scatter along one axis beyond which a place was approached along it.
const ALONG_AXIS: f64 = 0.9;

/// What was touched.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// One place, along a direction.
    Place(Vector3<f64>),
    Sphere(Round),
    /// In the plane of a normal.
    Ring(Round, Vector3<f64>),
}

/// A sphere or a ring, mm.
#[derive(Clone, Debug, PartialEq)]
pub struct Round {
    pub centre_mm: Vector3<f64>,
    pub radius_mm: f64,
    pub form_mm: f64,
}

impl Shape {
    /// Its name.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Place(_) => "place",
            Self::Sphere(_) => "sphere",
            Self::Ring(..) => "ring",
        }
    }

    /// Where it is, mm.
    pub fn centre_mm(&self, points: &[Vector3<f64>]) -> Vector3<f64> {
        match self {
            Self::Place(_) => points.first().copied().unwrap_or_default(),
            Self::Sphere(round) | Self::Ring(round, _) => round.centre_mm,
        }
    }
}

/// Whether all points are of one place.
pub fn is_place(points: &[Vector3<f64>]) -> bool {
    let first = points.first().copied().unwrap_or_default();
    points
        .iter()
        .all(|point| (point - first).norm() <= SAME_PLACE_MM)
}

/// What points are of.
///
/// # Errors
/// What they are instead, in words.
pub fn of(points: &[Vector3<f64>]) -> Result<Shape, String> {
    let n = points.len();
    if is_place(points) {
        if n < LEAST_OF_A_PLACE {
            return Err(format!(
                "{n} touches of one place: at least {LEAST_OF_A_PLACE}, 10 are usual"
            ));
        }
        return Ok(Shape::Place(approach(points)));
    }
    if n > MOST_OF_A_SHAPE {
        return Err(format!(
            "{n} touches of one shape: at most {MOST_OF_A_SHAPE}"
        ));
    }
    let (across, normal) = spread(points);
    let [length, width, height] = across;
    let [long, wide, high] = [length, width, height].map(|mm| number((mm * 1e3).round() / 1e3));
    let size = format!("{n} points within {long} mm × {wide} mm × {high} mm");
    if n < LEAST_OF_A_RING {
        return Err(format!(
            "{size}: a ring needs {LEAST_OF_A_RING}, a sphere {LEAST_OF_A_SPHERE}, one place {LEAST_OF_A_PLACE} touches"
        ));
    }
    if width <= SAME_PLACE_MM {
        return Err(format!("{size}: on one line"));
    }
    if height <= SAME_PLACE_MM {
        return ring(points, in_plane_of_axes(normal))
            .map_err(|why| format!("{size}: in one plane, {why}"));
    }
    if n < LEAST_OF_A_SPHERE {
        return Err(format!(
            "{size}: in no plane, and a sphere needs {LEAST_OF_A_SPHERE}"
        ));
    }
    sphere(points).map_err(|why| format!("{size}: in no plane, {why}"))
}

/// The direction along which touches of one place scatter most: an axis where most of it is along one.
fn approach(points: &[Vector3<f64>]) -> Vector3<f64> {
    let scatter = scatter(points);
    let whole = scatter.trace();
    let along = scatter.diagonal().imax();
    if whole <= 0.0 || scatter.diagonal()[along] >= ALONG_AXIS * whole {
        // Without any scatter along Z, as most surfaces are touched.
        let axis = if whole <= 0.0 { 2 } else { along };
        return Vector3::ith(axis, 1.0);
    }
    let eigen = SymmetricEigen::new(scatter);
    let first = eigen.eigenvalues.imax();
    upright(eigen.eigenvectors.column(first).into())
}

fn mean(points: &[Vector3<f64>]) -> Vector3<f64> {
    points.iter().sum::<Vector3<f64>>() / points.len().max(1) as f64
}

fn scatter(points: &[Vector3<f64>]) -> Matrix3<f64> {
    let mean = mean(points);
    let apart = points.iter().map(|point| point - mean);
    apart.map(|apart| apart * apart.transpose()).sum()
}

/// Extents along the principal directions, the greatest first, and the last of these directions.
fn spread(points: &[Vector3<f64>]) -> ([f64; 3], Vector3<f64>) {
    let eigen = SymmetricEigen::new(scatter(points));
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let direction = |k: usize| -> Vector3<f64> { eigen.eigenvectors.column(order[k]).into() };
    let extent = |k: usize| {
        let along = direction(k);
        let places = points.iter().map(|point| point.dot(&along));
        let [low, high] = places.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], at| {
            [low.min(at), high.max(at)]
        });
        high - low
    };
    ([0, 1, 2].map(extent), upright(direction(2)))
}

/// A direction whose greatest part is positive.
fn upright(direction: Vector3<f64>) -> Vector3<f64> {
    if direction[direction.iamax()] < 0.0 {
        -direction
    } else {
        direction
    }
}

fn in_plane_of_axes(normal: Vector3<f64>) -> Vector3<f64> {
    let axis = Vector3::ith(normal.iamax(), 1.0);
    if (normal - axis).norm() < IN_PLANE_RAD {
        axis
    } else {
        normal
    }
}

fn ring(points: &[Vector3<f64>], normal: Vector3<f64>) -> Result<Shape, String> {
    let [across, along] = metrology::fit::plane_basis(&normal);
    let flat: Vec<Vector2<f64>> = points
        .iter()
        .map(|point| Vector2::new(point.dot(&across), point.dot(&along)))
        .collect();
    let (centre, radius_mm, form_mm) = fitted(&flat, "circle")?;
    let mut angles: Vec<f64> = flat
        .iter()
        .map(|point| (point.y - centre.y).atan2(point.x - centre.x).to_degrees())
        .collect();
    angles.sort_by(f64::total_cmp);
    let gaps = angles.windows(2).map(|two| two[1] - two[0]);
    let around = angles.first().copied().unwrap_or_default() + 360.0
        - angles.last().copied().unwrap_or_default();
    let arc_deg = 360.0 - gaps.fold(around, f64::max);
    if arc_deg < LEAST_ARC_OF_A_RING_DEG {
        return Err(format!(
            "on an arc of {} deg: at least {LEAST_ARC_OF_A_RING_DEG} deg",
            number(arc_deg.round())
        ));
    }
    let height = mean(points).dot(&normal);
    let round = Round {
        centre_mm: across * centre.x + along * centre.y + normal * height,
        radius_mm,
        form_mm,
    };
    Ok(Shape::Ring(round, normal))
}

fn sphere(points: &[Vector3<f64>]) -> Result<Shape, String> {
    let (centre_mm, radius_mm, form_mm) = fitted(points, "sphere")?;
    let directions: Vec<Vector3<f64>> = points
        .iter()
        .map(|point| (point - centre_mm).normalize())
        .collect();
    let pairs = directions.iter().enumerate();
    let pairs = pairs.flat_map(|(k, one)| directions[k + 1..].iter().map(move |two| one.dot(two)));
    let least = pairs.fold(1.0_f64, f64::min);
    let cap_deg = least.clamp(-1.0, 1.0).acos().to_degrees();
    if cap_deg < LEAST_CAP_OF_A_SPHERE_DEG {
        return Err(format!(
            "on a cap of {} deg of a sphere: at least {LEAST_CAP_OF_A_SPHERE_DEG} deg from one touch to another",
            number(cap_deg.round())
        ));
    }
    Ok(Shape::Sphere(Round {
        centre_mm,
        radius_mm,
        form_mm,
    }))
}

/// The least-squares shape: centre, radius and form error. One touch of something else is no obstacle: the evaluation names it.
fn fitted<const D: usize>(
    points: &[nalgebra::SVector<f64, D>],
    what: &str,
) -> Result<(nalgebra::SVector<f64, D>, f64, f64), String> {
    let fit = |points: &[nalgebra::SVector<f64, D>]| {
        let fit = fit_round(points, &vec![1.0; points.len()]).ok()?;
        Some((fit.centre_mm, fit.radius_mm, fit.form_mm))
    };
    let found = fit(points).ok_or_else(|| format!("and no {what} is determined"))?;
    let form_mm = found.2;
    if form_mm <= GREATEST_FORM_MM {
        return Ok(found);
    }
    let without = |out: usize| {
        let mut others = points.to_vec();
        others.remove(out);
        fit(&others).map(|found| found.2)
    };
    let can_find = points.len() >= D + 1 + TO_FIND_ONE;
    let has_slip = can_find
        && (0..points.len())
            .filter_map(without)
            .any(|left_mm| left_mm <= GREATEST_FORM_MM);
    if has_slip {
        return Ok(found);
    }
    Err(format!(
        "and on no {what}: the best one leaves {} mm between them, at most {GREATEST_FORM_MM} mm",
        number((form_mm * 1e3).round() / 1e3)
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of latitudes and longitudes, by angles that are no formula of the crates' fit.
    fn on_sphere(n: usize, centre: [f64; 3], radius: f64, tilt: f64) -> Vec<Vector3<f64>> {
        let golden = 2.399_963;
        let point = |k: usize| {
            let height = 1.0 - (k as f64 + 0.5) / n as f64;
            let across = (1.0 - height * height).sqrt();
            let angle = golden * k as f64 + tilt;
            Vector3::from(centre)
                + radius * Vector3::new(across * angle.cos(), across * angle.sin(), height)
        };
        (0..n).map(point).collect()
    }

    fn on_ring(n: usize, arc_deg: f64, normal: usize) -> Vec<Vector3<f64>> {
        let point = |k: usize| {
            let angle = (arc_deg * k as f64 / n as f64).to_radians();
            let mut at = Vector3::new(7.0, -3.0, 5.0);
            at[(normal + 1) % 3] += 20.0 * angle.cos();
            at[(normal + 2) % 3] += 20.0 * angle.sin();
            at
        };
        (0..n).map(point).collect()
    }

    #[test]
    fn spheres_rings_and_places_are_known_apart() {
        for n in [6, 12, 25] {
            let Ok(Shape::Sphere(round)) = of(&on_sphere(n, [10.0, -20.0, 30.0], 14.5, 0.3)) else {
                panic!("{n}");
            };
            assert!((round.radius_mm - 14.5).abs() < 1e-9 && round.form_mm < 1e-9);
            assert!((round.centre_mm - Vector3::new(10.0, -20.0, 30.0)).norm() < 1e-9);
        }
        for normal in 0..3 {
            let Ok(Shape::Ring(round, up)) = of(&on_ring(8, 360.0, normal)) else {
                panic!("{normal}");
            };
            assert!((round.radius_mm - 20.0).abs() < 1e-9, "{round:?}");
            assert!((round.centre_mm - Vector3::new(7.0, -3.0, 5.0)).norm() < 1e-9);
            assert!((up - Vector3::ith(normal, 1.0)).norm() < 1e-12);
        }
        let touch = |k: usize| Vector3::new(1.0, 2.0, 3.0 + 1e-3 * [0.0, 1.0, 4.0, 2.0, 3.0][k]);
        let place: Vec<Vector3<f64>> = (0..5).map(touch).collect();
        assert_eq!(of(&place), Ok(Shape::Place(Vector3::z())));
        let still = vec![Vector3::new(1.0, 2.0, 3.0); 5];
        assert_eq!(of(&still), Ok(Shape::Place(Vector3::z())));
        let oblique: Vec<Vector3<f64>> = (0..5)
            .map(|k| f64::from(k) * 1e-3 * Vector3::new(1.0, 1.0, 0.0))
            .collect();
        let Ok(Shape::Place(along)) = of(&oblique) else {
            panic!("a place");
        };
        assert!((along - Vector3::new(1.0, 1.0, 0.0).normalize()).norm() < 1e-9);
    }

    #[test]
    fn what_is_none_of_them_is_refused_with_what_it_is() {
        let line = |n: u32| -> Vec<Vector3<f64>> {
            (0..n)
                .map(|k| f64::from(k) * Vector3::new(3.0, 2.0, 1.0))
                .collect()
        };
        let grid = |height: fn(usize) -> f64| -> Vec<Vector3<f64>> {
            (0..25)
                .map(|k| Vector3::new(10.0 * (k % 5) as f64, 10.0 * (k / 5) as f64, height(k)))
                .collect()
        };
        let cap: Vec<Vector3<f64>> = on_sphere(80, [0.0; 3], 50.0, 0.0)
            .into_iter()
            .take(12)
            .collect();
        for (points, words) in [
            (line(9), "on one line"),
            (line(3), "a ring needs 4, a sphere 6"),
            (
                vec![Vector3::zeros(); 4],
                "4 touches of one place: at least 5",
            ),
            (grid(|_| 0.0), "in one plane, and no circle is determined"),
            (
                grid(|k| 5.0 * ((k * 7) % 5) as f64),
                "in no plane, and on no sphere",
            ),
            (on_ring(12, 90.0, 2), "on an arc of"),
            (on_sphere(5, [0.0; 3], 10.0, 0.0), "a sphere needs 6"),
            (cap, "on a cap of"),
        ] {
            let said = of(&points).unwrap_err();
            assert!(said.contains(words), "{said}");
        }
        // One touch of something else leaves a sphere, which the evaluation refuses with that touch.
        let mut slipped = on_sphere(25, [0.0; 3], 14.0, 0.0);
        slipped[7].x += 2.0;
        assert!(matches!(of(&slipped), Ok(Shape::Sphere(_))));
    }
}
