//! From fitted columns to rows: value, span, shares, and the circularity without each.
//!
//! # Model
//!
//! With c_i the row's own trace, y the measured one less what setting up made, over all used samples:
//!
//! ```text
//!   span_i = max over traces of  max(c_i, 0) − min(c_i, 0)                      (1)
//!   share_i = span_i / Σ_j span_j                                               (2)
//!   Shapley_i = Σ c_i y / Σ y²           what is left has the rest, so Σ = 1    (3)
//!   incremental_i = β_iᵀ C_ii⁻¹ β_i · variance / Σ w y²                         (4)
//!   what-if: G of y − c_i about its least-squares centre                        (5)
//!   amplitude a = √(p² + q²),  u²(a) = (p² u_p² + 2 p q u_pq + q² u_q²)/a²      (6)
//! ```
//!
//! (1) contains the nominal circle, so that a radius that is wrong everywhere has a span too. (3) is
//! the Shapley value of the game whose worth is the squared deviation that a set of rows makes: each
//! row has its own square and half of each cross term. It is below 0 where a row mostly cancels others.
//!
//! # References
//! \[1\] L. S. Shapley, in: Contributions to the Theory of Games II, Princeton 1953, 307-317.

use nalgebra::{DMatrix, DVector};

use super::cause;
use super::distinguish;
use super::plane::Input;
use super::report::{Alias, Detail, Row, Unit};
use super::robust::Fit;
use super::scene::{Scene, Trace};
use super::search::{Found, nonlinear_uncertainty, wald};
use super::term::{RowKey, Term};

/// Rows of setting up and of the machine, and causes that are not seen at all.
pub(super) struct Rows {
    pub setting_up: Vec<Row>,
    pub machine: Vec<Row>,
    pub unseen: Vec<Alias>,
    /// y of the header, mm.
    pub deviations_mm: DVector<f64>,
}

/// A row's place in the fit and its trace.
struct Part {
    key: RowKey,
    columns: Vec<usize>,
    trace_mm: DVector<f64>,
}

/// The rows of a fit; `covariance` of its parameters, with the errors of the instruments.
pub(super) fn rows(input: &Input, scene: &Scene, found: &Found, covariance: &DMatrix<f64>) -> Rows {
    let fit = &found.fit;
    let parts = parts(scene, fit);
    let observed = scene.rows().map(|(_, point)| point.observed_mm);
    let mut deviations_mm = DVector::from_iterator(scene.n_rows, observed);
    for part in parts.iter().filter(|part| part.key.is_setting_up()) {
        deviations_mm -= &part.trace_mm;
    }
    let mut made: Vec<Row> = parts
        .iter()
        .map(|part| row(input, scene, (found, covariance), part, &deviations_mm))
        .collect();
    let is_machine = |row: &&Row| !row.key.is_setting_up();
    let spans: f64 = made
        .iter()
        .filter(is_machine)
        .map(|row| row.peak_to_peak_mm)
        .sum();
    for row in &mut made {
        row.share_percent = if spans > 0.0 {
            100.0 * row.peak_to_peak_mm / spans
        } else {
            0.0
        };
    }
    let (setting_up, mut machine): (Vec<Row>, Vec<Row>) =
        made.into_iter().partition(|row| row.key.is_setting_up());
    machine.sort_by(|a, b| b.peak_to_peak_mm.total_cmp(&a.peak_to_peak_mm));
    let unseen = fit
        .reduction
        .unseen
        .iter()
        .map(|column| alias(input, scene, &fit.terms[*column], 0.0));
    Rows {
        unseen: unseen.collect(),
        setting_up,
        machine,
        deviations_mm,
    }
}

/// Kept columns by row, in order.
fn parts(scene: &Scene, fit: &Fit) -> Vec<Part> {
    let mut parts: Vec<(RowKey, Vec<usize>)> = Vec::new();
    for (at, column) in fit.reduction.kept.iter().enumerate() {
        let key = fit.terms[*column].row(scene);
        match parts.iter_mut().find(|(other, _)| *other == key) {
            Some((_, columns)) => columns.push(at),
            None => parts.push((key, vec![at])),
        }
    }
    let part = |(key, columns): (RowKey, Vec<usize>)| {
        let trace_mm = fit.contribution(&columns);
        Part {
            key,
            columns,
            trace_mm,
        }
    };
    parts.into_iter().map(part).collect()
}

