//! The six error motions of one axis as functions of its position.
//!
//! ```text
//!   E(q) = sum_k c_k (q - origin)^k                  inside the recorded span             (1)
//!   linear: E(end) + E'(end) (q - end)               beyond it                            (2)
//!   hold:   E(end)                                   beyond it                            (3)
//! ```
//!
//! Polynomials that share origin and span are evaluated together by Horner's rule, tables that share their knots
//! by one look-up, which needs no search where the knots are equally far apart. A table is straight
//! between its knots and constant beyond the outer ones, under every policy.

use metrology::Axis;
use metrology::drift::Extrapolate;
use metrology::sample::{CurveForm, ErrorCurve};

use super::error::VolumetricError;

/// Shifts EX. EY. EZ. (mm), a zero, turns EA. EB. EC. (rad), a zero: each three in a place of four, since a
/// processor that writes pairs is slow to read one that straddles two of them.
pub(super) type Lanes = [f64; 8];

/// Place of a direction in [`Lanes`].
pub(super) const fn lane(direction: Axis) -> usize {
    if direction.is_linear() {
        direction.index()
    } else {
        direction.index() + 1
    }
}

/// All error motions of one axis.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Motions {
    /// Where all of them were recorded.
    span: (f64, f64),
    together: Polynomials,
    /// Whether they are one set of cubics, the usual machine.
    is_cubic: bool,
    /// Whether `together` is more than constants.
    has_powers: bool,
    tables: Vec<Tables>,
    others: Vec<(usize, Polynomials)>,
}

/// Polynomials about one origin over one span, one column each.
#[derive(Clone, Debug, PartialEq)]
struct Polynomials {
    origin: f64,
    span: (f64, f64),
    /// Powers above 3, the highest first.
    high: Vec<Lanes>,
    /// Powers 3 to 0: the usual cubic in one piece.
    low: [Lanes; 4],
}

/// Tables over the same knots, one column each.
#[derive(Clone, Debug, PartialEq)]
struct Tables {
    knots: Vec<f64>,
    values: Vec<Lanes>,
    /// Knots per unit of position where they are equally far apart.
    density: Option<f64>,
    /// One by the length of each cell.
    inverse_lengths: Vec<f64>,
}

impl Motions {
    /// An axis without errors.
    pub(super) const NONE: Self = Self {
        span: EVERYWHERE,
        together: Polynomials::NONE,
        is_cubic: false,
        has_powers: false,
        tables: Vec::new(),
        others: Vec::new(),
    };

    /// Adds one checked error motion.
    pub(super) fn add(&mut self, curve: &ErrorCurve) {
        let row = lane(curve.component.direction);
        match curve.form {
            CurveForm::Constant => self.together.add(row, &[0], &curve.coefficient),
            CurveForm::Polynomial => {
                self.narrow(curve.span);
                if self.together.is_constant() {
                    self.together.origin = curve.origin;
                    self.together.span = curve.span;
                }
                let same = (self.together.origin, self.together.span) == (curve.origin, curve.span);
                if same {
                    self.has_powers = true;
                    self.together.add(row, &curve.power, &curve.coefficient);
                } else {
                    let mut alone = Polynomials {
                        origin: curve.origin,
                        span: curve.span,
                        ..Polynomials::NONE
                    };
                    alone.add(row, &curve.power, &curve.coefficient);
                    self.others.push((row, alone));
                }
            }
            CurveForm::Table => {
                self.narrow(curve.span);
                let same = |tables: &&mut Tables| tables.knots == curve.position;
                if let Some(tables) = self.tables.iter_mut().find(same) {
                    tables.add(row, &curve.coefficient);
                } else {
                    let mut tables = Tables::over(&curve.position);
                    tables.add(row, &curve.coefficient);
                    self.tables.push(tables);
                }
            }
        }
        self.is_cubic = self.has_powers
            && self.together.high.is_empty()
            && self.tables.is_empty()
            && self.others.is_empty();
    }

    fn narrow(&mut self, (lower, upper): (f64, f64)) {
        self.span = (self.span.0.max(lower), self.span.1.min(upper));
    }

    /// Where all of them were recorded; infinite without any.
    pub(super) fn span(&self) -> (f64, f64) {
        self.span
    }

    /// Values at a position; the policy `Refuse` is for the caller to have asked about.
    #[inline(always)]
    pub(super) fn at(&self, position: f64, policy: Extrapolate) -> Lanes {
        if self.is_cubic {
            return self.together.cubics_at(position, policy);
        }
        self.of_any_form(position, policy)
    }

