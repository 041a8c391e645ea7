//! What the session knows of the columns in question.

use nalgebra::{DMatrix, DVector};

use super::distance::{Explanation, distance};
use crate::noise::normal::Normal;
use crate::search::signature::Library;

/// The session's information on the columns in question.
pub struct Known {
    /// J'J, whitened.
    pub gram: DMatrix<f64>,
    /// J'z.
    pub along: DVector<f64>,
    /// Which columns of the library these are.
    pub columns: Vec<usize>,
}

impl Known {
    /// The best sizes of some forms, and what is not known of them with the catalogue's typical sizes as prior.
    pub fn explanation(&self, signatures: &Library, forms: &[usize]) -> Explanation {
        let columns: Vec<usize> = forms
            .iter()
            .flat_map(|form| &signatures.forms[*form].columns)
            .filter_map(|column| self.columns.iter().position(|own| own == column))
            .collect();
        let normal = Normal {
            gram: self.gram.clone(),
            along: self.along.clone(),
        };
        let sizes = DVector::from_vec(normal.solve(&columns).sizes);
        let mut precision = self.gram.select_rows(&columns).select_columns(&columns);
        for k in 0..columns.len() {
            precision[(k, k)] += 1.0;
        }
        let doubt = precision.cholesky().map_or_else(
            || DMatrix::zeros(sizes.len(), sizes.len()),
            |factor| factor.inverse(),
        );
        Explanation {
            columns,
            sizes,
            doubt,
        }
    }

    /// Delta in what an experiment adds, of one form of a set against the rest of the set; what is not known of its size
    /// counts as often as `doubt` says.
    pub fn of_one(
        &self,
        signatures: &Library,
        set: &[usize],
        form: usize,
        added: &DMatrix<f64>,
        doubt: f64,
    ) -> f64 {
        let whole = self.explanation(signatures, set);
        let own = self.explanation(signatures, &[form]);
        let size = |column: &usize| {
            let place = whole.columns.iter().position(|c| c == column);
            place.map_or(0.0, |place| whole.sizes[place])
        };
        let sizes: Vec<f64> = own.columns.iter().map(size).collect();
        let mut others = whole.columns;
        others.retain(|column| !own.columns.contains(column));
        let own = Explanation {
            sizes: DVector::from_vec(sizes),
            doubt: doubt * own.doubt,
            ..own
        };
        distance(added, &own, &others)
    }
}
