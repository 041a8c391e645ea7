//! The protocol's targets beside what was reached, and what each rule of the diagnosis is worth.

use reports::section::{Rows, Section};
use trials::Arm;
use trials::comparison::MethodLine;
use trials::target::Target;

use super::arm::methods;

/// Targets, met and missed.
pub fn section(targets: &[Target]) -> Section {
    let mut section = Section::new("Targets");
    let with = |met: Option<bool>| targets.iter().filter(move |target| target.met == met);
    let missed: Vec<&str> = with(Some(false))
        .map(|target| target.metric.as_str())
        .collect();
    section.lines.push(format!(
        "{} met, {} missed, {} not measured by these trials.",
        with(Some(true)).count(),
        with(Some(false)).count(),
        with(None).count()
    ));
    if !missed.is_empty() {
        section
            .lines
            .push(format!("Missed: {}.", missed.join("; ")));
    }
    section.tables.push(Rows {
        head: ["what", "target", "reached", "95 % interval", "of", ""]
            .map(str::to_owned)
            .to_vec(),
        rows: targets.iter().map(row).collect(),
        note: "A share meets its target where its whole interval does and misses it where none of it does; where the interval holds \
               the target, the trials are too few to tell: not measured. D named in 95 %: of \
               classes of which the trials tell only that it is below the least D that was tried (<), or beyond the \
               largest (>), with that."
            .to_owned(),
    });
    section
}

fn row(target: &Target) -> Vec<String> {
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let reached = match (target.limit, target.value, target.count) {
        (Some(limit), ..) => limit.to_string(),
        (None, None, _) => "-".to_owned(),
        (None, Some(value), None) => format!("{value:.3}"),
        (None, Some(value), Some(_)) => percent(value),
    };
    let interval = target.interval.map_or_else(String::new, |[low, high]| {
        format!("{} to {}", percent(low), percent(high))
    });
    let of = match target.count {
        Some(count) => format!("{}/{}", count.k, count.n),
        None => target.n.to_string(),
    };
    let verdict = match target.met {
        Some(true) => "met",
        Some(false) => "MISSED",
        None => "not measured",
    };
    vec![
        target.metric.clone(),
        target.wanted.clone(),
        reached,
        interval,
        of,
        verdict.to_owned(),
    ]
}

/// The diagnosis without each of its rules.
pub fn ablated(arm: Arm, lines: &[MethodLine]) -> Section {
    let mut section = Section::new(format!("Rules switched off, arm {arm}"));
    section.lines.push(
        "The same trials, diagnosed with all rules and with one switched off at a time.".to_owned(),
    );
    section.tables.push(methods("rules", lines));
    section
}
