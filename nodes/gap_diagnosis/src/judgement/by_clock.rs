//! Whether an effect that goes with the clock alone could as well be heat.
//!
//! A tip that wanders evenly in time and one that goes with a body that warms look alike for hours. Where thermometers were
//! read, the shift with the temperature of each, with and without lags, is put in the place of the slow drift, all other
//! members refitted beside it:
//!
//! ```text
//!   gain(drift) - max gain(shift) >= 0,   |shift| <= 50 um/K               (1)
//! ```
//!
//! Where (1) does not hold the drift is shown with that reason and not named. In other recordings than logs the shifts with the
//! thermometers that do best in its place are then searched as well.
//!
//! Where no thermometer was read (for a growth: none at the spindle), a growth or a coolant's step is known by its course in time alone,
//! and the drift is listed with it.

use std::collections::{BTreeMap, BTreeSet};

use metrology::Axis;
use nalgebra::DVector;
use twin::Channel;
use twin::effects::{self, Kind, Target};

use crate::judgement::by_thermometer::{self, SHIFT};
use crate::judgement::cause::{Best, Found, Member, Scope};
use crate::judgement::{Check, CheckId, Verdict, unresolved};
use crate::noise::stack::Stack;
use crate::report::Status;
use crate::search::nuisance::orthonormal;
use crate::search::signature::{Instance, Library};
use crate::session::log;

/// The effect that has no other cause than time.
pub(crate) const BY_CLOCK: &str = "ambient_drift";
/// What warms or cools the machine, known by a thermometer or by its course in time.
const HEAT: [&str; 2] = [GROWTH, "coolant"];
const GROWTH: &str = "spindle_growth";
/// Lags of a body behind the thermometer, min.
const LAGS_MIN: [f64; 5] = [0.05, 8.0, 25.0, 80.0, 240.0];
/// The largest shift of a tip that a machine has, µm/K.
const MOST_UM_PER_K: f64 = 50.0;
/// What a drift may lose to be listed with the shift in its place: odds of one in twenty.
const MOST_LOST: f64 = 6.0;
/// Share of the best gain from which a thermometer is tried beside the best.
const NEAR_THE_BEST: f64 = 0.8;

/// (1) of the member at `place`; `others` are the derivatives of the other members. None where nothing is asked.
pub(crate) fn check(
    scope: &Scope<'_, '_>,
    signatures: &Library,
    best: &Best,
    place: usize,
    others: &[DVector<f64>],
) -> Option<Check> {
    let stack = scope.stack;
    let instance = &signatures.instances[signatures.forms[best.set[place]].instance];
    let Target::Axis(axis) = instance.target else {
        return None;
    };
    let read = &stack.session.history.temperature_degc;
    let kind = effects::kind(SHIFT).filter(|_| instance.kind.id == BY_CLOCK)?;
    if read.is_empty() {
        return None;
    }
    let part = &best.refit.parts[place];
    let basis = orthonormal(part.len(), others.iter().cloned());
    let beside = |column: &DVector<f64>| column - &basis * basis.tr_mul(column);
    let rest = beside(&(&best.left + part));
    let own = rest.norm_squared() - beside(&best.left).norm_squared();
    let gains = read
        .keys()
        .map(|id| best_gain(stack, (kind, id, axis), &rest, beside));
    let lost = own - gains.fold(0.0, f64::max);
    Some(Check::new(CheckId::BeatsHeat, lost >= 0.0).with(lost, 0.0))
}

/// What the shift with one thermometer explains of a rest, with the lag that does best.
fn best_gain(
    stack: &Stack<'_>,
    (kind, id, axis): (&Kind, &str, Axis),
    rest: &DVector<f64>,
    beside: impl Fn(&DVector<f64>) -> DVector<f64>,
) -> f64 {
    let shifts = LAGS_MIN.map(|lag_min| {
        let mut values = vec![0.0; kind.parameters.len()];
        values[axis.index()] = 1.0;
        if let Some(lag) = values.last_mut() {
            *lag = lag_min;
        }
        (kind.build)(Target::Thermometer(id.to_owned()), &values)
    });
    let gains = shifts.iter();
    let gains = gains.filter_map(|effect| gain(rest, &beside(&stack.signature(&**effect))));
    gains.fold(0.0, f64::max)
}

/// Shifts with temperatures that are searched in the place of slow drifts, and the directions of these.
#[derive(Default)]
pub(crate) struct InPlace {
    /// One for each thermometer.
    pub(crate) instances: Vec<Instance>,
    /// By the axis of a drift what it loses (1).
    lost: BTreeMap<usize, f64>,
}