fn row(
    input: &Input,
    scene: &Scene,
    (found, covariance): (&Found, &DMatrix<f64>),
    part: &Part,
    deviations_mm: &DVector<f64>,
) -> Row {
    let fit = &found.fit;
    let (_, of_fit, _) = value(scene, (found, &fit.covariance), part);
    let (value, standard_uncertainty, details) = value(scene, (found, covariance), part);
    let aliases = aliases(input, scene, fit, part);
    let (square, chance) = wald(fit, &part.columns);
    let dot = |a: &DVector<f64>, b: &DVector<f64>| {
        let products = a
            .iter()
            .zip(b)
            .zip(&fit.weights)
            .map(|((a, b), w)| w * a * b);
        products.sum::<f64>()
    };
    let total = dot(deviations_mm, deviations_mm).max(f64::MIN_POSITIVE);
    let without = if part.key.is_setting_up() {
        deviations_mm.clone()
    } else {
        deviations_mm - &part.trace_mm
    };
    let circularity_without_mm: Vec<f64> = scene
        .traces
        .iter()
        .map(|trace| circularity_mm(trace, &without, &fit.weights))
        .collect();
    Row {
        key: part.key,
        name: cause::name_with(&cause::name(&part.key, scene), &aliases),
        value,
        standard_uncertainty,
        standard_uncertainty_of_fit: of_fit,
        unit: cause::unit(&part.key),
        details,
        cause: causes(&part.key, value, &aliases, scene),
        aliases,
        chance,
        peak_to_peak_mm: span_mm(scene, &part.trace_mm),
        share_percent: 0.0,
        variance_share_percent: 100.0 * dot(&part.trace_mm, deviations_mm) / total,
        incremental_percent: 100.0 * square / total,
        worst_circularity_without_mm: circularity_without_mm.iter().copied().fold(0.0, f64::max),
        circularity_without_mm,
    }
}

fn causes(key: &RowKey, value: f64, aliases: &[Alias], scene: &Scene) -> String {
    let own = cause::cause(key, value, scene);
    aliases.iter().fold(own, |all, alias| {
        format!(
            "{all}; or {}",
            cause::cause(&alias.key, value * alias.coefficient, scene)
        )
    })
}

/// Value, standard uncertainty and what belongs to them.
fn value(
    scene: &Scene,
    (found, covariance): (&Found, &DMatrix<f64>),
    part: &Part,
) -> (f64, f64, Vec<Detail>) {
    let fit = &found.fit;
    let searched = nonlinear_uncertainty(&found.chosen, scene, part.key);
    let single = |at: usize| (fit.parameters[at], covariance[(at, at)].max(0.0).sqrt());
    match (part.columns.as_slice(), part.key) {
        ([sine, cosine], RowKey::Cyclic { .. }) => {
            let (a, u, phase, u_phase) = amplitude(fit, covariance, *sine, *cosine);
            let phase = detail("phase at axis position 0", phase, Some(u_phase), Unit::Rad);
            (a, u, vec![phase])
        }
        (
            columns,
            RowKey::Vibration { .. } | RowKey::Lobes { .. } | RowKey::VibrationOrLobes { .. },
        ) => {
            let pairs = columns
                .chunks_exact(2)
                .map(|pair| amplitude(fit, covariance, pair[0], pair[1]));
            let greatest = pairs.max_by(|a, b| a.0.total_cmp(&b.0));
            let (a, u, ..) = greatest.unwrap_or((0.0, f64::INFINITY, 0.0, 0.0));
            (a, u, tone_details(part.key, searched))
        }
        ([at], RowKey::ReversalSpike { .. }) => {
            let (a, u) = single(*at);
            let (rise, decay_s) = match fit.terms[fit.reduction.kept[*at]] {
                Term::Spike { rise, decay_s, .. } => (f64::from(rise), decay_s),
                _ => (f64::NAN, f64::NAN),
            };
            let to_peak = detail("time to the peak", rise * decay_s, None, Unit::S);
            (
                a,
                u,
                vec![detail("decay time", decay_s, searched, Unit::S), to_peak],
            )
        }
        (columns, _) => {
            let (value, u) = columns
                .first()
                .map_or((0.0, f64::INFINITY), |at| single(*at));
            (value, u, Vec::new())
        }
    }
}

fn tone_details(key: RowKey, searched: Option<f64>) -> Vec<Detail> {
    match key {
        RowKey::Vibration { hz, .. } => vec![detail("frequency", hz, searched, Unit::Hz)],
        RowKey::Lobes { per_turn, .. } => vec![detail("lobes", per_turn, None, Unit::LobesPerTurn)],
        RowKey::VibrationOrLobes { hz, per_turn, .. } => vec![
            detail("frequency, if vibration", hz, searched, Unit::Hz),
            detail("lobes, if in place", per_turn, None, Unit::LobesPerTurn),
        ],
        _ => Vec::new(),
    }
}

