//! Thermometers against each other: what one shows beyond another at the same place.
//!
//! A temperature has no nominal value, so a thermometer can only be compared. The first that the machine file has at
//! a place is taken for the temperature there:
//!
//! ```text
//!   d = reading - reading of the first thermometer at the place, linear in time between its samples   (1)
//! ```
//!
//! Where a place has one thermometer nothing is said of it.

use machine::MachineFile;
use machine::file::SensorEntry;
use metrology::sample::TemperatureSample;
use twin::Channel;

use super::channels::{Raw, Scope, Series};

/// Samples of the reference further apart than this many of its periods say nothing of the time between them.
const PERIODS: f64 = 3.0;

/// Deviations (1) of the thermometers that have another one at their place.
pub(super) fn compared(scope: &Scope<'_>) -> Vec<Series> {
    let pairs = scope.machine.temperature_sensors.iter();
    let pairs = pairs.filter_map(|sensor| Some((sensor, first_at(scope.machine, sensor)?)));
    pairs
        .map(|(sensor, first)| {
            let reference: Vec<&TemperatureSample> = of(scope, first).collect();
            let readings = of(scope, sensor).filter_map(|sample| {
                let there_degc = between(&reference, first, sample)?;
                Some(Raw {
                    place: scope.place(sample.at, false).ok()?,
                    deviation: sample.temperature_degc - there_degc,
                })
            });
            (Channel::Thermometer(sensor.id.clone()), readings.collect())
        })
        .collect()
}

/// The thermometer that another one at its place is compared with; none for itself.
fn first_at<'a>(machine: &'a MachineFile, sensor: &SensorEntry) -> Option<&'a SensorEntry> {
    let at_place = |other: &&SensorEntry| other.place == sensor.place;
    let first = machine.temperature_sensors.iter().find(at_place)?;
    (first.id != sensor.id).then_some(first)
}

fn of<'a>(scope: &Scope<'a>, sensor: &SensorEntry) -> impl Iterator<Item = &'a TemperatureSample> {
    let id = sensor.id.clone();
    let all = scope.record.temperatures.iter();
    all.filter(move |sample| sample.sensor == id)
}

/// The reference at the instant of a sample.
fn between(
    reference: &[&TemperatureSample],
    entry: &SensorEntry,
    sample: &TemperatureSample,
) -> Option<f64> {
    let next = reference.partition_point(|one| one.at <= sample.at);
    let before = reference.get(next.checked_sub(1)?)?;
    let since_s = (sample.at - before.at).as_secs_f64();
    let Some(after) = reference.get(next) else {
        return (since_s <= entry.period_s).then_some(before.temperature_degc);
    };
    let apart_s = (after.at - before.at).as_secs_f64();
    let change_k = after.temperature_degc - before.temperature_degc;
    (apart_s <= PERIODS * entry.period_s)
        .then(|| before.temperature_degc + change_k * since_s / apart_s)
}
