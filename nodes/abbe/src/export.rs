//! `abbe export BAG --format CONTROL`: what a bag knew last of a machine's errors, as tables for a control.

use node_runtime::complain;

use std::fs::File;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, anyhow};
use clap::{Args, ValueEnum};
use machine::export::selection::{Selected, Wanted, select};
use machine::export::{ExportFile, Unestimable};
use metrology::{Axis, AxisSet, PerAxis};
use recorder::Bag;

use crate::evaluate::Tests;
use crate::tell::tell;
use crate::usage::{USAGE, above_zero, refused};

mod counting;
mod found;
mod origin;
mod set_up;

use counting::Counting;
use found::{Found, looked_for, read, tables_of_stops};
use origin::Which;
use set_up::{SetUp, inner, of_axis};

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
    /// A plain table of errors and compensations, for other programs and for people.
    Csv,
}

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
#[derive(Args)]
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
    /// Spacing of the points of linear axes, mm.
    #[arg(long, default_value_t = 20.0, allow_negative_numbers = true, value_parser = above_zero)]
    spacing_mm: f64,
    /// Spacing of the points of rotary axes, deg.
    #[arg(long, default_value_t = 15.0, allow_negative_numbers = true, value_parser = above_zero)]
    spacing_deg: f64,
    /// Reference point of an axis such as X=-300, mm or deg; others: 0.
    #[arg(long, value_parser = position)]
    reference: Vec<(Axis, f64)>,
    /// Keep the error at the reference point instead of counting from it.
    #[arg(long)]
    absolute: bool,
    /// Which table of an axis that was refreshed while it worked.
    #[arg(long, value_enum, default_value_t)]
    table: Which,
    /// Where no positioning run gave a table, make one of the stops of a verification along one axis, as its scale or the control read them.
    #[arg(long)]
    stops: bool,
    /// Use components although the recordings do not determine them by themselves.
    #[arg(long)]
    accept_unestimable: bool,
    #[command(flatten)]
    set_up: SetUp,
}

impl Export {
    /// Exit code 0: every file is written; 1: there was nothing to write, or it failed; 3: written, but the bag has lost something.
    ///
    /// # Errors
    /// The bag cannot be read, a file cannot be written, or a named reference point is beyond the errors (exit code 2).
    pub fn execute(self) -> Result<ExitCode> {
        let Some(format) = self.format else {
            complain!("abbe: --format is missing; the formats are:\n{}", formats());
            return Ok(ExitCode::from(USAGE));
        };
        let Found {
            mut measured,
            losses,
            topics,
            mut origin,
        } = read(&self.bag, self.table)?;
        if self.stops {
            let tests = Tests::of(&Bag::open(&self.bag)?)?;
            origin.of_stops = tables_of_stops(&tests.stops, &mut measured);
        }
        let wanted = self.wanted();
        let selected = select(&measured, &wanted, &self.set_up.control(format));
        let left_out: Vec<String> = selected
            .left_out
            .iter()
            .map(|left| format!("left out: {}: {}", left.what, left.why))
            .collect();
        for line in &left_out {
            tell!("{line}");
        }
        if selected.files.is_empty() {
            let bag = self.bag.display();
            complain!("abbe: {bag}: nothing to export; looked for");
            for line in looked_for(&measured, topics, self.axes()) {
                complain!("  {line}");
            }
            for loss in &losses {
                complain!("abbe: what was looked for may have been in what was lost: {loss}");
            }
            return Ok(ExitCode::FAILURE);
        }
        let counting = Counting {
            which: self.table,
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
        self.write(&selected, &of_what)?;
        for loss in &losses {
            complain!("abbe: the bag has lost something, a table may be missing: {loss}");
        }
        Ok(if losses.is_empty() {
            ExitCode::SUCCESS
        } else {
            ExitCode::from(3)
        })
    }

    fn axes(&self) -> AxisSet {
        if self.axis.is_empty() {
            Axis::ALL.into_iter().collect()
        } else {
            self.axis.iter().copied().collect()
        }
    }

    fn wanted(&self) -> Wanted {
        let mut reference = PerAxis::default();
        for (axis, value) in &self.reference {
            reference[*axis] = inner(*axis, *value);
        }
        Wanted {
            axes: self.axes(),
            spacing_mm: self.spacing_mm,
            spacing_rad: self.spacing_deg.to_radians(),
            reference,
            relative_to_reference: !self.absolute,
            unestimable: if self.accept_unestimable {
                Unestimable::Accept
            } else {
                Unestimable::Refuse
            },
        }
    }

    fn write(&self, selected: &Selected, of_what: &[String]) -> Result<()> {
        std::fs::create_dir_all(&self.out).with_context(|| self.out.display().to_string())?;
        for file in &selected.files {
            create(&self.out.join(&file.name), &file.text)?;
            tell!("wrote {}", self.out.join(&file.name).display());
        }
        let notes = notes(of_what, &selected.files);
        create(&self.out.join(NOTES), &notes)?;
        tell!(
            "wrote {}: read it before loading anything",
            self.out.join(NOTES).display()
        );
        Ok(())
    }
}

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

fn create(path: &Path, text: &str) -> Result<()> {
    let mut file = File::create_new(path).map_err(|error| match error.kind() {
        ErrorKind::AlreadyExists => anyhow!(
            "{}: there already, and not overwritten: name another folder with --out",
            path.display()
        ),
        _ => anyhow!("{}: {error}", path.display()),
    })?;
    file.write_all(text.as_bytes())
        .with_context(|| path.display().to_string())
}

#[cfg(test)]
mod tests {
    use abbe_msgs::{Wire, topics};
    use clap::Parser;
    use metrology::sample::PositioningTable;
    use metrology::stamp::Stamp;
    use recorder::{Channel, Directory, MessageStamp, RecorderConfig, Recording};

