//! How well some information shows each effect, and tells it from each other one: (2) and (3) of `design`.

use std::ops::Range;

use nalgebra::DMatrix;

use super::information::MOST_COLUMNS;
use crate::judgement::veto::least_d_squared;
use crate::next::DECISION;

/// Logarithm of the rows that a form of several columns is priced by: those of a usual session, some 5000.
const LOG_ROWS: f64 = 8.5;
/// Squares below this show nothing.
const NOTHING: f64 = 1e-12;
/// Least pivot, as a share of the column's square.
const LEAST_PIVOT: f64 = 1e-7;
/// Standard deviations above a limit at which 95 of 100 recordings are beyond it.
pub const SURE: f64 = 1.64;

/// What an effect is to be shown at.
#[derive(Clone, Debug)]
pub struct Aim {
    /// Its columns.
    pub columns: Range<usize>,
    /// The stated size over the typical one.
    pub stated: f64,
    /// The greatest physical size over the typical one.
    pub greatest: f64,
    /// How much it counts.
    pub weight: f64,
    /// D_0.
    pub least_d: f64,
}

impl Aim {
    /// The aim of an effect with some columns.
    pub fn new(columns: Range<usize>, stated: f64, greatest: f64, weight: f64) -> Self {
        Self {
            least_d: least_d_squared(columns.len(), LOG_ROWS).sqrt(),
            columns,
            stated,
            greatest,
            weight,
        }
    }
}

/// A_0.
pub fn parted() -> f64 {
    DECISION.sqrt()
}

/// One effect at its typical size.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Shown {
    /// |J|.
    pub d: f64,
    /// What the nearest other effect leaves of it.
    pub apart: f64,
}

impl Shown {
    /// (3).
    pub fn separability(&self, aim: &Aim) -> f64 {
        let (d, apart) = (aim.stated * self.d, aim.stated * self.apart);
        (d / aim.least_d).min(apart / parted())
    }

    /// (4) over the typical size; none beyond what is physical.
    pub fn named_from(&self, aim: &Aim) -> Option<f64> {
        if self.d <= 0.0 || self.apart <= 0.0 {
            return None;
        }
        let from = ((aim.least_d + SURE) / self.d).max(parted() / self.apart);
        (from <= aim.greatest).then_some(from)
    }
}

/// Cholesky factor of the columns of one effect; a column that others span has none.
struct Factor {
    lower: [[f64; MOST_COLUMNS]; MOST_COLUMNS],
    kept: [bool; MOST_COLUMNS],
    columns: Range<usize>,
}

impl Factor {
    fn new(gram: &DMatrix<f64>, columns: &Range<usize>) -> Self {
        let mut factor = Self {
            lower: [[0.0; MOST_COLUMNS]; MOST_COLUMNS],
            kept: [false; MOST_COLUMNS],
            columns: columns.clone(),
        };
        for i in 0..columns.len().min(MOST_COLUMNS) {
            for j in 0..i {
                let sum: f64 = (0..j)
                    .map(|k| factor.lower[i][k] * factor.lower[j][k])
                    .sum();
                if factor.kept[j] {
                    let own = gram[(columns.start + i, columns.start + j)];
                    factor.lower[i][j] = (own - sum) / factor.lower[j][j];
                }
            }
            let square = gram[(columns.start + i, columns.start + i)];
            let spanned: f64 = factor.lower[i][..i].iter().map(|v| v * v).sum();
            let pivot = square - spanned;
            factor.kept[i] = square > NOTHING && pivot > LEAST_PIVOT * square;
            if factor.kept[i] {
                factor.lower[i][i] = pivot.sqrt();
            } else {
                factor.lower[i] = [0.0; MOST_COLUMNS];
            }
        }
        factor
    }

    /// What these columns explain of the square of another.
    fn explained(&self, gram: &DMatrix<f64>, column: usize) -> f64 {
        let mut half = [0.0; MOST_COLUMNS];
        let mut explained = 0.0;
        for i in 0..self.columns.len().min(MOST_COLUMNS) {
            if !self.kept[i] {
                continue;
            }
            let sum: f64 = (0..i).map(|k| self.lower[i][k] * half[k]).sum();
            half[i] = (gram[(self.columns.start + i, column)] - sum) / self.lower[i][i];
            explained += half[i] * half[i];
        }
        explained
    }
}

/// (2) of every effect at its typical size.
pub fn shown(gram: &DMatrix<f64>, aims: &[Aim]) -> Vec<Shown> {
    let factors: Vec<Factor> = aims
        .iter()
        .map(|aim| Factor::new(gram, &aim.columns))
        .collect();
    let of = |(i, aim): (usize, &Aim)| {
        let first = aim.columns.start;
        let square = gram[(first, first)];
        if square <= NOTHING {
            return Shown::default();
        }
        let others = factors.iter().enumerate().filter(|(j, _)| *j != i);
        let most = others
            .map(|(_, factor)| factor.explained(gram, first))
            .fold(0.0, f64::max);
        Shown {
            d: square.sqrt(),
            apart: (square - most).max(0.0).sqrt(),
        }
    };
    aims.iter().enumerate().map(of).collect()
}

