//! Runs that were measured and have no figure, each with its reason: none is left out in silence.

use std::fmt;

use super::Tests;
use super::paths::is_path;
use crate::circular;
use metrology::sample::{TestKind, TestSegment};

/// A run that was measured and is not evaluated.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NotEvaluated {
    /// Its number.
    pub run: u32,
    /// Which test, for people.
    pub test: String,
    /// Why not.
    pub reason: String,
}

impl fmt::Display for NotEvaluated {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { run, test, reason } = self;
        write!(f, "Not evaluated: run {run}, {test}: {reason}.")
    }
}

/// A run that was measured to its end.
#[derive(Clone, Debug)]
pub(super) struct Measured {
    /// Its begin.
    pub begin: TestSegment,
    /// Which test, for people.
    pub test: String,
}

impl Tests {
    /// Whether nothing was lost or left out, and every run that was measured is evaluated.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.reading.is_whole()
            && self.not_evaluated.is_empty()
            && circular::refused(&self.circles).is_empty()
    }

    /// Names the runs of which nothing stands on the page; `reasons` of circles with stops, by their runs.
    pub(super) fn name_not_evaluated(
        &mut self,
        measured: Vec<Measured>,
        reasons: &[(u32, String)],
    ) {
        for Measured { begin, test } in measured {
            if self.stands_for(&begin) {
                continue;
            }
            let known = reasons.iter().find(|(run, _)| *run == begin.run);
            let reason = known.map_or_else(|| reason(&begin), |(_, reason)| reason.clone());
            self.not_evaluated.push(NotEvaluated {
                run: begin.run,
                test,
                reason,
            });
        }
        let linear =
            { self.linear.iter() }.map(|it| (it.kind, it.name.clone(), &it.outlying.slips));
        let rotary = { self.rotary_positioning.iter() }.map(|it| {
            (
                TestKind::Positioning,
                it.axis.to_string(),
                &it.outlying.slips,
            )
        });
        for (kind, name, slips) in linear.chain(rotary) {
            let test = match kind {
                TestKind::Diagonal => format!("diagonal {name}"),
                _ => format!("positioning along or about {name}"),
            };
            let named = slips.iter().map(|(run, reason)| NotEvaluated {
                run: *run,
                test: test.clone(),
                reason: reason.clone(),
            });
            self.not_evaluated.extend(named);
        }
        self.not_evaluated.sort_by_key(|it| it.run);
    }

    /// Whether a run has a place on the page, or needs none.
    fn stands_for(&self, begin: &TestSegment) -> bool {
        let run = begin.run;
        match begin.kind {
            TestKind::Circle if begin.stations > 0 => {
                let circles = self.station_circles.iter();
                circles.map(|it| it.recording.run).any(|it| it == run)
            }
            TestKind::Circle => self.circles.iter().any(|it| it.segment.run == run),
            TestKind::Positioning | TestKind::Diagonal => {
                let linear = self.linear.iter().flat_map(|it| &it.runs);
                // Every run about a rotary axis has its part.
                let is_rotary = super::linear::axis_of(begin).is_some_and(|it| !it.is_linear());
                let slipped = self.linear.iter().flat_map(|it| &it.outlying.slips);
                let mut slipped = slipped.map(|(slipped, _)| *slipped);
                let mut linear = linear.copied();
                is_rotary || linear.any(|it| it == run) || slipped.any(|it| it == run)
            }
            kind if is_path(kind) && begin.stations == 0 => {
                self.paths.iter().any(|it| it.segment.run == run)
            }
            _ => true,
        }
    }
}

/// Why a run of which something was read is not evaluated.
fn reason(begin: &TestSegment) -> String {
    match begin.kind {
        TestKind::Diagonal | TestKind::Positioning => {
            "the axes rested at no two places: record stops of a second".to_owned()
        }
        _ => "no reading of it can be used".to_owned(),
    }
}
