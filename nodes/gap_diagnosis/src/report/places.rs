//! The report's table of places, and the heat map.

use std::collections::BTreeMap;

use crate::noise::stack::Stack;
use crate::report::description::fitted;
use crate::report::figures::HeatMap;
use crate::report::localise::Score;
use crate::report::{Condition, Place};
use crate::search::families::Slot;
use crate::search::rows::count;
use crate::shrink::split::title;

/// Most places that are listed.
const MAX_LISTED_PLACES: usize = 12;
/// Greatest p of a place that is listed.
const MOST_P: f64 = 0.01;

/// Places where more than noise lies.
pub fn places(stack: &Stack<'_>, slots: &[Slot], scores: &[Score], floated: &[f64]) -> Vec<Place> {
    let place = |score: &Score| {
        let slot = &slots[score.slot];
        let family = &slot.families[score.family];
        Place {
            channel: slot.channel.clone(),
            direction: slot.direction.clone(),
            covariate: family.covariate.clone(),
            share_unique: score.unique,
            share_shared: score.shared,
            p_value: score.p_value,
            z: score.z,
            per_condition: per_condition(stack, slot, &fitted(slot, family, floated)),
        }
    };
    listed(scores).map(place).collect()
}

/// Scores of the places that are listed.
pub fn listed(scores: &[Score]) -> impl Iterator<Item = &Score> {
    scores
        .iter()
        .filter(|score| score.p_value <= MOST_P)
        .take(MAX_LISTED_PLACES)
}

fn per_condition(stack: &Stack<'_>, slot: &Slot, told: &[f64]) -> Vec<Condition> {
    let mut sums = BTreeMap::<String, (f64, f64)>::new();
    let mut first = 0;
    for index in &slot.blocks {
        let block = &stack.rows.blocks[*index];
        let sum = sums
            .entry(title(&stack.session.runs[block.run].segment))
            .or_default();
        let part = &told[first..first + block.rows.len()];
        sum.0 += part.iter().map(|v| v * v).sum::<f64>();
        sum.1 += count(part.len());
        first += block.rows.len();
    }
    sums.into_iter()
        .map(|(condition, (square, n))| Condition {
            condition,
            rms_um: 1e3 * (square / n).sqrt(),
        })
        .collect()
}

/// Channel against covariate, before and after.
pub fn heat_map(slots: &[Slot], before: &[Score], after: &[Score]) -> HeatMap {
    let mut columns: Vec<String> = slots
        .iter()
        .flat_map(|slot| slot.families.iter().map(|family| family.covariate.clone()))
        .collect();
    columns.sort();
    columns.dedup();
    let table = |scores: &[Score]| {
        let mut table = vec![vec![None; columns.len()]; slots.len()];
        for score in scores {
            let covariate = &slots[score.slot].families[score.family].covariate;
            if let Ok(column) = columns.binary_search(covariate) {
                table[score.slot][column] = Some(score.z);
            }
        }
        table
    };
    HeatMap {
        rows: slots
            .iter()
            .map(|slot| format!("{} {}", slot.channel, slot.direction))
            .collect(),
        z: table(before),
        z_after: table(after),
        columns,
    }
}
