//! `abbe import CSV --map MAP -o BAG`: somebody's measurement as a bag that `abbe diagnose` reads.
//!
//! A table holds what an instrument read; the map says which column is what and how the machine moved. The motion is
//! made up from it: rests at the targets of a positioning test, approached as the order of the rows says; an even feed
//! round a circle, a quarter of a turn ahead of its first row; standing axes for a log. Motors were not recorded and
//! say nothing: they are written as commanded, which a diagnosis notices and leaves out.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, anyhow};
use clap::Args;
use machine::MachineFile;
use metrology::yaml;
use node_runtime::complain;
use node_runtime::text_file;
use recorder::RecorderError;
use reports::loss;
use reports::whole_file::WholeFolder;

mod again;
mod angles;
mod axis_names;
mod bare_touches;
pub(crate) mod begin;
mod beside;
mod book;
mod clock_parts;
mod columns;
mod dates;
mod deviation_names;
mod directions;
mod doubled;
mod encoding;
mod file;
mod formats;
mod hidden;
mod instrument;
mod lacking;
mod laser_conditions;
mod laser_owner;
mod laser_passes;
pub(crate) mod limits;
mod listed;
pub(crate) mod map;
mod map_schema;
mod measured;
mod merged;
mod motion;
mod odd;
mod parted;
mod pass_names;
mod passes;
pub mod plain_machine;
mod probe_log;
pub(crate) mod propose;
mod prose;
mod quantities;
mod recognise;
mod renishaw_laser;
mod rest;
mod returns;
mod runs;
mod said_of_numbers;
mod same;
mod separators;
mod shapes;
mod sheet;
mod spaced;
mod split_decimals;
mod stated;
mod statement;
mod table;
mod times;
mod titles;
mod touch_bag;
mod touch_shapes;
mod touches;
mod turned;
mod units;
mod unlikely;
mod unnamed;
mod unread;
mod vocabulary;
mod writer;

use begin::Before;
use file::Form;
use map::{Map, What};
use runs::Runs;
use table::Table;
use writer::Writer;

use crate::tell::tell;

/// Arguments of `abbe import`.
#[derive(Args)]
pub struct Import {
    /// Table of readings: text, a worksheet (xlsx), or a file of an instrument (Renishaw rtl, rta).
    csv: PathBuf,
    /// Which column is what, and how the machine moved.
    #[arg(long, required_unless_present = "propose")]
    map: Option<PathBuf>,
    /// Machine file of the machine that was measured.
    #[arg(long, required_unless_present = "propose")]
    machine: Option<PathBuf>,
    /// Folder of the bag.
    #[arg(short, long, required_unless_present = "propose")]
    output: Option<PathBuf>,
    /// Print a map with what was recognised in the table and what is missing; nothing is written.
    #[arg(long, conflicts_with_all = ["map", "machine", "output"])]
    propose: bool,
}

#[cfg(test)]
impl Import {
    /// The arguments as they are given.
    pub const fn of(csv: PathBuf, map: PathBuf, machine: PathBuf, output: PathBuf) -> Self {
        Self {
            csv,
            map: Some(map),
            machine: Some(machine),
            output: Some(output),
            propose: false,
        }
    }
}

/// Attachment of a bag with what its table states.
pub const ATTACHMENT: &str = "params/import.yaml";
/// Line of it where the rows were not in the order of the measurement.
pub const ORDER_UNKNOWN: &str = "order: unknown";

/// A text with the name of its file, which messages quote.
pub(crate) struct Named {
    pub place: String,
    pub text: String,
}

impl Named {
    /// Reads a file of YAML.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn read(path: &Path, what: &'static str) -> Result<Self> {
        let file = text_file::yaml_file(path).context(what)?;
        Ok(Self {
            place: file.path.display().to_string(),
            text: file.text,
        })
    }
}

/// What was written into a bag.
pub(crate) struct Imported {
    n_runs: u32,
    n_messages: u64,
    n_rows: usize,
    /// Cells that cost a row or a reading.
    pub n_odd: usize,
    /// Runs of a measurement that the table lacks or that were broken off, and are not in the bag; targets that an evaluation leaves
    /// out.
    pub n_lost_runs: usize,
    /// Whether its begin was put behind another table's, for nobody stated it.
    pub is_put_behind: bool,
    /// What a reader should know: rows and columns that were left out, and what the runs were made of.
    pub notes: Vec<String>,
}