    use super::*;

    #[derive(Parser)]
    struct CommandLine {
        #[command(flatten)]
        export: Export,
    }

    fn table(axis: Axis, slope: f64) -> PositioningTable {
        let position: Vec<f64> = (0..=10).map(|k| f64::from(k) * 20.0 - 100.0).collect();
        let deviation: Vec<f64> = position.iter().map(|p| slope * p).collect();
        PositioningTable {
            at: Stamp::from_nanos(1),
            axis,
            position,
            deviation_up: deviation.clone(),
            deviation_down: deviation,
            n_runs: 10,
            weight: 0.2,
            sequence: 1,
        }
    }

    /// A bag with these tables in order, and its last chunk cut off where asked for.
    fn bag(folder: &Path, tables: &[PositioningTable], cut: bool) -> PathBuf {
        let path = folder.join("bag");
        let directory = Directory::create(&path).unwrap();
        let mut recording = Recording::begin(directory, "bag", RecorderConfig::default()).unwrap();
        let channel = Channel {
            topic: format!("/mill/{}", topics::POSITIONING_TABLE.name),
            type_name: "abbe_msgs/msg/PositioningTable".to_owned(),
            type_hash: String::new(),
            definition: String::new(),
            qos_yaml: String::new(),
        };
        let id = recording.add_channel(&channel).unwrap();
        for (k, table) in tables.iter().enumerate() {
            let message = abbe_msgs::msg::PositioningTable::from_inner(table);
            let nanos = k as i64 + 1;
            let stamp = MessageStamp {
                log_time_nanos: nanos,
                publish_time_nanos: nanos,
                sequence: 0,
            };
            recording
                .write(id, stamp, &abbe_msgs::to_cdr(&message))
                .unwrap();
            recording.flush().unwrap();
        }
        recording.finish().unwrap();
        if cut {
            let file = path.join("bag_0.mcap");
            let bytes = std::fs::read(&file).unwrap();
            std::fs::write(&file, &bytes[..bytes.len() - 40]).unwrap();
        }
        path
    }

    fn execute(bag: &Path, out: &Path, more: &[&str]) -> Result<ExitCode> {
        let line = [
            "export",
            bag.to_str().unwrap(),
            "--out",
            out.to_str().unwrap(),
        ];
        CommandLine::parse_from(line.iter().chain(more))
            .export
            .execute()
    }

    fn code(result: Result<ExitCode>) -> String {
        format!("{:?}", result.unwrap())
    }

    #[test]
    fn the_last_table_of_each_axis_is_written_and_nothing_is_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let tables = [
            table(Axis::X, 1e-4),
            table(Axis::Y, 2e-4),
            table(Axis::X, 3e-4),
        ];
        let bag = bag(folder.path(), &tables, false);
        let out = folder.path().join("out");
        let done = execute(&bag, &out, &["--format", "linuxcnc", "--file-type", "1"]);
        assert_eq!(code(done), format!("{:?}", ExitCode::SUCCESS));
        let x = std::fs::read_to_string(out.join("x.comp")).unwrap();
        assert_eq!(x.lines().next(), Some("-100.000000 0.030000 0.030000"));
        assert!(out.join("y.comp").is_file() && !out.join("z.comp").exists());
        let notes = std::fs::read_to_string(out.join(NOTES)).unwrap();
        assert!(notes.starts_with("made of the bag "), "{notes}");
        assert!(notes.contains("the last of 2 tables"), "{notes}");
        assert!(notes.contains("\nx.comp\n  - LinuxCNC screw compensation of axis X"));
        let first = folder.path().join("first");
        let options = [
            "--format",
            "linuxcnc",
            "--file-type",
            "1",
            "--table",
            "first",
        ];
        execute(&bag, &first, &options).unwrap();
        let x_first = std::fs::read_to_string(first.join("x.comp")).unwrap();
        assert_eq!(
            x_first.lines().next(),
            Some("-100.000000 0.010000 0.010000")
        );
        let again = execute(&bag, &out, &["--format", "linuxcnc"]).unwrap_err();
        let again = format!("{again:#}");
        assert!(
            again.contains("x.comp") && again.contains("--out"),
            "{again}"
        );
    }

