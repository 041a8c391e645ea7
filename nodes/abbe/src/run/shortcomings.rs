//! What did not work in a run, in a few lines for its end.

use std::collections::BTreeMap;

use metrology::sample::{PlanState, Rejection, TestKind};
use node_runtime::Level;
use reports::evidence::Evidence;

/// Conditions that are named; the page has all.
const MAX_CONDITIONS: usize = 12;

/// One condition of one node over the whole run.
struct Told<'e> {
    level: Level,
    times: usize,
    over: bool,
    node: &'e str,
    name: &'e str,
    message: &'e str,
}

/// Everything that did not go as planned, a line each; empty: nothing.
pub fn of(evidence: &Evidence, lost_messages: u64) -> Vec<String> {
    let mut lines: Vec<String> = steps_not_run(evidence).into_iter().collect();
    lines.extend(touches_not_used(evidence));
    if lost_messages > 0 {
        lines.push(format!(
            "{lost_messages} messages are not in the bag: they were lost on the way to it"
        ));
    }
    lines.extend(evidence.not_used());
    lines.extend(conditions(evidence));
    lines
}

/// Steps behind the one at which the plan ended early.
fn steps_not_run(evidence: &Evidence) -> Option<String> {
    let status = evidence.status.as_ref()?;
    if status.state == PlanState::Done || status.step >= status.steps {
        return None;
    }
    let (first, last) = (status.step + 1, status.steps);
    let why = match status.state {
        PlanState::Failed => format!("the plan failed at step {}", status.step),
        _ if status.step == 0 => "the run ended before the first".to_owned(),
        _ => format!("the run ended in step {}", status.step),
    };
    Some(if first == last {
        format!("step {last} was skipped: {why}")
    } else {
        format!("steps {first} to {last} were skipped: {why}")
    })
}

/// Touches whose point was not used; those of a latency run are meant to be uncorrected before it has an answer.
fn touches_not_used(evidence: &Evidence) -> Option<String> {
    let latency_runs: Vec<u32> = evidence
        .segments
        .iter()
        .filter(|segment| segment.kind == TestKind::Latency)
        .map(|segment| segment.run)
        .collect();
    let of_use = |run: &u32| !latency_runs.contains(run);
    let touches = evidence.points.iter().filter(|(run, _)| of_use(run));
    let (mut all, mut refused) = (0, BTreeMap::<&str, usize>::new());
    for (_, point) in touches {
        all += 1;
        if point.rejection != Rejection::None {
            *refused.entry(in_words(point.rejection)).or_default() += 1;
        }
    }
    let n: usize = refused.values().sum();
    let reasons: Vec<String> = refused
        .into_iter()
        .map(|(reason, times)| format!("{reason} {times}"))
        .collect();
    (n > 0).then(|| format!("{n} of {all} touches gave no point: {}", reasons.join(", ")))
}

const fn in_words(rejection: Rejection) -> &'static str {
    match rejection {
        Rejection::None => "used",
        Rejection::BeforeQueue => "contact before the oldest position",
        Rejection::AfterQueue => "contact after the newest position",
        Rejection::Gap => "positions missing at contact",
        Rejection::NotFinite => "position or feed not a number",
        Rejection::ClockWentBack => "controller's clock went back",
        Rejection::StandoffTooShort => "stand-off too short",
        Rejection::NoLatency => "latency not known",
    }
}