impl Import {
    /// Writes the bag, or prints a proposal; exit code 3 when a cell was left out.
    ///
    /// # Errors
    /// When a file cannot be read, a column is missing, a cell is no number, or the bag not written.
    pub fn execute(self) -> Result<ExitCode> {
        let (Some(map), Some(machine), Some(output)) = (&self.map, &self.machine, &self.output)
        else {
            return self.propose();
        };
        let map = Named::read(map, "map")?;
        let machine = Named::read(machine, "machine file")?;
        let imported = import(&self.csv, (&map, &[]), machine, (output, None))?;
        tell!(
            "{}: {} runs, {} messages",
            output.display(),
            imported.n_runs,
            imported.n_messages
        );
        if !imported.notes.is_empty() {
            let (csv, used) = (self.csv.display(), imported.n_rows);
            complain!("abbe: {csv}: {used} rows used; besides");
            for note in &imported.notes {
                complain!("  {note}");
            }
        }
        Ok(loss::exit_code(
            imported.n_odd == 0 && imported.n_lost_runs == 0,
        ))
    }

    fn propose(&self) -> Result<ExitCode> {
        let in_table = || format!("table {}", self.csv.display());
        let proposal = propose::of(&self.csv).with_context(in_table)?;
        tell!("{}", proposal.map.trim_end_matches('\n'));
        for line in &proposal.recognised {
            complain!("{line}");
        }
        for line in &proposal.needed {
            complain!("needed: {line}");
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// Writes the bag of a table; `assumed`: keys of the map whose values nobody stated; `before`: what the same call read before.
///
/// # Errors
/// As [`Import::execute`].
pub(crate) fn import(
    csv: &Path,
    (named, assumed): (&Named, &[String]),
    machine: Named,
    (output, before): (&Path, Option<Before>),
) -> Result<Imported> {
    let machine_text = machine.text;
    let machine = MachineFile::parse(&machine_text, &machine.place)?;
    let (mut map, place) = map_for(named, &machine)?;
    let assumed = &mut assumed.to_vec();
    let is_put_behind = put_behind(&mut map, assumed, before);
    let ranges = limits::ranges(&map.test, &machine);
    let in_table = || format!("table {}", csv.display());
    let form = Form {
        separator: map.separator,
        decimal: map.decimal,
        sheet: map.sheet.as_deref(),
        is_by_number: unnamed::is_by_number(&map),
    };
    let columns = map.test.columns();
    let is_table = |sheet: &sheet::Sheet| columns.iter().all(|column| sheet.has(column.name));
    let mut cells = file::read(csv, form, &is_table).with_context(in_table)?;
    let unnamed = unnamed::give_names(&mut cells.sheet, &map);
    let table = Table::of(&cells.sheet, &map, &ranges).with_context(in_table)?;
    angles::check(&map, &table).with_context(in_table)?;
    let mut runs = runs::of(&map.test, &table).with_context(in_table)?;
    let remarks = plausible(&map.test, &machine, &runs).with_context(in_table)?;
    runs.remarks.extend(remarks);
    let of_machine = (&machine, machine_text);
    let folder = begun(output)?;
    let mut writer = Writer::begin(
        folder.path(),
        of_machine,
        map.start_s,
        Some(stated(&map, assumed, &runs)),
    )?;
    let n_runs = write(&map, (&table, &runs), &mut writer).with_context(in_table)?;
    let written = writer.finish()?;
    folder.finish()?;
    let mut notes = doubts(&map, &runs);
    notes.extend(place);
    notes.extend(written.in_words());
    let form = cells.form.map(str::to_owned);
    notes.extend(form.into_iter().chain(cells.note).chain(cells.remarks));
    notes.extend(unnamed);
    notes.extend(cells.sheet.turned);
    notes.extend(table.left_out);
    let one_sided = one_sided(&map, &runs);
    let n_odd = table.odd.len();
    let n_lost = cells.n_lost_runs + one_sided.len() + cells.sheet.overruns.len();
    notes.extend(spaced::lost(&cells.sheet.overruns));
    notes.extend(one_sided);
    notes.extend(unlikely::warnings(&map.test, &runs.runs));
    let n_rows = runs.runs.iter().map(Vec::len).sum();
    notes.extend(runs.remarks);
    Ok(Imported {
        n_runs,
        n_messages: written.messages,
        n_rows,
        n_odd,
        n_lost_runs: n_lost,
        is_put_behind,
        notes,
    })
}

/// The folder of a bag that is not there yet.
fn begun(output: &Path) -> Result<WholeFolder> {
    if output.exists() {
        let path = output.to_owned();
        return Err(RecorderError::Exists { path }.into());
    }
    WholeFolder::begin(output)
}

/// Puts a table without a date behind what was read before it; whether that was done.
fn put_behind(map: &mut Map, assumed: &mut Vec<String>, before: Option<Before>) -> bool {
    const START_KEY: &str = "start_s";
    let is_assumed = assumed.iter().any(|key| key == START_KEY);
    let begin_s = before.and_then(|before| begin::after(before, map.start_s, is_assumed));
    let Some(begin_s) = begin_s else {
        return false;
    };
    map.start_s = begin_s;
    if !is_assumed {
        assumed.push(START_KEY.to_owned());
    }
    true
}

/// Writes the runs of a table; gives their number.
fn write(map: &Map, (table, runs): (&Table, &Runs), writer: &mut Writer) -> Result<u32> {
    match &map.test {
        map::Test::Touches { .. } => touch_bag::write(runs, &table.features, writer),
        _ => motion::write(map, runs, writer),
    }
}

/// The map of a table of this machine, and a line on the places that are assumed.
fn map_for(named: &Named, machine: &MachineFile) -> Result<(Map, Option<String>)> {
    let in_map = |error: &dyn std::fmt::Display| {
        let said = yaml::placed(&named.place, &named.text, &error.to_string());
        anyhow!("map {said}")
    };
    let mut map: Map = yaml::read_letters(&named.text).map_err(|error| in_map(&error))?;
    limits::check(&map, machine).map_err(|error| in_map(&error))?;
    let place = rest::assume(&mut map, machine);
    Ok((map, place))
}

/// Targets of a positioning test that every run reads from one side alone.
fn one_sided(map: &Map, runs: &Runs) -> Vec<String> {
    match &map.test {
        map::Test::Positioning { axis, .. } => lacking::one_sided(&runs.runs, map::units(*axis)),
        _ => vec![],
    }
}

/// Whether a file is of an instrument's own form, by its content; one that cannot be read is of none.
pub(crate) fn is_of_instrument(path: &Path) -> bool {
    let bytes = path
        .is_file()
        .then(|| text_file::bytes(path).ok())
        .flatten();
    bytes.is_some_and(|bytes| instrument::of(&bytes).is_some())
}

/// What a bag carries of a table beside its readings, as YAML.
fn stated(map: &Map, assumed: &[String], runs: &Runs) -> String {
    let mut stated = map.statement(assumed);
    if !runs.is_order_known {
        stated.push_str(ORDER_UNKNOWN);
        stated.push('\n');
    }
    stated
}

/// Refuses targets beyond the travel; gives remarks about readings that the test cannot have.
fn plausible(test: &map::Test, machine: &MachineFile, runs: &Runs) -> Result<Vec<String>> {
    match test {
        map::Test::Positioning {
            axis, overrun_mm, ..
        } => {
            let travel = limits::targets(machine, *axis);
            let beyond = runs::check_travel(runs, travel.as_ref(), (*axis, *overrun_mm))?;
            Ok(beyond.into_iter().collect())
        }
        map::Test::Circle {
            radius_mm,
            radial_um,
            ..
        } => Ok(limits::outliers_of_circles(runs, *radius_mm, radial_um)),
        map::Test::Log { .. } | map::Test::Touches { .. } => Ok(vec![]),
    }
}

/// Asks about deviations that cannot be in the unit that they were read in, where the map does not state it.
fn doubts(map: &Map, runs: &Runs) -> Vec<String> {
    if let Some(doubt) = touch_bag::doubt(map, runs) {
        return vec![doubt];
    }
    let columns = map.test.columns();
    let is_open = |name: &str| !map.units.contains_key(name);
    // Rows of a positioning test have one shape, whatever their table had.
    let (place, likely, is_linear) = match &map.test {
        map::Test::Positioning { axis, .. } if !axis.is_linear() => (Some(2), "deg", false),
        map::Test::Positioning { .. } => (Some(2), "mm", true),
        map::Test::Circle { .. } | map::Test::Log { .. } | map::Test::Touches { .. } => {
            let is_read = |column: &map::Column<'_>| matches!(column.what, What::Deviation(_));
            (columns.iter().position(is_read), "mm", false)
        }
    };
    let of_rows = |k: usize| -> Vec<f64> {
        let rows = runs.runs.iter().flatten();
        let numbers = rows.filter_map(|row| row.cells.get(k).copied());
        numbers.filter(|number| number.is_finite()).collect()
    };
    let read = columns.iter().find_map(|column| match column.what {
        What::Deviation(unit) if is_open(column.name) => Some((column.name, unit.name())),
        _ => None,
    });
    let small = read
        .zip(place)
        .and_then(|((name, unit), place)| propose::doubt(&of_rows(place), name, [unit, likely]));
    let is_target = |column: &&map::Column<'_>| matches!(column.what, What::Place(_));
    let target = columns.iter().find(is_target);
    let target = target.filter(|column| is_linear && is_open(column.name));
    let near = target.and_then(|target| propose::doubt_of_targets(&of_rows(1), target.name));
    small.into_iter().chain(near).collect()
}
