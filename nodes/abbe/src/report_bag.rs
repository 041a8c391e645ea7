//! `abbe report BAG`: the tests of a bag, evaluated.

use node_runtime::complain;
use node_runtime::text_file;
use reports::evaluate::budget::{Budget, unstate};
use reports::evaluate::limits::{Limits, state_traceability};
use reports::evaluate::{BrokenOff, NotEvaluated, Tests};
use reports::loss;
use reports::machine_defaults;
use reports::page::fold_details;
use reports::screen::{Made, Screen};
use reports::section::{FAR, Section};
use reports::terminal::{self, Part, Rank, Room};
use reports::whole_file::{Form, Output, check_outputs};
use reports::{self, Report};

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result};
use clap::Args;
use maud::{Markup, html};
use recorder::Bag;
use replayer::machines;

use crate::SOFTWARE;
use crate::diagnose::bags;
use crate::history::alarms::{self, Alarms};
use crate::history::keep::Keep;
use crate::history::origin::Origin;
use crate::pdf;
use crate::tell::tell;

mod first_screen;
pub mod folder;
pub mod foreign_log;
pub mod from_table;

/// Arguments of `abbe report`.
#[derive(Args)]
pub struct ReportBag {
    /// Folder of the bag, or a table (csv, tsv, txt, dat, xlsx), which is then imported by what is recognised in it.
    bag: PathBuf,
    /// Which column of the table is what, as `abbe import` takes it.
    #[arg(long)]
    map: Option<PathBuf>,
    /// What is not known about the measurements: the expanded uncertainties of ISO 230-2, 230-4 and 230-6 come from it and are not
    /// stated without it. What fits say of themselves (geometric errors, causes of circles) is stated in any case.
    #[arg(long)]
    budget: Option<PathBuf>,
    /// Limits of figures, which are then judged by ISO 14253-1 with the uncertainties of --budget, which it needs; an example
    /// is launch_configs/dual_loop/limits.yaml. With --keep also exit code 4 and an alarm for each figure that exceeds its own.
    #[arg(long, requires = "budget")]
    limits: Option<PathBuf>,
    /// Folder to write `report.html` and `report.json` into; without it the terminal alone.
    #[arg(long)]
    out: Option<PathBuf>,
    /// The figures as JSON instead of text.
    #[arg(long)]
    json: bool,
    /// Print every table and remark, instead of the answer and three tables in at most 40 lines.
    #[arg(long)]
    full: bool,
    /// Write the page as a PDF of A4 sheets; Chromium prints it.
    #[arg(long, value_name = "FILE")]
    pdf: Option<PathBuf>,
    #[command(flatten)]
    keep: Keep,
}

/// Prints what was lost, left out or not completed.
fn complain_of(tests: &Tests) {
    loss::complain_of(&tests.reading);
    for run in &tests.broken_off {
        complain!("abbe: {run}");
    }
    for run in &tests.not_evaluated {
        complain!("abbe: {run}");
    }
    for run in reports::circular::refused(&tests.circles) {
        complain!("abbe: not evaluated: {run}");
    }
}

/// Nothing is known of the machine of a table; a map states where it was measured.
fn forget_machine(tests: &mut Tests, has_map: bool) {
    tests.machine = None;
    if !has_map {
        let linear = tests.linear.iter_mut();
        linear.for_each(|test| test.place_mm = None);
    }
    tests.left_out.clear();
}

/// Reports cells of a table that are no values.
fn complain_of_odd(table: &Path, n_odd: usize) {
    if n_odd > 0 {
        let shown = table.display();
        complain!("abbe: {shown}: {n_odd} cells hold no value of their column and are left out");
    }
}

