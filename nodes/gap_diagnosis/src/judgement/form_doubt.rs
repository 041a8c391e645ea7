//! What a size owes to the form that its effect is given.
//!
//! # Model
//!
//! A member is sized in the catalogue's form and once more in its wide form, all others as they are. Were the
//! catalogue's form right, both would find one size but for noise; what they differ by beyond noise is doubt:
//!
//! ```text
//!   u2 = u_n2 + ((v_w - v_n)2 - (u_w2 - u_n2))+                           (1)
//! ```
//!
//! with v and u value and standard uncertainty, n the catalogue's form and w the wide one.
//!
//! An instrument that rounds repeats to the same values, in steps of q, hides what it rounds off. It may be common to all that
//! the effect moves, by c for each unit of its size (root mean square):
//!
//! ```text
//!   u2 = u2 + (q / (sqrt 12 c))2                                          (2)
//! ```
//!
//! # Holds when
//! The wide form reaches the machine's own: what neither form shows stays out of the interval.
//!
//! # References
//! \[1\] J. A. Hausman, Econometrica 46, 1978 (the variance of a difference of two estimates, one efficient).

use nalgebra::DVector;
use twin::effects::{Parameter, Role};

use crate::noise::form_error;
use crate::noise::stack::Stack;
use crate::search::refit::{self, COVERAGE, Estimate};
use crate::search::rows::count;
use crate::search::signature::{Form, Library};
use crate::search::widening;

/// Squared cosine from which a free amplitude is the form over again.
const MAX_SQUARED_COSINE: f64 = 0.98;

/// (1) for every form of a set that has a wider one.
pub fn widen(stack: &Stack<'_>, signatures: &Library, forms: &[&Form], estimates: &mut [Estimate]) {
    for place in 0..forms.len() {
        let kind = signatures.instances[forms[place].instance].kind;
        if forms[place].wide || kind.free.is_empty() {
            continue;
        }
        let wide = wider(stack, signatures, forms[place], &estimates[place]);
        let mut all = forms.to_vec();
        all[place] = &wide;
        let sizes: Vec<f64> = all
            .iter()
            .zip(estimates.iter())
            .flat_map(|(form, estimate)| sizes(signatures, form, estimate))
            .collect();
        let refit = refit::joint(stack, signatures, &all, &sizes);
        doubt(&mut estimates[place], &refit.estimates[place]);
    }
}

/// (2) for every amplitude.
pub fn round(stack: &Stack<'_>, signatures: &Library, forms: &[&Form], estimates: &mut [Estimate]) {
    let step_mm = form_error::rounding_step_mm(stack).unwrap_or(0.0);
    if step_mm <= 0.0 {
        return;
    }
    for (form, estimate) in forms.iter().zip(estimates) {
        let instance = &signatures.instances[form.instance];
        let all: Vec<&Parameter> = { instance.kind.parameters.iter() }
            .chain(instance.kind.free)
            .collect();
        for place in estimate.active.clone() {
            let Some(parameter) = all.get(place).filter(|p| p.role == Role::Amplitude) else {
                continue;
            };
            let mut on = form.values.clone();
            on[place] = parameter.typical;
            let rows = stack.simulate(&[&*instance.effect(&on)]);
            let moved: Vec<f64> = rows.into_iter().filter(|mm| *mm != 0.0).collect();
            let squares_mm2: f64 = moved.iter().map(|mm| mm * mm).sum();
            if squares_mm2 <= 0.0 {
                continue;
            }
            let rms_mm = (squares_mm2 / count(moved.len())).sqrt();
            let u = step_mm / 12_f64.sqrt() * parameter.typical / rms_mm;
            let half = 0.5 * (estimate.high[place] - estimate.low[place]);
            let by = half.hypot(COVERAGE * u);
            estimate.low[place] = estimate.values[place] - by;
            estimate.high[place] = estimate.values[place] + by;
        }
    }
}

