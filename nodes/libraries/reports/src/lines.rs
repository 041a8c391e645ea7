//! Squareness between reference lines, as ISO 230-1 defines it, beside that of a model's curves.

use grid_encoder::reference_lines::{Lines, LinesSquareness, squareness};
use machine::Kinematics;
use metrology::sample::{GeometryModel, TestPlane};
use metrology::squareness::between;
use nalgebra::Vector3;
use serde_json::{Value, json};

use super::geometry::COVERAGE;
use super::section::{Section, rounded};
use crate::evaluate::Tests;
use crate::evaluate::circles::plane_axes;

/// Places that differ by less are one, mm.
const SAME_MM: f64 = 1e-6;

/// Centre and radius of a circle, for the extent of the recorded trajectories.
#[derive(Clone, Copy)]
struct Where {
    plane: TestPlane,
    centre_mm: Vector3<f64>,
    radius_mm: f64,
    tool_offset_mm: Vector3<f64>,
}

/// Adds the squareness between least-squares lines over the recorded circles of each plane to the part of `model`.
pub fn state(section: &mut Section, tests: &Tests, model: &GeometryModel) {
    let kinematics = tests.machine.as_ref().map(Kinematics::new);
    let Some(Ok(kinematics)) = kinematics else {
        return;
    };
    let mut figures: Vec<Value> = Vec::new();
    for plane in [TestPlane::Xy, TestPlane::Yz, TestPlane::Zx] {
        let Some(lines) = lines(&circles(tests), plane) else {
            continue;
        };
        let Some([u, v]) = plane_axes(plane) else {
            continue;
        };
        let component = between(u, v);
        let is_in = |one| model.curves.iter().any(|curve| curve.component == one);
        let Some(component) = component.filter(|one| is_in(*one)) else {
            continue;
        };
        let found = squareness(&kinematics, model, &lines);
        let [(u0, u1), (v0, v1)] = lines.spans_mm;
        let place = format!("{u} {u0:.0} to {u1:.0} mm and {v} {v0:.0} to {v1:.0} mm");
        section.lines.push(format!(
            "{component} of the coefficients is that of the tangents at the origins of the curves. Between reference lines by least squares, as ISO 230-1 defines squareness, over {place}: {}.",
            found.as_ref().map_or_else(|| "not determined by these recordings".to_owned(), in_words)
        ));
        figures.push(json!({
            "component": component.to_string(),
            "value_rad": found.map(|found| found.value_rad),
            "standard_uncertainty_rad": found.map(|found| found.standard_uncertainty_rad),
            "first_axis": u.letter(),
            "first_span_mm": [u0, u1],
            "second_axis": v.letter(),
            "second_span_mm": [v0, v1],
        }));
    }
    section.figures["geometry"]["squareness_between_lines"] = figures.into();
}

fn in_words(found: &LinesSquareness) -> String {
    let u = COVERAGE * found.standard_uncertainty_rad;
    let (value, u) = rounded(found.value_rad * 1e6, u * 1e6);
    format!("{value} ± {u} µrad (k = 2)")
}

fn circles(tests: &Tests) -> Vec<Where> {
    let moving = tests.circles.iter().map(|circle| Where {
        plane: circle.segment.plane,
        centre_mm: circle.segment.centre_mm,
        radius_mm: circle.segment.radius_mm,
        tool_offset_mm: circle.segment.tool_offset_mm,
    });
    let with_stops = tests.station_circles.iter().map(|circle| {
        let place = &circle.recording.place;
        Where {
            plane: place.plane,
            centre_mm: place.centre_mm,
            radius_mm: place.radius_mm,
            tool_offset_mm: place.tool_offset_mm,
        }
    });
    moving.chain(with_stops).collect()
}

/// Lines along both axes of a plane through the middle of the circles that the same head recorded at the same height.
fn lines(circles: &[Where], plane: TestPlane) -> Option<Lines> {
    let axes = plane_axes(plane)?;
    let own = circles.iter().filter(|circle| circle.plane == plane);
    let first = own.clone().next()?;
    let in_plane = axes.map(|axis| axis.index());
    let is_apart = |circle: &Where| {
        let apart_mm = circle.centre_mm - first.centre_mm;
        let across_mm = (0..3).filter(|at| !in_plane.contains(at));
        let across_mm = across_mm.fold(0.0, |sum: f64, at| sum + apart_mm[at].abs());
        across_mm > SAME_MM || (circle.tool_offset_mm - first.tool_offset_mm).norm() > SAME_MM
    };
    let ends = [(f64::INFINITY, f64::NEG_INFINITY); 2];
    let spans_mm = own
        .filter(|circle| !is_apart(circle))
        .fold(ends, |mut spans, circle| {
            for (span, at) in spans.iter_mut().zip(in_plane) {
                span.0 = span.0.min(circle.centre_mm[at] - circle.radius_mm);
                span.1 = span.1.max(circle.centre_mm[at] + circle.radius_mm);
            }
            spans
        });
    let mut through_mm = first.centre_mm;
    for ((low, high), at) in spans_mm.into_iter().zip(in_plane) {
        through_mm[at] = f64::midpoint(low, high);
    }
    Some(Lines {
        plane,
        through_mm,
        tool_offset_mm: first.tool_offset_mm,
        spans_mm,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_run_through_the_middle_of_the_circles_of_one_height() {
        let circle = |x: f64, z: f64| Where {
            plane: TestPlane::Xy,
            centre_mm: Vector3::new(x, -20.0, z),
            radius_mm: 50.0,
            tool_offset_mm: Vector3::zeros(),
        };
        let all = [circle(150.0, 30.0), circle(-50.0, 30.0), circle(900.0, 0.0)];
        let found = lines(&all, TestPlane::Xy).unwrap();
        assert_eq!(found.spans_mm, [(-100.0, 200.0), (-70.0, 30.0)]);
        assert_eq!(found.through_mm, Vector3::new(50.0, -20.0, 30.0));
        assert!(lines(&all, TestPlane::Yz).is_none());
    }
}
