//! `abbe export BAG --format CONTROL`: what a bag knew last of a machine's errors, as tables for a control.

use node_runtime::complain;
use reports::evaluate::Tests;
use reports::evaluate::budget::Budget;
use reports::loss;
use reports::whole_file;

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use control_tables::selection::{Selected, Wanted, select};
use control_tables::{ExportFile, Travels, Unestimable};
use metrology::{Axis, AxisSet, PerAxis};
use recorder::Bag;
use replayer::machines;

use crate::tell::tell;
use crate::usage::{USAGE, above_zero, refused};

mod counting;
mod effect;
mod found;
mod origin;
mod references;
mod set_up;
mod temperature;
mod travel;

use counting::Counting;
use found::{Found, looked_for, read, tables_of_stops};
use origin::{Origin, THERMAL, Which};
use set_up::{SetUp, inner, of_axis, once_and_exported};

/// Controls that tables are made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    /// LinuxCNC: screw compensation files, one for each axis.
    Linuxcnc,
    /// SINUMERIK 840D sl / 828D: leadscrew, cross-axis and temperature compensation.
    Sinumerik,
    /// HEIDENHAIN: compensation-value tables (.COM), one for each axis.
    Heidenhain,
    /// FANUC: stored pitch error compensation, whole pulses.
    Fanuc,
    /// A plain table of everything that is known, for other programs and for people.
    Csv,
    /// Rexroth IndraMotion MTX: refused, no documentation of its tables was found; take csv.
    Mtx,
}

/// Why nothing is written for Rexroth IndraMotion MTX.
const NO_MTX: &str = "--format mtx is not written: of the manuals of Rexroth IndraMotion MTX only title pages and tables of contents were found \
     (functional description DOK-MTX***-NC*FUNC, R911320243), none that gives the format, the unit or the sign of its axis correction. \
     Take --format csv, which has every error and compensation, and enter them by the manual of your control";

/// Every format with what it is, a line each.
fn formats() -> String {
    let line = |format: &Format| {
        let value = format.to_possible_value()?;
        let help = value.get_help().map(ToString::to_string);
        Some(format!(
            "  {:<12}{}",
            value.get_name(),
            help.unwrap_or_default()
        ))
    };
    let lines: Vec<String> = Format::value_variants().iter().filter_map(line).collect();
    lines.join("\n")
}

impl Format {
    /// As the command line has it.
    fn name(self) -> &'static str {
        match self {
            Self::Linuxcnc => "linuxcnc",
            Self::Sinumerik => "sinumerik",
            Self::Heidenhain => "heidenhain",
            Self::Fanuc => "fanuc",
            Self::Csv => "csv",
            Self::Mtx => "mtx",
        }
    }
}

/// A position of an axis, mm or deg.
fn position(text: &str) -> Result<(Axis, f64), String> {
    let (axis, value) = of_axis::<f64>(text, "a number")?;
    if value.is_finite() {
        Ok((axis, value))
    } else {
        Err("must be finite".to_owned())
    }
}

/// Arguments of `abbe export`.
#[derive(Clone, Args)]
pub struct Export {
    /// Folder of the bag, or one of its files.
    bag: PathBuf,
    /// The control that the tables are for; must be given.
    #[arg(long, value_enum)]
    format: Option<Format>,
    /// Axes; none: every axis that the bag knows something of.
    #[arg(long)]
    axis: Vec<Axis>,
    /// Folder to write the files into; existing files are not overwritten.
    #[arg(long, default_value = "export")]
    out: PathBuf,
    /// Spacing of the points of linear axes, mm; without it 20.
    #[arg(long, allow_negative_numbers = true, value_parser = above_zero)]
    spacing_mm: Option<f64>,
    /// Spacing of the points of rotary axes, deg; without it 15.
    #[arg(long, allow_negative_numbers = true, value_parser = above_zero)]
    spacing_deg: Option<f64>,
    /// Reference point of an axis such as X=-300, mm or deg; others: 0.
    #[arg(long, value_parser = position)]
    reference: Vec<(Axis, f64)>,
    /// Keep the error at the reference point instead of counting from it.
    #[arg(long)]
    absolute: bool,
    /// Which table of an axis that was refreshed while it worked; without it the last.
    #[arg(long, value_enum)]
    table: Option<Which>,
    /// Where no positioning run gave a table, make one of the stops of a verification along one axis, as its scale or the control read them.
    #[arg(long)]
    stops: bool,
    /// What is known about the measurements, as `abbe report` takes it: tables of a laser's runs are corrected to 20 °C by it.
    #[arg(long)]
    budget: Option<PathBuf>,
    /// Use components although the recordings do not determine them by themselves.
    #[arg(long)]
    accept_unestimable: bool,
    #[command(flatten)]
    set_up: SetUp,
}

