//! The errors of a model as curves over the travel of their axis.
//!
//! ```text
//!   e(x) = sum_k c_k (x - x0)^k,   or straight lines between the knots of a table      (1)
//! ```
//!
//! Drawn are curves of which every coefficient is determined by itself; the others are no curve but a sum with others. The band
//! about a curve is U (k = 2): that of a knot of a table, and of a polynomial
//!
//! ```text
//!   U(x)^2 = 4 sum_kl u_k u_l r_kl (x - x0)^(k+l)                                    (2)
//! ```
//!
//! with the correlations r_kl of the model's covariance. Where it has none, U is drawn as the most that it can be (every term
//! of one sign).

use std::collections::BTreeMap;

use anyhow::Result;
use metrology::Axis;
use metrology::sample::{CurveForm, ErrorCurve, GeometryModel};
use nalgebra::DMatrix;

use super::COVERAGE;
use super::{scale, unit};
use crate::plot::{self, Band, Plot, Trace};
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

/// Correlation of two coefficients of the model; `None` where it is not known.
fn correlation(covariance: &DMatrix<f64>, k: usize, l: usize) -> Option<f64> {
    let of = |row: usize, column: usize| covariance.get((row, column)).copied();
    let size = (of(k, k)? * of(l, l)?).sqrt();
    (size > 0.0).then_some(of(k, l)? / size)
}

/// (2) at a place, in the unit of the component; `first`: place of the curve's first coefficient in the model.
fn u_at(curve: &ErrorCurve, (covariance, first): (&DMatrix<f64>, usize), at: f64) -> f64 {
    let away = at - curve.origin;
    let terms: Vec<f64> = { curve.power.iter().zip(&curve.standard_uncertainty) }
        .map(|(power, u)| u * away.powi(i32::from(*power)))
        .collect();
    let mut square = 0.0;
    for (k, a) in terms.iter().enumerate() {
        for (l, b) in terms.iter().enumerate() {
            let known = correlation(covariance, first + k, first + l);
            square += known.map_or_else(|| (a * b).abs(), |r| a * b * r);
        }
    }
    COVERAGE * square.max(0.0).sqrt()
}

/// Lower and upper end of U about the points of a curve, in their units.
fn band(
    curve: &ErrorCurve,
    of_model: (&DMatrix<f64>, usize),
    points: &[(f64, f64)],
) -> Vec<(f64, f64, f64)> {
    let scale = scale(curve.component);
    let is_linear = curve.component.of.is_linear();
    let u = |k: usize, place: f64| match curve.form {
        CurveForm::Table => {
            let u = curve.standard_uncertainty.get(k).copied();
            // A knot that fixes the curve has none.
            COVERAGE * u.filter(|u| u.is_finite()).unwrap_or(0.0)
        }
        _ if is_linear => u_at(curve, of_model, place),
        _ => u_at(curve, of_model, place.to_radians()),
    };
    let all = points.iter().enumerate();
    all.map(|(k, (at, value))| {
        let u = u(k, *at) * scale;
        (*at, value - u, value + u)
    })
    .collect()
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
    let mut by_axis: BTreeMap<(Axis, bool), (Vec<Trace>, Vec<Band>)> = BTreeMap::new();
    let mut next = 0;
    for curve in &model.curves {
        let first = next;
        next += curve.coefficient.len();
        let points = points(curve);
        if points.is_empty() {
            continue;
        }
        let component = curve.component;
        let key = (component.of, component.is_angular());
        let (traces, bands) = by_axis.entry(key).or_default();
        bands.push(Band {
            name: String::new(),
            of: traces.len(),
            points: band(curve, (&model.covariance, first), &points),
        });
        traces.push(Trace {
            name: component.to_string(),
            points,
            marks: false,
        });
    }
    let drawn = by_axis.into_iter().map(|((axis, is_angular), (traces, bands))| {
        let first = model.curves.iter().find(|curve| curve.component.is_angular() == is_angular);
        let unit = first.map_or("", |curve| unit(curve.component));
        let place = if axis.is_linear() { "mm" } else { "deg" };
        let what = if is_angular { "turn" } else { "shift" };
        Ok(Drawing {
            svg: plot::banded_svg(
                &Plot {
                    x: format!("position of {axis} / {place}"),
                    y: format!("{what} / {unit}"),
                    traces,
                },
                &bands,
            )?,
            caption: format!(
                "Errors of {axis} by their symbols of ISO 230-1, as far as the recordings determine them by themselves. Bands: U (k = 2)."
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
    fn eq2_the_band_has_the_correlations_of_the_model_and_is_the_widest_without_them() {
        let curve = curve(true);
        let half = |covariance: &DMatrix<f64>| {
            let band = band(&curve, (covariance, 1), &points(&curve));
            let (at, low, high) = band[band.len() - 1];
            assert!((at - 400.0).abs() < 1e-9 && (low + high - 24.0).abs() < 1e-9);
            (high - low) / 2.0
        };
        // By hand: terms of 1e-7 * 300 = 30e-6 and 1e-9 * 9e4 = 90e-6 mm.
        assert!((half(&DMatrix::zeros(0, 0)) - 0.24).abs() < 1e-9);
        let mut covariance = DMatrix::from_diagonal_element(3, 3, 1.0);
        assert!((half(&covariance) - 2.0 * 0.03_f64.hypot(0.09)).abs() < 1e-9);
        covariance[(1, 2)] = -1.0;
        covariance[(2, 1)] = -1.0;
        assert!((half(&covariance) - 0.12).abs() < 1e-9);
    }

    #[test]
    fn what_is_known_only_together_is_no_curve() {
        assert!(points(&curve(false)).is_empty());
    }
}
