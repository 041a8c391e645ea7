//! Columns of the stacked design, each evaluated once, and their products with one another.
//!
//! A fit that is repeated with other weights or one more column needs only what is new: the products of
//! that column with the others, and of the rows that weigh less.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::ops::Range;
use std::rc::Rc;

use nalgebra::DMatrix;

use super::scene::Scene;
use super::term::Term;

/// One column; outside `rows` it is zero.
#[derive(Clone, Debug)]
pub(super) struct Column {
    pub rows: Range<usize>,
    values: Vec<f64>,
}

/// Sum of products, eight at a time.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a_wide, a_rest) = a.as_chunks::<8>();
    let (b_wide, b_rest) = b.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for (a, b) in a_wide.iter().zip(b_wide) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a * b;
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f64>() + rest
}

impl Column {
    /// What a value of 1 makes at every row.
    pub fn of(scene: &Scene, term: &Term) -> Self {
        let mut values: Vec<f64> = Vec::with_capacity(scene.n_rows);
        for trace in &scene.traces {
            values.extend(trace.rows().map(|row| {
                trace.mean(row - trace.first_row, |point| term.at(scene, trace, point))
            }));
        }
        let is_something = |value: &f64| value.abs() > 0.0;
        let first = values.iter().position(is_something).unwrap_or(0);
        let end = values
            .iter()
            .rposition(is_something)
            .map_or(0, |last| last + 1);
        values.truncate(end);
        values.drain(..first.min(end));
        Self {
            rows: first.min(end)..end,
            values,
        }
    }

    /// Value in a row.
    pub fn at(&self, row: usize) -> f64 {
        let place = row.checked_sub(self.rows.start);
        place
            .and_then(|place| self.values.get(place))
            .copied()
            .unwrap_or(0.0)
    }

    /// Product with numbers of every row.
    pub fn dot_rows(&self, all: &[f64]) -> f64 {
        dot(&self.values, &all[self.rows.clone()])
    }

    /// Product with another column.
    pub fn dot(&self, other: &Self) -> f64 {
        let start = self.rows.start.max(other.rows.start);
        let end = self.rows.end.min(other.rows.end);
        if start >= end {
            return 0.0;
        }
        let part = |column: &'_ Self| start - column.rows.start..end - column.rows.start;
        dot(&self.values[part(self)], &other.values[part(other)])
    }

    /// Adds a multiple to numbers of every row.
    pub fn add_to(&self, factor: f64, all: &mut [f64]) {
        for (sum, value) in all[self.rows.clone()].iter_mut().zip(&self.values) {
            *sum += factor * value;
        }
    }

    /// The column times a factor of every row.
    pub fn times(&self, factors: &[f64]) -> Self {
        let pairs = self.values.iter().zip(&factors[self.rows.clone()]);
        Self {
            rows: self.rows.clone(),
            values: pairs.map(|(value, factor)| value * factor).collect(),
        }
    }
}

/// The columns of a scene that were asked for so far.
pub(super) struct Columns<'a> {
    pub scene: &'a Scene,
    /// Measured deviations by row, mm.
    pub observed_mm: Vec<f64>,
    known: RefCell<Vec<(Term, Rc<Column>)>>,
    products: RefCell<BTreeMap<(usize, usize), f64>>,
}

impl<'a> Columns<'a> {
    pub fn new(scene: &'a Scene) -> Self {
        let observed = |trace: &super::scene::Trace| {
            let of = |place| trace.mean(place, |point| point.observed_mm);
            (0..trace.points.len()).map(of).collect::<Vec<_>>()
        };
        Self {
            scene,
            observed_mm: scene.traces.iter().flat_map(observed).collect(),
            known: RefCell::default(),
            products: RefCell::default(),
        }
    }

    fn place(&self, term: &Term) -> usize {
        let mut known = self.known.borrow_mut();
        let found = known.iter().position(|(other, _)| other == term);
        found.unwrap_or_else(|| {
            known.push((*term, Rc::new(Column::of(self.scene, term))));
            known.len() - 1
        })
    }

    /// The column of a term.
    pub fn get(&self, term: &Term) -> Rc<Column> {
        let place = self.place(term);
        Rc::clone(&self.known.borrow()[place].1)
    }

    /// The columns of some terms and the products of all with all.
    pub fn gram(&self, terms: &[Term]) -> (Vec<Rc<Column>>, DMatrix<f64>) {
        let places: Vec<usize> = terms.iter().map(|term| self.place(term)).collect();
        let known = self.known.borrow();
        let mut products = self.products.borrow_mut();
        let mut gram = DMatrix::zeros(terms.len(), terms.len());
        for (i, a) in places.iter().enumerate() {
            for (j, b) in places.iter().enumerate().take(i + 1) {
                let key = (*a.min(b), *a.max(b));
                let product = *products
                    .entry(key)
                    .or_insert_with(|| known[*a].1.dot(&known[*b].1));
                gram[(i, j)] = product;
                gram[(j, i)] = product;
            }
        }
        let columns = places.iter().map(|place| Rc::clone(&known[*place].1));
        (columns.collect(), gram)
    }
}
