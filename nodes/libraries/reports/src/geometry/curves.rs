//! The errors of a model as curves over the travel of their axis.
//!
//! ```text
//!   e(x) = sum_k c_k (x - x0)^k,   or straight lines between the knots of a table      (1)
//! ```
//!
//! Drawn are curves of which every coefficient is determined by itself; the others are no curve but a sum with others.

use std::collections::BTreeMap;

use anyhow::Result;
use metrology::Axis;
use metrology::sample::{CurveForm, ErrorCurve, GeometryModel};

use super::{scale, unit};
use crate::plot::{self, Plot, Trace};
use crate::section::Drawing;

/// Steps of a polynomial.
const STEPS: u32 = 48;

/// Value of (1) at a place, in the unit of the component.
fn value_at(curve: &ErrorCurve, at: f64) -> f64 {
    let terms = curve.power.iter().zip(&curve.coefficient);
    terms
        .map(|(power, c)| c * (at - curve.origin).powi(i32::from(*power)))
        .sum()
}

/// Points of the curve over its span: (mm or degrees, µm or µrad); empty without a curve.
fn points(curve: &ErrorCurve) -> Vec<(f64, f64)> {
    let is_whole = !curve.coefficient.is_empty() && curve.estimable.iter().all(|known| *known);
    let (low, high) = curve.span;
    if !is_whole || high <= low {
        return Vec::new();
    }
    let of = curve.component.of;
    let place = |at: f64| if of.is_linear() { at } else { at.to_degrees() };
    let scale = scale(curve.component);
    match curve.form {
        CurveForm::Constant => Vec::new(),
        CurveForm::Table => { curve.position.iter().zip(&curve.coefficient) }
            .map(|(at, value)| (place(*at), value * scale))
            .collect(),
        CurveForm::Polynomial => { (0..=STEPS).map(|k| f64::from(k) / f64::from(STEPS)) }
            .map(|share| low + share * (high - low))
            .map(|at| (place(at), value_at(curve, at) * scale))
            .collect(),
    }
}

/// A drawing for the shifts and one for the turns of each axis.
///
/// # Errors
/// When a plot cannot be drawn.
pub(super) fn drawings(model: &GeometryModel) -> Result<Vec<Drawing>> {
    let mut by_axis: BTreeMap<(Axis, bool), Vec<Trace>> = BTreeMap::new();
    for curve in &model.curves {
        let points = points(curve);
        if points.is_empty() {
            continue;
        }
        let component = curve.component;
        let key = (component.of, component.is_angular());
        by_axis.entry(key).or_default().push(Trace {
            name: component.to_string(),
            points,
            marks: false,
        });
    }
    let drawn = by_axis.into_iter().map(|((axis, is_angular), traces)| {
        let first = model.curves.iter().find(|curve| curve.component.is_angular() == is_angular);
        let unit = first.map_or("", |curve| unit(curve.component));
        let place = if axis.is_linear() { "mm" } else { "deg" };
        let what = if is_angular { "turn" } else { "shift" };
        Ok(Drawing {
            svg: plot::svg(&Plot {
                x: format!("position of {axis} / {place}"),
                y: format!("{what} / {unit}"),
                traces,
            })?,
            caption: format!(
                "Errors of {axis} by their symbols of ISO 230-1, as far as the recordings determine them by themselves; U of each coefficient is in the table."
            ),
        })
    });
    drawn.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use metrology::ErrorComponent;

    fn curve(estimable: bool) -> ErrorCurve {
        let component: ErrorComponent = "EYX".parse().unwrap();
        ErrorCurve {
            component,
            form: CurveForm::Polynomial,
            origin: 100.0,
            power: vec![1, 2],
            position: vec![],
            coefficient: vec![1e-5, 1e-7],
            standard_uncertainty: vec![1e-7, 1e-9],
            estimable: vec![true, estimable],
            span: (0.0, 400.0),
        }
    }

    #[test]
    fn eq1_a_polynomial_is_drawn_from_end_to_end_of_its_span() {
        let points = points(&curve(true));
        let ends = [points[0], points[points.len() - 1]];
        // By hand: -100 * 1e-5 + 1e4 * 1e-7 = 0; 300 * 1e-5 + 9e4 * 1e-7 = 12e-3 mm.
        assert!(ends[0].0.abs() < 1e-9 && ends[0].1.abs() < 1e-9, "{ends:?}");
        assert!(
            (ends[1].0 - 400.0).abs() < 1e-9 && (ends[1].1 - 12.0).abs() < 1e-9,
            "{ends:?}"
        );
    }

    #[test]
    fn what_is_known_only_together_is_no_curve() {
        assert!(points(&curve(false)).is_empty());
    }
}
