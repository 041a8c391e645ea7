//! Geometric errors and positioning tables.
//!
//! A coefficient of power k is a value per position to the k, so that its wire form follows from the
//! component: with v = 1 for shifts and 0 for turns, p = 1 for linear and 0 for rotary axes,
//!
//! ```text
//!   coefficient on the wire = coefficient inside * 1000^(k p - v)        (3)
//! ```

use metrology::sample::{self, CurveForm};
use metrology::{Axis, ErrorComponent};
use nalgebra::DMatrix;

use crate::msg::{ErrorCurve, EstimableCombination, GeometryModel, PositioningTable};
use crate::wire::{Allowed, Reader, metres, millimetres, time};
use crate::{Message, Place, Wire, WireError, bounds};

pub(crate) const FORMS: [CurveForm; 3] =
    [CurveForm::Constant, CurveForm::Polynomial, CurveForm::Table];

pub(crate) fn form_code(form: CurveForm) -> u8 {
    match form {
        CurveForm::Constant => ErrorCurve::FORM_CONSTANT,
        CurveForm::Polynomial => ErrorCurve::FORM_POLYNOMIAL,
        CurveForm::Table => ErrorCurve::FORM_TABLE,
    }
}

/// (3): the factor from inside to wire.
fn factor(component: ErrorComponent, power: u8) -> f64 {
    let position = i32::from(component.of.is_linear());
    let value = i32::from(!component.is_angular());
    1000_f64.powi(i32::from(power) * position - value)
}

fn position_to_wire(axis: Axis, position: f64) -> f64 {
    if axis.is_linear() {
        metres(position)
    } else {
        position
    }
}

fn position_from_wire(axis: Axis, position: f64) -> f64 {
    if axis.is_linear() {
        millimetres(position)
    } else {
        position
    }
}

/// Factor of each coefficient of a curve, in order.
fn factors(curve: &sample::ErrorCurve) -> impl Iterator<Item = f64> {
    let power = |idx: usize| curve.power.get(idx).copied().unwrap_or(0);
    (0..curve.coefficient.len()).map(move |idx| factor(curve.component, power(idx)))
}

impl Wire for ErrorCurve {
    type Inner = sample::ErrorCurve;

    fn set_from_inner(&mut self, inner: &Self::Inner) {
        let of = inner.component.of;
        self.component = inner.component.to_string();
        self.form = form_code(inner.form);
        self.origin = position_to_wire(of, inner.origin);
        self.power.clone_from(&inner.power);
        self.position.clear();
        self.position
            .extend(inner.position.iter().map(|q| position_to_wire(of, *q)));
        let scaled = |values: &[f64]| {
            let pairs = values.iter().zip(factors(inner));
            pairs.map(|(value, factor)| value * factor).collect()
        };
        self.coefficient = scaled(&inner.coefficient);
        self.standard_uncertainty = scaled(&inner.standard_uncertainty);
        self.estimable.clone_from(&inner.estimable);
        self.span = [
            position_to_wire(of, inner.span.0),
            position_to_wire(of, inner.span.1),
        ];
    }