fn conditions(evidence: &Evidence) -> Vec<String> {
    let mut found = BTreeMap::<(&str, &str), Told<'_>>::new();
    for condition in &evidence.conditions {
        let (node, name) = (condition.node.as_str(), condition.diagnostic.name.as_ref());
        if condition.is_of_start && evidence.start_up.has_passed(node, name) {
            continue;
        }
        let told = found.entry((node, name)).or_insert(Told {
            level: Level::Ok,
            times: 0,
            over: evidence.over.contains(&(node.to_owned(), name.to_owned())),
            node,
            name,
            message: "",
        });
        told.level = told.level.max(condition.diagnostic.level);
        told.times += 1;
        told.message = &condition.diagnostic.message;
    }
    let (mut told, gone): (Vec<Told<'_>>, Vec<Told<'_>>) = found
        .into_values()
        .partition(|told| !told.over || told.level >= Level::Error);
    // What still stands before what is over, the worse before the better.
    told.sort_by_key(|told| (told.over, std::cmp::Reverse(told.level)));
    let left = told.len().saturating_sub(MAX_CONDITIONS);
    let mut lines: Vec<String> = told.iter().take(MAX_CONDITIONS).map(Told::line).collect();
    if left > 0 {
        lines.push(format!("{left} more conditions are on the page"));
    }
    if !gone.is_empty() {
        let names: Vec<String> = gone.iter().map(Told::whose).collect();
        lines.push(format!(
            "came and went: {}; their messages are among the conditions that nodes reported",
            names.join(", ")
        ));
    }
    lines
}

impl Told<'_> {
    fn line(&self) -> String {
        let level = match self.level {
            Level::Ok => "ok",
            Level::Warn => "warning",
            Level::Error => "error",
            Level::Stale => "silence",
        };
        let times = match self.times {
            1 => String::new(),
            n => format!(", {n} times"),
        };
        let over = if self.over { ", over since" } else { "" };
        format!("{}: {level}{times}{over}: {}", self.whose(), self.message)
    }

    fn whose(&self) -> String {
        let node = self.node.trim_start_matches('/');
        format!("{node} ({})", self.name.replace('_', " "))
    }
}

#[cfg(test)]
mod tests {
    use metrology::Stamp;
    use metrology::sample::PlanStatus;
    use node_runtime::Diagnostic;

    use super::*;

    fn status(state: PlanState, step: u32) -> PlanStatus {
        PlanStatus {
            at: Stamp::from_nanos(0),
            state,
            step,
            steps: 9,
            activity: String::new(),
            run: 0,
            progress: 0.0,
            message: String::new(),
        }
    }

    #[test]
    fn steps_that_were_not_run_are_said_with_the_reason() {
        let of_status = |state, step| {
            let evidence = Evidence {
                status: Some(status(state, step)),
                ..Evidence::default()
            };
            of(&evidence, 0)
        };
        assert!(of_status(PlanState::Done, 9).is_empty());
        assert_eq!(
            of_status(PlanState::Failed, 4),
            ["steps 5 to 9 were skipped: the plan failed at step 4"]
        );
        assert_eq!(
            of_status(PlanState::Running, 8),
            ["step 9 was skipped: the run ended in step 8"]
        );
    }