impl ReportBag {
    /// Evaluates the bag; exit code 3 when a part of it was lost or left out, or a circle has an outlier.
    ///
    /// # Errors
    /// When bag or budget cannot be read, or the page not written.
    pub fn execute(self) -> Result<ExitCode> {
        self.check_outputs()?;
        let budget = self.budget.as_deref().map(Budget::open).transpose()?;
        let limits = self.limits.as_deref().map(alarms::read).transpose()?;
        complain!("Evaluating the tests of {}", self.bag.display());
        folder::check(&self.bag, "report")?;
        let table = from_table::of(&self.bag, self.map.as_deref())?;
        let bag = Bag::open(table.as_ref().map_or(&self.bag, |table| &table.bag))?;
        machines::check(bag.topics()).with_context(|| self.bag.display().to_string())?;
        let mut tests = Tests::of(&bag);
        if table.is_some() {
            forget_machine(&mut tests, self.map.is_some());
        }
        complain_of(&tests);
        complain_of_odd(&self.bag, table.as_ref().map_or(0, |table| table.n_odd));
        let title = match &table {
            // The folders of a table are no part of its name.
            Some(_) => format!("Tests in the table {}", file_name(&self.bag)),
            None => title_of(&tests, &self.bag),
        };
        let (mut report, alarms) = self.judged(&title, &tests, budget.as_ref(), limits)?;
        if let Some(table) = &table {
            report.begin_with_table(&table.lines);
            report.state_shortcomings(None, table.warnings());
        }
        let machine = tests.machine.as_ref().map(|machine| machine.name.as_str());
        let mut made = Made::of(
            SOFTWARE,
            &bag,
            &self.bag.display().to_string(),
            machine,
            tests.conditions.nanos(),
        );
        if table.is_some() {
            // The bag of a table has a machine file that nobody stated.
            made.machine = None;
        }
        report.made(made);
        self.identify(&mut report, &bag, table.is_some())?;
        let page = self.out.as_ref().map(|out| out.join("report.html"));
        if self.json {
            tell!("{}", serde_json::to_string_pretty(&report.figures)?);
        } else if self.full {
            tell!("{}", report.terminal());
        } else {
            tell!("{}", report.short(&Room::with_page(page.as_deref())));
        }
        if let Some(out) = &self.out {
            std::fs::create_dir_all(out).with_context(|| format!("folder {}", out.display()))?;
            report.write(out)?;
        }
        let kept = self.print_and_keep(
            &report,
            &tests,
            table.as_ref().map(|table| table.bag.as_path()),
        );
        let is_whole = is_whole(&tests, &report) && table.is_none_or(|table| table.is_whole());
        alarms::ended(alarms.as_ref(), kept, loss::exit_code(is_whole))
    }

    /// The page with the figures judged by their limits, and those that are kept as alarms.
    fn judged(
        &self,
        title: &str,
        tests: &Tests,
        budget: Option<&Budget>,
        limits: Option<Limits>,
    ) -> Result<(Report, Option<Alarms>)> {
        let machine = tests.machine.as_ref().map(|machine| machine.name.as_str());
        let machine = self.keep.kept_as().or(machine);
        let own = limits.clone().map(|limits| limits.of_machine(machine));
        let mut report = judged_page(title, tests, budget, own.as_ref())?;
        let Some(limits) = limits.filter(|_| self.keep.is_wanted()) else {
            return Ok((report, None));
        };
        let of = (machine, tests.conditions.nanos(), self.bag.as_path());
        let alarms = self.keep.judge_report(limits, &report.figures, of)?;
        alarms.add_to(&mut report);
        Ok((report, Some(alarms)))
    }

    /// Refuses outputs over inputs and over what is no page, before the work begins.
    fn check_outputs(&self) -> Result<()> {
        let of_folder = self.out.iter().flat_map(|out| {
            [("report.html", Form::Html), ("report.json", Form::Json)]
                .map(|(name, form)| Output::new("--out", out.join(name), form))
        });
        let pdf = self.pdf.iter();
        let pdf = pdf.map(|path| Output::new("--pdf", path.clone(), Form::Pdf));
        let outputs: Vec<Output> = of_folder.chain(pdf).collect();
        let files = [&self.map, &self.budget, &self.limits];
        let files = files.into_iter().filter_map(|file| file.as_deref());
        let inputs = files.chain([self.bag.as_path()]).chain(self.keep.store());
        check_outputs(&outputs, inputs)
    }

    /// States by which SHA-256 a history recognises the bag or table, where the figures are written.
    fn identify(&self, report: &mut Report, bag: &Bag, is_table: bool) -> Result<()> {
        if self.json || self.out.is_some() {
            let sha256 = if is_table {
                Origin::of_text(&text_file::bytes(&self.bag)?, &self.bag).sha256
            } else {
                bags::hash(bag)?
            };
            report.figures["made"]["input_sha256"] = sha256.into();
        }
        Ok(())
    }

