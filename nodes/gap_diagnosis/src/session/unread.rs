//! When thermometers were silent, as a reader of the report should know it.

use std::ops::Range;

use twin::{Reading, Run, Session};

use crate::report::figures::Note;
use crate::search::rows::count;

/// One note a thermometer that was not read for longer than usual: its longest silence.
pub fn notes(session: &Session) -> Vec<Note> {
    let step_s = session.history.step_s;
    let of = |(thermometer, silences): (&String, &Vec<Range<usize>>)| {
        let longest = silences.iter().max_by_key(|silence| silence.len())?;
        let [begin_s, end_s] = [longest.start, longest.end].map(|entry| count(entry) * step_s);
        Some(Note::Unread {
            thermometer: thermometer.clone(),
            hours: (end_s - begin_s) / 3600.0,
            runs: around(session, begin_s, end_s)?,
            more: silences.len() - 1,
        })
    };
    session.history.unread.iter().filter_map(of).collect()
}

/// The last run that began before a time, and the first that ended after another; none without runs.
fn around(session: &Session, begin_s: f64, end_s: f64) -> Option<[u32; 2]> {
    let time_s = |run: &Run, one: Option<&Reading>| one.and_then(|one| run.time_of(one));
    let begins_s = |run: &Run| time_s(run, run.readings.first()).unwrap_or(0.0);
    let ends_s = |run: &Run| time_s(run, run.readings.last()).unwrap_or(0.0);
    let [first, last] = [session.runs.first()?, session.runs.last()?];
    let before = session.runs.iter().rfind(|run| begins_s(run) <= begin_s);
    let after = session.runs.iter().find(|run| ends_s(run) >= end_s);
    Some([before.unwrap_or(first), after.unwrap_or(last)].map(|run| run.segment.run))
}
