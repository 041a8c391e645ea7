//! `abbe history [MACHINE]`: which view is shown, and in which form.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Result, anyhow, bail};
use clap::Args;
use history::{Limit, Options, Series, SeriesKey, Side, Store, Window};
use maud::html;
use metrology::number::number;
use reports::loss;
use reports::page::figure;
use reports::screen::{Screen, Tone};
use reports::section::{Section, capitalised};
use reports::whole_file::{self, Form, Output, check_outputs};
use serde_json::{Value, json};

use super::alarms::{self, Alarms};
use super::dates::{Moment, moment, time};
use super::{machines, overview, single, store_path};
use crate::tell::tell;
use crate::usage::{above_zero, refused};

/// Most figures whose trends are shown at once.
const MOST_TRENDS: usize = 20;
/// Most names that an error lists.
const MOST_FIGURE_NAMES: usize = 20;

/// Arguments of `abbe history` without `add`.
#[derive(Args)]
pub struct View {
    /// Name of the machine; without it all machines are listed, or compared by `--figure` or `--effect`.
    machine: Option<String>,
    /// Figure whose trend is shown, such as `iso230_2.accuracy`, or the begin of its name before a dot.
    #[arg(long)]
    figure: Option<String>,
    /// Effect of diagnoses whose trend is shown, such as `backlash`.
    #[arg(long, conflicts_with = "figure")]
    effect: Option<String>,
    /// Axis of the effect.
    #[arg(long, requires = "effect")]
    axis: Option<String>,
    /// Only tests whose title has this text.
    #[arg(long)]
    test: Option<String>,
    /// Only values from this date on: 2026-03-01 or 2026-03-01T12:00:00Z.
    #[arg(long, value_parser = moment)]
    since: Option<Moment>,
    /// Only values up to this date.
    #[arg(long, value_parser = moment)]
    until: Option<Moment>,
    /// Show the changes between two dates.
    #[arg(long, num_args = 2, value_names = ["DATE", "DATE"], value_parser = moment, requires = "machine")]
    between: Vec<Moment>,
    /// Limit that the figure must not rise above, in the unit that is shown.
    #[arg(long, allow_negative_numbers = true, value_parser = finite)]
    upper: Option<f64>,
    /// Limit that the figure must not fall below, in the unit that is shown.
    #[arg(long, allow_negative_numbers = true, value_parser = finite)]
    lower: Option<f64>,
    /// Limits that the last values are held against (limits.yaml): exit code 4 and an alarm for each that exceeds its own.
    #[arg(long, value_name = "FILE", conflicts_with = "between")]
    limits: Option<PathBuf>,
    /// Days after which each test is due again; without it the machine's own usual interval.
    #[arg(long, value_name = "DAYS", value_parser = above_zero)]
    every_days: Option<f64>,
    /// Print JSON instead of text.
    #[arg(long, conflicts_with = "csv")]
    json: bool,
    /// Print a table of the values (csv) instead of text.
    #[arg(long)]
    csv: bool,
    /// Write the page as one HTML file.
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// The history: a file, or `postgres://USER@HOST/DATABASE`; without it `~/.local/share/abbe/history.sqlite`.
    #[arg(long, value_name = "STORE")]
    store: Option<PathBuf>,
}

/// A view before it is laid out.
pub struct Page {
    /// Title.
    pub title: String,
    /// Its parts.
    pub sections: Vec<Section>,
    /// Its values for a table.
    pub values: Vec<Line>,
    /// Its content for machines.
    pub json: Value,
}

/// A value in a table: series, point, status and source.
pub struct Line {
    /// The series.
    pub series: Series,
    /// The value.
    pub point: history::Point,
    /// Status of a cause.
    pub status: String,
    /// Path of the bag or report; empty: not listed.
    pub source: String,
}

/// A finite number.
fn finite(text: &str) -> Result<f64, &'static str> {
    let number = text.parse().ok();
    number
        .filter(|number: &f64| number.is_finite())
        .ok_or("must be a finite number")
}