    /// The page as a PDF, and its figures in the history, where that is wanted; `of_table`: the bag that a table was made into.
    fn print_and_keep(
        &self,
        report: &Report,
        tests: &Tests,
        of_table: Option<&Path>,
    ) -> Result<()> {
        if let Some(path) = &self.pdf {
            let machine = tests.machine.as_ref().map(|machine| machine.name.as_str());
            let head = pdf::Head::of(machine, &report.figures["conditions"]);
            pdf::write(path, &report.html(), &head)?;
        }
        if self.keep.is_wanted() {
            let origin = match of_table {
                Some(bag) => Origin::of_table(bag, &self.bag)?,
                None => Origin::of_bag(&self.bag, &self.bag, true)?,
            };
            self.keep.report(&report.figures, origin)?;
        }
        Ok(())
    }
}

/// The title of a page of tests: the machine, whose path is among the data below it.
fn title_of(tests: &Tests, bag: &Path) -> String {
    match tests.machine.as_ref().map(|machine| machine.name.as_str()) {
        Some(name) if !name.is_empty() => format!("Tests of {name}"),
        _ => format!("Tests in {}", bag.display()),
    }
}

/// Name of a file without its folders.
fn file_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str());
    name.to_string_lossy().into_owned()
}

/// More parts of detail than these stand behind one title.
const MOST_DETAILS: usize = 4;

/// The page of everything that `tests` hold.
///
/// # Errors
/// When a plot cannot be drawn.
pub fn page(title: &str, tests: &Tests, budget: Option<&Budget>) -> Result<Report> {
    judged_page(title, tests, budget, None)
}

/// The same with the figures judged by their limits.
fn judged_page(
    title: &str,
    tests: &Tests,
    budget: Option<&Budget>,
    limits: Option<&Limits>,
) -> Result<Report> {
    budget.map_or(Ok(()), |budget| budget.check_tests(tests))?;
    let conditions = reports::test_conditions::of(&tests.conditions, budget, Some(tests));
    let defaults = machine_defaults::of_tests(tests);
    let defaults_line = machine_defaults::in_words(&defaults);
    let mut sections = sections(tests, budget)?;
    let lines = lines_of(tests, sections.is_empty());
    let is_bad = !tests.is_whole();
    let all = sections.iter().map(|section| section.figures.clone());
    let mut figures: Vec<serde_json::Value> = all.filter(|figures| !figures.is_null()).collect();
    if budget.is_none() {
        figures.iter_mut().for_each(unstate);
    }
    let judge = |limits: &Limits| judged_by(limits, &figures, &conditions.section.figures);
    let judged = limits.map(judge).transpose()?;
    let conformance = judged.as_ref().map(|section| section.figures.clone());
    let far = far(&sections);
    let screen = first_screen::of(tests, &sections, judged.as_ref(), budget.is_some());
    sections.extend(judged);
    Ok(Report {
        title: title.to_owned(),
        screen: Screen {
            behind: vec![conditions.section.html()],
            conditions: conditions.facts.clone(),
            ..screen
        },
        parts: terminal::apart(
            std::iter::once(Part::plain(conditions.terminal()))
                .chain(sections.iter().map(Part::of)),
        ),
        body: body((&lines, is_bad, defaults_line.as_deref()), &sections),
        figures: serde_json::json!({
            "title": title,
            "loss": loss::as_json(&tests.reading),
            "leaps": loss::leaps_as_json(&tests.reading.leaps),
            "account": loss::account_as_json(&tests.reading.account),
            "uncertainty": uncertainty(budget.is_some()),
            "conditions": conditions.section.figures,
            "machine_defaults": defaults,
            "not_completed": not_completed(&tests.broken_off),
            "not_evaluated": not_evaluated(&tests.not_evaluated, &sections),
            "far_from_the_others": far,
            "tests": figures,
            "conformance": conformance,
        }),
        lines: lines.into_iter().chain(defaults_line).collect(),
    })
}