impl Export {
    /// Exit code 0: every file is written; 1: there was nothing to write, or it failed; 3: written, but a part of the bag was lost or left out, or an
    /// error that no machine has was refused.
    ///
    /// # Errors
    /// The bag cannot be read, a file cannot be written, or a named reference point is beyond the errors (exit code 2).
    #[expect(clippy::too_many_lines, reason = "one case after another")]
    pub fn execute(self) -> Result<ExitCode> {
        let Some(format) = self.format else {
            complain!("abbe: --format is missing; the formats are:\n{}", formats());
            return Ok(ExitCode::from(USAGE));
        };
        self.check(format)
            .map_err(|reason| refused("export", reason))?;
        let budget = self.budget.as_deref().map(Budget::open).transpose()?;
        let bag = Bag::open(&self.bag)?;
        machines::check(bag.topics()).with_context(|| self.bag.display().to_string())?;
        let Found {
            mut measured,
            reading,
            topics,
            mut origin,
        } = read(&bag, self.table.unwrap_or_default());
        let mut losses = reading.lines();
        if self.stops || references::are_in(&bag) {
            let tests = Tests::of(&bag);
            let more = tests.reading.lines().into_iter();
            losses.extend(more.filter(|line| !reading.lines().contains(line)));
            if let Some(budget) = &budget {
                budget.check_tests(&tests)?;
            }
            origin.of_references = references::tables(&tests, budget.as_ref(), &mut measured);
            if self.stops {
                origin.of_stops = tables_of_stops(&tests.stops, &mut measured);
            }
        }
        let wanted = self.wanted(travel::of(&bag, &mut losses));
        let selected = select(&measured, &wanted, &self.set_up.control(format));
        let mut without_effect = self.without_effect(format, &origin);
        without_effect.extend(effect::without_effect(
            &self,
            format,
            (&measured, &wanted.travels),
            &selected,
        ));
        let left_out: Vec<String> = selected
            .left_out
            .iter()
            .map(|left| format!("left out: {}: {}", left.what, left.why))
            .collect();
        let said = selected.left_out.iter().zip(&left_out);
        for (left, line) in said {
            if left.why.is_implausible() {
                complain!("abbe: {line}");
            } else {
                tell!("{line}");
            }
        }
        let all_plausible = !selected
            .left_out
            .iter()
            .any(|left| left.why.is_implausible());
        if let Some(leaps) = reading.leaps.line() {
            complain!("abbe: {leaps}");
        }
        if selected.files.is_empty() {
            let bag = self.bag.display();
            complain!("abbe: {bag}: nothing to export; looked for");
            for line in looked_for(
                &measured,
                (topics, &reading),
                (self.axes(), &origin.of_references),
            ) {
                complain!("  {line}");
            }
            for loss in &losses {
                complain!(
                    "abbe: what was looked for may have been in what was lost or left out: {loss}"
                );
            }
            return Ok(ExitCode::FAILURE);
        }
        self.check_written(&selected)
            .map_err(|reason| refused("export", reason))?;
        for line in &without_effect {
            complain!("abbe: {line}");
        }
        let counting = Counting {
            which: self.table.unwrap_or_default(),
            spans: selected.positioning,
            reference: wanted.reference,
            named: self.reference.iter().map(|(axis, _)| *axis).collect(),
            relative_to_reference: wanted.relative_to_reference,
        };
        counting
            .check()
            .map_err(|reason| refused("export", reason))?;
        let mut of_what = origin.lines(&self.bag, &counting);
        for line in &of_what[1..] {
            tell!("{line}");
        }
        of_what.extend(left_out);
        let not_whole = losses.iter();
        of_what.extend(not_whole.map(|loss| format!("not read whole: {loss}")));
        self.write(&selected, &of_what)?;
        for loss in &losses {
            complain!(
                "abbe: the bag was not read whole, a table may be missing or an older one: {loss}"
            );
        }
        Ok(loss::exit_code(losses.is_empty() && all_plausible))
    }

    /// Refuses options that can do nothing, whatever the bag holds.
    fn check(&self, format: Format) -> Result<(), String> {
        if format == Format::Mtx {
            return Err(NO_MTX.to_owned());
        }
        once_and_exported("--axis", &self.axis, self.axes())?;
        let named: Vec<Axis> = self.reference.iter().map(|(axis, _)| *axis).collect();
        once_and_exported("--reference", &named, self.axes())?;
        self.set_up.check(format, self.axes())?;
        let has = |is_linear: bool| self.axes().iter().any(|axis| axis.is_linear() == is_linear);
        if self.spacing_mm.is_some() && !has(true) {
            return Err(
                "--spacing-mm does nothing: no linear axis is among those of --axis".to_owned(),
            );
        }
        if self.spacing_deg.is_some() && !has(false) {
            return Err(
                "--spacing-deg does nothing: no rotary axis is among those of --axis".to_owned(),
            );
        }
        let counts_from_zero =
            matches!(format, Format::Linuxcnc | Format::Heidenhain | Format::Csv);
        if let Some(axis) = named.first().filter(|_| self.absolute && counts_from_zero) {
            return Err(format!(
                "--reference {axis} does nothing with --absolute: a table for {} has no reference point of its own",
                format.name()
            ));
        }
        match self.set_up.control(format).without_sign() {
            Some(why) => Err(why.to_string()),
            None => Ok(()),
        }
    }

