//! Rows of what is known beside the effects: single components and the thermal drift.

use metrology::epoch::utc;
use metrology::sample::{AxisDrift, CurveForm, ErrorCurve, GeometryModel, ThermalModel};
use metrology::{Axis, ErrorComponent};
use nalgebra::{DMatrix, DVector};

use super::super::error::ExportError;
use super::super::grid::{Grid, SAME};
use super::inner_unit;
use machine::volumetric::{Alone, check_curve, on_line};

/// Length that shows a drift along an axis that was touched at one place only, mm.
const SHOWN_MM: f64 = 100.0;

/// Rows of what is known.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Known {
    rows: String,
}

impl Known {
    /// Whether no row is known.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    pub(super) fn rows(&self) -> &str {
        &self.rows
    }

    /// A component as it was published: its constant, or its values every `spacing` (mm, rad) of the recorded span. With
    /// `covariance` of its coefficients each value has its standard uncertainty; a component that is not estimable by itself
    /// has none.
    ///
    /// # Errors
    /// An invalid curve.
    pub fn add_curve(
        &mut self,
        curve: &ErrorCurve,
        covariance: Option<&DMatrix<f64>>,
        spacing: f64,
    ) -> Result<(), ExportError> {
        check_curve(curve)?;
        let component = curve.component;
        let estimable = curve.estimable.iter().all(|estimable| *estimable);
        let note = if estimable {
            ""
        } else {
            "not estimable by itself: one of infinitely many solutions"
        };
        let alone = Alone::new(curve);
        let covariance = covariance.filter(|_| estimable);
        let u = |at| covariance.and_then(|covariance| standard_uncertainty(curve, covariance, at));
        if curve.form == CurveForm::Constant {
            let at = curve.span.0;
            self.push_component(component, None, (alone.at(at), u(at)), note);
            return Ok(());
        }
        let positions: Vec<f64> = match Grid::inside(component.of, spacing, curve.span) {
            Ok(grid) => grid.positions().collect(),
            // Fewer than two whole spacings: the ends say all that a line can.
            Err(ExportError::TooFewPoints { .. }) => ends(curve.span),
            Err(error) => return Err(error),
        };
        for at in positions {
            self.push_component(component, Some(at), (alone.at(at), u(at)), note);
        }
        Ok(())
    }

    fn push_component(
        &mut self,
        component: ErrorComponent,
        at: Option<f64>,
        (value, uncertainty): (f64, Option<f64>),
        note: &str,
    ) {
        let (at, unit_at) = at.map_or_else(Default::default, |at| {
            (at.to_string(), inner_unit(component.of))
        });
        let unit = inner_unit(component.direction);
        let base = component.of;
        let uncertainty = cell(uncertainty);
        self.rows.push_str(&format!(
            "{component},{base},{at},{unit_at},{value},{value},,,{unit},component,{note},{uncertainty}\n"
        ));
    }

    /// The drift of an axis: along itself at the ends of what was touched, and along the other axes that change it.
    ///
    /// # Errors
    /// A number that is not finite.
    pub fn add_drift(&mut self, model: &ThermalModel, axis: Axis) -> Result<(), ExportError> {
        let Some(drift) = model.axes[axis] else {
            return Ok(());
        };
        check_drift(axis, &drift)?;
        let note = note(model, &drift);
        for at in ends(drift.span_mm) {
            let reading = drift.k0_mm + drift.slope_mm_per_mm * (at - drift.p0_mm);
            let lever = at - drift.p0_mm;
            let u = drift_uncertainty(&drift, [(0, 1.0), (1 + axis.index(), lever)]);
            self.push_drift((axis, axis), at, (-reading, u), &note);
        }
        for other in Axis::LINEAR.into_iter().filter(|other| *other != axis) {
            let slope = drift.cross_slope_mm_per_mm[other.index()];
            if slope.abs() > 0.0 {
                let origin = drift.cross_origin_mm[other.index()];
                let touched = model.axes[other].map(|of| of.span_mm);
                let touched = touched.filter(|(least, greatest)| greatest - least > SAME);
                for at in ends(touched.unwrap_or((origin, origin + SHOWN_MM))) {
                    let note = format!("{note}; added to the drift along {axis}");
                    let lever = at - origin;
                    let u = drift_uncertainty(&drift, [(1 + other.index(), lever)]);
                    self.push_drift((axis, other), at, (-slope * lever, u), &note);
                }
            }
        }
        Ok(())
    }

    fn push_drift(
        &mut self,
        (axis, base): (Axis, Axis),
        at: f64,
        (error_mm, uncertainty_mm): (f64, Option<f64>),
        note: &str,
    ) {
        let (e, c) = (error_mm + 0.0, 0.0 - error_mm);
        let uncertainty = cell(uncertainty_mm);
        self.rows.push_str(&format!(
            "drift of {axis},{base},{at},mm,{e},{e},{c},{c},mm,drift,{note},{uncertainty}\n"
        ));
    }
}