    fn of_any_form(&self, position: f64, policy: Extrapolate) -> Lanes {
        let mut six = if self.has_powers {
            self.together.at(position, policy)
        } else {
            self.together.low[3]
        };
        for tables in &self.tables {
            six = tables.add_at(position, six);
        }
        if self.others.is_empty() {
            return six;
        }
        self.with_others(position, policy, six)
    }

    // By value, here and below, so that the usual values need no place in memory.
    fn with_others(&self, position: f64, policy: Extrapolate, mut six: Lanes) -> Lanes {
        for (row, alone) in &self.others {
            six[*row] += alone.at(position, policy)[*row];
        }
        six
    }
}

const EVERYWHERE: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

impl Polynomials {
    const NONE: Self = Self {
        origin: 0.0,
        span: EVERYWHERE,
        high: Vec::new(),
        low: [[0.0; 8]; 4],
    };

    /// Whether origin and span are still anybody's.
    fn is_constant(&self) -> bool {
        self.span == EVERYWHERE
    }

    fn add(&mut self, row: usize, powers: &[u8], coefficients: &[f64]) {
        for (&power, &coefficient) in powers.iter().zip(coefficients) {
            let power = usize::from(power);
            while self.high.len() + 3 < power {
                self.high.insert(0, Lanes::default());
            }
            let all = self.low.len() + self.high.len();
            let place = all - 1 - power;
            match place.checked_sub(self.high.len()) {
                Some(place) => self.low[place][row] += coefficient,
                None => self.high[place][row] += coefficient,
            }
        }
    }

    /// Nearest position of the span. Two comparisons that a processor has as one instruction each, since no position is NaN.
    #[inline(always)]
    fn inside(&self, position: f64) -> f64 {
        let (lower, upper) = self.span;
        let raised = if position < lower { lower } else { position };
        if raised > upper { upper } else { raised }
    }

    /// Without powers above 3.
    #[inline(always)]
    fn cubics_at(&self, position: f64, policy: Extrapolate) -> Lanes {
        let inside = self.inside(position);
        let u = inside - self.origin;
        let [mut six, square, line, constant] = self.low;
        for coefficients in [&square, &line, &constant] {
            for (value, c) in six.iter_mut().zip(coefficients) {
                *value = *value * u + c; // (1)
            }
        }
        if policy == Extrapolate::Linear && (position - inside).abs() > 0.0 {
            return self.continued_by(position - inside, u, six);
        }
        six
    }

    fn at(&self, position: f64, policy: Extrapolate) -> Lanes {
        let inside = self.inside(position);
        let u = inside - self.origin;
        let mut six = Lanes::default();
        for coefficients in self.high.iter().chain(&self.low) {
            for (value, c) in six.iter_mut().zip(coefficients) {
                *value = *value * u + c; // (1)
            }
        }
        if policy == Extrapolate::Linear && (position - inside).abs() > 0.0 {
            return self.continued_by(position - inside, u, six);
        }
        six
    }

    /// Equation (2).
    #[cold]
    fn continued_by(&self, beyond: f64, u: f64, mut six: Lanes) -> Lanes {
        let mut values = Lanes::default();
        let mut slopes = Lanes::default();
        for coefficients in self.high.iter().chain(&self.low) {
            for ((slope, value), c) in slopes.iter_mut().zip(&mut values).zip(coefficients) {
                *slope = *slope * u + *value;
                *value = *value * u + c;
            }
        }
        for (value, slope) in six.iter_mut().zip(slopes) {
            *value += slope * beyond;
        }
        six
    }
}

impl Tables {
    /// Without columns yet; the knots ascend and are two or more.
    fn over(knots: &[f64]) -> Self {
        /// Of a cell: how far a knot may be from where equal cells would put it.
        const EVEN: f64 = 1e-6;
        let cells = knots.len() - 1;
        let length = (knots[cells] - knots[0]) / cells as f64;
        let is_even =
            |(k, knot): (usize, &f64)| (knot - knots[0] - k as f64 * length).abs() <= EVEN * length;
        let lengths = knots.windows(2).map(|pair| pair[1] - pair[0]);
        Self {
            values: vec![Lanes::default(); knots.len()],
            density: knots.iter().enumerate().all(is_even).then(|| 1.0 / length),
            inverse_lengths: lengths.map(|length| 1.0 / length).collect(),
            knots: knots.to_vec(),
        }
    }

    fn add(&mut self, row: usize, values: &[f64]) {
        for (lanes, value) in self.values.iter_mut().zip(values) {
            lanes[row] += value;
        }
    }

