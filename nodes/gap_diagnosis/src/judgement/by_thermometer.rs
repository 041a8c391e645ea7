//! Whether an effect of the temperatures is driven by a thermometer that the log goes with.
//!
//! A log that goes with thermometers on runs left out (`thermal`) says which body moves the tip. An effect of another body, and an
//! event whose time nobody recorded, can follow the same curve for a while; neither is named then. Of the others a shift with the
//! temperature of that body is tried (`thermal_shift`): the spindle's are its own growth.
//!
//! A growth by time alone, or an event, fits a warm-up as well as the body does, and would stand in its place without being named.
//! Where nothing that follows a thermometer is named beside it, the search is made again without it. Both are listed as one set then.

use std::collections::BTreeSet;

use machine::file::SensorPlace;
use metrology::Axis;
use nalgebra::DVector;
use twin::effects::{self, Target};

use crate::judgement::cause::{Found, Member, Scope};
use crate::judgement::{Check, CheckId, unresolved};
use crate::noise::stack::Stack;
use crate::noise::unrepeated;
use crate::report::Status;
use crate::report::figures::Note;
use crate::search::rows::count;
use crate::search::signature::{Instance, Library};
use crate::session::log;

/// Effects and the places of the thermometers that drive them.
const DRIVEN: [(&str, &[SensorPlace]); 2] = [
    (
        "spindle_growth",
        &[SensorPlace::SpindleFront, SensorPlace::SpindleRear],
    ),
    (
        "column_bend",
        &[SensorPlace::Column, SensorPlace::Ambient, SensorPlace::Bed],
    ),
];
/// Effects that begin at an instant of their own.
const EVENTS: [&str; 2] = ["coolant", "homing_shift"];

/// Cosine from which an effect that no thermometer drives is listed with the one that was found in its place.
const MIN_COSINE_HIDDEN: f64 = 0.9;

/// The effect of one thermometer.
pub(crate) const SHIFT: &str = "thermal_shift";

/// Shifts with the thermometers that logs go with.
pub(crate) fn shifts(scope: &Scope<'_, '_>, thermometers: &[Note]) -> Vec<Instance> {
    let stack = scope.stack;
    let is_left_out = scope.config.left_out.iter().any(|id| id == SHIFT);
    let Some(kind) = effects::kind(SHIFT).filter(|_| !is_left_out && log::is_of_logs(stack)) else {
        return vec![];
    };
    let reads_z = |channel: &str| channel.ends_with('Z');
    let found = thermometers.iter().filter_map(|note| match note {
        Note::GoesWith { channel, found } => Some((channel, found)),
        _ => None,
    });
    let sensors = &stack.twin.machine().temperature_sensors;
    let is_spindle = |id: &str| {
        let own = sensors.iter().find(|sensor| sensor.id == id);
        own.is_some_and(|own| DRIVEN[0].1.contains(&own.place))
    };
    let bends = bends_by(stack);
    let bends = bends.as_deref();
    let ids = found.flat_map(|(channel, found)| {
        let kept = found.thermometers().cloned();
        // Along X the column's bend is in its wider form alone.
        let has_own = move |id: &str| match reads_z(channel) {
            true => is_spindle(id) || bends == Some(id),
            false => channel.ends_with('Y') && bends == Some(id),
        };
        kept.filter(move |id| !has_own(id))
    });
    let ids: BTreeSet<String> = ids.collect();
    let targets = ids.into_iter().map(Target::Thermometer);
    targets
        .map(|target| Instance {
            kind,
            target,
            begins: None,
        })
        .collect()
}

/// The thermometers that logs go with, those that predict hardly worse included.
pub(crate) fn goes_with(thermometers: &[Note]) -> impl Iterator<Item = &str> {
    let found = thermometers.iter().filter_map(|note| match note {
        Note::GoesWith { found, .. } => Some(found),
        _ => None,
    });
    found.flat_map(|found| found.thermometers().map(String::as_str))
}