/// What stands below the first screen: sentences on the whole, then the parts, those of detail last.
fn body(
    (lines, is_bad, defaults): (&[String], bool, Option<&str>),
    sections: &[Section],
) -> Markup {
    let (mut ordered, details): (Vec<&Section>, Vec<&Section>) = sections
        .iter()
        .partition(|section| section.rank < Rank::Detail);
    ordered.sort_by_key(|section| section.rank);
    html! {
        @for line in lines { p.bad[is_bad] { (line) } }
        @if let Some(line) = defaults { p { (line) } }
        @for section in &ordered { (section.html()) }
        @if details.len() > MOST_DETAILS {
            (fold_details(details.len(), &html! {
                @for section in &details { (section.html()) }
            }))
        } @else {
            @for section in &details { (section.html()) }
        }
    }
}

/// Whether nothing was lost or left out, and every test that was measured has a figure.
pub fn is_whole(tests: &Tests, report: &Report) -> bool {
    tests.is_whole() && is_evaluated(report)
}

/// Whether every test that was measured has a figure.
fn is_evaluated(report: &Report) -> bool {
    let without = report.figures["not_evaluated"].as_array();
    without.is_none_or(Vec::is_empty)
}

/// What was lost, broken off or not evaluated, in words.
fn lines_of(tests: &Tests, is_empty: bool) -> Vec<String> {
    let mut lines = loss::in_words(&tests.reading);
    lines.extend(tests.broken_off.iter().map(ToString::to_string));
    let n = tests.not_evaluated.len() + tests.broken_off.len();
    if n > 0 {
        lines.push(format!(
            "NOT WHOLE: runs that were measured and are not evaluated: {n}."
        ));
    }
    lines.extend(tests.not_evaluated.iter().map(ToString::to_string));
    if is_empty {
        lines.push("The bag holds no test that can be evaluated.".to_owned());
    }
    lines
}

/// The decisions on figures that were measured under these conditions.
fn judged_by(
    limits: &Limits,
    figures: &[serde_json::Value],
    conditions: &serde_json::Value,
) -> Result<Section> {
    let mut section = limits.section(figures)?;
    state_traceability(&mut section, conditions);
    Ok(section)
}

/// The runs that the machine did not complete, for machines.
fn not_completed(runs: &[BrokenOff]) -> serde_json::Value {
    let row = |it: &BrokenOff| serde_json::json!({ "run": it.run, "test": it.test, "reason": BrokenOff::REASON });
    runs.iter().map(row).collect()
}

/// The readings and touches that are far from the others and are in the figures, for machines.
fn far(sections: &[Section]) -> Vec<serde_json::Value> {
    let of_section = |section: &Section| {
        let named = section.warnings.iter().filter(|it| it.kind == FAR);
        let row = |line: &str| serde_json::json!({ "test": section.title, "what": line });
        let rows: Vec<serde_json::Value> = named.map(|it| row(&it.line)).collect();
        rows
    };
    sections.iter().flat_map(of_section).collect()
}

/// The runs, and the tests of several runs, that were measured and have no figure, for machines.
fn not_evaluated(runs: &[NotEvaluated], sections: &[Section]) -> serde_json::Value {
    let row = |it: &NotEvaluated| serde_json::json!({ "run": it.run, "test": it.test, "reason": it.reason });
    let of_section = |section: &Section| {
        let reason = section.unevaluated.as_ref()?;
        Some(serde_json::json!({ "run": null, "test": section.title, "reason": reason }))
    };
    let runs = runs.iter().map(row);
    runs.chain(sections.iter().filter_map(of_section)).collect()
}

fn uncertainty(stated: bool) -> serde_json::Value {
    if stated {
        serde_json::json!({ "stated": true })
    } else {
        serde_json::json!({
            "stated": false,
            "reason": "no budget was given (--budget): the expanded uncertainties of ISO 230-2, 230-4 and 230-6 are null; standard uncertainties are those of fits, which need none",
        })
    }
}