/// Covariance of the coefficients of one curve of a model; none where the model's does not fit its curves.
#[must_use]
pub fn covariance_of(model: &GeometryModel, curve: usize) -> Option<DMatrix<f64>> {
    let counts = || model.curves.iter().map(|curve| curve.coefficient.len());
    let all: usize = counts().sum();
    let n = counts().nth(curve)?;
    let first: usize = counts().take(curve).sum();
    let fits = model.covariance.nrows() == all && model.covariance.ncols() == all;
    fits.then(|| model.covariance.view((first, first), (n, n)).into_owned())
}

/// Standard uncertainty of a curve at a position, mm or rad; none where it is no number.
fn standard_uncertainty(curve: &ErrorCurve, covariance: &DMatrix<f64>, at: f64) -> Option<f64> {
    let at = at.clamp(curve.span.0, curve.span.1);
    let weights: Vec<f64> = match curve.form {
        CurveForm::Constant => vec![1.0],
        CurveForm::Polynomial => {
            let powers = curve.power.iter();
            powers
                .map(|power| (at - curve.origin).powi(i32::from(*power)))
                .collect()
        }
        CurveForm::Table => (0..curve.position.len())
            .map(|knot| {
                let mut one = vec![0.0; curve.position.len()];
                one[knot] = 1.0;
                on_line(&curve.position, &one, at)
            })
            .collect(),
    };
    if weights.len() != covariance.nrows() {
        return None;
    }
    let weights = DVector::from_vec(weights);
    root(weights.dot(&(covariance * &weights)))
}

/// Standard uncertainty of a drift that is the sum of coefficients times levers, mm.
fn drift_uncertainty<const N: usize>(drift: &AxisDrift, terms: [(usize, f64); N]) -> Option<f64> {
    let pairs = terms
        .iter()
        .flat_map(|one| terms.iter().map(move |other| (one, other)));
    let variance_mm2: f64 = pairs
        .map(|((i, a), (j, b))| a * b * drift.covariance[(*i, *j)])
        .sum();
    root(variance_mm2).filter(|_| drift.offset_identifiable && drift.slope_identifiable)
}

/// Root of a variance; none of one that is unknown.
fn root(variance: f64) -> Option<f64> {
    (variance.is_finite() && variance >= 0.0).then(|| variance.sqrt())
}

/// A number, or nothing where it is unknown.
fn cell(value: Option<f64>) -> String {
    value.map_or_else(String::new, |value| value.to_string())
}

/// Both ends of a span, or its one point.
fn ends((least, greatest): (f64, f64)) -> Vec<f64> {
    if greatest - least > SAME {
        vec![least, greatest]
    } else {
        vec![least]
    }
}

fn check_drift(axis: Axis, drift: &AxisDrift) -> Result<(), ExportError> {
    let single = [
        ("k0", drift.k0_mm),
        ("slope", drift.slope_mm_per_mm),
        ("p0", drift.p0_mm),
        ("span", drift.span_mm.0),
        ("span", drift.span_mm.1),
    ];
    let slopes = drift.cross_slope_mm_per_mm.iter();
    let slopes = slopes.map(|slope| ("cross slope", *slope));
    let origin = drift.cross_origin_mm.iter();
    let origin = origin.map(|origin| ("cross origin", *origin));
    let mut all = single.into_iter().chain(slopes).chain(origin);
    match all.find(|(_, value)| !value.is_finite()) {
        Some((quantity, value)) => Err(ExportError::NotFinite {
            axis,
            quantity,
            index: 0,
            value,
        }),
        None => Ok(()),
    }
}

fn note(model: &ThermalModel, drift: &AxisDrift) -> String {
    let mut note = format!(
        "fitted at {} and valid until {} of the host's clock",
        utc(model.at),
        utc(model.valid_until)
    );
    if model.quarantined {
        note.push_str("; in quarantine until a second measurement confirms it");
    }
    if !drift.offset_identifiable {
        note.push_str("; the offset is not identifiable");
    }
    if !drift.slope_identifiable {
        note.push_str("; the slope is not identifiable");
    }
    note
}
