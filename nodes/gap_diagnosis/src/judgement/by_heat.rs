//! Shifts with a temperature that read like a named effect of time or heat.
//!
//! # Model
//!
//! With f the signature of what is named and U unit columns of the shift with one thermometer along X, Y and Z at one lag,
//!
//! ```text
//!   |f - U U'f| < 3                                                       (1)
//! ```
//!
//! lists that shift with it. An effect that follows a thermometer of its own which was read is known by that.
//!
//! # Holds when
//! The recording is no log: of these `other_thermometer` lists what predicts as well.

use nalgebra::DVector;
use twin::effects::{self, Kind, Role, Target};

use crate::config::GapConfig;
use crate::judgement::by_thermometer::{SHIFT, drivers_of};
use crate::judgement::cause::Member;
use crate::judgement::unresolved;
use crate::judgement::veto::SAME_SIGNATURE;
use crate::noise::stack::Stack;
use crate::report::Status;
use crate::search::nuisance::orthonormal;
use crate::search::signature::{Library, shapes};
use crate::session::log;

/// Effects that go with time or heat and have one place that is read.
const SLOW: [&str; 5] = [
    "ambient_drift",
    "column_bend",
    "screw_elongation",
    "spindle_growth",
    "workpiece_expansion",
];

/// Lists the shifts with other thermometers that read like what is named.
pub(crate) fn list(
    stack: &Stack<'_>,
    signatures: &Library,
    members: &mut [Member],
    config: &GapConfig,
) {
    let is_left_out = config.left_out.iter().any(|id| id == SHIFT);
    let read = &stack.session.history.temperature_degc;
    let Some(kind) = effects::kind(SHIFT).filter(|_| !is_left_out && !log::is_of_logs(stack))
    else {
        return;
    };
    for member in members {
        let own = &signatures.instances[signatures.forms[member.form].instance];
        if !SLOW.contains(&own.kind.id) || member.status() == Status::Surrogate {
            continue;
        }
        let found = stack.signature(&*own.effect(&member.estimate.values));
        if !drivers_of(stack, own.kind.id, &own.target).is_empty() {
            continue;
        }
        for id in read.keys() {
            if let Some(cos) = cosine(stack, &found, kind, id) {
                unresolved::list(member, SHIFT, id, cos);
            }
        }
    }
}

/// Cosine of what was found and the shift with a thermometer at the lag that does best, where (1) holds.
fn cosine(stack: &Stack<'_>, found: &DVector<f64>, kind: &Kind, id: &str) -> Option<f64> {
    let column = |values: &[f64], place: usize, typical: f64| {
        let mut on = values.to_vec();
        on[place] = typical;
        stack.signature(&*(kind.build)(Target::Thermometer(id.to_owned()), &on))
    };
    let left = |values: Vec<f64>| {
        let parameters = kind.parameters.iter().enumerate();
        let sizes = parameters.filter(|(_, own)| own.role == Role::Amplitude);
        let columns = sizes.map(|(place, own)| column(&values, place, own.typical));
        let columns = orthonormal(found.len(), columns);
        (found - &columns * columns.tr_mul(found)).norm()
    };
    let least = shapes(kind)
        .into_iter()
        .map(left)
        .fold(f64::INFINITY, f64::min);
    let share = least / found.norm().max(f64::MIN_POSITIVE);
    (least < SAME_SIGNATURE).then(|| (1.0 - share * share).max(0.0).sqrt())
}
