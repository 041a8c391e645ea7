//! How one error component depends on the position of its axis: a constant, powers, or a table.
//!
//! # Model
//!
//! ```text
//!   E(q) = Σ c_k b_k(q)
//!   constant:   b(q) = 1                                                        (1)
//!   powers:     b_k(q) = (q − o)^k,  k ≥ 1: no constant term                     (2)
//!   table:      b_k(q) = hat at knot k; straight between knots, constant beyond  (3)
//! ```
//!
//! A constant term of an error motion shifts or turns the whole machine and is what the datum takes;
//! a linear term of a straightness turns its axis and is what squareness and the reference frame take.
//! So in a table of positioning or turns the knot nearest to the origin is zero, and in a table of
//! straightness the outer knots are: they span the reference line.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | q | `position` | mm, rad |
//! | c | coefficient | mm or rad per mm^k or rad^k |
//!
//! # References
//! \[1\] ISO 230-1:2012, 3.4: straightness is stated about a reference line.

use metrology::ErrorComponent;

/// The functions of position that make up a component.
#[derive(Clone, Debug, PartialEq)]
pub enum Basis {
    /// (1): location errors.
    Constant,
    /// (2).
    Polynomial {
        /// Where it is zero, mm or rad.
        origin: f64,
        /// Powers, each at least 1, ascending.
        powers: Vec<u8>,
    },
    /// (3).
    Table {
        /// Knots, ascending, mm or rad.
        knots: Vec<f64>,
        /// Indices of the knots that are unknown; at the others the error is zero.
        free: Vec<usize>,
    },
}

/// One component and its functions.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelComponent {
    /// Which.
    pub component: ErrorComponent,
    /// Its functions of position.
    pub basis: Basis,
}

impl Basis {
    /// Powers `first..=last` about `origin`.
    #[must_use]
    pub fn powers(origin: f64, first: u8, last: u8) -> Self {
        Self::Polynomial {
            origin,
            powers: (first..=last).collect(),
        }
    }

    /// A table for `component` with the zero knots that its reference asks for.
    #[must_use]
    pub fn table(component: ErrorComponent, origin: f64, knots: Vec<f64>) -> Self {
        let last = knots.len().saturating_sub(1);
        let distance = |idx: &usize| (knots[*idx] - origin).abs();
        let nearest = (0..knots.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
        let is_zero = |idx: usize| {
            if is_straightness(component) {
                idx == 0 || idx == last
            } else {
                Some(idx) == nearest
            }
        };
        Self::Table {
            free: (0..knots.len()).filter(|idx| !is_zero(*idx)).collect(),
            knots,
        }
    }

    /// Number of unknown coefficients.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::Constant => 1,
            Self::Polynomial { powers, .. } => powers.len(),
            Self::Table { free, .. } => free.len(),
        }
    }

    /// Whether there is no unknown.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Appends the value of each function at `position`.
    pub fn values(&self, position: f64, out: &mut Vec<f64>) {
        match self {
            Self::Constant => out.push(1.0),
            Self::Polynomial { origin, powers } => {
                let lever = position - origin;
                out.extend(powers.iter().map(|k| lever.powi(i32::from(*k))));
            }
            Self::Table { knots, free } => {
                out.extend(free.iter().map(|idx| hat(knots, *idx, position)));
            }
        }
    }

    /// Greatest value of coefficient `idx`'s function where the axis was within `span`; 1 where that is zero.
    #[must_use]
    pub(crate) fn reach(&self, idx: usize, span: (f64, f64)) -> f64 {
        match self {
            Self::Polynomial { origin, powers } => {
                let lever = (span.0 - origin).abs().max((span.1 - origin).abs());
                let power = powers.get(idx).copied().unwrap_or(0);
                match lever.powi(i32::from(power)) {
                    reach if reach > 0.0 && reach.is_finite() => reach,
                    _ => 1.0,
                }
            }
            _ => 1.0,
        }
    }
}

/// Whether a component is the straightness of a linear axis.
#[must_use]
pub(crate) fn is_straightness(component: ErrorComponent) -> bool {
    !component.is_location && component.direction.is_linear() && component.direction != component.of
}

fn hat(knots: &[f64], idx: usize, position: f64) -> f64 {
    let at = knots[idx];
    let side = |neighbour: Option<&f64>| match neighbour {
        Some(other) => (1.0 - (position - at) / (other - at)).max(0.0),
        None => 1.0,
    };
    if position < at {
        side(idx.checked_sub(1).and_then(|before| knots.get(before)))
    } else {
        side(knots.get(idx + 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(basis: &Basis, position: f64) -> Vec<f64> {
        let mut out = Vec::new();
        basis.values(position, &mut out);
        out
    }

    #[test]
    fn eq2_powers_are_taken_about_the_origin() {
        let basis = Basis::powers(10.0, 2, 3);
        assert_eq!(values(&basis, 12.0), [4.0, 8.0]);
        assert!((basis.reach(1, (5.0, 13.0)) - 125.0).abs() < 1e-12);
    }

    #[test]
    fn eq3_hats_add_up_to_one_and_are_constant_outside() {
        let knots = vec![-10.0, 0.0, 30.0];
        for position in [-50.0, -10.0, -3.0, 0.0, 7.5, 30.0, 90.0] {
            let sum: f64 = (0..3).map(|idx| hat(&knots, idx, position)).sum();
            assert!((sum - 1.0).abs() < 1e-15, "{position}: {sum}");
        }
        assert!((hat(&knots, 1, 7.5) - 0.75).abs() < 1e-15);
    }

    #[test]
    fn a_table_is_zero_where_its_reference_is() {
        let knots = vec![-10.0, 1.0, 5.0, 20.0];
        let free = |name: &str| match Basis::table(name.parse().unwrap(), 0.0, knots.clone()) {
            Basis::Table { free, .. } => free,
            _ => Vec::new(),
        };
        assert_eq!(free("EXX"), [0, 2, 3]);
        assert_eq!(free("ECX"), [0, 2, 3]);
        assert_eq!(free("EYX"), [1, 2]);
    }
}
