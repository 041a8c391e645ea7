//! The diagnosis of simulator against machine, as a page: three answers first, tables and drawings after.

use anyhow::Result;
use gap_diagnosis::report::{Cause, GapReport, NextExperiment, ParameterValue, Status};
use maud::html;

use diagnosed::{Diagnosed, InPlant};
use simulated::Simulated;
use words::{covariate, in_units, name, name_of, signs};

use super::Report;
use super::page::fold;
use super::screen::Screen;
use super::section::{Rows, Section, head};
use super::svg::unsigned_zero;
use super::terminal::{self, Part, Rank};
use crate::machine_defaults;

pub mod designed;
pub mod diagnosed;
mod drawings;
mod first_screen;
mod floor;
mod heat;
mod logs;
mod look_alikes;
pub mod planned;
mod sentences;
pub mod simulated;
mod waterfall;
mod why;
mod words;

const CAUSES: &str = "Causes";
const HELD_OUT: &str = "Runs before and after";
const NEXT: &str = "What to measure next";
const GAP: &str = "Gap and noise floor";
const NOT_EXCITED: &str = "Effects that this recording could not show";
/// Begin of the names of amplitudes that only widen an effect's form.
const FREE_FORM: &str = "free_";
/// How the sum of a size and its shares begins.
const WHOLE: &str = "whole_";
/// Most rows of a table on the page.
const MAX_PAGE_ROWS: usize = 24;

/// The page of a diagnosis; with `explain` its text has every check of every cause, which the page has folded.
///
/// # Errors
/// When a drawing cannot be made.
pub fn page(title: &str, diagnosed: &Diagnosed, explain: bool) -> Result<Report> {
    let report = &diagnosed.diagnosis.report;
    let figures = &diagnosed.diagnosis.figures;
    let lost = sentences::lost(&diagnosed.losses());
    let defaults = machine_defaults::in_words(&diagnosed.defaults);
    let answers = sentences::answers(report).into_iter().chain(defaults);
    let simulator = diagnosed.simulated.iter().flat_map(Simulated::in_words);
    let lines = lost.into_iter().chain(simulator).chain(answers);
    let lines: Vec<String> = lines.collect();
    let sections = sections(diagnosed);
    let drifts = logs::sections(report, &figures.drifts)?;
    let notes: Vec<String> = notes(diagnosed);
    let traces = drawings::traces(&figures.traces)?;
    let look_alikes = look_alikes::section(&figures.isolability);
    let parts = explain
        .then(|| Part::of(&why::section(report)))
        .into_iter()
        .chain(drifts.iter().chain(&sections).map(Part::of))
        .chain(look_alikes.as_ref().map(Part::of))
        .chain(remarks(&notes));
    let parts = terminal::apart(parts);
    let mut screen = first_screen::of(report, &diagnosed.losses());
    screen.picture = waterfall::picture(report, &figures.apart)?;
    screen.behind.push(remarks_of_page(report, &notes));
    let compared = html! { div.traces { @for trace in &traces { (trace) } } };
    Ok(Report {
        title: title.to_owned(),
        parts,
        screen,
        body: html! {
            (heat::style())
            @for line in &lines { p { (line) } }
            @for section in &drifts { (logs::unfolded(section)) }
            @for section in sections.iter().filter(|one| one.rank < Rank::Detail) { (on_page(section, diagnosed)) }
            (fold("Machine minus simulator, before and after", None, true, &compared))
            (why::folded(report))
            (heat::heat(&figures.heat))
            @for section in sections.iter().filter(|one| one.rank == Rank::Detail) { (on_page(section, diagnosed)) }
            @if let Some(section) = &look_alikes { (section.html()) }
        },
        figures: diagnosed.json()?,
        lines,
    })
}

/// A part with its answer beside the title, which a page shows while the part is folded.
fn on_page(section: &Section, diagnosed: &Diagnosed) -> maud::Markup {
    let answers = answer(&section.title, diagnosed).into_iter().collect();
    let own = Section {
        answers,
        ..section.clone()
    };
    own.html()
}

