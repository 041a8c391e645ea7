//! The noise floor of single runs in motion, where no test was repeated and nothing is a log.
//!
//! # Model
//!
//! Within a run it is what its own smooth modes (`field`) leave, sharp places such as reversals among it: rather too great than
//! too small. At targets that were read from both sides it is what the two sides differ by beside a smooth lost motion
//! (`both_ways`). How a second run would differ was not measured; `unrepeated` states what is assumed, and lowers confidences.
//!
//! # Holds when
//! A run has three rows for each mode that is taken out of it; channels without such runs have no noise floor.

use std::collections::BTreeMap;

use twin::Channel;

use super::{
    Difference, Noise, Readings, autoregression, both_ways, differences, doubt, resolution_mm,
};
use crate::config::GapConfig;
use crate::noise::pace::Pace;
use crate::noise::repeats::{self, Contrasts};
use crate::noise::unrepeated;
use crate::search::rows::Block;
use crate::session::log;

/// Noise of every channel in motion.
pub(super) fn noise(
    readings: Readings<'_>,
    raw: &[f64],
    config: &GapConfig,
) -> BTreeMap<Channel, Noise> {
    let mut blocks = BTreeMap::<Channel, Vec<usize>>::new();
    for (place, block) in readings.rows.blocks.iter().enumerate() {
        let is_read = !matches!(block.channel, Channel::Touch | Channel::Thermometer(_));
        if is_read && !log::is_log(&readings.session.runs[block.run]) {
            let own = blocks.entry(block.channel.clone()).or_default();
            own.push(place);
        }
    }
    let of = |(channel, places): (Channel, Vec<usize>)| {
        let single = |place: &usize| {
            let block = &readings.rows.blocks[*place];
            Contrasts {
                blocks: vec![*place],
                rows: (0..block.rows.len()).collect(),
                values: vec![raw[block.range()].to_vec()],
                one_zero: false,
                joins: None,
            }
        };
        let groups: Vec<Contrasts> = places.iter().map(single).collect();
        let all: Vec<Difference> = groups
            .iter()
            .flat_map(|group| {
                let block = &readings.rows.blocks[group.blocks[0]];
                let is_along = both_ways::is_along(&channel);
                let paired = is_along.then(|| both_ways::difference(readings, raw, block));
                match paired.flatten() {
                    Some(difference) => vec![difference],
                    None => differences(readings, group),
                }
            })
            .filter(|one| one.values.len() >= LEAST_ROWS_OF_A_MODE * one.modes.ncols())
            .collect();
        let all: Vec<&Difference> = all.iter().collect();
        let least_mm2 = resolution_mm(readings.machine, &channel).powi(2) / 12.0;
        let (within, freedom) = autoregression(&all, config.most_ar, least_mm2)?;
        let known = places.iter().map(|place| &readings.rows.blocks[*place]);
        let known: Vec<&Block> = known.collect();
        let within_row = repeats::within_row_variance(readings.residual, &known);
        let row_sigma_mm = within.variances[0].sqrt();
        Some((
            channel,
            Noise {
                within: within.scaled(doubt(freedom)),
                pace: Pace::default(),
                between: unrepeated::between_in_motion(),
                row_sigma_mm,
                reading_sigma_mm: (row_sigma_mm.powi(2) + within_row).sqrt(),
                repeats: 1,
                freedom,
                field_freedom: 1.0,
            },
        ))
    };
    blocks.into_iter().filter_map(of).collect()
}

/// Rows that a single run needs for each smooth mode taken out of it.
const LEAST_ROWS_OF_A_MODE: usize = 3;