impl View {
    /// Shows the view.
    ///
    /// # Errors
    /// When the store cannot be read, nothing matches, or too much does.
    pub fn execute(self) -> Result<ExitCode> {
        if let Some(reason) = self.without_effect() {
            return Err(refused("history", reason));
        }
        let path = store_path(self.store.as_deref())?;
        let html = self.html.iter();
        let html = html.map(|page| Output::new("--html", page.clone(), Form::Html));
        let inputs = self.limits.iter().map(PathBuf::as_path);
        let inputs = inputs.chain([path.as_path()]);
        check_outputs(&html.collect::<Vec<_>>(), inputs)?;
        let store = Store::open_to_read(&path, Options::default())?;
        if let Some(machine) = &self.machine {
            is_there(&store, machine)?;
        }
        let mut page = self.page(&store)?;
        let alarms = self.alarms(&store)?;
        if let Some(alarms) = &alarms {
            page.sections.insert(0, alarms.section());
            page.json["alarms"] = alarms.json();
        }
        if self.json {
            tell!("{}", serde_json::to_string_pretty(&page.json)?);
        } else if self.csv {
            tell!("{}", table(&page.values)?.trim_end());
        } else {
            let parts: Vec<String> = page.sections.iter().map(Section::terminal).collect();
            tell!("{}\n\n{}", page.title, parts.join("\n").trim_end());
        }
        if let Some(path) = &self.html {
            let body = html! {
                (screen(&page.sections).html(&page.title))
                @for section in &page.sections { (section.html()) }
            };
            whole_file::write(path, &reports::html(&page.title, &body))?;
        }
        let Some(alarms) = alarms else {
            return Ok(ExitCode::SUCCESS);
        };
        alarms.raise()?;
        Ok(alarms.code(loss::exit_code(alarms.is_whole())))
    }

    /// The last values beside their limits, where there are limits.
    fn alarms(&self, store: &Store) -> Result<Option<Alarms>> {
        let Some(path) = &self.limits else {
            return Ok(None);
        };
        let limits = alarms::read(path)?;
        Alarms::of_store(limits, store, &self.key(), self.window()).map(Some)
    }

    /// Why an option would have no effect, or nothing could be shown; `None`: each has one.
    fn without_effect(&self) -> Option<String> {
        let (has_machine, has_name) = (self.machine.is_some(), self.name().is_some());
        let has_between = !self.between.is_empty();
        let has_limit = self.upper.is_some() || self.lower.is_some();
        let has_window = self.since.is_some() || self.until.is_some();
        let reason = if has_limit && !has_name {
            "--upper and --lower: name the figure that they limit with --figure or --effect"
        } else if has_limit && (!has_machine || has_between) {
            "--upper and --lower: they limit the trend of one machine: name the machine, without --between"
        } else if self.every_days.is_some() && (!has_machine || has_name || has_between) {
            "--every-days: it is for the overview of one machine: name the machine, without --figure, --effect and --between"
        } else if has_window && has_between {
            "--since and --until: --between has its own dates: leave out one of them"
        } else if has_window && !has_machine && !has_name && self.limits.is_none() {
            "--since and --until: the list of machines has no dates to choose: name a machine, --figure or --effect"
        } else if self.test.is_some() && !has_machine && !has_name && self.limits.is_none() {
            "--test: the list of machines has no tests to choose: name a machine, --figure or --effect"
        } else {
            return self.reversed();
        };
        Some(reason.to_owned())
    }

    /// Two ends in the wrong order.
    fn reversed(&self) -> Option<String> {
        let dates = self.since.zip(self.until);
        if let Some((since, until)) = dates.filter(|(since, until)| since.begin_s > until.end_s) {
            return Some(format!(
                "--since {} is later than --until {}: no value lies between them; exchange them",
                time(since.begin_s as f64),
                time(until.end_s as f64)
            ));
        }
        let limits = self.upper.zip(self.lower);
        let (upper, lower) = limits.filter(|(upper, lower)| upper < lower)?;
        Some(format!(
            "--upper {} is below --lower {}: no value is within them; exchange them",
            number(upper),
            number(lower)
        ))
    }