fn answer(title: &str, diagnosed: &Diagnosed) -> Option<String> {
    let report = &diagnosed.diagnosis.report;
    let figures = &diagnosed.diagnosis.figures;
    Some(match title {
        CAUSES => {
            let n = |status| {
                report
                    .causes
                    .iter()
                    .filter(|own| own.status == status)
                    .count()
            };
            let all = [
                (n(Status::Named), "named"),
                (n(Status::Set), "one of a set"),
                (n(Status::Surrogate), "looking like one"),
            ];
            let there = all.iter().filter(|(n, _)| *n > 0);
            let there: Vec<String> = there.map(|(n, what)| format!("{n} {what}")).collect();
            match there[..] {
                [] => "None named.".to_owned(),
                _ => format!("{}.", there.join(", ")),
            }
        }
        HELD_OUT => {
            let runs = figures.held_out.iter();
            let most = runs.max_by(|a, b| a.after_um.total_cmp(&b.after_um))?;
            format!(
                "Most is left in run {}, {}: {} to {} µm rms.",
                most.run,
                most.title,
                three(most.before_um),
                three(most.after_um)
            )
        }
        NEXT => {
            let first = report.next_experiments.first()?;
            format!("{}, {:.0} min.", first.run, first.minutes.ceil())
        }
        GAP => {
            let channels = &report.gap.per_channel;
            let n_above = channels.iter().filter(|one| one.above_floor).count();
            format!(
                "{n_above} of {} channels are above the floor.",
                channels.len()
            )
        }
        NOT_EXCITED => match report.not_excited.len() {
            1 => "1 effect.".to_owned(),
            n => format!("{n} effects."),
        },
        _ => return None,
    })
}

/// The page of a recording that cannot be diagnosed.
pub fn without(title: &str, reason: &str) -> Report {
    let line = format!("No diagnosis: {reason}.");
    Report {
        title: title.to_owned(),
        parts: vec![],
        screen: Screen {
            lacks: vec![line.clone()],
            ..Screen::default()
        },
        body: html! { p { (line) } },
        figures: serde_json::json!({ "refused": reason }),
        lines: vec![line],
    }
}

/// Remarks, and what was read, at the end of the page.
fn remarks_of_page(report: &GapReport, notes: &[String]) -> maud::Markup {
    let content = html! {
        @for note in notes { p.note { (note) } }
        p.note { (read(report)) }
    };
    fold("Remarks on the diagnosis", None, false, &content)
}

/// The remarks of a diagnosis, which the whole text has.
fn remarks(notes: &[String]) -> Option<Part> {
    (!notes.is_empty()).then(|| Part::plain(format!("Remarks\n{}\n", notes.join("\n"))))
}

fn read(report: &GapReport) -> String {
    let bags = report.inputs.bags.iter().map(|bag| {
        let hash = bag.sha256.get(..12).unwrap_or("");
        format!(
            "{} ({} runs, {} readings, sha256 {hash})",
            bag.path, bag.runs, bag.samples
        )
    });
    let bags: Vec<String> = bags.collect();
    format!(
        "Read: {}. Diagnosed in {:.1} s. Intervals are 95 %.",
        bags.join("; "),
        report.runtime_s
    )
}

fn notes(diagnosed: &Diagnosed) -> Vec<String> {
    let notes = diagnosed.diagnosis.notes.iter().map(ToString::to_string);
    notes
        .chain(diagnosed.losses())
        .chain(diagnosed.remarks.iter().cloned())
        .collect()
}

/// A number with three significant digits, a small one with two.
fn three(value: f64) -> String {
    let size = value.abs();
    unsigned_zero(match () {
        () if !value.is_finite() => "—".to_owned(),
        () if size >= 100.0 => format!("{value:.0}"),
        () if size >= 10.0 => format!("{value:.1}"),
        () if size >= 1.0 || size == 0.0 => format!("{value:.2}"),
        () if size >= 0.1 => format!("{value:.3}"),
        () if size >= 1e-6 => {
            let decimals = (1.0 - size.log10().floor()) as usize;
            format!("{value:.decimals$}")
        }
        () => "0".to_owned(),
    })
}

fn maybe(value: Option<f64>) -> String {
    value.map_or_else(|| "—".to_owned(), three)
}

fn sections(diagnosed: &Diagnosed) -> Vec<Section> {
    let report = &diagnosed.diagnosis.report;
    let all = [
        causes(diagnosed),
        places(diagnosed).ranked(Rank::Detail),
        floor::section(report).ranked(Rank::Detail),
        held_out(diagnosed),
        next(report),
        not_excited(report).ranked(Rank::Detail),
    ];
    all.into_iter()
        .filter(|section| section.tables.iter().any(|table| !table.rows.is_empty()))
        .collect()
}

fn section(title: &str, names: &[&str], rows: Vec<Vec<String>>, note: &str) -> Section {
    Section {
        tables: vec![Rows {
            head: head(names),
            rows,
            note: note.to_owned(),
        }],
        ..Section::new(title)
    }
}

