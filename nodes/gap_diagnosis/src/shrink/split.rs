//! Which runs are held out, chosen by condition before anything is looked at.
//!
//! # Model
//!
//! Runs of one kind and plane under one condition (radius, feed, sense, centre, stylus) go together. The latest
//! condition is held out, then the next, up to a third of the runs, as long as the runs that are left still have
//! two levels of every factor that had two: without them no fit could tell a delay from a play. A condition that only a later
//! bag has is held out where no other can be: it was measured to decide something, which it cannot do held out. Where no
//! condition can be spared and a test was repeated four times, its last quarter is held out: later, if not other. Of one
//! log that was cut into parts (`log`) the last third is held out.

use metrology::sample::{Sense, TestSegment};
use twin::{Run, Session};

use crate::noise::repeats::same_condition;
use crate::search::nuisance::plane_name;
use crate::session::log;

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
    let families = families(session, &used);
    let held = |additions: bool| {
        let each = families.iter();
        let mut held: Vec<usize> = each
            .flat_map(|family| of_family(session, family, additions))
            .collect();
        held.sort_unstable();
        held
    };
    let mut held_out = held(false);
    if held_out.is_empty() {
        held_out = held(true);
    }
    let fit = used
        .into_iter()
        .filter(|run| !held_out.contains(run))
        .collect();
    Split { fit, held_out }
}

fn families(session: &Session, used: &[usize]) -> Vec<Vec<usize>> {
    grouped(used, |a, b| {
        let (a, b) = (&session.runs[a].segment, &session.runs[b].segment);
        let are_parts = log::part(a).is_some() && log::part(b).is_some();
        a.kind == b.kind && a.plane == b.plane && (are_parts || a.features == b.features)
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

/// What is held out of a family; with or without conditions that only later bags have.
fn of_family(session: &Session, family: &[usize], additions: bool) -> Vec<usize> {
    let mut conditions = grouped(family, |a, b| {
        same_condition(&session.runs[a], &session.runs[b])
    });
    conditions.sort_by_key(|runs| std::cmp::Reverse(runs.last().copied()));
    let may_be = |runs: &[usize]| {
        let is_addition = runs.iter().all(|run| session.is_addition(*run));
        additions || !is_addition
    };
    let mut held = Vec::<usize>::new();
    for condition in conditions.iter().filter(|runs| may_be(runs)) {
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
    let is_one = conditions.len() == 1 && may_be(family);
    if held.is_empty() && is_one && family.len() >= 4 {
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
    words.extend(log::part(segment).map(str::to_owned));
    match segment.sense {
        Sense::None => {}
        Sense::Clockwise => words.push("cw".to_owned()),
        Sense::CounterClockwise => words.push("ccw".to_owned()),
    }
    words.join(" ")
}

#[cfg(test)]
mod tests {
    use metrology::Stamp;
    use metrology::sample::{TestKind, TestPlane};
    use twin::{Channel, Motion, Reading};

    use super::*;

    fn run(number: u32, kind: TestKind, radius_mm: f64, feed_mm_s: f64) -> Run {
        Run {
            segment: TestSegment {
                plane: TestPlane::Xy,
                radius_mm,
                feed_mm_s,
                zero_id: 1,
                setup_id: 1,
                ..TestSegment::of_kind(kind, number, Stamp::from_nanos(0))
            },
            motion: Motion::default(),
            touches: vec![],
            readings: vec![Reading {
                channel: Channel::GridU,
                at: 0,
                fraction: 0.0,
                deviation: 0.0,
            }],
        }
    }

    /// Circles at three feeds, twice each, and then a circle at a fourth and a line at two.
    fn session(first_bag_ends: Option<u32>) -> Session {
        let circle = |n: u32| {
            let feed = 10.0 * f64::from(1 + n / 2);
            run(n, TestKind::Circle, 50.0, feed)
        };
        let mut runs: Vec<Run> = (0..6).map(circle).collect();
        runs.push(run(6, TestKind::Circle, 50.0, 90.0));
        runs.push(run(7, TestKind::Line, 0.0, 20.0));
        runs.push(run(8, TestKind::Line, 0.0, 20.0));
        runs.push(run(9, TestKind::Line, 0.0, 20.0));
        runs.push(run(10, TestKind::Line, 0.0, 20.0));
        Session {
            runs,
            first_bag_ends,
            ..Session::default()
        }
    }

    #[test]
    fn what_was_measured_in_addition_to_decide_something_is_not_held_out() {
        assert_eq!(split(&session(None), true).held_out, [6, 10]);
        let split = split(&session(Some(5)), true);
        assert_eq!(split.held_out, [4, 5]);
        assert_eq!(split.fit, [0, 1, 2, 3, 6, 7, 8, 9, 10]);
    }

    #[test]
    fn where_nothing_else_can_be_held_out_an_addition_is() {
        let mut session = session(Some(5));
        session.runs.drain(..6);
        assert_eq!(split(&session, true).held_out, [4]);
    }
}
