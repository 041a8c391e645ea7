//! Runs that were measured and have no figure, each with its reason: none is left out in silence.

use std::fmt;

use super::Tests;
use super::paths::is_path;
use crate::circular;
use metrology::sample::{ProbedPoint, Rejection, TestKind, TestSegment};

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
            && self.broken_off.is_empty()
            && circular::refused(&self.circles).is_empty()
    }

    /// Names the runs of which nothing stands on the page; `reasons` by runs: of circles with stops, and of
    /// readings that contradict each other.
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
        self.not_evaluated.extend(without_points(&self.touches));
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
            TestKind::Dwell => self.drift.logs.iter().any(|it| it.run == run),
            kind if is_path(kind) && begin.stations == 0 => {
                self.paths.iter().any(|it| it.segment.run == run)
            }
            _ => true,
        }
    }
}

/// Runs with touches of which none gave a point; a latency run needs none.
fn without_points(touches: &[(TestSegment, ProbedPoint)]) -> Vec<NotEvaluated> {
    let runs = touches.chunk_by(|(a, _), (b, _)| a.run == b.run);
    let of_run = |touches: &[(TestSegment, ProbedPoint)]| {
        let (begin, first) = touches.first()?;
        let is_any_used = touches
            .iter()
            .any(|(_, it)| it.rejection == Rejection::None);
        (begin.kind != TestKind::Latency && !is_any_used).then(|| NotEvaluated {
            run: begin.run,
            test: format!("touches of {}", begin.features.join(" ")),
            reason: format!(
                "none of its {} touches gave a point: {}",
                touches.len(),
                remedy(first.rejection)
            ),
        })
    };
    runs.filter_map(of_run).collect()
}

/// Why touches gave no point, and what to do.
const fn remedy(rejection: Rejection) -> &'static str {
    match rejection {
        Rejection::NoLatency => {
            "the latency is not known: measure it by a latency step before, or state it"
        }
        Rejection::StandoffTooShort => {
            "the stand-off is too short for the programmed feed: lengthen it or lower the feed"
        }
        Rejection::BeforeQueue | Rejection::AfterQueue | Rejection::Gap => {
            "no axis states are of their time: record /axes/state without holes"
        }
        Rejection::ClockWentBack => "the controller's clock went back: repeat the run",
        Rejection::NotFinite | Rejection::None => {
            "a position or feed is no finite number: repeat the run"
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

#[cfg(test)]
mod tests {
    use metrology::sample::Correction;
    use metrology::stamp::Stamp;
    use metrology::{AxisSet, PerAxis};
    use nalgebra::Vector3;

    use super::*;

    fn touch(run: u32, kind: TestKind, rejection: Rejection) -> (TestSegment, ProbedPoint) {
        let point = ProbedPoint {
            received_at: Stamp::from_nanos(1),
            feature_id: "high.1".to_owned(),
            axes_at_contact: PerAxis::default(),
            axes: AxisSet::XYZ,
            point_in_machine_mm: Vector3::zeros(),
            point_in_workpiece_mm: Vector3::zeros(),
            applied_latency_s: 0.0,
            correction: Correction::None,
            standard_uncertainty_mm: 0.0,
            approach: -Vector3::z(),
            feed_mm_s: 2.0,
            rejection,
            sequence: 0,
        };
        let segment = TestSegment {
            features: vec!["high".to_owned()],
            ..TestSegment::of_kind(kind, run, Stamp::from_nanos(0))
        };
        (segment, point)
    }

    #[test]
    fn a_run_whose_touches_gave_no_point_is_named_with_the_remedy() {
        let none = Rejection::NoLatency;
        let found = without_points(&[
            touch(1, TestKind::Latency, none),
            touch(2, TestKind::Sphere, none),
            touch(2, TestKind::Sphere, none),
            touch(3, TestKind::Sphere, none),
            touch(3, TestKind::Sphere, Rejection::None),
        ]);
        let said: Vec<String> = found.iter().map(ToString::to_string).collect();
        let wanted = "Not evaluated: run 2, touches of high: none of its 2 touches gave a point: the latency is not known: measure it by a latency step before, or state it.";
        assert_eq!(said, [wanted]);
    }
}
