//! Thermometers that a log goes with and no effect of the catalogue.
//!
//! Where the air is read, no effect goes with the temperature of the bed (a table, a test stand). What a log shows of it would be
//! shared out among effects that are there, and change their lags. Where prediction of runs left out (`thermal`) finds such a
//! thermometer among others, its lagged warming floats: it is projected out as a set-up is, and reported.

use std::collections::BTreeSet;

use machine::file::SensorPlace;

use crate::noise::stack::Stack;
use crate::report::figures::Note;
use crate::search::rows::time_s;
use crate::session::thermal;

/// A lagged warming that floats in a channel.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ThermalFloat {
    /// The channel, as it is written.
    channel: String,
    /// Its name in the machine file.
    thermometer: String,
    /// Lag, s.
    lag_s: f64,
}

/// The floats of the logs of a stack.
pub(crate) fn of(stack: &Stack<'_>) -> Vec<ThermalFloat> {
    let unowned = unowned(stack);
    if unowned.is_empty() {
        return vec![];
    }
    let fits = thermal::notes(stack).into_iter();
    let floats = fits.filter_map(|note| match note {
        Note::GoesWith { channel, found } => Some((channel, found)),
        _ => None,
    });
    floats
        .flat_map(|(channel, found)| {
            // A thermometer alone may stand for one that was not read.
            let terms = if found.by.len() > 1 { found.by } else { vec![] };
            let own = terms
                .into_iter()
                .filter(|term| unowned.contains(&term.thermometer));
            own.map(move |term| ThermalFloat {
                channel: channel.clone(),
                thermometer: term.thermometer,
                lag_s: 60.0 * term.lag_min,
            })
            .collect::<Vec<_>>()
        })
        .collect()
}

/// Thermometers that were read and that no effect goes with.
fn unowned(stack: &Stack<'_>) -> BTreeSet<String> {
    let history = &stack.session.history;
    let sensors = &stack.twin.machine().temperature_sensors;
    let read = |place: SensorPlace| {
        let own = sensors.iter().filter(move |sensor| sensor.place == place);
        own.map(|sensor| sensor.id.clone())
            .filter(move |id| history.temperature_degc.contains_key(id))
    };
    if read(SensorPlace::Ambient).next().is_none() {
        return BTreeSet::new();
    }
    read(SensorPlace::Bed).collect()
}

impl ThermalFloat {
    /// Its warming at the rows of a stack, K; zero in other channels.
    pub(crate) fn column(&self, stack: &Stack<'_>) -> Vec<f64> {
        let history = &stack.session.history;
        let warming_k = history.warming_k(&self.thermometer).unwrap_or_default();
        let lagged = if self.lag_s > 0.0 {
            history.lagged_temperature(&warming_k, self.lag_s)
        } else {
            warming_k
        };
        let mut column = vec![0.0; stack.rows.len];
        for block in &stack.rows.blocks {
            if block.channel.to_string() != self.channel {
                continue;
            }
            let run = &stack.session.runs[block.run];
            for (row, value) in block.rows.iter().zip(&mut column[block.range()]) {
                *value = history.at(&lagged, time_s(run, row));
            }
        }
        column
    }

    /// What a reader should know of it.
    pub(crate) fn note(&self) -> Note {
        Note::ThermalFloat {
            channel: self.channel.clone(),
            thermometer: self.thermometer.clone(),
            lag_min: self.lag_s / 60.0,
        }
    }
}
