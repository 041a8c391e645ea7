//! Effects that an error at the measured point explains as well.
//!
//! # Model
//!
//! Where nothing but positions along axes was read, positioning is the error at the point that is read. What
//! an arm makes of an angle, or a bow of a guide, is a sum of such errors where all readings have one arm: its columns J_g lie
//! in the span of those of scale and pitch, H, up to
//!
//! ```text
//!   |J_g - H (H'H)^-1 H'J_g| high / typical < D of what is seen at all      (1)
//! ```
//!
//! or up to a ten-thousandth of its square. Even at its greatest size it could not be separated from them. It is set aside:
//! the direct error is found, and the effect that was set aside is listed with it as a possible alternative. A sum of two
//! errors would otherwise lose to an angle that has one name. An angle that one direct error explains in its plain form competes with
//! it; where it loses to a curve of that error it is listed all the same.
//!
//! A pitch error has any form. Where one channel was read along an axis, H is therefore every function of the target: a column for
//! each, which is one at the readings of that target. What differs between lines, directions or times is in none of them.

use std::collections::BTreeMap;

use metrology::Axis;
use nalgebra::{DMatrix, DVector};
use twin::Channel;
use twin::effects::{Parameter, Target};

use crate::noise::normal::Normal;
use crate::noise::stack::Stack;
use crate::search::isolability;
use crate::search::resolved;
use crate::search::signature::{Library, MIN_D_EXCITED};

/// Errors at the point that is read.
const DIRECT: [&str; 2] = ["scale_error", "pitch_error"];
/// What an arm makes of an angle.
const BY_AN_ARM: [&str; 2] = ["angular_error", "guide_bow"];
/// Share of the square of a column that rounding and the second order leave.
const ROUNDING_SHARE: f64 = 1e-4;
/// Most targets of which each has a column.
const MOST_TARGETS: usize = 200;
/// A column of which less is left is a sum of those before.
const LEAST_NORM_SHARE: f64 = 1e-6;
/// Cosine from which an effect that was set aside is listed with a direct error.
const MIN_COSINE_LISTED: f64 = 0.9;

/// The instances that are set aside, and those that compete as equals, each with the direct ones that explain it.
pub fn set_aside(
    stack: &Stack<'_>,
    signatures: &Library,
    normal: &Normal,
) -> [BTreeMap<usize, Vec<usize>>; 2] {
    let nothing = || [BTreeMap::new(), BTreeMap::new()];
    if !resolved::is_along_axes(stack) {
        return nothing();
    }
    let direct: Vec<usize> = (0..signatures.forms.len())
        .filter(|form| is_direct(signatures, *form))
        .collect();
    if direct.is_empty() {
        return nothing();
    }
    let any_form = any_form(stack);
    let columns: Vec<usize> = direct
        .iter()
        .flat_map(|form| signatures.forms[*form].columns.clone())
        .collect();
    let [mut aside, mut shared] = nothing();
    for instance in 0..signatures.instances.len() {
        let own = |form: &usize| signatures.forms[*form].instance == instance;
        let forms: Vec<usize> = (0..signatures.forms.len()).filter(own).collect();
        let is_by_an_arm = BY_AN_ARM.contains(&signatures.instances[instance].kind.id);
        let Some(&first) = forms.first().filter(|_| is_by_an_arm) else {
            continue;
        };
        let left = |column: usize| match &any_form {
            Some(form) => left_of_any_form(form, &signatures.columns[column]),
            None => left_of(normal, &columns, column),
        };
        let is_explained = |form: &usize| is_explained(signatures, normal, *form, left);
        // An effect that one direct error explains in its plain form competes with it as an equal.
        let needs_more = |form: &usize| {
            let mut plain = direct.iter().filter(|one| !signatures.forms[**one].wide);
            let tells = |one: &usize| {
                let by = &signatures.forms[*one].columns;
                self::is_explained(signatures, normal, *form, |column| {
                    left_of(normal, by, column)
                })
            };
            !plain.any(tells)
        };
        if forms.iter().all(is_explained) {
            let alike = |one: &&usize| {
                isolability::cos(signatures, normal, first, **one) > MIN_COSINE_LISTED
            };
            let by = direct.iter().filter(alike);
            let by: Vec<usize> = by.map(|one| signatures.forms[*one].instance).collect();
            let is_aside = forms.iter().any(needs_more);
            let found = if is_aside { &mut aside } else { &mut shared };
            found.insert(instance, by);
        }
    }
    aside.extend(wavelengths(stack, signatures));
    [aside, shared]
}

