//! Errors in one direction as a function of an axis' position, composed from named components.
//!
//! # Model
//!
//! An error motion `E_db` acts as it is. A location error is a turn θ of the direction in which axis b
//! moves, about the axis of its first letter, so that at position p of b the tool is displaced by
//!
//! ```text
//!   E_d(p) = E_db(p) + θ p (r × b)·d          r: direction of the turn        (1)
//! ```
//!
//! A positive EC0Y (Y turned about Z) therefore gives -θ y in X; EB0Z gives +θ z in X; EA0Z gives -θ z in Y.
//! The constant part is chosen zero at machine position 0 of b.
//!
//! # Holds when
//! The errors are small: their order does not matter. Positions lie in the recorded span of each curve.
//!
//! # References
//! \[1\] ISO 230-1:2012, 3.4 and 3.6.

use metrology::sample::{CurveForm, ErrorCurve, GeometryModel};
use metrology::{Axis, ErrorComponent};
use nalgebra::Vector3;

use super::axis_errors::{check_inside, check_positions, check_values, on_line};
use super::error::ExportError;
use super::grid::{Grid, SAME};

/// What to do with a component that the recordings do not determine by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unestimable {
    /// It is an error: the number is one of infinitely many.
    Refuse,
    /// Take the minimum-norm member, because its companions are exported too and only their sum counts.
    Accept,
}

/// Error in `direction` as a function of the position of `base`: actual minus commanded.
#[derive(Clone, Debug, PartialEq)]
pub struct CrossErrors {
    base: Axis,
    direction: Axis,
    position: Vec<f64>,
    error: Vec<f64>,
    parts: Vec<ErrorComponent>,
}

impl CrossErrors {
    /// Errors (mm; rad for a rotary direction) at positions of `base` (mm, rad), and what they consist of.
    ///
    /// # Errors
    /// As [`super::AxisErrors::new`]; no part named.
    pub fn new(
        base: Axis,
        direction: Axis,
        position: Vec<f64>,
        error: Vec<f64>,
        parts: Vec<ErrorComponent>,
    ) -> Result<Self, ExportError> {
        if parts.is_empty() {
            return Err(ExportError::NoComponent { base, direction });
        }
        check_positions(base, &position)?;
        check_values(base, "error", &error, position.len())?;
        Ok(Self {
            base,
            direction,
            position,
            error,
            parts,
        })
    }

    /// The sum of the named components of `model` in `direction`, at the points of `grid`.
    ///
    /// # Errors
    /// A component that the model lacks, that does not act this way, that is not estimable (unless accepted),
    /// whose curve is malformed, or that was not recorded at a point.
    pub fn sample(
        model: &GeometryModel,
        components: &[ErrorComponent],
        direction: Axis,
        grid: &Grid,
        unestimable: Unestimable,
    ) -> Result<Self, ExportError> {
        let base = grid.axis();
        let position: Vec<f64> = grid.positions().collect();
        let mut error = vec![0.0; position.len()];
        for &component in components {
            let share = share(component, base, direction)?;
            let curve = model
                .curves
                .iter()
                .find(|curve| curve.component == component)
                .ok_or(ExportError::MissingComponent { component })?;
            check_curve(curve)?;
            if unestimable == Unestimable::Refuse {
                check_estimable(curve)?;
            }
            for (at, error) in position.iter().zip(&mut error) {
                *error += share.of(curve, *at)?;
            }
        }
        Self::new(base, direction, position, error, components.to_vec())
    }

    /// The same errors at the points of `grid`, on straight lines between the own points.
    ///
    /// # Errors
    /// A grid of another axis, or a point beyond the first or last own one.
    pub fn on_grid(&self, grid: &Grid) -> Result<Self, ExportError> {
        let position: Vec<f64> = grid.positions().collect();
        check_inside(self.base, grid.axis(), &self.position, &position)?;
        let error = position
            .iter()
            .map(|at| on_line(&self.position, &self.error, *at))
            .collect();
        let (base, direction) = (self.base, self.direction);
        Self::new(base, direction, position, error, self.parts.clone())
    }

    /// Whether a component acts in `direction` as a function of `base`.
    #[must_use]
    pub fn acts(component: ErrorComponent, base: Axis, direction: Axis) -> bool {
        share(component, base, direction).is_ok()
    }