fn sections(tests: &Tests, budget: Option<&Budget>) -> Result<Vec<Section>> {
    let mut sections = reports::positioning::sections(tests, budget)?;
    sections.extend(reports::periodic::section(tests, budget));
    sections.extend(reports::angular::sections(tests, budget)?);
    sections.extend(reports::stops::section(
        &tests.stops,
        tests.machine.as_ref(),
    ));
    sections.extend(reports::geometry::tables(&tests.tables));
    sections.extend(reports::circular::sections(
        &tests.circles,
        budget,
        &tests.conditions,
    )?);
    sections.extend(reports::paths::section(&tests.paths)?);
    for circle in &tests.station_circles {
        sections.extend(reports::published::sections(
            circle,
            tests.geometry.as_ref(),
        ));
    }
    for (name, model) in [
        ("Geometric errors of the linear axes", &tests.geometry),
        ("Geometric errors of the rotary axes", &tests.rotary),
    ] {
        sections.extend(model.as_ref().map(|model| {
            let mut section = reports::geometry::section(name, model);
            reports::lines::state(&mut section, tests, model);
            section
        }));
    }
    sections.extend(reports::probing::sections(tests, budget));
    sections.extend(reports::drift::sections(
        &tests.blocks,
        (&tests.drift, &tests.conditions),
        budget,
    )?);
    Ok(sections)
}

#[cfg(test)]
mod tables;

#[cfg(test)]
mod tests {
    use recorder::{Loss, LossReason};
    use replayer::Reading;

    use super::*;

    fn cut() -> Loss {
        Loss {
            file: "bag_0.mcap".into(),
            at_byte: 4000,
            reason: LossReason::Cut {
                opcode: 6,
                end_byte: 4096,
            },
            messages_read: 17,
        }
    }

    #[test]
    fn a_bag_that_was_cut_is_marked_at_the_head_of_every_form() {
        let tests = Tests {
            reading: Reading {
                losses: vec![cut()],
                ..Reading::default()
            },
            ..Tests::default()
        };
        let report = page("Tests in bag", &tests, None).unwrap();
        let terminal = report.terminal();
        let head: Vec<&str> = terminal.lines().skip(2).take(2).collect();
        assert!(head[0].starts_with("NOT WHOLE: "), "{terminal}");
        let place = "bag_0.mcap, byte 4000: the file was read up to its end at byte 4096";
        assert!(head[1].contains(place), "{terminal}");
        assert!(head[1].contains("what followed is unknown"), "{terminal}");
        let html = report.body.into_string();
        assert!(html.contains("<p class=\"bad\">NOT WHOLE"), "{html}");
        let place = &report.figures["loss"]["places"][0];
        assert_eq!(place["at_byte"], 4000);
        assert_eq!(place["messages_read_before"], 17);
        let whole = page("", &Tests::default(), None).unwrap();
        assert!(whole.figures["loss"].is_null());
        assert!(!whole.terminal().contains("NOT WHOLE"));
    }

    #[test]
    fn what_is_far_from_the_others_is_in_the_json_with_its_test() {
        let mut section = Section::new("Probing errors");
        assert!(far(std::slice::from_ref(&section)).is_empty());
        section.name_far(&["touch 16 of 25 makes the form error 283.67 µm".to_owned()]);
        section.warn("Left out", "Left out: run 2.".to_owned());
        let wanted = serde_json::json!({
            "test": "Probing errors",
            "what": "Touch 16 of 25 makes the form error 283.67 µm.",
        });
        assert_eq!(far(&[section]), [wanted]);
    }

    #[test]
    fn without_a_budget_no_figure_has_an_expanded_uncertainty() {
        let mut figures = serde_json::json!({
            "a": {"value_mm": 0.1, "expanded_uncertainty_mm": 0.0},
            "b": [{"expanded_uncertainty_rad": 0.0, "standard_uncertainty_mm": 0.2}],
        });
        unstate(&mut figures);
        let expected = serde_json::json!({
            "a": {"value_mm": 0.1, "expanded_uncertainty_mm": null},
            "b": [{"expanded_uncertainty_rad": null, "standard_uncertainty_mm": 0.2}],
        });
        assert_eq!(figures, expected);
        let report = page("", &Tests::default(), None).unwrap();
        assert_eq!(report.figures["uncertainty"]["stated"], false);
        let reason = report.figures["uncertainty"]["reason"].as_str().unwrap();
        assert!(reason.contains("--budget"), "{reason}");
        assert!(reason.contains("ISO 230-2, 230-4 and 230-6"), "{reason}");
        assert!(reason.contains("those of fits"), "{reason}");
    }
}