/// (1) for every value that both estimate.
fn doubt(narrow: &mut Estimate, wide: &Estimate) {
    for place in narrow.active.clone() {
        if !wide.active.contains(&place) {
            continue;
        }
        let variance = |estimate: &Estimate| {
            ((estimate.high[place] - estimate.low[place]) / (2.0 * COVERAGE)).powi(2)
        };
        let (own, other) = (variance(narrow), variance(wide));
        let apart = (wide.values[place] - narrow.values[place]).powi(2);
        let excess = (apart - (other - own).max(0.0)).max(0.0);
        let by = COVERAGE * (own + excess).sqrt();
        narrow.low[place] = narrow.values[place] - by;
        narrow.high[place] = narrow.values[place] + by;
    }
}

/// The wide form at the shapes that were found.
fn wider(stack: &Stack<'_>, signatures: &Library, form: &Form, estimate: &Estimate) -> Form {
    let instance = &signatures.instances[form.instance];
    let parameters = || {
        instance
            .kind
            .parameters
            .iter()
            .chain(instance.kind.free)
            .enumerate()
    };
    let mut values = estimate.values.clone();
    for (place, parameter) in parameters() {
        if parameter.role == Role::Amplitude {
            values[place] = 0.0;
        }
    }
    let signature = |place: usize, typical: f64| {
        let mut on = values.clone();
        on[place] = typical;
        stack.signature(&*instance.effect(&on))
    };
    let own: Vec<DVector<f64>> = parameters()
        .filter(|(place, _)| form.amplitudes.contains(place))
        .map(|(place, p)| signature(place, p.typical))
        .collect();
    // What is the catalogue's own form over again widens nothing: between the two any share would do.
    let shows = |place: &usize, typical: f64| {
        let column = signature(*place, typical);
        let is_other = |own: &DVector<f64>| {
            let square = own.norm_squared() * column.norm_squared();
            own.dot(&column).powi(2) < MAX_SQUARED_COSINE * square
        };
        column.norm() > 1e-3 && own.iter().all(is_other)
    };
    let amplitudes = parameters()
        .filter(|(place, p)| {
            p.role == Role::Amplitude
                && widening::is_free_here(stack, instance, p.name)
                && (form.amplitudes.contains(place) || shows(place, p.typical))
        })
        .map(|(place, _)| place)
        .collect();
    Form {
        amplitudes,
        values,
        wide: true,
        ..form.clone()
    }
}

/// Amplitudes of an estimate, in typical sizes.
fn sizes(signatures: &Library, form: &Form, estimate: &Estimate) -> Vec<f64> {
    let kind = signatures.instances[form.instance].kind;
    let typical = |place: usize| {
        kind.parameters
            .iter()
            .chain(kind.free)
            .nth(place)
            .map_or(1.0, |p| p.typical)
    };
    form.amplitudes
        .iter()
        .map(|place| estimate.values[*place] / typical(*place))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn estimate(value: f64, u: f64) -> Estimate {
        Estimate {
            whole: None,
            values: vec![value],
            active: vec![0],
            low: vec![value - COVERAGE * u],
            high: vec![value + COVERAGE * u],
            at_bound: vec![false],
            d: 1.0,
        }
    }

    #[test]
    fn eq1_two_forms_that_agree_within_noise_add_nothing_and_the_rest_is_added_in_squares() {
        let mut narrow = estimate(4.0, 0.3);
        doubt(&mut narrow, &estimate(4.3, 0.5));
        assert!((narrow.high[0] - 4.0 - COVERAGE * 0.3).abs() < 1e-12);
        // Apart by 0.9: its square less 0.25 - 0.09 is doubt beside the 0.09 of the catalogue's form.
        doubt(&mut narrow, &estimate(4.9, 0.5));
        let u = (0.81_f64 - 0.16 + 0.09).sqrt();
        assert!(
            (narrow.high[0] - 4.0 - COVERAGE * u).abs() < 1e-12,
            "{narrow:?}"
        );
        assert!((narrow.low[0] - 4.0 + COVERAGE * u).abs() < 1e-12);
    }
}