fn causes(diagnosed: &Diagnosed) -> Section {
    let report = &diagnosed.diagnosis.report;
    let is_known = !diagnosed.in_plant.is_empty();
    let rows = report.causes.iter().enumerate().map(|(place, cause)| {
        let own = [
            name(&cause.effect, &cause.axis),
            status(cause.status).to_owned(),
            format!("{:.2}", cause.confidence),
            three(cause.d),
        ];
        let truth = diagnosed.in_plant.get(place);
        let truth = truth.map(|own| own.has_it.to_owned());
        let last = [constancy(cause), alike(cause)];
        own.into_iter().chain(truth).chain(last).collect()
    });
    let names = [
        "effect",
        "status",
        "confidence",
        "D",
        OF_PLANT,
        "one size under all conditions",
        "could be instead",
    ];
    let names: Vec<&str> = { names.into_iter() }
        .filter(|name| is_known || *name != OF_PLANT)
        .collect();
    let note = "D: size over noise, whitened. Below 6.5 nothing is named; in blind trials with other physics nine of ten above 20 are.";
    let note = format!("{note}{}", parts_of_plant(diagnosed));
    let mut section = section(CAUSES, &names, rows.collect(), &note);
    section.tables.push(sizes(report));
    section
}

/// The column of what the simulated machine has.
const OF_PLANT: &str = "simulated machine has it";

/// The parts of a simulated machine that make what the causes name.
fn parts_of_plant(diagnosed: &Diagnosed) -> String {
    let causes = diagnosed.diagnosis.report.causes.iter();
    let has_part = |(_, own): &(&Cause, &InPlant)| !own.part.is_empty();
    let parts = causes.zip(&diagnosed.in_plant).filter(has_part);
    let parts =
        parts.map(|(cause, own)| format!("{}: {}", name(&cause.effect, &cause.axis), own.part));
    let parts: Vec<String> = parts.collect();
    if parts.is_empty() {
        return String::new();
    }
    format!(
        " Its plant file, which no node reads, has {}.",
        parts.join("; ")
    )
}

/// What is said of a parameter of which the recording tells nothing.
const NOT_DETERMINED: &str = "not determined by these runs";

/// Parameters, one a row.
fn sizes(report: &GapReport) -> Rows {
    let of_cause = |cause: &Cause| -> Vec<Vec<String>> {
        let title = name(&cause.effect, &cause.axis);
        let row = |p: &ParameterValue| {
            let remark = match (p.determined, p.at_bound) {
                (Some(false), _) => NOT_DETERMINED,
                (_, true) => "at its bound",
                (_, false) => "",
            };
            vec![
                title.clone(),
                spoken(&p.name),
                three(p.value),
                three(p.low),
                three(p.high),
                remark.to_owned(),
            ]
        };
        told(cause).map(row).collect()
    };
    Rows {
        head: head(&[
            "effect",
            "key of the machine file",
            "value",
            "from",
            "to",
            "",
        ]),
        rows: report.causes.iter().flat_map(of_cause).collect(),
        note: "From and to: 95 % interval of noise and repeats; in blind trials 95 % of them held. What the instruments themselves are off by \
               is not in them. Amplitudes of an effect's free form are in the JSON; `in all` is with those that are shares of a value."
            .to_owned()
            + &sign_of_squareness(report),
    }
}

/// The sign of every squareness among the causes.
fn sign_of_squareness(report: &GapReport) -> String {
    let causes = report.causes.iter();
    let signs = signs(causes.map(|cause| (cause.effect.as_str(), cause.axis.as_str())));
    signs.map_or_else(String::new, |signs| format!(" {signs}"))
}

fn status(status: Status) -> &'static str {
    match status {
        Status::Named => "named",
        Status::Surrogate => "looks like it",
        Status::Set => "one of a set",
    }
}

fn values(cause: &Cause) -> String {
    let value = |p: &ParameterValue| {
        let (label, factor, unit) = in_units(spoken_key(&p.name), p.value);
        let whole = if p.name.starts_with(WHOLE) {
            " in all"
        } else {
            ""
        };
        if p.determined == Some(false) {
            return format!("{label}{whole} {NOT_DETERMINED}");
        }
        let bound = if p.at_bound { ", at its bound" } else { "" };
        let value = format!("{label}{whole} {} {unit}", three(p.value * factor));
        format!(
            "{} ({} to {}{bound})",
            value.trim_end(),
            three(p.low * factor),
            three(p.high * factor)
        )
    };
    let all: Vec<String> = told(cause).map(value).collect();
    all.join(", ")
}

/// The parameters that people are told: none of the free form, and where shares of the first have forms of their own,
/// their sum instead of what is left of it.
fn told(cause: &Cause) -> impl Iterator<Item = &ParameterValue> {
    let all = cause.parameters.iter();
    let whole = all.clone().find_map(|p| p.name.strip_prefix(WHOLE));
    all.filter(move |p| !p.name.starts_with(FREE_FORM) && whole != Some(&p.name))
}

/// The key of a parameter without its mark of a sum.
fn spoken_key(name: &str) -> &str {
    name.strip_prefix(WHOLE).unwrap_or(name)
}