    fn page(&self, store: &Store) -> Result<Page> {
        let key = self.key();
        match (&self.machine, self.name()) {
            (None, None) => machines::list(store),
            (None, Some(name)) => machines::compare(store, &key, &name, self.window()),
            (Some(machine), _) if !self.between.is_empty() => {
                overview::changes(store, machine, &key, [self.between[0], self.between[1]])
            }
            (Some(machine), None) => {
                overview::of(store, machine, &key, self.every_days, self.window())
            }
            (Some(machine), Some(name)) => self.trends(store, machine, &name, &key),
        }
    }

    /// Name of the figure, or its begin.
    fn name(&self) -> Option<String> {
        let effect = self
            .effect
            .as_ref()
            .map(|effect| format!("effect.{effect}"));
        self.figure.clone().or(effect)
    }

    fn key(&self) -> SeriesKey {
        SeriesKey {
            machine: self.machine.clone(),
            name: self.name(),
            axis: self.axis.clone(),
            test: self.test.clone(),
        }
    }

    fn window(&self) -> Window {
        Window {
            since_s: self.since.map_or(i64::MIN, |moment| moment.begin_s),
            until_s: self.until.map_or(i64::MAX, |moment| moment.end_s),
        }
    }

    fn limits(&self) -> Vec<Limit> {
        let of = |value: Option<f64>, side| value.map(|value| Limit { value, side });
        let both = [of(self.upper, Side::Upper), of(self.lower, Side::Lower)];
        both.into_iter().flatten().collect()
    }

    fn trends(&self, store: &Store, machine: &str, name: &str, key: &SeriesKey) -> Result<Page> {
        let mut all = store.series(key)?;
        all.sort_by_key(|series| is_form(&series.name));
        if all.is_empty() {
            bail!("{}", nothing(store, machine, name)?);
        }
        if all.len() > MOST_TRENDS {
            bail!(
                "{name}: {} figures match, at most {MOST_TRENDS} are shown at once: choose one with --figure, --axis or --test",
                all.len()
            );
        }
        let limits = self.limits();
        let mut page = Page {
            title: format!("History of {machine}: {name}"),
            sections: Vec::new(),
            values: Vec::new(),
            json: json!({ "schema": SCHEMA, "machine": machine, "series": [] }),
        };
        for series in all {
            let (section, json, values) = single::of(store, &series, self.window(), &limits)?;
            page.sections.push(section);
            page.values.extend(values);
            if let Some(list) = page.json["series"].as_array_mut() {
                list.push(json);
            }
        }
        Ok(page)
    }
}

/// Whether a figure is a height of an effect's free form, which says little beside the effect's size.
fn is_form(name: &str) -> bool {
    name.starts_with("effect.") && name.contains(".free_")
}

/// The first screen: what decides, the last values, and the first plot.
fn screen(sections: &[Section]) -> Screen {
    let answered = sections
        .iter()
        .find_map(|section| Some((section, section.answers.first()?)));
    let drawn = sections
        .iter()
        .find_map(|section| Some((section, section.drawings.first()?)));
    Screen {
        verdict: answered.map(|(section, answer)| {
            let sentence = format!("{}: {answer}", section.title);
            (capitalised(&sentence), Tone::Plain)
        }),
        tiles: { sections.iter() }
            .filter_map(|section| section.tile.clone())
            .collect(),
        picture: drawn.map(|(section, drawing)| {
            let caption = format!("{}. {}", section.title, drawing.caption);
            figure(&drawing.svg, &caption)
        }),
        ..Screen::default()
    }
}

/// Name and version of the JSON.
pub const SCHEMA: &str = "abbe.history/1";

/// Refuses a machine that the store does not have.
fn is_there(store: &Store, machine: &str) -> Result<()> {
    let all = store.machines()?;
    if all.iter().any(|known| known.machine == machine) {
        return Ok(());
    }
    let names: Vec<&str> = all.iter().map(|known| known.machine.as_str()).collect();
    bail!(
        "{machine}: the history has no such machine, but {}",
        few(&names)
    );
}