    #[expect(clippy::too_many_lines, reason = "one arm or field after another")]
    fn to_inner(&self) -> Result<Self::Inner, WireError> {
        let read = Reader::of::<Self>();
        let component: ErrorComponent =
            self.component
                .parse()
                .map_err(|_| WireError::UnknownComponent {
                    message: Self::TYPE_NAME,
                    name: self.component.clone(),
                })?;
        let of = component.of;
        let len = self.coefficient.len();
        let form = read.variant("form", Place::Whole, self.form, &FORMS, form_code)?;
        let (powers, knots) = match form {
            CurveForm::Constant => (0, 0),
            CurveForm::Polynomial => (len, 0),
            CurveForm::Table => (0, len),
        };
        read.length("power", self.power.len(), powers)?;
        if let Some(power) = self.power.iter().find(|power| **power > bounds::POWER) {
            return Err(WireError::UnknownValue {
                message: Self::TYPE_NAME,
                field: "power",
                place: Place::Whole,
                value: *power,
                greatest: bounds::POWER,
            });
        }
        read.length("position", self.position.len(), knots)?;
        read.length("standard_uncertainty", self.standard_uncertainty.len(), len)?;
        read.length("estimable", self.estimable.len(), len)?;
        if form == CurveForm::Constant {
            read.length("coefficient", len, 1)?;
        }
        let position = |field, idx, value| {
            let value = read.number(field, Place::Entry(idx), value, Allowed::Finite)?;
            Ok(position_from_wire(of, value))
        };
        let scaled = |field, values: &[f64], allowed| -> Result<Vec<f64>, WireError> {
            let each = values.iter().enumerate().map(|(idx, value)| {
                let power = self.power.get(idx).copied().unwrap_or(0);
                let value = read.number(field, Place::Entry(idx), *value, allowed)?;
                Ok(value / factor(component, power))
            });
            each.collect()
        };
        let knots = self.position.iter().enumerate();
        Ok(sample::ErrorCurve {
            component,
            form,
            origin: position_from_wire(of, read.finite("origin", self.origin)?),
            power: self.power.clone(),
            position: knots
                .map(|(idx, value)| position("position", idx, *value))
                .collect::<Result<_, WireError>>()?,
            coefficient: scaled("coefficient", &self.coefficient, Allowed::Finite)?,
            standard_uncertainty: scaled(
                "standard_uncertainty",
                &self.standard_uncertainty,
                Allowed::OrNan,
            )?,
            estimable: self.estimable.clone(),
            span: (
                position("span", 0, self.span[0])?,
                position("span", 1, self.span[1])?,
            ),
        })
    }
}

impl Wire for GeometryModel {
    type Inner = sample::GeometryModel;

    fn set_from_inner(&mut self, inner: &Self::Inner) {
        let factors: Vec<f64> = inner.curves.iter().flat_map(factors).collect();
        let factor = |idx: usize| factors.get(idx).copied().unwrap_or(1.0);
        self.header.stamp = time(inner.at);
        self.chain.clone_from(&inner.chain);
        self.curves = inner.curves.iter().map(ErrorCurve::from_inner).collect();
        let (rows, columns) = inner.covariance.shape();
        self.covariance = (0..rows)
            .flat_map(|row| (0..columns).map(move |column| (row, column)))
            .map(|(row, column)| inner.covariance[(row, column)] * factor(row) * factor(column))
            .collect();
        let combination = |inner: &sample::EstimableCombination| EstimableCombination {
            coefficient: inner.weights.iter().map(|(idx, _)| *idx).collect(),
            weight: inner
                .weights
                .iter()
                .map(|(idx, weight)| metres(*weight) / factor(*idx as usize))
                .collect(),
            value_m: metres(inner.value_mm),
            standard_uncertainty_m: metres(inner.standard_uncertainty_mm),
        };
        self.combinations = inner.combinations.iter().map(combination).collect();
        self.n_samples = inner.n_samples;
        self.n_unknowns = inner.n_unknowns;
        self.rank = inner.rank;
        self.residual_standard_deviation_m = metres(inner.residual_standard_deviation_mm);
        self.sequence = inner.sequence;
    }

    fn to_inner(&self) -> Result<Self::Inner, WireError> {
        let read = Reader::of::<Self>();
        read.at_most("curves", self.curves.len(), bounds::CURVES)?;
        let coefficients = self.curves.iter().map(|curve| curve.coefficient.len());
        let n_coefficients = coefficients.fold(0, usize::saturating_add);
        read.at_most("coefficient", n_coefficients, bounds::COEFFICIENTS)?;
        let combinations = self.combinations.iter();
        let n_weights = combinations.fold(0, |n: usize, one| n.saturating_add(one.weight.len()));
        read.at_most(
            "combinations",
            self.combinations.len(),
            bounds::COMBINATIONS,
        )?;
        read.at_most("weight", n_weights, bounds::WEIGHTS)?;
        let curves: Vec<_> = self
            .curves
            .iter()
            .map(ErrorCurve::to_inner)
            .collect::<Result<_, _>>()?;
        let factors: Vec<f64> = curves.iter().flat_map(factors).collect();
        let n = factors.len();
        read.length("covariance", self.covariance.len(), n * n)?;
        for (idx, value) in self.covariance.iter().enumerate() {
            read.number("covariance", Place::Entry(idx), *value, Allowed::Finite)?;
        }
        let covariance = DMatrix::from_fn(n, n, |row, column| {
            self.covariance[row * n + column] / factors[row] / factors[column]
        });
        let combinations = self.combinations.iter();
        Ok(sample::GeometryModel {
            at: read.stamp("header.stamp", Place::Whole, &self.header.stamp)?,
            chain: read.name("chain", &self.chain)?,
            curves,
            covariance,
            combinations: combinations
                .map(|wire| combination(wire, &factors))
                .collect::<Result<_, _>>()?,
            n_samples: self.n_samples,
            n_unknowns: self.n_unknowns,
            rank: self.rank,
            residual_standard_deviation_mm: read
                .number(
                    "residual_standard_deviation_m",
                    Place::Whole,
                    self.residual_standard_deviation_m,
                    Allowed::OrNan,
                )
                .map(millimetres)?,
            sequence: self.sequence,
        })
    }
}