/// Shifts with the thermometers that do best in the place of the slow drifts which fail (1), for recordings that are no logs.
pub(crate) fn in_place(scope: &Scope<'_, '_>, found: &Found) -> InPlace {
    let stack = scope.stack;
    let is_left_out = scope.config.left_out.iter().any(|id| id == SHIFT);
    let is_asked = !is_left_out && !log::is_of_logs(stack);
    let Some(kind) = effects::kind(SHIFT).filter(|_| is_asked) else {
        return InPlace::default();
    };
    let fails =
        |check: &Check| check.check == CheckId::BeatsHeat && check.verdict == Verdict::Failed;
    let (mut ids, mut lost) = (BTreeSet::<&String>::new(), BTreeMap::new());
    for member in &found.members {
        let own = found.instance(member);
        let failed = member.checks.iter().find(|check| fails(check));
        let (Some(failed), Target::Axis(axis)) = (failed, &own.target) else {
            continue;
        };
        let part = stack.signature(&*own.effect(&member.estimate.values));
        let rest = &found.left + part;
        let read = stack.session.history.temperature_degc.keys();
        let gains = read.map(|id| {
            let gain = best_gain(stack, (kind, id, *axis), &rest, DVector::clone);
            (gain, id)
        });
        let gains: Vec<(f64, &String)> = gains.collect();
        let most = gains.iter().map(|own| own.0).fold(0.0, f64::max);
        let near = gains.iter().filter(|own| own.0 >= NEAR_THE_BEST * most);
        ids.extend(near.map(|own| own.1));
        lost.insert(axis.index(), failed.value.unwrap_or(0.0));
    }
    let of = |id: &String| Instance {
        kind,
        target: Target::Thermometer(id.clone()),
        begins: None,
    };
    InPlace {
        instances: ids.into_iter().map(of).collect(),
        lost,
    }
}

impl InPlace {
    /// Whether an effect is a slow drift in whose place they are.
    pub(crate) fn replaces(&self, instance: &Instance) -> bool {
        let is_own = |axis: &Axis| self.lost.contains_key(&axis.index());
        instance.kind.id == BY_CLOCK
            && matches!(&instance.target, Target::Axis(axis) if is_own(axis))
    }

    /// Lists a drift that loses little with the shift that is named in its place.
    pub(crate) fn list_drift(&self, found: &mut Found) {
        let signatures = &found.signatures;
        for member in &mut found.members {
            let own = &signatures.forms[member.form];
            let is_shift = signatures.instances[own.instance].kind.id == SHIFT;
            if !is_shift || member.status() == Status::Surrogate {
                continue;
            }
            let is_near = |axis: &Axis| {
                let lost = self.lost.get(&axis.index());
                own.amplitudes.contains(&axis.index())
                    && lost.is_some_and(|lost| *lost > -MOST_LOST)
            };
            for axis in Axis::LINEAR.into_iter().filter(is_near) {
                unresolved::list(member, BY_CLOCK, &axis.to_string(), 1.0);
            }
        }
    }

    /// Leaves of the forms of these shifts those along one of the directions: another direction is another effect's.
    pub(crate) fn keep_own(&self, signatures: &mut Library) {
        if self.instances.is_empty() {
            return;
        }
        let is_shift = |signatures: &Library, form: usize| {
            let instance = &signatures.instances[signatures.forms[form].instance];
            instance.kind.id == SHIFT
        };
        let wholes = signatures.forms.len();
        for form in (0..wholes)
            .filter(|form| is_shift(signatures, *form))
            .collect::<Vec<_>>()
        {
            let sizes = signatures.forms[form].amplitudes.clone();
            for own in (0..sizes.len()).filter(|own| self.lost.contains_key(&sizes[*own])) {
                signatures.add_part(form, &[own]);
            }
        }
        let kept: Vec<bool> = (0..signatures.forms.len())
            .map(|form| form >= wholes || !is_shift(signatures, form))
            .collect();
        let mut kept = kept.into_iter();
        signatures.forms.retain(|_| kept.next().unwrap_or(true));
    }
}

/// Lists the slow drift with what warms the machine, where none of its thermometers was read and one axis.
pub(crate) fn list_drift(stack: &Stack<'_>, signatures: &Library, members: &mut [Member]) {
    let axes: BTreeSet<Axis> = { stack.rows.blocks.iter() }
        .filter_map(|block| match block.channel {
            Channel::Length(axis) => Some(axis),
            _ => None,
        })
        .collect();
    let sole = axes.first().copied().filter(|_| axes.len() == 1);
    for member in members {
        let instance = &signatures.instances[signatures.forms[member.form].instance];
        let (id, target) = (instance.kind.id, &instance.target);
        let has_none = stack.session.history.temperature_degc.is_empty()
            || id == GROWTH && by_thermometer::drivers_of(stack, id, target).is_empty();
        let is_heat = HEAT.contains(&id) && has_none;
        let axis = match instance.target {
            Target::Axis(axis) => Some(axis),
            _ => sole,
        };
        let Some(axis) = axis.filter(|_| is_heat && member.status() != Status::Surrogate) else {
            continue;
        };
        unresolved::list(member, BY_CLOCK, &axis.to_string(), 1.0);
    }
}

/// What a shift of so much for 1 µm/K explains, where its size is one that a machine has.
fn gain(rest: &DVector<f64>, column: &DVector<f64>) -> Option<f64> {
    let square = column.norm_squared();
    let size = rest.dot(column) / square;
    (size.abs() <= MOST_UM_PER_K).then_some(size * size * square)
}