    #[test]
    fn what_is_in_no_file_is_told_as_left_out_and_by_no_other_line() {
        let folder = tempfile::tempdir().unwrap();
        let mut short = table(Axis::Z, 0.0);
        for values in [
            &mut short.position,
            &mut short.deviation_up,
            &mut short.deviation_down,
        ] {
            values.truncate(1);
        }
        let bag = bag(folder.path(), &[table(Axis::X, 1e-4), short], false);
        let out = folder.path().join("out");
        execute(&bag, &out, &["--format", "csv"]).unwrap();
        let notes = std::fs::read_to_string(out.join(NOTES)).unwrap();
        let left_out = "left out: positioning of Z: axis Z: 1 points";
        assert!(notes.contains(left_out), "{notes}");
        assert_eq!(notes.matches("of Z").count(), 1, "{notes}");
        let far = execute(
            &bag,
            &folder.path().join("far"),
            &["--format", "csv", "--reference", "X=9999"],
        );
        assert!(far.unwrap_err().is::<clap::Error>());
        assert!(!folder.path().join("far").exists());
    }

    #[test]
    fn a_bag_without_errors_of_the_wanted_axis_is_said_and_fails() {
        let folder = tempfile::tempdir().unwrap();
        let bag = bag(folder.path(), &[table(Axis::X, 1e-4)], false);
        let out = folder.path().join("out");
        let nothing = execute(&bag, &out, &["--format", "csv", "--axis", "Z"]);
        assert_eq!(code(nothing), format!("{:?}", ExitCode::FAILURE));
        assert!(!out.exists());
        let absent = execute(&folder.path().join("nowhere"), &out, &["--format", "csv"]);
        assert!(absent.is_err());
    }

    #[test]
    fn nothing_to_export_names_each_source_and_why_it_gave_none() {
        let folder = tempfile::tempdir().unwrap();
        let bag = bag(folder.path(), &[table(Axis::X, 1e-4)], false);
        let found = read(&bag, Which::Last).unwrap();
        assert_eq!(found.topics, [Some(1), None, None]);
        let lines = looked_for(&found.measured, found.topics, AxisSet::EMPTY.with(Axis::Z));
        assert!(lines[0].contains("positioning/table"), "{lines:?}");
        assert!(lines[0].contains("it is about X"), "{lines:?}");
        for line in &lines[1..3] {
            assert!(line.contains("the bag has no such topic"), "{lines:?}");
        }
        assert_eq!(lines[3], "for axes Z");
    }

    #[test]
    fn without_a_format_all_of_them_are_named_and_nothing_is_read() {
        let line = ["export", "no_such_bag"];
        let done = CommandLine::parse_from(line).export.execute();
        assert_eq!(code(done), format!("{:?}", ExitCode::from(USAGE)));
        let said = formats();
        for name in ["linuxcnc", "sinumerik", "heidenhain", "fanuc", "csv"] {
            assert!(said.contains(&format!("  {name} ")), "{said}");
        }
    }

    #[test]
    fn a_bag_that_was_cut_is_exported_with_a_code_of_its_own() {
        let folder = tempfile::tempdir().unwrap();
        let bag = bag(folder.path(), &[table(Axis::X, 1e-4)], true);
        let out = folder.path().join("out");
        let done = execute(&bag, &out, &["--format", "csv"]);
        assert_eq!(code(done), format!("{:?}", ExitCode::from(3)));
        assert!(out.join("errors.csv").is_file());
    }

    #[test]
    fn an_argument_that_is_none_is_a_matter_of_usage() {
        for wrong in [
            &["--format", "okuma"][..],
            &["--format", "csv", "--axis", "Q"],
            &["--format", "csv", "--reference", "X"],
            &["--format", "csv", "--reference", "X=here"],
            &["--format", "csv", "--reference", "X=nan"],
            &["--format", "linuxcnc", "--file-type", "2"],
            &["--format", "csv", "--spacing-mm", "0"],
            &["--format", "csv", "--spacing-mm", "-20"],
            &["--format", "csv", "--spacing-deg", "inf"],
            &["--format", "sinumerik", "--max-sum-mm", "nan"],
            &["--format", "sinumerik", "--max-slope", "-1e-3"],
            &["--format", "fanuc", "--detection-unit", "0"],
            &["--format", "fanuc", "--magnification", "101"],
            &["--format", "fanuc", "--max-pulses", "0"],
            &["--format", "fanuc", "--reference-number", "X=4.5"],
            &["--format", "fanuc", "--reference-number", "X=-1"],
        ] {
            let line = ["export", "bag"].iter().chain(wrong);
            let refused = CommandLine::try_parse_from(line).err().unwrap();
            assert_eq!(refused.exit_code(), 2, "{wrong:?}");
        }
    }
}