    #[inline]
    fn add_at(&self, position: f64, mut six: Lanes) -> Lanes {
        let last = self.inverse_lengths.len() - 1;
        let inside = position.max(self.knots[0]).min(self.knots[last + 1]);
        let cell = match self.density {
            Some(density) => {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "a cell inside the table"
                )]
                let cell = ((inside - self.knots[0]) * density) as usize;
                cell.min(last)
            }
            None => {
                let above = self.knots.partition_point(|&knot| knot <= inside);
                above.saturating_sub(1).min(last)
            }
        };
        let share = (inside - self.knots[cell]) * self.inverse_lengths[cell];
        let (from, to) = (&self.values[cell], &self.values[cell + 1]);
        for ((value, from), to) in six.iter_mut().zip(from).zip(to) {
            *value += from + share * (to - from);
        }
        six
    }
}

/// Straight between ascending points, constant beyond the outer ones; zero without a point. Positions and values in any
/// units, the result in that of the values; `value` has an entry for each of `position`.
#[must_use]
pub fn on_line(position: &[f64], value: &[f64], at: f64) -> f64 {
    let above = position.partition_point(|&point| point <= at);
    let (Some(below), true) = (above.checked_sub(1), above < position.len()) else {
        let end = if above == 0 {
            value.first()
        } else {
            value.last()
        };
        return end.copied().unwrap_or_default();
    };
    let share = (at - position[below]) / (position[above] - position[below]);
    value[below] + share * (value[above] - value[below])
}

/// One checked curve, ready to be evaluated alone.
pub struct Alone {
    motions: Motions,
    lane: usize,
}

impl Alone {
    /// Of a curve that [`check`] lets pass.
    #[must_use]
    pub fn new(curve: &ErrorCurve) -> Self {
        let mut motions = Motions::NONE;
        motions.add(curve);
        Self {
            motions,
            lane: lane(curve.component.direction),
        }
    }

    /// Its value at a position, mm or rad; beyond the recorded span that at its end.
    #[must_use]
    pub fn at(&self, position: f64) -> f64 {
        self.motions.at(position, Extrapolate::Hold)[self.lane]
    }
}

/// Whether the numbers of a curve are what its form needs.
///
/// # Errors
/// Names the component and the number, power, knot or span that is wrong.
pub fn check(curve: &ErrorCurve) -> Result<(), VolumetricError> {
    let component = curve.component;
    if component.is_location && curve.form != CurveForm::Constant {
        return Err(VolumetricError::LocationNotConstant { component });
    }
    let finite = |what, values: &[f64]| {
        let at = values.iter().position(|value| !value.is_finite());
        at.map_or(Ok(()), |index| {
            Err(VolumetricError::NotFinite {
                component,
                what,
                index,
                value: values[index],
            })
        })
    };
    finite("coefficient", &curve.coefficient)?;
    finite("position", &curve.position)?;
    finite("origin", &[curve.origin])?;
    let n_coefficients = curve.coefficient.len();
    let (n_powers, n_knots, needed) = match curve.form {
        CurveForm::Constant => (0, 0, 1),
        CurveForm::Polynomial => (n_coefficients, 0, 1),
        CurveForm::Table => (0, n_coefficients, 2),
    };
    let is_exact = curve.form == CurveForm::Constant;
    if n_coefficients < needed || is_exact && n_coefficients > needed {
        return Err(VolumetricError::CoefficientCount {
            component,
            found: n_coefficients,
            needed,
        });
    }
    let lists = [
        ("powers", n_powers, curve.power.len()),
        ("knots", n_knots, curve.position.len()),
    ];
    for (what, needed, found) in lists {
        if needed != found {
            return Err(VolumetricError::LengthsDiffer {
                component,
                what,
                n_coefficients,
                needed,
                found,
            });
        }
    }
    check_arguments(curve)
}

/// Powers that differ, knots that ascend, a span that is one.
fn check_arguments(curve: &ErrorCurve) -> Result<(), VolumetricError> {
    let component = curve.component;
    for (index, &power) in curve.power.iter().enumerate() {
        if curve.power[..index].contains(&power) {
            return Err(VolumetricError::RepeatedPower { component, power });
        }
    }
    let falls = curve
        .position
        .windows(2)
        .position(|pair| pair[0] >= pair[1]);
    if let Some(index) = falls {
        return Err(VolumetricError::KnotsNotAscending {
            component,
            index: index + 1,
            before: curve.position[index],
            position: curve.position[index + 1],
        });
    }
    let (lower, upper) = curve.span;
    let is_span = lower.is_finite() && upper.is_finite() && lower < upper;
    if curve.form != CurveForm::Constant && !is_span {
        return Err(VolumetricError::SpanNotAscending {
            component,
            lower,
            upper,
        });
    }
    Ok(())
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "small whole numbers are exact")]
mod tests {
    use super::*;