    /// Conditions of a controller as (second, name, level), with the second at which a program was proposed and that at
    /// which it ended; what is listed at the end, by name.
    fn listed(
        reported: &[(i64, &'static str, Level)],
        proposed_s: i64,
        ended_s: i64,
    ) -> Vec<String> {
        let at =
            |second: i64| Stamp::from_nanos(1_767_600_000_000_000_000 + second * 1_000_000_000);
        let mut evidence = Evidence::default();
        for second in 0..200 {
            if second == proposed_s {
                evidence.start_up.propose(at(second));
            }
            if second == ended_s {
                evidence.start_up.work();
            }
            for (_, name, level) in reported.iter().filter(|(when, ..)| *when == second) {
                let diagnostic = Diagnostic::new(*level, *name, (*name).to_owned());
                evidence.condition(at(second), "controller", &diagnostic);
            }
        }
        of(&evidence, 0)
    }

    #[test]
    #[expect(clippy::too_many_lines, reason = "a table of cases")]
    #[expect(clippy::type_complexity, reason = "a table of cases")]
    fn states_that_a_start_passes_through_are_not_listed_unless_they_stay_or_return() {
        use Level::{Error, Ok, Warn};
        let start = [
            (1, "stop", Warn),
            (1, "drives", Warn),
            (2, "homing", Warn),
            (3, "stop", Ok),
            (4, "drives", Ok),
            (30, "homing", Ok),
        ];
        let with = |more: &[(i64, &'static str, Level)]| [&start[..], more].concat();
        let table: [(&str, Vec<(i64, &'static str, Level)>, &[&str]); 12] = [
            ("a normal start", with(&[]), &[]),
            ("a program is proposed long before", with(&[]), &[]),
            (
                "states shown one after another",
                vec![
                    (1, "stop", Warn),
                    (3, "stop", Ok),
                    (4, "drives", Warn),
                    (8, "drives", Ok),
                    (9, "homing", Warn),
                    (39, "homing", Ok),
                ],
                &[],
            ),
            (
                "shown twice",
                with(&[(31, "stop", Warn), (32, "stop", Ok)]),
                &[],
            ),
            (
                "one stays",
                with(&[(2, "tool", Warn)]),
                &["controller (tool): warning: tool"],
            ),
            (
                "homing is not over",
                start[..5].to_vec(),
                &["controller (homing): warning: homing"],
            ),
            (
                "over after the program has ended",
                [&start[..5], &[(150, "homing", Ok)]].concat(),
                &[
                    "came and went: controller (homing); their messages are among the conditions that nodes reported",
                ],
            ),
            (
                "one returns in a program",
                with(&[(70, "stop", Warn), (71, "stop", Ok)]),
                &[
                    "came and went: controller (stop); their messages are among the conditions that nodes reported",
                ],
            ),
            (
                "one returns and stays",
                with(&[(150, "drives", Warn)]),
                &["controller (drives): warning: drives"],
            ),
            (
                "an error of the start",
                with(&[(3, "servo", Error), (4, "servo", Ok)]),
                &["controller (servo): error, over since: servo"],
            ),
            (
                "one that comes when it was calm",
                with(&[(60, "hot", Warn), (61, "hot", Ok)]),
                &[
                    "came and went: controller (hot); their messages are among the conditions that nodes reported",
                ],
            ),
            (
                "one that comes after the program",
                with(&[(150, "hot", Warn), (151, "hot", Ok)]),
                &[
                    "came and went: controller (hot); their messages are among the conditions that nodes reported",
                ],
            ),
        ];
        for (what, reported, wanted) in table {
            for proposed_s in [0, 5, 35] {
                assert_eq!(
                    listed(&reported, proposed_s, 120),
                    wanted,
                    "{what}, {proposed_s} s"
                );
            }
        }
        // Who speaks for the first time in the midst of a run is not starting.
        let late = [(80, "hot", Warn), (81, "hot", Ok)];
        assert_eq!(listed(&late, 5, 120).len(), 1);
        assert!(listed(&late, 60, 120).is_empty());
    }

    #[test]
    fn what_stands_at_the_end_is_named_and_what_went_is_counted() {
        let mut evidence = Evidence::default();
        evidence.start_up.work();
        let mut tell = |level, name: &'static str, message: &str| {
            let diagnostic = Diagnostic::new(level, name, message.to_owned());
            evidence.condition(Stamp::from_nanos(0), "axis_compensation", &diagnostic);
        };
        tell(Level::Warn, "positioning_run/X", "run 3 gave no table");
        tell(Level::Warn, "positioning_run/X", "run 4 gave no table");
        tell(Level::Warn, "model", "kept back");
        tell(Level::Ok, "model", "confirmed");
        tell(Level::Error, "geometry", "of another machine");
        tell(Level::Ok, "geometry", "used");
        let lines = of(&evidence, 2);
        assert_eq!(
            lines,
            [
                "2 messages are not in the bag: they were lost on the way to it",
                "axis_compensation (positioning run/X): warning, 2 times: run 4 gave no table",
                "axis_compensation (geometry): error, over since: of another machine",
                "came and went: axis_compensation (model); their messages are among the conditions that nodes reported",
            ]
        );
    }
}
