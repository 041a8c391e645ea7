//! A touch of something else among those of a shape.

use metrology::number::number;
use nalgebra::Vector3;

use crate::section::um;

/// Greatest form error of a shape that was touched, mm: beyond it a touch is of something else, or was latched wrongly.
const GREATEST_FORM_MM: f64 = 0.5;
/// A touch is far from the others that makes the form error this many times as great.
const FAR_FORMS: f64 = 10.0;
/// None is far where the form error is smaller, mm.
const LEAST_FAR_FORM_MM: f64 = 0.01;

/// The touch without which the others are nearest to a shape, and their form error then, mm.
fn farthest(
    points: &[Vector3<f64>],
    form_mm: impl Fn(&[Vector3<f64>]) -> Option<f64>,
) -> Option<(usize, f64)> {
    let without = |out: usize| {
        let mut others = points.to_vec();
        others.remove(out);
        Some((out, form_mm(&others)?))
    };
    let nearest = (0..points.len()).filter_map(without);
    nearest.min_by(|a, b| a.1.total_cmp(&b.1))
}

/// The touch of a shape that is far from the others, in words; `None` also with too few touches.
pub(super) fn far(
    points: &[Vector3<f64>],
    n_unknowns: usize,
    form_mm: impl Fn(&[Vector3<f64>]) -> Option<f64>,
) -> Option<String> {
    let found_mm = form_mm(points).filter(|mm| *mm > LEAST_FAR_FORM_MM)?;
    if points.len() < n_unknowns + 3 {
        return None;
    }
    let (place, left_mm) = farthest(points, &form_mm)?;
    (found_mm > FAR_FORMS * left_mm).then(|| {
        format!(
            "touch {} of {} makes the form error {} µm, which is {} µm without it. It is in every figure; repeat the measurement where it is a slip",
            place + 1,
            points.len(),
            um(found_mm),
            um(left_mm)
        )
    })
}

/// Why touches are not those of one shape: the one without which the others are nearest to it.
pub(super) fn slip(
    points: &[Vector3<f64>],
    n_unknowns: usize,
    form_mm: impl Fn(&[Vector3<f64>]) -> Option<f64>,
) -> Option<String> {
    let found_mm = form_mm(points).filter(|mm| *mm > GREATEST_FORM_MM)?;
    let greatest = um(GREATEST_FORM_MM);
    if points.len() < n_unknowns + 3 {
        // Without any of so few the others fit nearly as well.
        return Some(format!(
            "form error of {} µm, at most {greatest} µm: one of its {} touches is of something else: repeat the measurement",
            um(found_mm),
            points.len()
        ));
    }
    let (place, left_mm) = farthest(points, &form_mm)?;
    let at = points[place].iter().map(|mm| number(*mm));
    Some(format!(
        "form error of {} µm, at most {} µm: touch {} of {}, at ({}) mm, is the farthest from the others, which have {} µm without it: \
         repeat the measurement",
        um(found_mm),
        greatest,
        place + 1,
        points.len(),
        at.collect::<Vec<_>>().join(", "),
        um(left_mm)
    ))
}
