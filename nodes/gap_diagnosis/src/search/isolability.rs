//! What can be told from what on a recording, before and after it is measured.
//!
//! # Model
//!
//! With U_g the orthonormal whitened columns of an instance and all other kinds' columns together H:
//!
//! ```text
//!   cos_gh = largest singular value of U_g' U_h                           (1)
//!   sin_g = |J_g - H (H'H)^-1 H'J_g| / |J_g|                              (2)
//!   D95 = sqrt(q ln n + 2 ln K) + 1.64,   size95 = D95 typical / |J_g|    (3)
//! ```
//!
//! # References
//! \[1\] D. Eriksson, E. Frisk, M. Krysander, Automatica 49, 2013 (distinguishability).

use nalgebra::{DMatrix, DVector};

use crate::noise::normal::Normal;
use crate::report::figures::Isolability;
use crate::search::rows::count;
use crate::search::signature::{Form, Library};

/// One form for each instance: those given, and the form that shows best of the others.
pub fn forms(signatures: &Library, normal: &Normal, chosen: &[usize]) -> Vec<usize> {
    let size = |form: &Form| -> f64 { form.columns.iter().map(|c| normal.gram[(*c, *c)]).sum() };
    (0..signatures.instances.len())
        .filter_map(|instance| {
            let own = |form: &usize| signatures.forms[*form].instance == instance;
            chosen.iter().copied().find(own).or_else(|| {
                let all = (0..signatures.forms.len()).filter(own);
                let plain = all.filter(|form| !signatures.forms[*form].wide);
                plain.max_by(|a, b| {
                    size(&signatures.forms[*a]).total_cmp(&size(&signatures.forms[*b]))
                })
            })
        })
        .collect()
}

/// The whole matrix.
pub fn isolability(
    signatures: &Library,
    normal: &Normal,
    forms: &[usize],
    freedom: f64,
) -> Isolability {
    let log_instances = 2.0 * count(signatures.seen().max(2)).ln();
    let mut matrix = Isolability::default();
    for &form in forms {
        let entry = &signatures.forms[form];
        let instance = &signatures.instances[entry.instance];
        matrix.names.push(instance.name());
        matrix.cos.push(
            forms
                .iter()
                .map(|other| cos(signatures, normal, form, *other))
                .collect(),
        );
        matrix
            .sin_alone
            .push(sin_alone(signatures, normal, forms, form));
        let d95 = (count(entry.price) * freedom.ln() + log_instances).sqrt() + 1.64;
        let first = entry.amplitudes[0];
        let parameter = instance
            .kind
            .parameters
            .iter()
            .chain(instance.kind.free)
            .nth(first);
        let size = normal.gram[(entry.columns[0], entry.columns[0])].sqrt();
        matrix
            .detectable
            .push(parameter.map_or(f64::NAN, |p| d95 * p.typical / size));
        matrix
            .unit
            .push(parameter.map_or_else(String::new, |p| p.name.to_owned()));
    }
    matrix
}

/// (1).
pub fn cos(signatures: &Library, normal: &Normal, a: usize, b: usize) -> f64 {
    let (a, b) = (&signatures.forms[a].columns, &signatures.forms[b].columns);
    let half = |own: &[usize]| root_inverse(&normal.gram.select_rows(own).select_columns(own));
    let between = normal.gram.select_rows(a).select_columns(b);
    let cosines = half(a) * between * half(b);
    cosines
        .singular_values()
        .iter()
        .copied()
        .fold(0.0, f64::max)
        .min(1.0)
}

/// Inverse square root of a Gram matrix, its null space left out.
fn root_inverse(gram: &DMatrix<f64>) -> DMatrix<f64> {
    let eigen = gram.clone().symmetric_eigen();
    let most = eigen.eigenvalues.iter().copied().fold(0.0, f64::max);
    let inverse = |value: f64| {
        if value > 1e-9 * most && value > 0.0 {
            1.0 / value.sqrt()
        } else {
            0.0
        }
    };
    let values: DVector<f64> = eigen.eigenvalues.map(inverse);
    &eigen.eigenvectors * DMatrix::from_diagonal(&values) * eigen.eigenvectors.transpose()
}

/// (2).
fn sin_alone(signatures: &Library, normal: &Normal, forms: &[usize], form: usize) -> f64 {
    let kind = |form: usize| {
        signatures.instances[signatures.forms[form].instance]
            .kind
            .id
    };
    let others: Vec<usize> = forms
        .iter()
        .filter(|other| kind(**other) != kind(form))
        .flat_map(|other| signatures.forms[*other].columns.clone())
        .collect();
    let own = signatures.forms[form].columns[0];
    let square = normal.gram[(own, own)];
    (1.0 - normal.explained_square(own, &others) / square)
        .max(0.0)
        .sqrt()
}
