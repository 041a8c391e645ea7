//! Size of an effect against the noise of a shift, with its set-ups and others taken out.
//!
//! Circles and touches have noise of their own (`metric`); products of both add up. What each set-up leaves open is taken
//! out once for all columns: with N the set-up and F = N' C^-1 N
//!
//! ```text
//!   <a, b> = a' C^-1 b - (N' C^-1 a)' F^-1 (N' C^-1 b)                    (1)
//! ```

use nalgebra::{DMatrix, DVector};

use super::super::metric::{Floor, Metric, last_left};
use super::timetable::Timetable;

/// Keeps a set-up that no reading has from being divided by.
const SET_UP_RIDGE: f64 = 1e-9;

/// A column of readings, ready for products (1).
pub struct Weighed {
    plain: DVector<f64>,
    weighted: DVector<f64>,
    /// Set-up part, as a vector whose products are those of the second term of (1).
    along: DVector<f64>,
}

/// Products of a shift.
pub struct Sizing {
    /// Of circles and of touches.
    metrics: [Metric; 2],
    set_up: DMatrix<f64>,
    /// Inverse of the lower factor of F.
    inverse: DMatrix<f64>,
}

impl Sizing {
    /// Products of the noise of circles and of touches.
    pub fn of(floors: &[Floor; 2], table: &Timetable) -> Self {
        let courses = courses(table);
        let metrics = [0, 1].map(|part| Metric::of(&floors[part], &courses[part]));
        let mut sizing = Self {
            metrics,
            set_up: DMatrix::zeros(0, 0),
            inverse: DMatrix::zeros(0, 0),
        };
        let columns = set_up(table);
        let n = columns.len();
        let weighed: Vec<[DVector<f64>; 2]> = columns.iter().map(|c| sizing.whole(c)).collect();
        let mut floats = DMatrix::from_fn(n, n, |a, b| weighed[a][0].dot(&weighed[b][1]));
        for k in 0..n {
            floats[(k, k)] *= 1.0 + SET_UP_RIDGE;
        }
        let weighted: Vec<DVector<f64>> = weighed.into_iter().map(|[_, own]| own).collect();
        sizing.set_up = DMatrix::from_columns(&weighted);
        let factor = floats.cholesky().map(|factor| factor.l());
        sizing.inverse = factor
            .and_then(|lower| lower.try_inverse())
            .unwrap_or_else(|| DMatrix::zeros(n, n));
        sizing
    }

    fn whole(&self, column: &[f64]) -> [DVector<f64>; 2] {
        let [circles, touches] = &self.metrics;
        let (first, second) = column.split_at(circles.len());
        let ([a, b], [c, d]) = (circles.weighted(first), touches.weighted(second));
        let both = |a: DVector<f64>, b: DVector<f64>| {
            DVector::from_iterator(a.len() + b.len(), a.iter().chain(b.iter()).copied())
        };
        [both(a, c), both(b, d)]
    }

    /// Makes a column ready.
    pub fn weigh(&self, column: &[f64]) -> Weighed {
        let [plain, weighted] = self.whole(column);
        let along = &self.inverse * self.set_up.tr_mul(&plain);
        Weighed {
            plain,
            weighted,
            along,
        }
    }

    /// D of a column with others taken out.
    pub fn d(&self, own: &Weighed, taken_out: &[&Weighed]) -> f64 {
        let mut all = taken_out.to_vec();
        all.push(own);
        let n = all.len();
        let product = |a: &Weighed, b: &Weighed| a.plain.dot(&b.weighted) - a.along.dot(&b.along);
        last_left(DMatrix::from_fn(n, n, |a, b| product(all[a], all[b])))
    }
}

/// Courses of the runs: of circles, and of block cycles.
pub fn courses(table: &Timetable) -> [Vec<Vec<f64>>; 2] {
    let even = |n: usize| (0..n).map(|k| (k as f64 + 0.5) / n as f64).collect();
    [
        table
            .turns()
            .map(|turn| even(turn.circle.angles.len()))
            .collect(),
        table
            .cycles()
            .map(|cycle| even(cycle.touches.len()))
            .collect(),
    ]
}

/// Centre and length of the bar in every circle, and the place of every face.
fn set_up(table: &Timetable) -> Vec<Vec<f64>> {
    let circles: usize = table.turns().map(|turn| turn.circle.angles.len()).sum();
    let len = circles + table.touches().count();
    let mut columns = vec![];
    let mut from = 0;
    for turn in table.turns() {
        for of in [|_: f64| 1.0, f64::cos, f64::sin] {
            let mut column = vec![0.0; len];
            let own = column[from..].iter_mut().zip(&turn.circle.angles);
            own.for_each(|(value, angle)| *value = of(*angle));
            columns.push(column);
        }
        from += turn.circle.angles.len();
    }
    for block in 0..table.blocks.len() {
        for axis in 0..3 {
            let mut column = vec![0.0; len];
            let touches = column[circles..].iter_mut().zip(table.touches());
            let own = touches.filter(|(_, touch)| (touch.block, touch.axis) == (block, axis));
            own.for_each(|(value, _)| *value = 1.0);
            columns.push(column);
        }
    }
    columns
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_pcg::Pcg64Mcg;

    use super::*;

    #[test]
    fn eq1_is_what_is_left_when_the_set_up_is_taken_out_column_by_column() {
        let mut random = Pcg64Mcg::seed_from_u64(2);
        let table = Timetable::draw(&mut random);
        let floors = [0.3, 0.4].map(|um| Floor::draw(&mut random, [um, um], [0.2, 0.2]));
        let sizing = Sizing::of(&floors, &table);
        let len: usize = sizing.metrics.iter().map(Metric::len).sum();
        let signature: Vec<f64> = (0..len).map(|k| ((k * k) % 17) as f64).collect();
        let d = sizing.d(&sizing.weigh(&signature), &[]);
        let [whole, set_up] = [vec![signature.clone()], set_up(&table)];
        let weigh = |column: &Vec<f64>| sizing.whole(column);
        let all: Vec<[DVector<f64>; 2]> = set_up.iter().chain(&whole).map(weigh).collect();
        let n = all.len();
        let wanted = last_left(DMatrix::from_fn(n, n, |a, b| all[a][0].dot(&all[b][1])));
        assert!((d / wanted - 1.0).abs() < 1e-6, "{d} {wanted}");
        let zero = sizing.d(&sizing.weigh(&set_up[1]), &[]);
        assert!(zero < 1e-2, "{zero}");
    }
}
