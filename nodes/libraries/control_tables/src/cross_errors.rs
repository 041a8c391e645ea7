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

use super::axis_errors::{check_inside, check_positions, check_values};
use super::error::ExportError;
use super::grid::{Grid, SAME};
use machine::kinematics::direction_of;
use machine::volumetric::{Alone, check_curve, lean, on_line};

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
            check(curve)?;
            if unestimable == Unestimable::Refuse {
                check_estimable(curve)?;
            }
            let alone = Alone::new(curve);
            for (at, error) in position.iter().zip(&mut error) {
                *error += match share {
                    Share::Motion => {
                        check_recorded(curve, *at)?;
                        alone.at(*at)
                    }
                    Share::Turn(sign) => sign * alone.at(*at) * at, // (1)
                };
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
#[derive(Clone, Copy)]
enum Share {
    /// As its curve says.
    Motion,
    /// As an angle times position, with this sign.
    Turn(f64),
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
    let sign = lean(component).dot(&direction_of(direction));
    if sign.abs() < 0.5 {
        Err(none)
    } else {
        Ok(Share::Turn(sign))
    }
}

/// What a curve must be beyond what the machine model asks of it.
fn check(curve: &ErrorCurve) -> Result<(), ExportError> {
    check_curve(curve)?;
    let component = curve.component;
    let rule = if component.is_location != (curve.form == CurveForm::Constant) {
        "a location error is one number and an error motion is not"
    } else if curve.estimable.len() != curve.coefficient.len() {
        "each coefficient needs its mark of estimability"
    } else {
        return Ok(());
    };
    Err(ExportError::Malformed { component, rule })
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

/// Whether a curve was recorded at a position.
fn check_recorded(curve: &ErrorCurve, at: f64) -> Result<(), ExportError> {
    let (least, greatest) = curve.span;
    if (least - SAME..=greatest + SAME).contains(&at) {
        return Ok(());
    }
    let (axis, position) = (curve.component.of, at);
    Err(ExportError::OutsideMeasured {
        axis,
        position,
        least,
        greatest,
    })
}
