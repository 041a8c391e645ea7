//! Which runs are held out, chosen by condition before anything is looked at.
//!
//! # Model
//!
//! Runs of one kind and plane under one condition (radius, feed, sense, centre, stylus) go together. The latest
//! condition is held out, then the next, up to a third of the runs, as long as the runs that are left still have
//! two levels of every factor that had two: without them no fit could tell a delay from a play. Where no
//! condition can be spared and a test was repeated four times, its last quarter is held out: later, if not other.

use machine::twin::{Run, Session};
use metrology::sample::{Sense, TestSegment};

use crate::nuisance::plane_name;
use crate::repeats::same_condition;

/// Runs that are fitted, and runs that are held out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Split {
    /// Places of the runs that are fitted.
    pub fit: Vec<usize>,
    /// Places of the runs that are only predicted.
    pub held_out: Vec<usize>,
}

impl Split {
    /// The runs that are judged: those held out, or all where none was.
    pub fn judged(&self) -> &[usize] {
        if self.held_out.is_empty() {
            &self.fit
        } else {
            &self.held_out
        }
    }

    /// All runs, in the order of the session.
    pub fn all(&self) -> Vec<usize> {
        let mut all = [self.fit.as_slice(), &self.held_out].concat();
        all.sort_unstable();
        all
    }
}

/// Splits the runs that hold readings.
pub fn split(session: &Session, hold_out: bool) -> Split {
    let used: Vec<usize> = (0..session.runs.len())
        .filter(|run| !session.runs[*run].readings.is_empty())
        .collect();
    if !hold_out {
        return Split {
            fit: used,
            held_out: vec![],
        };
    }
    let mut held_out = Vec::new();
    for family in families(session, &used) {
        held_out.extend(of_family(session, &family));
    }
    held_out.sort_unstable();
    let fit = used
        .into_iter()
        .filter(|run| !held_out.contains(run))
        .collect();
    Split { fit, held_out }
}

fn families(session: &Session, used: &[usize]) -> Vec<Vec<usize>> {
    grouped(used, |a, b| {
        let (a, b) = (&session.runs[a].segment, &session.runs[b].segment);
        a.kind == b.kind && a.plane == b.plane && a.features == b.features
    })
}

fn grouped(runs: &[usize], same: impl Fn(usize, usize) -> bool) -> Vec<Vec<usize>> {
    let mut groups = Vec::<Vec<usize>>::new();
    for &run in runs {
        match groups.iter_mut().find(|group| same(group[0], run)) {
            Some(group) => group.push(run),
            None => groups.push(vec![run]),
        }
    }
    groups
}

fn of_family(session: &Session, family: &[usize]) -> Vec<usize> {
    let mut conditions = grouped(family, |a, b| {
        same_condition(&session.runs[a], &session.runs[b])
    });
    conditions.sort_by_key(|runs| std::cmp::Reverse(runs.last().copied()));
    let mut held = Vec::<usize>::new();
    for condition in &conditions {
        let left: Vec<usize> = family
            .iter()
            .copied()
            .filter(|run| !held.contains(run) && !condition.contains(run))
            .collect();
        let few = held.len() + condition.len() <= family.len() / 3;
        if few && keeps_levels(session, family, &left) {
            held.extend(condition);
        }
    }
    if held.is_empty() && conditions.len() == 1 && family.len() >= 4 {
        held.extend(&family[family.len() - family.len() / 4..]);
    }
    held
}

/// Whether every factor keeps two of its levels.
fn keeps_levels(session: &Session, all: &[usize], left: &[usize]) -> bool {
    let levels = |runs: &[usize], factor: fn(&Run) -> String| {
        let mut levels: Vec<String> = runs.iter().map(|run| factor(&session.runs[*run])).collect();
        levels.sort();
        levels.dedup();
        levels.len()
    };
    let factors: [fn(&Run) -> String; 5] = [
        |run| format!("{:.1}", run.segment.radius_mm),
        |run| format!("{:.2}", run.segment.feed_mm_s),
        |run| format!("{:?}", run.segment.sense),
        |run| run.segment.stylus.clone(),
        |run| format!("{:.0?}", run.segment.centre_mm.as_slice()),
    ];
    factors
        .iter()
        .all(|factor| levels(left, *factor) >= levels(all, *factor).min(2))
}

/// What a run was, in a few words.
pub fn title(segment: &TestSegment) -> String {
    let mut words = vec![format!("{:?}", segment.kind).to_lowercase()];
    if !plane_name(segment.plane).is_empty() {
        words.push(plane_name(segment.plane).to_owned());
    }
    if segment.radius_mm > 0.0 {
        words.push(format!("R{:.0}", segment.radius_mm));
    }
    if segment.feed_mm_s > 0.0 {
        words.push(format!("F{:.0}", segment.feed_mm_s * 60.0));
    }
    match segment.sense {
        Sense::None => {}
        Sense::Clockwise => words.push("cw".to_owned()),
        Sense::CounterClockwise => words.push("ccw".to_owned()),
    }
    words.join(" ")
}
