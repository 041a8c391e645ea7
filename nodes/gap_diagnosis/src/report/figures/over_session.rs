//! Surfaces that are touched again and again, over the time of the session: how they drift.

use std::collections::BTreeMap;

use twin::Channel;

use super::{Abscissa, Trace};
use crate::noise::stack::Stack;
use crate::search::rows::time_s;

/// A surface that was touched in fewer runs shows no course.
const MIN_RUNS_OF_COURSE: usize = 5;
/// Seconds in a minute.
const MINUTE_S: f64 = 60.0;

/// One touch: its run, its row in the stack, when it was.
struct Contact {
    run: usize,
    row: usize,
    at_s: f64,
}

/// A trace for each surface at each feed; none of those that were touched in few runs.
pub(crate) fn over_session(
    stack: &Stack<'_>,
    before: &[f64],
    after: &[f64],
    floor_um: f64,
) -> Vec<Trace> {
    let mut surfaces = BTreeMap::<String, Vec<Contact>>::new();
    let touched = stack
        .rows
        .blocks
        .iter()
        .filter(|b| b.channel == Channel::Touch);
    for block in touched {
        let run = &stack.session.runs[block.run];
        for (row, place) in block.rows.iter().zip(block.range()) {
            let Some(touch) = row.touch.and_then(|touch| run.touches.get(touch)) else {
                continue;
            };
            let feed_mm_min = touch.feed_mm_s * 60.0;
            let surface = format!("{} F{feed_mm_min:.0}, every time", touch.feature_id);
            surfaces.entry(surface).or_default().push(Contact {
                run: block.run,
                row: place,
                at_s: time_s(run, row),
            });
        }
    }
    let first_s = surfaces
        .values()
        .flatten()
        .map(|contact| contact.at_s)
        .fold(f64::INFINITY, f64::min);
    let um = |values: &[f64], contacts: &[Contact]| {
        contacts.iter().map(|c| values[c.row] * 1e3).collect()
    };
    surfaces
        .into_iter()
        .filter(|(_, contacts)| runs(contacts) >= MIN_RUNS_OF_COURSE)
        .map(|(title, contacts)| Trace {
            run: stack.session.runs[contacts[0].run].segment.run,
            channel: Channel::Touch.to_string(),
            title,
            abscissa: Abscissa::SessionTime,
            at: contacts
                .iter()
                .map(|contact| (contact.at_s - first_s) / MINUTE_S)
                .collect(),
            before_um: um(before, &contacts),
            after_um: um(after, &contacts),
            floor_um,
        })
        .collect()
}

fn runs(contacts: &[Contact]) -> usize {
    let mut runs: Vec<usize> = contacts.iter().map(|contact| contact.run).collect();
    runs.dedup();
    runs.len()
}