fn detail(name: &str, value: f64, standard_uncertainty: Option<f64>, unit: Unit) -> Detail {
    Detail {
        name: name.to_owned(),
        value,
        standard_uncertainty,
        unit,
    }
}

/// Amplitude with (6), phase of a sin(· + ψ) and its uncertainty.
fn amplitude(
    fit: &Fit,
    covariance: &DMatrix<f64>,
    sine: usize,
    cosine: usize,
) -> (f64, f64, f64, f64) {
    let (p, q) = (fit.parameters[sine], fit.parameters[cosine]);
    let c = |i: usize, j: usize| covariance[(i, j)];
    let a = p.hypot(q);
    let along = p * p * c(sine, sine) + 2.0 * p * q * c(sine, cosine) + q * q * c(cosine, cosine);
    let across = q * q * c(sine, sine) - 2.0 * p * q * c(sine, cosine) + p * p * c(cosine, cosine);
    (
        a,
        along.max(0.0).sqrt() / a,
        q.atan2(p),
        across.max(0.0).sqrt() / (a * a),
    )
}

/// Causes that depend on the part's column.
fn aliases(input: &Input, scene: &Scene, fit: &Fit, part: &Part) -> Vec<Alias> {
    let own: Vec<usize> = part
        .columns
        .iter()
        .map(|at| fit.reduction.kept[*at])
        .collect();
    let shares = fit.reduction.dependent.iter().flat_map(|dependent| {
        let of_own = dependent
            .aliases
            .iter()
            .filter(|(kept, _)| own.contains(kept));
        of_own.map(|(_, share)| (dependent.column, *share))
    });
    shares
        .map(|(column, share)| alias(input, scene, &fit.terms[column], share))
        .collect()
}

fn alias(input: &Input, scene: &Scene, term: &Term, coefficient: f64) -> Alias {
    let key = term.row(scene);
    Alias {
        key,
        name: cause::name(&key, scene),
        coefficient,
        unit: cause::unit(&key),
        needed: distinguish::needed(input, key),
    }
}

/// (1)
fn span_mm(scene: &Scene, trace_mm: &DVector<f64>) -> f64 {
    let of = |trace: &Trace| {
        let values = trace.rows().map(|row| trace_mm[row]);
        let (low, high) = values.fold((0.0_f64, 0.0_f64), |(low, high), x| {
            (low.min(x), high.max(x))
        });
        high - low
    };
    scene.traces.iter().map(of).fold(0.0, f64::max)
}

/// (5): greatest minus least deviation of one turn about its least-squares centre, mm.
///
/// `deviations_mm` are small and nearly centred, so the circle is linear in its centre.
pub(super) fn circularity_mm(trace: &Trace, deviations_mm: &DVector<f64>, weights: &[f64]) -> f64 {
    let turn = one_turn(trace, weights);
    let mut normal = nalgebra::Matrix3::<f64>::zeros();
    let mut right = nalgebra::Vector3::zeros();
    let basis = |row: usize| {
        let [cos, sin] = trace.points[row - trace.first_row].direction;
        nalgebra::Vector3::new(1.0, cos, sin)
    };
    for &row in &turn {
        let b = basis(row);
        normal += b * b.transpose();
        right += b * deviations_mm[row];
    }
    let circle = normal
        .lu()
        .solve(&right)
        .unwrap_or_else(nalgebra::Vector3::zeros);
    let centred = turn
        .iter()
        .map(|row| deviations_mm[*row] - basis(*row).dot(&circle));
    let (low, high) = centred.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
        (l.min(x), h.max(x))
    });
    (high - low).max(0.0)
}

/// Used rows of the middle turn; what was driven beyond it is left out.
pub(super) fn one_turn(trace: &Trace, weights: &[f64]) -> Vec<usize> {
    let angle = |point: Option<&super::scene::Point>| point.map_or(0.0, |p| p.angle_rad);
    let middle = 0.5 * (angle(trace.points.first()) + angle(trace.points.last()));
    let inside = |row: &usize| {
        let away = (trace.points[row - trace.first_row].angle_rad - middle).abs();
        away <= std::f64::consts::PI + 1e-9 && weights[*row] > 0.0
    };
    trace.rows().filter(inside).collect()
}