/// What one effect leaves of another, both ways, at their stated sizes.
pub fn between(gram: &DMatrix<f64>, [a, b]: [&Aim; 2]) -> [f64; 2] {
    let left = |own: &Aim, other: &Aim| {
        let first = own.columns.start;
        let explained = Factor::new(gram, &other.columns).explained(gram, first);
        own.stated * (gram[(first, first)] - explained).max(0.0).sqrt()
    };
    [left(a, b), left(b, a)]
}

/// What is maximised: the worst separability first, then how much is named.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Score {
    /// Worst q of the effects that can be shown at all.
    pub worst: f64,
    /// Sum over all effects, w (1 - exp(-2 q)).
    pub sum: f64,
}

impl Score {
    /// Of some information; `reachable`: which effects count for the worst.
    pub fn of(gram: &DMatrix<f64>, aims: &[Aim], reachable: &[bool]) -> Self {
        let mut score = Self {
            worst: f64::INFINITY,
            sum: 0.0,
        };
        for ((shown, aim), is_reachable) in shown(gram, aims).iter().zip(aims).zip(reachable) {
            let q = shown.separability(aim);
            if *is_reachable && aim.weight > 0.0 {
                score.worst = score.worst.min(q);
            }
            score.sum += aim.weight * (1.0 - (-2.0 * q).exp());
        }
        if score.worst.is_infinite() {
            score.worst = 0.0;
        }
        score
    }

    /// Whether it is better than another.
    pub fn is_above(&self, other: &Self) -> bool {
        let by = |a: f64, b: f64| a.total_cmp(&b);
        by(self.worst, other.worst)
            .then(by(self.sum, other.sum))
            .is_gt()
    }
}

/// Whether an effect is named at its stated size.
pub fn is_named(shown: &Shown, aim: &Aim) -> bool {
    shown.named_from(aim).is_some_and(|from| from <= aim.stated)
}

/// Effects that are named at their stated size.
pub fn named(shown: &[Shown], aims: &[Aim]) -> usize {
    let all = shown.iter().zip(aims);
    all.filter(|(shown, aim)| is_named(shown, aim)).count()
}

/// Cosine between the first columns of two effects; zero where one shows nothing.
pub fn cos(gram: &DMatrix<f64>, [a, b]: [&Aim; 2]) -> f64 {
    let (a, b) = (a.columns.start, b.columns.start);
    let squares = gram[(a, a)] * gram[(b, b)];
    if squares <= 0.0 {
        return 0.0;
    }
    (gram[(a, b)] / squares.sqrt()).abs().min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn aims(columns: &[usize]) -> Vec<Aim> {
        let mut next = 0;
        let mut all = Vec::new();
        for n in columns {
            all.push(Aim::new(next..next + n, 1.0, 100.0, 1.0));
            next += n;
        }
        all
    }

    /// Two unit vectors at 60 degrees: of each the other leaves sin 60.
    #[test]
    fn eq2_two_effects_at_an_angle_leave_each_other_its_sine() {
        let gram = DMatrix::from_row_slice(2, 2, &[4.0, 2.0, 2.0, 4.0]);
        let found = shown(&gram, &aims(&[1, 1]));
        for one in &found {
            assert!((one.d - 2.0).abs() < 1e-12);
            assert!((one.apart - 2.0 * 60.0_f64.to_radians().sin()).abs() < 1e-12);
        }
        assert!((cos(&gram, [&aims(&[1, 1])[0], &aims(&[1, 1])[1]]) - 0.5).abs() < 1e-12);
    }

    /// The third column lies in the plane of the first two, which are one effect: nothing is left of it.
    #[test]
    fn an_effect_that_another_spans_is_never_named() {
        let columns = DMatrix::from_row_slice(3, 3, &[1.0, 0.0, 3.0, 0.0, 2.0, 4.0, 0.0, 0.0, 0.0]);
        let gram = columns.tr_mul(&columns);
        let all = aims(&[2, 1]);
        let found = shown(&gram, &all);
        assert!((found[1].d - 5.0).abs() < 1e-12 && found[1].apart < 1e-6);
        assert!(found[1].named_from(&all[1]).is_none_or(|from| from > 1e5));
        // The other way round the first column keeps what is across: 1 - (3/5)^2.
        assert!((found[0].apart - 0.8).abs() < 1e-12, "{:?}", found[0]);
    }

    /// (4) by hand: D 20 at the typical size is named from (6.5 + 1.64) / 20 of it, where nothing is near.
    #[test]
    fn eq4_an_effect_without_a_rival_is_named_by_its_d_alone() {
        let gram = DMatrix::from_row_slice(1, 1, &[400.0]);
        let all = aims(&[1]);
        let from = shown(&gram, &all)[0].named_from(&all[0]).unwrap();
        assert!((from - 8.14 / 20.0).abs() < 1e-9, "{from}");
        assert_eq!(named(&shown(&gram, &all), &all), 1);
    }
}