    /// The axis on whose position it depends.
    #[must_use]
    pub fn base(&self) -> Axis {
        self.base
    }

    /// Direction of the error.
    #[must_use]
    pub fn direction(&self) -> Axis {
        self.direction
    }

    /// Positions of the base axis, ascending, mm or rad.
    #[must_use]
    pub fn position(&self) -> &[f64] {
        &self.position
    }

    /// Errors, mm, or rad for a rotary direction.
    #[must_use]
    pub fn error(&self) -> &[f64] {
        &self.error
    }

    /// The components in it.
    #[must_use]
    pub fn parts(&self) -> &[ErrorComponent] {
        &self.parts
    }

    /// Their names, joined.
    pub(super) fn names(&self) -> String {
        let names: Vec<String> = self.parts.iter().map(ToString::to_string).collect();
        names.join(" + ")
    }
}

/// How a component acts in a direction.
enum Share {
    /// As its curve says.
    Motion,
    /// As an angle times position, with this sign.
    Turn(f64),
}

impl Share {
    fn of(&self, curve: &ErrorCurve, at: f64) -> Result<f64, ExportError> {
        match self {
            Self::Motion => value_at(curve, at),
            // (1)
            Self::Turn(sign) => Ok(sign * curve.coefficient[0] * at),
        }
    }
}

fn unit_vector(axis: Axis) -> Vector3<f64> {
    Vector3::ith(axis.index() % 3, 1.0)
}

fn share(component: ErrorComponent, base: Axis, direction: Axis) -> Result<Share, ExportError> {
    let none = ExportError::NoEffect {
        component,
        base,
        direction,
    };
    if component.of != base {
        return Err(none);
    }
    if !component.is_location {
        return if component.direction == direction {
            Ok(Share::Motion)
        } else {
            Err(none)
        };
    }
    if component.direction.is_linear() || !base.is_linear() || !direction.is_linear() {
        return Err(none);
    }
    let turned = unit_vector(component.direction).cross(&unit_vector(base));
    let sign = turned.dot(&unit_vector(direction));
    if sign.abs() < 0.5 {
        Err(none)
    } else {
        Ok(Share::Turn(sign))
    }
}

fn check_curve(curve: &ErrorCurve) -> Result<(), ExportError> {
    let component = curve.component;
    let n = curve.coefficient.len();
    let fits = match curve.form {
        CurveForm::Constant => n == 1,
        CurveForm::Polynomial => curve.power.len() == n,
        CurveForm::Table => curve.position.len() == n && n >= 2,
    };
    let rule = if !fits {
        Some("the number of coefficients does not fit the form of the curve")
    } else if component.is_location != (curve.form == CurveForm::Constant) {
        Some("a location error is one number and an error motion is not")
    } else if curve.estimable.len() != n {
        Some("each coefficient needs its mark of estimability")
    } else if !curve.origin.is_finite() {
        Some("the origin must be finite")
    } else {
        None
    };
    if let Some(rule) = rule {
        return Err(ExportError::Malformed { component, rule });
    }
    check_values(component.of, "coefficient", &curve.coefficient, n)?;
    if curve.form == CurveForm::Table {
        check_positions(component.of, &curve.position)?;
    }
    Ok(())
}

fn check_estimable(curve: &ErrorCurve) -> Result<(), ExportError> {
    match curve.estimable.iter().position(|estimable| !estimable) {
        Some(index) => Err(ExportError::NotEstimable {
            component: curve.component,
            index,
        }),
        None => Ok(()),
    }
}

/// Value of a curve inside its recorded span.
fn value_at(curve: &ErrorCurve, at: f64) -> Result<f64, ExportError> {
    let (least, greatest) = curve.span;
    // A span that is no number contains nothing.
    if !(least - SAME..=greatest + SAME).contains(&at) {
        let (axis, position) = (curve.component.of, at);
        return Err(ExportError::OutsideMeasured {
            axis,
            position,
            least,
            greatest,
        });
    }
    Ok(match curve.form {
        CurveForm::Constant => curve.coefficient[0],
        CurveForm::Polynomial => {
            let q = at - curve.origin;
            let terms = curve.power.iter().zip(&curve.coefficient);
            terms.map(|(power, c)| c * q.powi(i32::from(*power))).sum()
        }
        CurveForm::Table => on_line(&curve.position, &curve.coefficient, at),
    })
}