    /// Refuses options for an axis of which no file was made.
    fn check_written(&self, selected: &Selected) -> Result<(), String> {
        let named = self.reference.iter().map(|(axis, _)| *axis);
        match named
            .into_iter()
            .find(|axis| selected.positioning[*axis].is_none())
        {
            Some(axis) => Err(format!(
                "--reference {axis} does nothing: the positioning of {axis} is in no file (see what was left out)"
            )),
            None => Ok(()),
        }
    }

    /// Options without effect on what this bag holds.
    fn without_effect(&self, format: Format, origin: &Origin) -> Vec<String> {
        let mut lines = vec![];
        let has_drift = origin.models[THERMAL].is_some();
        if format == Format::Sinumerik && self.set_up.sign().is_some() && !has_drift {
            lines.push(
                "--sign has no effect: the bag holds no thermal drift, and the signs of the other tables are in the control's manual".to_owned(),
            );
        }
        let is_of_laser = |axis: &Axis| origin.of_references[*axis].is_some();
        if self.budget.is_some() && !Axis::LINEAR.iter().any(is_of_laser) {
            lines.push(
                "--budget has no effect: no table is made of a laser's runs, and no other one is corrected to 20 °C".to_owned(),
            );
        }
        let has_tables = Axis::ALL.iter().any(|axis| origin.tables[*axis].is_some());
        if self.table.is_some() && !has_tables {
            lines.push("--table has no effect: the bag holds no positioning table".to_owned());
        }
        if self.stops && origin.of_stops.is_empty() {
            lines.push(
                "--stops has no effect: no verification along one axis, or every axis has a table of its own".to_owned(),
            );
        }
        lines
    }

    fn axes(&self) -> AxisSet {
        if self.axis.is_empty() {
            Axis::ALL.into_iter().collect()
        } else {
            self.axis.iter().copied().collect()
        }
    }

    fn wanted(&self, travels: Travels) -> Wanted {
        let mut reference = PerAxis::default();
        for (axis, value) in &self.reference {
            reference[*axis] = inner(*axis, *value);
        }
        Wanted {
            axes: self.axes(),
            spacing_mm: self.spacing_mm.unwrap_or(SPACING_MM),
            spacing_rad: self.spacing_deg.unwrap_or(SPACING_DEG).to_radians(),
            reference,
            relative_to_reference: !self.absolute,
            unestimable: if self.accept_unestimable {
                Unestimable::Accept
            } else {
                Unestimable::Refuse
            },
            travels,
        }
    }

    fn write(&self, selected: &Selected, of_what: &[String]) -> Result<()> {
        std::fs::create_dir_all(&self.out).with_context(|| self.out.display().to_string())?;
        let notes = notes(of_what, &selected.files);
        let tables = selected.files.iter();
        let tables = tables.map(|file| (self.out.join(&file.name), file.text.as_str()));
        let files: Vec<(PathBuf, &str)> = tables
            .chain([(self.out.join(NOTES), notes.as_str())])
            .collect();
        // A part of the tables, or tables without their notes, must not be loaded.
        let all = files.iter().map(|(path, text)| (path.as_path(), *text));
        whole_file::create_all(all, "name another folder with --out")?;
        for file in &selected.files {
            tell!("wrote {}", self.out.join(&file.name).display());
        }
        tell!(
            "wrote {}: read it before loading anything",
            self.out.join(NOTES).display()
        );
        Ok(())
    }
}

/// Default spacing of the points.
const SPACING_MM: f64 = 20.0;
const SPACING_DEG: f64 = 15.0;

/// Beside the files, since not every format has comments.
const NOTES: &str = "READ_ME_FIRST.txt";

fn notes(of_what: &[String], files: &[ExportFile]) -> String {
    let mut text: String = of_what.iter().map(|line| format!("{line}\n")).collect();
    text.push('\n');
    for file in files {
        text.push_str(&format!("{}\n", file.name));
        for note in &file.notes {
            text.push_str(&format!("  - {note}\n"));
        }
    }
    text
}

#[cfg(test)]
mod tests;
