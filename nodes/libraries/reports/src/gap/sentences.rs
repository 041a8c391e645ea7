//! One sentence for each question: where, which, how far.

use gap_diagnosis::report::{Cause, DoesNotRepeat, GapReport, Status};

use super::logs;
use super::words::{self, name};
use super::{maybe, three, told, values};

/// That a part of the recording could not be read.
pub(super) fn lost(losses: &[String]) -> Option<String> {
    let first = losses.first()?;
    let more = match losses.len() {
        1 => String::new(),
        n => format!(", and {} more (see the remarks)", n - 1),
    };
    Some(format!(
        "Lost: a part of the recording could not be used: {first}{more}. What follows is of the rest."
    ))
}

/// The answers: of logs the thermometers that they go with, then where, which, how far.
pub(super) fn answers(report: &GapReport) -> Vec<String> {
    let three = [place(report), cause(report), shrink(report)];
    logs::sentences(report).into_iter().chain(three).collect()
}

fn place(report: &GapReport) -> String {
    let gap = &report.gap;
    if !gap.above_floor {
        return format!(
            "Where: no gap above the noise floor; machine and simulator differ by {} µm rms, noise alone gives {} µm.",
            three(gap.rms_um),
            three(gap.floor_um)
        );
    }
    let size = format!(
        "machine and simulator differ by {} µm rms (95 % within {} µm; noise alone gives {} µm)",
        three(gap.rms_um),
        three(gap.p95_um),
        three(gap.floor_um)
    );
    match words::place(report) {
        Some(place) => format!("Where: {size}; {place}."),
        None => {
            let most = report.gap.per_channel.iter();
            let most = most.max_by(|a, b| a.rms_um.total_cmp(&b.rms_um));
            let channel = most.map_or("", |channel| channel.channel.as_str());
            format!("Where: {size}; most of it is in {channel}.")
        }
    }
}

fn cause(report: &GapReport) -> String {
    let of = |status: Status| report.causes.iter().filter(move |c| c.status == status);
    let with_size = |cause: &Cause| {
        let title = name(&cause.effect, &cause.axis) + &since(report, cause);
        format!(
            "{title} ({}; confidence {:.2})",
            sizes(cause),
            cause.confidence
        )
    };
    let mut parts = vec![];
    let named: Vec<String> = of(Status::Named).map(with_size).collect();
    if !named.is_empty() {
        parts.push(named.join("; "));
    }
    for cause in of(Status::Set) {
        let others = cause.confusable_with.iter().filter(|other| !other.excluded);
        let others: Vec<String> = others.map(|o| name(&o.effect, &o.axis)).collect();
        parts.push(format!(
            "{} or one that this recording cannot tell from it ({})",
            with_size(cause),
            others.join(", ")
        ));
    }
    let alike: Vec<String> = of(Status::Surrogate)
        .map(|cause| name(&cause.effect, &cause.axis))
        .collect();
    if !alike.is_empty() {
        parts.push(format!(
            "something that looks like {} but fails a check of it",
            alike.join(", ")
        ));
    }
    parts.extend(report.does_not_repeat.iter().map(|change| {
        let (channel, size) = (changed(change), three(change.size_um));
        let [last, from] = [change.last_run, change.from_run];
        if change.evenly {
            return format!(
                "{channel} does not repeat: it went on changing, by {size} µm from run {last} to run {from}"
            );
        }
        format!("{channel} does not repeat: it changed by {size} µm between run {last} and run {from}")
    }));
    if report.unknown.flagged {
        parts.push(unknown(report));
    }
    if parts.is_empty() {
        return "Which: no effect of the catalogue is named.".to_owned();
    }
    format!("Which: {}.", parts.join(". And "))
}

/// What does not repeat: a channel, of touches with what is touched.
fn changed(change: &DoesNotRepeat) -> String {
    match &change.feature {
        Some(feature) => format!("{} of {feature}", change.channel),
        None => change.channel.clone(),
    }
}

/// From which run on an effect is there, where it was not from the begin.
pub(super) fn since(report: &GapReport, cause: &Cause) -> String {
    let named = report
        .causes
        .iter()
        .filter(|c| c.status != Status::Surrogate);
    let mut over_session = named.zip(&report.over_session);
    let own = over_session.find(|(named, _)| std::ptr::eq(*named, cause));
    let run = own.and_then(|(_, own)| own.from_run);
    run.map_or_else(String::new, |run| format!(" from run {run} on"))
}

/// Most parameters that a sentence holds.
const MOST_SAID: usize = 2;

/// The sizes of an effect, as many as a sentence can hold; all are in the table.
fn sizes(cause: &Cause) -> String {
    let shown = told(cause).count();
    if shown <= MOST_SAID {
        return values(cause);
    }
    let first = Cause {
        parameters: cause.parameters[..1].to_vec(),
        ..cause.clone()
    };
    format!("{} and {} more in the table", values(&first), shown - 1)
}

fn unknown(report: &GapReport) -> String {
    if report.unknown.score <= report.unknown.threshold {
        return "a gap of the held-out runs alone that no known effect explains".to_owned();
    }
    let found = &report.unknown.description;
    let mut said = vec![];
    if !found.covariate.is_empty() {
        said.push(format!(
            "it goes with {}",
            words::covariate(&found.covariate)
        ));
    }
    if !found.parity.is_empty() {
        said.push(format!("is {} in the direction of motion", found.parity));
    }
    if !found.period.is_empty() {
        said.push(format!("has a period of {}", found.period));
    }
    if let Some(exponent) = found.feed_exponent {
        said.push(words::feed_exponent(exponent));
    }
    if let Some(time_s) = found.time_constant_s {
        said.push(format!("has a time constant of {} s", three(time_s)));
    }
    format!(
        "a rest that no known effect explains (score {} over {}): {}",
        three(report.unknown.score),
        three(report.unknown.threshold),
        if said.is_empty() {
            "without a clear shape".to_owned()
        } else {
            said.join(", ")
        }
    )
}

fn shrink(report: &GapReport) -> String {
    let shrink = &report.shrink;
    if shrink.held_out_runs.is_empty() {
        return "How far: no run was held out, so nothing is said of how far the gap shrinks."
            .to_owned();
    }
    let runs: Vec<String> = shrink
        .held_out_runs
        .iter()
        .map(ToString::to_string)
        .collect();
    let closed = shrink.gap_closed.map_or_else(
        || {
            if shrink.held_out_runs.len() < gap_diagnosis::LEAST_JUDGED_RUNS {
                "so few say nothing of how much of the gap is closed".to_owned()
            } else {
                "there was no gap above the floor on them".to_owned()
            }
        },
        |closed| {
            format!(
                "{:.1} % of the gap is closed ({:.1} to {:.1} %)",
                100.0 * closed.value,
                100.0 * closed.low,
                100.0 * closed.high
            )
        },
    );
    let runs = runs.join(", ");
    let before = maybe(shrink.rms_um.before);
    if report
        .causes
        .iter()
        .all(|cause| cause.status == Status::Surrogate)
    {
        return format!(
            "How far: no effect was named, so nothing was added to the simulator; the held-out runs ({runs}) stay at {before} µm rms."
        );
    }
    format!(
        "How far: with the effects found in the simulator, the held-out runs ({runs}) go from {before} to {} µm rms; {closed}.",
        maybe(shrink.rms_um.after),
    )
}