/// Why no figure of this name is shown.
fn nothing(store: &Store, machine: &str, name: &str) -> Result<String> {
    let of_machine = SeriesKey {
        machine: Some(machine.to_owned()),
        ..SeriesKey::default()
    };
    let all = store.series(&of_machine)?;
    let mut names: Vec<&str> = all.iter().map(|series| series.name.as_str()).collect();
    names.dedup();
    Ok(format!(
        "{name}: {machine} has no such figure with this axis and test, but {}",
        few(&names)
    ))
}

/// The first names of a list, and how many more there are.
fn few(names: &[&str]) -> String {
    if names.is_empty() {
        return "none at all".to_owned();
    }
    let listed = names
        .iter()
        .take(MOST_FIGURE_NAMES)
        .copied()
        .collect::<Vec<_>>()
        .join(", ");
    let more = names.len().saturating_sub(MOST_FIGURE_NAMES);
    if more > 0 {
        format!("{listed} and {more} more")
    } else {
        listed
    }
}

/// Values as a table, in the units in which they are kept.
fn table(values: &[Line]) -> Result<String> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record([
        "machine",
        "test",
        "figure",
        "axis",
        "time",
        "value",
        "standard_uncertainty",
        "unit",
        "status",
        "source",
    ])?;
    for Line {
        series,
        point,
        status,
        source,
    } in values
    {
        let uncertainty = point.standard_uncertainty.map(|u| u.to_string());
        writer.write_record([
            &series.machine,
            &series.test,
            &series.name,
            &series.axis,
            &time(point.at_s),
            &point.value.to_string(),
            &uncertainty.unwrap_or_default(),
            &series.unit,
            status,
            source,
        ])?;
    }
    let bytes = writer.into_inner().map_err(|error| anyhow!("{error}"))?;
    Ok(String::from_utf8(bytes)?)
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct CommandLine {
        #[command(flatten)]
        view: View,
    }

    #[test]
    fn the_size_of_an_effect_stands_before_its_form() {
        let mut names = [
            "effect.backlash.free_0p01mm_um",
            "effect.backlash.width_um",
            "iso230_2.free_figure",
        ];
        names.sort_by_key(|name| is_form(name));
        assert_eq!(names[2], "effect.backlash.free_0p01mm_um");
    }

    fn said(words: &[&str]) -> Option<String> {
        let line = ["history"].iter().chain(words);
        CommandLine::try_parse_from(line)
            .unwrap()
            .view
            .without_effect()
    }

    #[test]
    fn an_option_without_effect_is_refused_by_its_name() {
        for (words, option) in [
            (&["--every-days", "5"][..], "--every-days"),
            (
                &["m", "--figure", "f", "--every-days", "5"][..],
                "--every-days",
            ),
            (&["m", "--upper", "5"][..], "--upper"),
            (&["--figure", "f", "--upper", "5"][..], "--upper"),
            (&["--since", "2026-01-01"][..], "--since"),
            (&["--test", "t"][..], "--test"),
            (
                &[
                    "m",
                    "--between",
                    "2026-01-01",
                    "2026-02-01",
                    "--until",
                    "2026-01-09",
                ][..],
                "--until",
            ),
            (
                &["m", "--since", "2026-06-30", "--until", "2026-01-01"][..],
                "--since 2026-06-30T00:00:00Z is later than --until 2026-01-01T23:59:59Z",
            ),
            (
                &["m", "--figure", "f", "--upper", "1", "--lower", "2"][..],
                "--upper 1 is below --lower 2",
            ),
        ] {
            let said = said(words).unwrap_or_default();
            assert!(said.contains(option), "{words:?}: {said:?}");
        }
        for words in [
            &[][..],
            &["m", "--every-days", "5"],
            &["m", "--figure", "f", "--upper", "2", "--lower", "2"],
            &["--figure", "f", "--since", "2026-01-01"],
            &["m", "--since", "2026-01-01", "--until", "2026-01-01"],
        ] {
            assert_eq!(said(words), None, "{words:?}");
        }
    }
}