/// The error of a laser's wavelength, which is a scale of the axis where it reads one alone, whatever the noise: the instances of
/// it, with those of that scale.
fn wavelengths(stack: &Stack<'_>, signatures: &Library) -> BTreeMap<usize, Vec<usize>> {
    let mut channels = stack.rows.blocks.iter().map(|block| &block.channel);
    let Some(Channel::Length(axis)) = channels.next() else {
        return BTreeMap::new();
    };
    if channels.any(|channel| *channel != Channel::Length(*axis)) {
        return BTreeMap::new();
    }
    let of = |id: &'static str| {
        let all = signatures.instances.iter().enumerate();
        all.filter(move |(_, instance)| instance.kind.id == id)
    };
    let scales: Vec<usize> = of("scale_error")
        .filter(|(_, instance)| matches!(instance.target, Target::Axis(own) if own == *axis))
        .map(|(place, _)| place)
        .collect();
    if scales.is_empty() {
        return BTreeMap::new();
    }
    of("length_wavelength")
        .map(|(place, _)| (place, scales.clone()))
        .collect()
}

fn is_direct(signatures: &Library, form: usize) -> bool {
    let instance = &signatures.instances[signatures.forms[form].instance];
    DIRECT.contains(&instance.kind.id) && matches!(instance.target, Target::Axis(_))
}

/// (1), with what is left of the square of a column.
fn is_explained(
    signatures: &Library,
    normal: &Normal,
    form: usize,
    left: impl Fn(usize) -> f64,
) -> bool {
    let entry = &signatures.forms[form];
    let kind = signatures.instances[entry.instance].kind;
    let all: Vec<&Parameter> = kind.parameters.iter().chain(kind.free).collect();
    let mut columns = entry.columns.iter().zip(&entry.amplitudes);
    columns.all(|(column, place)| {
        let Some(parameter) = all.get(*place) else {
            return false;
        };
        let square = normal.gram[(*column, *column)];
        let left = left(*column);
        let most = parameter.low.abs().max(parameter.high.abs()) / parameter.typical;
        left < ROUNDING_SHARE * square || left.max(0.0).sqrt() * most < MIN_D_EXCITED
    })
}

/// What other columns leave of the square of a column.
fn left_of(normal: &Normal, by: &[usize], column: usize) -> f64 {
    normal.gram[(column, column)] - normal.explained_square(column, by)
}

/// What every function of the target leaves of the square of a column.
fn left_of_any_form(form: &DMatrix<f64>, column: &DVector<f64>) -> f64 {
    column.norm_squared() - form.tr_mul(column).norm_squared()
}

/// Unit columns that span every function of the target along the one axis that was read, whitened; none of a recording of several
/// axes or channels.
fn any_form(stack: &Stack<'_>) -> Option<DMatrix<f64>> {
    let mut axes = Axis::LINEAR.into_iter();
    let axis = axes.find(|axis| resolved::is_at_targets(stack, *axis))?;
    let channel = &stack.rows.blocks.first()?.channel;
    if stack
        .rows
        .blocks
        .iter()
        .any(|block| block.channel != *channel)
    {
        return None;
    }
    let targets = resolved::targets(stack, axis)?;
    if targets.len() > MOST_TARGETS {
        return None;
    }
    let columns: Vec<DVector<f64>> = { targets.iter() }
        .map(|rows| {
            let mut column = vec![0.0; stack.rows.len];
            for row in rows {
                column[*row] = 1.0;
            }
            stack.whitened(column)
        })
        .collect();
    Some(unit_span(&columns))
}

/// Unit columns of the span of some columns.
fn unit_span(columns: &[DVector<f64>]) -> DMatrix<f64> {
    let mut units: Vec<DVector<f64>> = vec![];
    for column in columns {
        let mut rest = column.clone();
        // Twice, for the rounding of the first time.
        for _ in 0..2 {
            for unit in &units {
                rest -= unit * unit.dot(&rest);
            }
        }
        let norm = rest.norm();
        if norm > LEAST_NORM_SHARE * column.norm() && norm > 0.0 {
            units.push(rest / norm);
        }
    }
    if units.is_empty() {
        return DMatrix::zeros(columns.first().map_or(0, DVector::len), 0);
    }
    DMatrix::from_columns(&units)
}
