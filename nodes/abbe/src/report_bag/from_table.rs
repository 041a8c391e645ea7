//! A table in place of a bag: what is recognised in it is imported into a folder that goes away, without a machine file.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail};
use metrology::yaml;
use reports::whole_file::{self, Vanishing};

use crate::import::begin::Before;
use crate::import::map::{Map, Test};
use crate::import::plain_machine::PlainMachine;
use crate::import::{self, Named, propose};
use crate::report_bag::foreign_log::{self, Log};

/// Ends of names of files that are tables.
const ENDS: [&str; 6] = ["csv", "tsv", "txt", "dat", "xlsx", "xlsm"];

/// Begin of a line that stands on the first screen.
const WARNING: &str = "warning, ";
/// Begin of a line with what was assumed of a column.
const ASSUMED: &str = "warning, column ";

/// The key whose assumed value is in angles and relative lengths.
const RADIUS: &str = "radius_mm";
/// What that means.
const OF_RADIUS: &str = ": it is assumed, and squareness and scale are off by as much as it is";

/// A bag of a table.
pub struct FromTable {
    /// Its folder, which goes away with this.
    _home: Vanishing,
    /// The bag.
    pub bag: PathBuf,
    /// What was recognised in the table, what it lacks, and what is not in the bag; a line each.
    pub lines: Vec<String>,
    /// Cells that cost a row or a reading.
    pub n_odd: usize,
    /// Runs that the table lacks or that were broken off, and messages of another program's bag that were left out.
    n_lost_runs: usize,
    /// Whether its begin was put behind another table's, for nobody stated it.
    pub is_put_behind: bool,
}

impl FromTable {
    /// Whether all that was measured is in the bag.
    pub const fn is_whole(&self) -> bool {
        self.n_odd == 0 && self.n_lost_runs == 0
    }

    /// What was assumed of columns, and readings that no machine has.
    pub fn warnings(&self) -> Vec<String> {
        let lines = self.lines.iter();
        let warnings = lines.filter(|line| line.starts_with(WARNING));
        warnings.cloned().collect()
    }
}

/// Whether a path is a table by its name, or a file of an instrument by its content.
pub fn is_table(path: &Path) -> bool {
    let end = path.extension().and_then(|end| end.to_str());
    let is_named = end.is_some_and(|end| ENDS.contains(&end.to_lowercase().as_str()));
    !path.is_dir() && (is_named || import::is_of_instrument(path))
}

/// Imports a table by a map, or by what is recognised in it; `None` for a bag.
///
/// # Errors
/// When a map is named for a bag, when table or map cannot be read, or nothing is recognised.
pub fn of(path: &Path, map: Option<&Path>) -> Result<Option<FromTable>> {
    if !is_table(path) {
        if let Some(log) = foreign_log::of(path)? {
            return of_log(path, &log, map, (None, None)).map(Some);
        }
        if map.is_some() {
            bail!(
                "--map does nothing: {} is no table, which ends with one of {}, and no file of an instrument",
                path.display(),
                ENDS.join(", ")
            );
        }
        return Ok(None);
    }
    of_any(path, map, None).map(Some)
}

/// Imports a table for a machine that is wide enough for any; `before`: what the same call read before.
///
/// # Errors
/// As [`of`].
pub fn of_any(path: &Path, map: Option<&Path>, before: Option<Before>) -> Result<FromTable> {
    let (described, read) = described(path, map)?;
    imported(path, described, (stand_in(&read), before))
}

/// The machine of a table that states none.
fn stand_in(read: &Map) -> Named {
    Named {
        place: "the machine that is taken where none is stated".to_owned(),
        text: PlainMachine::of_map(read).text(),
    }
}

