//! Which thermometers the channels of logs go with, as the report has them.

use machine::file::SensorPlace;
use serde::{Deserialize, Serialize};
use twin::Channel;

use crate::judgement::cause::Found;
use crate::noise::stack::Stack;
use crate::report::figures::{Drift, Note, Temperature};
use crate::search::rows::{Block, count, time_s};
use crate::search::searched::told;
use crate::session::log;
use crate::session::thermal::{GoesWith, ThermalFit};

/// A channel of a log that goes with thermometers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Follows {
    /// The channel.
    pub channel: String,
    /// Share of its drift that they explain, on runs (of one log: parts) left out one by one.
    pub share: f64,
    /// The thermometers together.
    pub thermometers: Vec<GoesWith>,
}

/// The effect whose sign is known: a warm spindle comes down towards the table.
const GROWTH: &str = "spindle_growth";
/// Parts of its growth.
const PARTS_OF_GROWTH: [&str; 2] = ["fast_um", "slow_um"];
/// Most rows that a page draws of a channel.
const MOST_DRAWN: usize = 600;
const HOUR_S: f64 = 3600.0;

/// The channels that go with thermometers.
pub(crate) fn of(found: &Found) -> Vec<Follows> {
    fits(found)
        .map(|(channel, fit)| Follows {
            channel: channel.to_owned(),
            share: fit.share,
            thermometers: fit.by.clone(),
        })
        .collect()
}

fn fits(found: &Found) -> impl Iterator<Item = (&str, &ThermalFit)> {
    found.thermometers.iter().filter_map(|note| match note {
        Note::GoesWith { channel, found } => Some((channel.as_str(), found)),
        _ => None,
    })
}

/// The remarks, with one for a named growth of the spindle that lifts the nose.
pub(crate) fn with_sign(mut notes: Vec<Note>, stack: &Stack<'_>, found: &Found) -> Vec<Note> {
    notes.extend(shrinking(stack, found));
    notes
}

fn shrinking(stack: &Stack<'_>, found: &Found) -> Option<Note> {
    let mut named = found.named();
    let member = named.find(|member| found.instance(member).kind.id == GROWTH)?;
    let parameters = found.instance(member).kind.parameters.iter();
    let parts = parameters.zip(&member.estimate.values);
    let parts = parts.filter(|(own, _)| PARTS_OF_GROWTH.contains(&own.name));
    let um: f64 = parts.map(|(_, um)| um).sum();
    let sensors = stack.twin.machine().temperature_sensors.iter();
    let mut of_spindle = sensors
        .filter(|own| [SensorPlace::SpindleFront, SensorPlace::SpindleRear].contains(&own.place));
    let read = &stack.session.history.temperature_degc;
    (um < 0.0).then(|| Note::ShrinksWarming {
        um,
        by_thermometer: of_spindle.any(|own| read.contains_key(&own.id)),
    })
}

/// The drift of every channel of the logs, with what thermometers, else the named effects, say of it.
pub(crate) fn drifts(stack: &Stack<'_>, found: &Found) -> Vec<Drift> {
    let named = told(stack, found.named(), found);
    let has_named = found.named().next().is_some();
    let mut channels: Vec<&Channel> = vec![];
    for block in of_logs(stack) {
        if !channels.contains(&&block.channel) {
            channels.push(&block.channel);
        }
    }
    let of_channel = |channel: &Channel| {
        let name = channel.to_string();
        let fit = fits(found).find(|(of, _)| *of == name).map(|(_, fit)| fit);
        let blocks: Vec<&Block> = of_logs(stack).filter(|b| b.channel == *channel).collect();
        let model = match fit {
            Some(fit) => Some(by_thermometers(stack, &blocks, fit)),
            None if has_named => {
                let mm = blocks.iter().flat_map(|block| &named[block.range()]);
                Some(mm.map(|mm| 1e3 * mm).collect())
            }
            None => None,
        };
        drawn(stack, name, &blocks, (model, fit.is_some()))
    };
    channels.into_iter().map(of_channel).collect()
}