    fn curve(
        component: &str,
        form: CurveForm,
        power: &[u8],
        position: &[f64],
        c: &[f64],
    ) -> ErrorCurve {
        ErrorCurve {
            component: component.parse().expect("a component"),
            form,
            origin: 10.0,
            power: power.to_vec(),
            position: position.to_vec(),
            coefficient: c.to_vec(),
            standard_uncertainty: Vec::new(),
            estimable: Vec::new(),
            span: (-10.0, 30.0),
        }
    }

    fn motions(curves: &[ErrorCurve]) -> Motions {
        let mut motions = Motions::NONE;
        for curve in curves {
            check(curve).expect("a good curve");
            motions.add(curve);
        }
        motions
    }

    #[test]
    fn eq1_any_powers_about_the_origin() {
        let eyx = curve("EYX", CurveForm::Polynomial, &[3, 1], &[], &[2.0, -1.0]);
        let mut ecx = curve("ECX", CurveForm::Polynomial, &[0, 5], &[], &[7.0, 1.0]);
        let ezx = curve("EZX", CurveForm::Constant, &[], &[], &[0.5]);
        let all = motions(&[ezx.clone(), eyx.clone(), ecx.clone()]);
        assert!(all.others.is_empty());
        let six = all.at(13.0, Extrapolate::Refuse);
        assert_eq!(six, [0.0, 51.0, 0.5, 0.0, 0.0, 0.0, 250.0, 0.0]);
        ecx.origin = 11.0;
        let six = motions(&[ezx, eyx, ecx]).at(13.0, Extrapolate::Refuse);
        assert_eq!(six, [0.0, 51.0, 0.5, 0.0, 0.0, 0.0, 39.0, 0.0]);
    }

    #[test]
    fn eq2_and_eq3_beyond_the_span() {
        let exx = curve("EXX", CurveForm::Polynomial, &[2], &[], &[1.0]);
        let all = motions(&[exx]);
        assert_eq!(all.span(), (-10.0, 30.0));
        assert_eq!(all.at(31.0, Extrapolate::Hold)[0], 400.0);
        assert_eq!(all.at(31.0, Extrapolate::Linear)[0], 440.0);
        assert_eq!(all.at(-12.0, Extrapolate::Linear)[0], 480.0);
    }

    #[test]
    fn a_table_is_straight_between_knots_and_constant_beyond() {
        let exx = curve(
            "EXX",
            CurveForm::Table,
            &[],
            &[0.0, 1.0, 3.0],
            &[1.0, 2.0, 0.0],
        );
        let all = motions(&[exx]);
        for (at, value) in [
            (-1.0, 1.0),
            (0.0, 1.0),
            (0.5, 1.5),
            (1.0, 2.0),
            (2.0, 1.0),
            (3.0, 0.0),
            (4.0, 0.0),
        ] {
            for policy in [Extrapolate::Linear, Extrapolate::Hold] {
                assert_eq!(all.at(at, policy)[0], value, "at {at}");
            }
        }
    }

    #[test]
    fn errors_name_component_and_numbers() {
        let message = |curve: &ErrorCurve| check(curve).expect_err("a bad curve").to_string();
        let cubic = curve(
            "EXX",
            CurveForm::Polynomial,
            &[1, 2, 3],
            &[],
            &[1.0, 2.0, 3.0],
        );
        let with = |change: fn(&mut ErrorCurve)| {
            let mut changed = cubic.clone();
            change(&mut changed);
            message(&changed)
        };
        assert_eq!(
            with(|c| c.coefficient[1] = f64::NAN),
            "EXX: coefficient[1] = NaN: must be a finite number"
        );
        assert_eq!(with(|c| c.power[1] = 3), "EXX: power 3 is given twice");
        assert_eq!(
            with(|c| c.power.truncate(2)),
            "EXX: 3 coefficients need 3 powers, there are 2"
        );
        assert_eq!(
            with(|c| c.span = (1.0, 1.0)),
            "EXX: recorded span from 1 mm to 1 mm: must be finite and ascending"
        );
        assert!(with(|c| c.origin = f64::INFINITY).contains("origin[0] = inf"));
        assert_eq!(
            message(&curve(
                "EXX",
                CurveForm::Table,
                &[],
                &[0.0, 2.0, 2.0],
                &[1.0, 2.0, 3.0]
            )),
            "EXX: knot 2 at 2 mm must lie above the one before, at 2 mm"
        );
        assert_eq!(
            message(&curve("EXX", CurveForm::Table, &[], &[0.0], &[1.0])),
            "EXX: 1 coefficients, its form needs 2"
        );
        assert_eq!(
            message(&curve("EXX", CurveForm::Constant, &[], &[], &[1.0, 2.0])),
            "EXX: 2 coefficients, its form needs 1"
        );
        assert_eq!(
            message(&curve("EC0Y", CurveForm::Polynomial, &[1], &[], &[1.0])),
            "EC0Y is a location error and must be a constant"
        );
    }
}
