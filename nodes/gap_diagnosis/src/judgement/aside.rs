//! Effects that an error at the measured point explains as well.
//!
//! # Model
//!
//! Where an axis was read at targets alone (`resolved::is_coarse`), positioning is the error at the point that is read. What
//! an arm makes of an angle, or a bow of a guide, is a sum of such errors where all readings have one arm: its columns J_g lie
//! in the span of those of scale and pitch, H, up to
//!
//! ```text
//!   |J_g - H (H'H)^-1 H'J_g| high / typical < D of what is seen at all      (1)
//! ```
//!
//! or up to a ten-thousandth of its square. Even at its greatest size it could not be separated from them. It is set aside:
//! the direct error is found, and the effect that was set aside is listed with it as a possible alternative. A sum of two
//! errors would otherwise lose to an angle that has one name.

use std::collections::BTreeMap;

use metrology::Axis;
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
/// Cosine from which an effect that was set aside is listed with a direct error.
const MIN_COSINE_LISTED: f64 = 0.9;

/// The instances that are set aside, each with the direct ones that explain it.
pub fn set_aside(
    stack: &Stack<'_>,
    signatures: &Library,
    normal: &Normal,
) -> BTreeMap<usize, Vec<usize>> {
    let direct: Vec<usize> = (0..signatures.forms.len())
        .filter(|form| is_direct(stack, signatures, *form))
        .collect();
    if direct.is_empty() {
        return BTreeMap::new();
    }
    let columns: Vec<usize> = direct
        .iter()
        .flat_map(|form| signatures.forms[*form].columns.clone())
        .collect();
    let mut aside = BTreeMap::new();
    for instance in 0..signatures.instances.len() {
        let own = |form: &usize| signatures.forms[*form].instance == instance;
        let forms: Vec<usize> = (0..signatures.forms.len()).filter(own).collect();
        let is_by_an_arm = BY_AN_ARM.contains(&signatures.instances[instance].kind.id);
        let Some(&first) = forms.first().filter(|_| is_by_an_arm) else {
            continue;
        };
        let is_explained = |form: &usize| is_explained(signatures, normal, &columns, *form);
        // An effect that one direct error explains in its plain form competes with it as an equal.
        let needs_more = |form: &usize| {
            let mut plain = direct.iter().filter(|one| !signatures.forms[**one].wide);
            let tells = |one: &usize| {
                let by = &signatures.forms[*one].columns;
                self::is_explained(signatures, normal, by, *form)
            };
            !plain.any(tells)
        };
        if forms.iter().all(is_explained) && forms.iter().any(needs_more) {
            let alike = |one: &&usize| {
                isolability::cos(signatures, normal, first, **one) > MIN_COSINE_LISTED
            };
            let by = direct.iter().filter(alike);
            aside.insert(
                instance,
                by.map(|one| signatures.forms[*one].instance).collect(),
            );
        }
    }
    aside
}

fn is_direct(stack: &Stack<'_>, signatures: &Library, form: usize) -> bool {
    let instance = &signatures.instances[signatures.forms[form].instance];
    let is_coarse = |axis: Axis| resolved::is_coarse(stack, axis);
    let own = instance.target.clone();
    DIRECT.contains(&instance.kind.id) && matches!(own, Target::Axis(axis) if is_coarse(axis))
}

/// (1).
fn is_explained(signatures: &Library, normal: &Normal, by: &[usize], form: usize) -> bool {
    let entry = &signatures.forms[form];
    let kind = signatures.instances[entry.instance].kind;
    let all: Vec<&Parameter> = kind.parameters.iter().chain(kind.free).collect();
    let mut columns = entry.columns.iter().zip(&entry.amplitudes);
    columns.all(|(column, place)| {
        let Some(parameter) = all.get(*place) else {
            return false;
        };
        let square = normal.gram[(*column, *column)];
        let left = square - normal.explained_square(*column, by);
        let most = parameter.low.abs().max(parameter.high.abs()) / parameter.typical;
        left < ROUNDING_SHARE * square || left.max(0.0).sqrt() * most < MIN_D_EXCITED
    })
}