/// Imports what another program's bag holds as a log, for a machine file where there is one.
///
/// # Errors
/// As [`of`].
pub fn of_log(
    path: &Path,
    log: &Log,
    map: Option<&Path>,
    (machine, before): (Option<Named>, Option<Before>),
) -> Result<FromTable> {
    let home = Vanishing::temporary().context("a folder for the table of the bag")?;
    let name = path.file_name().unwrap_or(path.as_os_str());
    let table = home.path().join(format!("{}.csv", name.to_string_lossy()));
    whole_file::write(&table, &log.table)?;
    // The table goes away: what is said of it is said of the bag.
    let (own, of_bag) = (table.display().to_string(), path.display().to_string());
    let told = |text: String| text.replace(&own, &of_bag);
    let made = described(&table, map).and_then(|(described, read)| {
        let machine = machine.unwrap_or_else(|| stand_in(&read));
        imported(&table, described, (machine, before))
    });
    let mut made = made.map_err(|error| anyhow!("{}", told(format!("{error:#}"))))?;
    let lines = std::mem::take(&mut made.lines).into_iter().map(told);
    made.lines = lines.chain(log.lines.iter().cloned()).collect();
    made.lines.sort_by_key(|line| !line.starts_with(WARNING));
    made.n_lost_runs += log.n_lost;
    Ok(made)
}

/// The same for a machine file.
///
/// # Errors
/// As [`of`], and where the machine could not have been measured so.
pub fn of_machine(
    path: &Path,
    map: Option<&Path>,
    (machine, before): (Named, Option<Before>),
) -> Result<FromTable> {
    let (described, read) = described(path, map)?;
    if matches!(read.test, Test::Touches { .. }) {
        bail!(
            "{}: a list of touches: it has no axis' motion of which a cause could be found; `abbe report {}` evaluates it by ISO 230-10",
            path.display(),
            path.display()
        );
    }
    imported(path, described, (machine, before))
}

/// A map, its keys whose values are assumed, and the lines of what it rests on.
type Described = (Named, Vec<String>, Vec<String>);

/// The map that is given, or the one that is proposed.
fn described(path: &Path, map: Option<&Path>) -> Result<(Described, Map)> {
    let (named, assumed, lines) = match map {
        Some(map) => (Named::read(map, "map")?, vec![], vec![]),
        None => proposed(path)?,
    };
    let place = &named.place;
    let read: Map = yaml::read_letters(&named.text).map_err(|error| {
        anyhow!(
            "map {}",
            yaml::placed(place, &named.text, &error.to_string())
        )
    })?;
    Ok(((named, assumed, lines), read))
}

fn imported(
    path: &Path,
    (named, assumed, mut lines): Described,
    (machine, before): (Named, Option<Before>),
) -> Result<FromTable> {
    let home = Vanishing::temporary().context("a folder for the bag of the table")?;
    let bag = home.path().join("bag");
    let imported = import::import(path, (&named, &assumed), machine, (&bag, before))?;
    let is_new = |note: &String| !lines.contains(note);
    let notes: Vec<String> = imported.notes.into_iter().filter(is_new).collect();
    lines.extend(notes);
    lines.sort_by_key(|line| !line.starts_with(WARNING));
    Ok(FromTable {
        _home: home,
        bag,
        lines,
        n_odd: imported.n_odd,
        n_lost_runs: imported.n_lost_runs,
        is_put_behind: imported.is_put_behind,
    })
}

/// The map that is proposed for a table, its keys whose values are assumed, and what it rests on.
fn proposed(path: &Path) -> Result<(Named, Vec<String>, Vec<String>)> {
    let proposal = propose::of(path).with_context(|| format!("table {}", path.display()))?;
    let mut lines: Vec<String> = proposal.recognised;
    // What was assumed of a column is not folded with what the table lacks.
    let needed = proposal.needed.into_iter();
    lines.extend(needed.map(|line| match line.strip_prefix("column ") {
        Some(rest) => format!("{ASSUMED}{rest}"),
        None if line.starts_with(RADIUS) => format!("{WARNING}{line}{OF_RADIUS}"),
        None => format!("not in the table: {line}"),
    }));
    let named = Named {
        place: "proposed for the table (abbe import --propose prints it)".to_owned(),
        text: proposal.map,
    };
    Ok((named, proposal.assumed, lines))
}