/// Whether an effect is driven by none of the thermometers that the logs go with, so that it is not searched.
pub(crate) fn is_of_another(stack: &Stack<'_>, instance: &Instance, thermometers: &[Note]) -> bool {
    if !log::is_of_logs(stack) {
        return false;
    }
    let found: BTreeSet<&str> = goes_with(thermometers).collect();
    if found.is_empty() {
        return false;
    }
    let own = drivers_of(stack, instance.kind.id, &instance.target);
    let is_driven = DRIVEN.iter().any(|(driven, _)| *driven == instance.kind.id);
    is_driven && !own.is_empty() && own.iter().all(|id| !found.contains(id.as_str()))
}

/// Whether a log goes with thermometers of which none drives an effect: it would not be named.
pub(crate) fn is_driven_by_none(
    stack: &Stack<'_>,
    instance: &Instance,
    thermometers: &[Note],
) -> bool {
    drivers(stack, instance, thermometers) == Some(0)
}

/// An effect and its signature with the values that were found.
pub(crate) type Hiding = (&'static str, String, DVector<f64>);

/// The members that are not named since no thermometer that the log goes with drives them, where what follows one is not named
/// either: they may stand in its place.
pub(crate) fn hiding(stack: &Stack<'_>, found: &Found) -> Vec<Hiding> {
    if !log::is_of_logs(stack) || found.named().any(|member| follows(found, member)) {
        return vec![];
    }
    let hides =
        |member: &&Member| is_driven_by_none(stack, found.instance(member), &found.thermometers);
    let all = found.members.iter().filter(hides).map(|member| {
        let own = found.instance(member);
        let shown = stack.signature(&*own.effect(&member.estimate.values));
        (own.kind.id, own.target.to_string(), shown)
    });
    all.collect()
}

/// Lists what a search did without with the named members that follow thermometers in its place, where both show the same; whether
/// there are members that follow thermometers at all.
pub(crate) fn list_hiding(stack: &Stack<'_>, found: &mut Found, hiding: &[Hiding]) -> bool {
    let members = found.members.iter().enumerate();
    let following = members.filter(|(_, member)| follows(found, member));
    let (shown, named): (Vec<usize>, Vec<usize>) = following
        .map(|(place, _)| place)
        .partition(|place| found.members[*place].status() == Status::Surrogate);
    for place in &named {
        let values = &found.members[*place].estimate.values;
        let own = found.instance(&found.members[*place]).effect(values);
        let own = stack.signature(&*own);
        for (effect, target, hidden) in hiding {
            let cos = own.dot(hidden).abs() / (own.norm() * hidden.norm()).max(f64::MIN_POSITIVE);
            if cos >= MIN_COSINE_HIDDEN {
                unresolved::list(&mut found.members[*place], effect, target, cos);
            }
        }
    }
    !shown.is_empty() || !named.is_empty()
}

/// Whether a member follows a thermometer.
fn follows(found: &Found, member: &Member) -> bool {
    let id = found.instance(member).kind.id;
    id == SHIFT || DRIVEN.iter().any(|(driven, _)| *driven == id)
}

/// The thermometers that were read and that an effect follows, both of a pair.
pub(crate) fn drivers_of(stack: &Stack<'_>, id: &str, target: &Target) -> Vec<String> {
    let at = |place| first_at(stack, place);
    match (id, target) {
        (_, Target::Thermometer(id)) => vec![id.clone()],
        ("spindle_growth", _) => { at(SensorPlace::SpindleFront) }
            .or_else(|| at(SensorPlace::SpindleRear))
            .into_iter()
            .collect(),
        ("column_bend", _) => match [SensorPlace::Column, SensorPlace::Ambient].map(at) {
            [Some(column), Some(ambient)] => vec![column, ambient],
            _ => bends_by(stack).into_iter().collect(),
        },
        _ => vec![],
    }
}

/// The effect of the catalogue that follows a thermometer in logs along some axes, with its target.
pub(crate) fn effect_of(
    stack: &Stack<'_>,
    thermometer: &str,
    mut axes: impl Iterator<Item = Axis>,
) -> (&'static str, String) {
    let is_at = |place| first_at(stack, place).is_some_and(|id| id == thermometer);
    let reads_z = axes.any(|axis| axis == Axis::Z);
    let has_front = first_at(stack, SensorPlace::SpindleFront).is_some();
    let bends = bends_by(stack).is_some_and(|id| id == thermometer);
    if reads_z
        && (is_at(SensorPlace::SpindleFront) || !has_front && is_at(SensorPlace::SpindleRear))
    {
        (DRIVEN[0].0, String::new())
    } else if reads_z && is_at(SensorPlace::SpindleRear) {
        (DRIVEN[0].0, thermometer.to_owned())
    } else if reads_z && bends {
        (DRIVEN[1].0, String::new())
    } else {
        (SHIFT, thermometer.to_owned())
    }
}

/// The first thermometer at a place that was read.
fn first_at(stack: &Stack<'_>, place: SensorPlace) -> Option<String> {
    let read = &stack.session.history.temperature_degc;
    let sensors = stack.twin.machine().temperature_sensors.iter();
    let mut there = sensors.filter(|own| own.place == place && read.contains_key(&own.id));
    there.next().map(|own| own.id.clone())
}

/// The thermometer that alone drives the bend of the column, where it is no pair.
fn bends_by(stack: &Stack<'_>) -> Option<String> {
    let [column, ambient, bed] =
        [SensorPlace::Column, SensorPlace::Ambient, SensorPlace::Bed].map(|at| first_at(stack, at));
    match (column, ambient) {
        (Some(_), Some(_)) => None,
        (column, ambient) => column.or(ambient).or(bed),
    }
}

/// Adds the check to the members of a session of logs that go with thermometers. Of logs that nothing repeats an event is not named
/// beside thermometers either: a body that warms slowly looks like one.
pub(crate) fn check(
    scope: &Scope<'_, '_>,
    signatures: &Library,
    members: &mut [Member],
    thermometers: &[Note],
) {
    let stack = scope.stack;
    if !log::is_of_logs(stack) {
        return;
    }
    let has_temperatures = !stack.session.history.temperature_degc.is_empty();
    let is_open = has_temperatures && unrepeated::is_assumed(scope.noise);
    for member in members {
        let instance = &signatures.instances[signatures.forms[member.form].instance];
        let is_event = EVENTS.contains(&instance.kind.id);
        let by_none = (is_event && is_open).then_some(0);
        if let Some(drivers) = drivers(stack, instance, thermometers).or(by_none) {
            let check = Check::new(CheckId::OwnThermometer, drivers > 0);
            member.put(check.with(count(drivers), 1.0));
        }
    }
}

/// How many thermometers that the log goes with drive an effect; `None` where that is not asked of it.
fn drivers(stack: &Stack<'_>, instance: &Instance, thermometers: &[Note]) -> Option<usize> {
    let id = instance.kind.id;
    let driven = DRIVEN.iter().find(|(driven, _)| *driven == id);
    let places = match driven {
        Some((_, places)) => *places,
        None if EVENTS.contains(&id) => &[],
        None => return None,
    };
    let found = thermometers.iter().filter_map(|note| match note {
        Note::GoesWith { channel, found } => Some((channel, found)),
        _ => None,
    });
    let of_axis = |channel: &str| match instance.target {
        Target::Axis(axis) => channel.ends_with(axis.letter()),
        _ => true,
    };
    let mut seen = found.filter(|(channel, _)| of_axis(channel)).peekable();
    seen.peek()?;
    let sensors = &stack.twin.machine().temperature_sensors;
    let is_there = |name: &String| {
        let mut there = sensors.iter().filter(|sensor| sensor.id == *name);
        there.any(|sensor| places.contains(&sensor.place))
    };
    let by = seen.flat_map(|(_, found)| found.thermometers());
    Some(by.filter(|one| is_there(one)).count())
}