/// The blocks of logs that are no touches and no thermometers.
fn of_logs<'s>(stack: &'s Stack<'_>) -> impl Iterator<Item = &'s Block> {
    let runs = &stack.session.runs;
    let blocks = stack.rows.blocks.iter();
    blocks.filter(move |block| log::is_log(&runs[block.run]) && log::is_read(&block.channel))
}

/// What thermometers say of the rows of some blocks, µm.
fn by_thermometers(stack: &Stack<'_>, blocks: &[&Block], fit: &ThermalFit) -> Vec<f64> {
    let history = &stack.session.history;
    let mut sum = vec![0.0; blocks.iter().map(|block| block.rows.len()).sum()];
    for one in &fit.by {
        let Some(warming_k) = history.warming_k(&one.thermometer) else {
            continue;
        };
        let lagged = match 60.0 * one.lag_min {
            lag_s if lag_s > 0.0 => history.lagged_temperature(&warming_k, lag_s),
            _ => warming_k,
        };
        for (sum, at_s) in sum.iter_mut().zip(instants(stack, blocks)) {
            *sum += one.um_per_k * history.at(&lagged, at_s);
        }
    }
    sum
}

/// Instants of the rows of some blocks, s.
fn instants<'s>(stack: &'s Stack<'_>, blocks: &'s [&Block]) -> impl Iterator<Item = f64> + 's {
    let runs = &stack.session.runs;
    let rows = blocks.iter().flat_map(|block| {
        let run = &runs[block.run];
        block.rows.iter().map(move |row| time_s(run, row))
    });
    rows.collect::<Vec<_>>().into_iter()
}

/// What is drawn of the blocks of one channel; the model begins at zero, the readings under each zero lie about it.
fn drawn(
    stack: &Stack<'_>,
    channel: String,
    blocks: &[&Block],
    (model, is_by_thermometers): (Option<Vec<f64>>, bool),
) -> Drift {
    let at_s: Vec<f64> = instants(stack, blocks).collect();
    let mut model_um = model.unwrap_or_default();
    let begin = model_um.first().copied().unwrap_or(0.0);
    model_um.iter_mut().for_each(|um| *um -= begin);
    let raw = blocks.iter().flat_map(|block| &stack.raw[block.range()]);
    let mut deviation_um: Vec<f64> = raw.map(|mm| 1e3 * mm).collect();
    let zeros = blocks.iter().flat_map(|block| {
        let segment = &stack.session.runs[block.run].segment;
        vec![(segment.setup_id, segment.zero_id); block.rows.len()]
    });
    let zeros: Vec<(u32, u32)> = zeros.collect();
    let told = |k: usize| model_um.get(k).copied();
    for zero in zeros.iter().collect::<std::collections::BTreeSet<_>>() {
        let own = || (0..zeros.len()).filter(|k| zeros[*k] == *zero);
        let off = own().map(|k| deviation_um[k] - told(k).unwrap_or(0.0));
        let mean = off.sum::<f64>() / count(own().count().max(1));
        let first = own().next().map_or(0.0, |k| deviation_um[k]);
        let shift = if model_um.is_empty() { first } else { mean };
        for k in own().collect::<Vec<_>>() {
            deviation_um[k] -= shift;
        }
    }
    let every = at_s.len() / MOST_DRAWN + 1;
    let thinned = |values: &[f64]| values.iter().step_by(every).copied().collect::<Vec<f64>>();
    Drift {
        temperatures: temperatures(stack, &thinned(&at_s)),
        time_h: thinned(&at_s).iter().map(|s| s / HOUR_S).collect(),
        deviation_um: thinned(&deviation_um),
        model_um: thinned(&model_um),
        is_by_thermometers,
        channel,
    }
}

/// All thermometers that were read, at some instants.
fn temperatures(stack: &Stack<'_>, at_s: &[f64]) -> Vec<Temperature> {
    let history = &stack.session.history;
    let read = history.temperature_degc.iter();
    let of = |(id, series): (&String, &Vec<f64>)| {
        let first = series.iter().copied().find(|t| t.is_finite())?;
        let warming_k = history.warming_k(id)?;
        let degc = at_s.iter().map(|s| first + history.at(&warming_k, *s));
        Some(Temperature {
            thermometer: id.clone(),
            degc: degc.collect(),
        })
    };
    read.filter_map(of).collect()
}