/// How people call a parameter.
fn spoken(name: &str) -> String {
    name.strip_prefix(WHOLE)
        .map_or_else(|| name.to_owned(), |of| format!("{of} in all"))
}

fn constancy(cause: &Cause) -> String {
    let constancy = &cause.constancy;
    if constancy.split_by.is_empty() {
        return "one condition only".to_owned();
    }
    let word = if constancy.passed { "yes" } else { "no" };
    format!(
        "{word}, z {} by {}",
        three(constancy.worst_z),
        constancy.split_by
    )
}

fn alike(cause: &Cause) -> String {
    let open = cause.confusable_with.iter().filter(|other| !other.excluded);
    let names: Vec<String> = open
        .map(|other| {
            format!(
                "{} (cos {:.2})",
                name(&other.effect, &other.axis),
                other.cos
            )
        })
        .collect();
    if names.is_empty() {
        "nothing else".to_owned()
    } else {
        names.join(", ")
    }
}

fn places(diagnosed: &Diagnosed) -> Section {
    let report = &diagnosed.diagnosis.report;
    let intervals = &diagnosed.diagnosis.figures.share_intervals;
    let interval = |place: usize| match intervals.get(place).copied().flatten() {
        Some([low, high]) => format!(" ({:.0} to {:.0})", 100.0 * low, 100.0 * high),
        None => String::new(),
    };
    let places = report.r#where.iter().take(MAX_PAGE_ROWS).enumerate();
    let rows = places.map(|(number, place)| {
        vec![
            place.channel.clone(),
            place.direction.clone(),
            covariate(&place.covariate),
            format!("{:.0} %{}", 100.0 * place.share_unique, interval(number)),
            format!("{:.0} %", 100.0 * place.share_shared),
            format!("{:.3}", place.p_value),
            three(place.z),
        ]
    });
    let names = [
        "channel",
        "direction",
        "goes with",
        "alone",
        "shared",
        "p",
        "z",
    ];
    section(
        "Where the gap lies",
        &names,
        rows.collect(),
        "Alone: share of the structured gap that only this explains, in brackets its 95 % interval over the runs, where these are enough to tell one; p: chance of so much in noise, over all places that were looked at.",
    )
}

fn held_out(diagnosed: &Diagnosed) -> Section {
    let report = &diagnosed.diagnosis.report;
    let runs = diagnosed.diagnosis.figures.held_out.iter().map(|run| {
        vec![
            format!("run {}: {}", run.run, run.title),
            three(run.before_um),
            three(run.after_um),
            three(run.floor_um),
        ]
    });
    let names = ["run", "before / µm", "after / µm", "floor / µm"];
    let mut section = section(
        HELD_OUT,
        &names,
        runs.collect(),
        "Root mean square of machine minus simulator, set-up floated.",
    );
    let apart = &diagnosed.diagnosis.figures.apart;
    let without = report.shrink.leave_one_out.iter().map(|out| {
        let own = apart
            .iter()
            .find(|own| own.effect == out.effect && own.axis == out.axis);
        let share = own.and_then(|own| own.share);
        vec![
            name(&out.effect, &out.axis),
            three(out.rms_um_without),
            own.map_or_else(String::new, |own| three(own.rms_um_alone)),
            share.map_or_else(String::new, |share| format!("{:.0} %", 100.0 * share)),
        ]
    });
    let without: Vec<Vec<String>> = without.collect();
    if !without.is_empty() {
        section.tables.push(Rows {
            head: head(&[
                "effect",
                "rms without it / µm",
                "rms with it alone / µm",
                "its share",
            ]),
            rows: without,
            note: "Its share: of the squares that all effects together close; what two close alike counts half for each."
                .to_owned(),
        });
    }
    section
}

/// What an experiment separates, in words.
fn separated(next: &NextExperiment) -> String {
    let names: Vec<String> = next.separates.iter().map(|id| name_of(id)).collect();
    match names.as_slice() {
        [one, other] => format!("{one} from {other}"),
        _ => names.join(", "),
    }
}

fn next(report: &GapReport) -> Section {
    let rows = report.next_experiments.iter().map(|next| {
        vec![
            next.run.clone(),
            separated(next),
            three(next.delta),
            three(next.minutes),
        ]
    });
    section(
        NEXT,
        &["run", "separates", "squared distance", "minutes"],
        rows.collect(),
        "A squared distance of 9 or more is a decision. There and back: both ways in one run, with one zero.",
    )
}

fn not_excited(report: &GapReport) -> Section {
    let rows = report.not_excited.iter().map(|effect| {
        let kind = name(&effect.effect, "");
        vec![kind, effect.needs.clone()]
    });
    section(NOT_EXCITED, &["effect", "needs"], rows.collect(), "")
}