fn combination(
    wire: &EstimableCombination,
    factors: &[f64],
) -> Result<sample::EstimableCombination, WireError> {
    let read = Reader::of::<EstimableCombination>();
    read.length("weight", wire.weight.len(), wire.coefficient.len())?;
    let weight = |(place, (idx, weight)): (usize, (&u32, &f64))| {
        let factor = factors
            .get(*idx as usize)
            .copied()
            .ok_or(WireError::NoSuchCoefficient {
                message: EstimableCombination::TYPE_NAME,
                place: Place::Entry(place),
                value: *idx,
                len: factors.len(),
            })?;
        let weight = read.number("weight", Place::Entry(place), *weight, Allowed::Finite)?;
        Ok((*idx, millimetres(weight) * factor))
    };
    let pairs = wire.coefficient.iter().zip(&wire.weight).enumerate();
    Ok(sample::EstimableCombination {
        weights: pairs.map(weight).collect::<Result<_, WireError>>()?,
        value_mm: read.length_mm("value_m", wire.value_m)?,
        standard_uncertainty_mm: read
            .length_mm("standard_uncertainty_m", wire.standard_uncertainty_m)?,
    })
}

impl Wire for PositioningTable {
    type Inner = sample::PositioningTable;

    fn set_from_inner(&mut self, inner: &Self::Inner) {
        let to_wire = |values: &[f64]| {
            let each = values.iter();
            each.map(|value| position_to_wire(inner.axis, *value))
                .collect()
        };
        self.header.stamp = time(inner.at);
        inner.axis.letter().clone_into(&mut self.axis);
        self.position = to_wire(&inner.position);
        self.deviation_up = to_wire(&inner.deviation_up);
        self.deviation_down = to_wire(&inner.deviation_down);
        self.n_runs = inner.n_runs;
        self.weight = inner.weight;
        self.sequence = inner.sequence;
    }

    fn to_inner(&self) -> Result<Self::Inner, WireError> {
        let read = Reader::of::<Self>();
        let axis = read.axis("axis", 0, &self.axis)?;
        let len = self.position.len();
        read.at_most("position", len, bounds::TABLE_POINTS)?;
        read.length("deviation_up", self.deviation_up.len(), len)?;
        read.length("deviation_down", self.deviation_down.len(), len)?;
        let (places, deviations) = if axis.is_linear() {
            (bounds::POSITION_M, bounds::DEVIATION_M)
        } else {
            (bounds::POSITION_RAD, bounds::DEVIATION_RAD)
        };
        let from_wire = |field, values: &[f64], range| -> Result<Vec<f64>, WireError> {
            let each = values.iter().enumerate().map(|(idx, value)| {
                read.inside(field, Place::Entry(idx), *value, range)
                    .map(|value| position_from_wire(axis, value))
            });
            each.collect()
        };
        Ok(sample::PositioningTable {
            at: read.stamp("header.stamp", Place::Whole, &self.header.stamp)?,
            axis,
            position: from_wire("position", &self.position, places)?,
            deviation_up: from_wire("deviation_up", &self.deviation_up, deviations)?,
            deviation_down: from_wire("deviation_down", &self.deviation_down, deviations)?,
            n_runs: self.n_runs,
            weight: read.inside("weight", Place::Whole, self.weight, bounds::TABLE_WEIGHT)?,
            sequence: self.sequence,
        })
    }
}
