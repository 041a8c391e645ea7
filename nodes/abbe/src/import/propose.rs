//! A map for a table that nobody has described yet, and a machine file with only what the table contains.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Context, Result, bail};
use metrology::Axis;

use super::map::{Direction, units};
use super::pass_names;
use super::recognise::{Known, Recognised, Role};
use super::separators;
use super::stated::{in_one_line, quoted};
use super::titles;
use super::units::{Kind, Unit};
use super::unread;
use kinds::{Of, kind};
pub use likely::{doubt, doubt_of_targets};
use likely::{likely_deviation, likely_target};

/// A map with what it rests on.
#[derive(Debug)]
pub struct Proposal {
    /// The map.
    pub map: String,
    /// What was recognised, a line each.
    pub recognised: Vec<String>,
    /// What the table lacks, a line each.
    pub needed: Vec<String>,
    /// Keys whose values are assumed.
    pub assumed: Vec<String>,
}

/// Proposes a map for a table.
///
/// # Errors
/// When the file cannot be read, or none of its columns is recognised.
pub fn of(path: &Path) -> Result<Proposal> {
    let looked = looked::at(path)?;
    let found = looked.found.with_context(|| separators::no_names(path))?;
    if let Some(odd) = &found.odd {
        bail!("{odd}");
    }
    let stem = path.file_stem().map(|stem| stem.to_string_lossy());
    let stem = stem.unwrap_or_default();
    let mut text = Text::new(&found, path);
    let start_s = looked.start_s.or_else(|| titles::start_s(&found));
    text.start_s = start_s.unwrap_or(0.0);
    if let Some(form) = looked.form {
        text.recognised = vec![format!(
            "{}: {form}, {} readings",
            path.display(),
            found.n_rows
        )];
    }
    text.recognised.extend(looked.encoding);
    if let Some(name) = looked.sheet {
        let _ = writeln!(text.head, "sheet: {}", quoted(&name));
        text.recognised.push(format!("sheet: \"{name}\""));
    }
    match kind(&found) {
        Some(Of::Positioning) => {
            let told = text.axis_told(&stem, false)?;
            text.positioning(told)?;
        }
        Some(Of::Log) => {
            let told = text.axis_told(&stem, true)?;
            text.log(told)?;
        }
        Some(Of::Circle) => text.circle(&stem)?,
        Some(Of::Touches(axes)) => text.touches(axes)?,
        None => bail!("{}", nothing::in_words(&found)),
    };
    Ok(Proposal {
        map: text.finished(),
        recognised: text.recognised,
        needed: text.needed,
        assumed: text.assumed,
    })
}

fn names(found: &Recognised) -> Vec<&str> {
    let columns = found.columns.iter();
    columns.map(|column| column.name.as_str()).collect()
}

/// A map on its way.
struct Text<'t> {
    found: &'t Recognised,
    head: String,
    test: String,
    units: Vec<String>,
    used: Vec<String>,
    start_s: f64,
    is_axis_of_file: bool,
    recognised: Vec<String>,
    needed: Vec<String>,
    assumed: Vec<String>,
}

impl<'t> Text<'t> {
    fn new(found: &'t Recognised, path: &Path) -> Self {
        let form = match found.separator {
            '\t' => "tabs".to_owned(),
            other => format!("\"{other}\""),
        };
        let names = match found.head_line {
            0 => "no line of names, so its columns are \"column 1\" and so on".to_owned(),
            line => format!("names of columns in line {line}"),
        };
        let said = format!(
            "{}: {names}, {} rows below; cells apart by {form}, decimals behind \"{}\"",
            path.display(),
            found.n_rows,
            found.decimal
        );
        Self {
            found,
            head: format!(
                "# Proposed by abbe for {}. NEEDED marks what the table lacks: state it.\nseparator: {}\ndecimal: {}\n",
                in_one_line(&path.display().to_string()),
                if found.separator == '\t' {
                    "\"\\t\"".to_owned()
                } else {
                    quoted(&found.separator.to_string())
                },
                quoted(&found.decimal.to_string())
            ),
            test: String::new(),
            units: vec![],
            used: vec![],
            start_s: 0.0,
            is_axis_of_file: false,
            recognised: vec![said],
            needed: vec![],
            assumed: vec![],
        }
    }

    /// Names a column under a key.
    fn column(&mut self, key: &str, column: &Known) {
        let _ = writeln!(self.test, "    {key}: {}", quoted(&column.name));
        self.note(key, column);
    }

    /// Notes which column gave what a key holds.
    fn note(&mut self, key: &str, column: &Known) {
        self.used.push(column.name.clone());
        let name = &column.name;
        self.recognised.push(format!("{key}: column \"{name}\""));
    }

    /// Names the column that is read under a key, and says which other ones fit as well.
    fn read(&mut self, key: &str, column: &Known) {
        self.column(key, column);
        let others = self.found.as_plain(column);
        let others: Vec<String> = others.map(|other| format!("\"{}\"", other.name)).collect();
        if !others.is_empty() {
            self.needed.push(format!(
                "column \"{}\": read as {key}, and {} by name could be it as well: name the one that is meant in a map",
                column.name,
                others.join(", ")
            ));
        }
    }

    /// Lists what the table lacks.
    fn stated(&mut self, key: &str, value: &str, why: &str) {
        let _ = writeln!(self.test, "    {key}: {value}  # NEEDED: {why}");
        self.needed.push(format!("{key} = {value}: {why}"));
        self.assumed.push(key.to_owned());
    }

    /// States the unit of a column that is read in `wanted`; of one without a unit that cannot be right the `likely` one.
    fn unit(&mut self, column: &Known, wanted: Unit, likely: Option<Unit>) -> Result<()> {
        if let Some(cells) = &column.thousands {
            bail!("{}", unread::of_thousands(&column.name, cells));
        }
        if let Some(word) = &column.unknown {
            self.needed.push(format!(
                "column \"{}\": its unit \"{word}\" is not known: state it in units as one of {}",
                column.name,
                wanted.kind().units()
            ));
            return Ok(());
        }
        let unit = match (column.unit, likely) {
            (Some(unit), _) if unit.kind() != wanted.kind() => bail!(
                "column \"{}\": its unit {} cannot be that of a quantity in {}: write a map",
                column.name,
                unit.name(),
                wanted.name()
            ),
            (_, Some(likely)) => {
                let why = format!(
                    "column \"{}\": no unit in its name, and its numbers are too small for {}; {} is likely, and it is read so: correct it where it is another",
                    column.name,
                    wanted.name(),
                    likely.name()
                );
                self.needed.push(why);
                likely
            }
            (Some(unit), None) => unit,
            (None, None) => {
                let name = &column.name;
                let wanted = wanted.name();
                self.needed.push(format!(
                    "column \"{name}\": no unit in its name, read in {wanted}"
                ));
                return Ok(());
            }
        };
        if unit != wanted {
            self.units
                .push(format!("{}: {}", quoted(&column.name), unit.name()));
        }
        self.recognised
            .push(format!("column \"{}\" is in {}", column.name, unit.name()));
        Ok(())
    }

    fn positioning(&mut self, told: Option<Axis>) -> Result<()> {
        let found = self.found;
        titles::check(found)?;
        let target = found.first(Role::Target).context("no column of targets")?;
        let stated = found.axis_stated()?;
        let is_rotary = stated.is_some_and(|axis| !axis.is_linear());
        let is_angle = target
            .unit
            .map_or(is_rotary, |unit| unit.kind() == Kind::Angle);
        if let Some(axis) = stated.filter(|axis| axis.is_linear() == is_angle) {
            bail!(
                "the table says axis {axis}, and its targets (column \"{}\") are {}: correct one of them, or write a map",
                target.name,
                if is_angle { "angles" } else { "lengths" }
            );
        }
        let axis = told.filter(|axis| axis.is_linear() != is_angle);
        let taken = axis.unwrap_or(if is_angle { Axis::C } else { Axis::X });
        let units = units(taken);
        let [place, _] = units.of_cells;
        let is_linear = taken.is_linear();
        let key =
            |linear: &'static str, rotary: &'static str| if is_linear { linear } else { rotary };
        self.test.push_str("  positioning:\n");
        self.axis(axis, taken);
        let [feed, overrun] = units.keys;
        let [feed_per_min, dwell_s] = assumed_motion(found);
        self.stated(
            feed,
            feed_per_min,
            "feed between the targets; figures do not depend on it",
        );
        self.stated(
            "dwell_s",
            dwell_s,
            "rest at each target; figures do not depend on it",
        );
        self.stated(
            overrun,
            "1.0",
            "how far it turned round beyond an end; figures do not depend on it",
        );
        self.read(key("target_mm", "target_deg"), target);
        self.unit(target, place, likely_target(target, place))?;
        if self.readings(taken)? {
            return Ok(());
        }
        if let Some(run) = found.first(Role::Run) {
            self.column("run", run);
        }
        if let Some(direction) = found.first(Role::Direction) {
            self.column("direction", direction);
        } else {
            self.needed.push(
                "no column of directions: the side of approach follows from the order of the rows, which must be that of the measurement".to_owned(),
            );
        }
        Ok(())
    }

    /// Names the columns of the deviations; whether there is one for each pass.
    fn readings(&mut self, axis: Axis) -> Result<bool> {
        let found = self.found;
        let [place, deviation] = units(axis).of_cells;
        let key = |linear: &'static str, rotary: &'static str| {
            if axis.is_linear() { linear } else { rotary }
        };
        let passes = found.passes();
        if !passes.is_empty() {
            self.passes(&passes, key("passes_um", "passes_arcsec"), deviation)?;
            return Ok(true);
        }
        if let Some(read) = dial::column(found) {
            self.dial(key("deviation_um", "deviation_arcsec"), read);
            self.unit(read, deviation, likely_deviation(&[read], deviation))?;
            return Ok(false);
        }
        match (found.first(Role::Deviation), found.first(Role::Measured)) {
            (Some(read), _) => {
                sign::check(found, read)?;
                across::check(found, read)?;
                across::check_positions(found, &[read])?;
                self.read(key("deviation_um", "deviation_arcsec"), read);
                self.unit(read, deviation, likely_deviation(&[read], deviation))?;
            }
            (None, Some(read)) => {
                across::check_measured(found, read)?;
                self.read(key("measured_mm", "measured_deg"), read);
                let likely = likely_target(read, place);
                self.unit(read, place, likely)?;
            }
            (None, None) => bail!("no column of deviations"),
        }
        Ok(false)
    }

    fn passes(&mut self, passes: &[(&Known, Direction)], key: &str, wanted: Unit) -> Result<()> {
        pass_names::check(self.found)?;
        pass_names::check_sides(self.found)?;
        if let Some(run) = passes_of::run(self.found, passes) {
            self.column("run", run);
        }
        let _ = writeln!(self.test, "    {key}:");
        let columns: Vec<&Known> = passes.iter().map(|(column, _)| *column).collect();
        across::check_positions(self.found, &columns)?;
        let likely = likely_deviation(&columns, wanted);
        for (column, direction) in passes {
            let word = match direction {
                Direction::Up => "up",
                Direction::Down => "down",
            };
            let name = quoted(&column.name);
            let _ = writeln!(self.test, "      - {{column: {name}, direction: {word}}}");
            self.note(&format!("pass {word}"), column);
            match passes_of::unit(passes, column) {
                Some(unit) => self.unit_of_others(column, (unit, wanted)),
                None => self.unit(column, wanted, likely)?,
            }
        }
        Ok(())
    }

    fn axis(&mut self, told: Option<Axis>, taken: Axis) {
        if told.is_some() {
            let _ = writeln!(self.test, "    axis: {taken}");
            self.say_axis(taken);
            if let Some((name, _)) = &self.found.axis_column {
                self.used.push(name.clone());
            }
        } else {
            self.stated("axis", taken.letter(), "which axis moved");
        }
    }

    fn log(&mut self, told: Option<Axis>) -> Result<()> {
        let found = self.found;
        let time = found.first(Role::Time).context("no column of times")?;
        let read = found.first(Role::Displacement);
        let read = read.or_else(|| found.first(Role::Deviation));
        let read = read.context("no column of displacements")?;
        if let Some(axis) = found.axis_stated()?.filter(|axis| !axis.is_linear()) {
            bail!("the table says axis {axis}: a log is of a length along X, Y or Z: write a map");
        }
        let axis = told.filter(|axis| axis.is_linear());
        let taken = axis.unwrap_or(Axis::Z);
        self.test.push_str("  log:\n");
        self.axis(axis, taken);
        self.column("time_s", time);
        if let Some(dates) = &found.date_column {
            self.used.push(dates.clone());
            self.recognised
                .push(format!("dates before its times: column \"{dates}\""));
        }
        match epochs::of_first(time)? {
            Some(first_s) => self.start_s = first_s,
            None => self.time_unit(time)?,
        }
        self.read("displacement_um", read);
        self.unit(read, Unit::Um, likely_deviation(&[read], Unit::Um))?;
        if let Some(run) = found.first(Role::Run) {
            self.column("run", run);
        }
        let mut sensors: Vec<String> = vec![];
        for column in found.all(Role::Temperature) {
            let mut id = sensor_id(&column.name, sensors.len());
            if sensors.is_empty() {
                self.test.push_str("    temperature_degc:\n");
            }
            if sensors.contains(&id) {
                id = format!("{id}_no_{}", sensors.len() + 1);
            }
            let _ = writeln!(self.test, "      {id}: {}", quoted(&column.name));
            self.note(&format!("temperature_degc.{id}"), column);
            self.unit(column, Unit::Degc, None)?;
            sensors.push(id);
        }
        if !sensors.is_empty() {
            self.needed.push(
                "temperature_degc: the thermometers' names in the machine file, in place of those made from the columns".to_owned(),
            );
        }
        Ok(())
    }

    fn circle(&mut self, stem: &str) -> Result<()> {
        let found = self.found;
        let angle = found.first(Role::Angle).context("no column of angles")?;
        let (read, nominal) = radial::columns(found)?;
        let run = found.first(Role::Run);
        let run =
            run.context("no column of the run: a circle needs one that numbers the circles")?;
        self.test.push_str("  circle:\n");
        self.plane(stem)?;
        self.stated("centre_mm", "[0.0, 0.0, 0.0]", "centre of the circles");
        self.radius(nominal, stem);
        match radial::feed(found) {
            Some((column, feed_mm_min)) => {
                let _ = writeln!(self.test, "    feed_mm_min: {feed_mm_min:?}");
                self.note("feed_mm_min", column);
            }
            None => match titles::feed_mm_min(found) {
                Some(feed_mm_min) => {
                    let _ = writeln!(self.test, "    feed_mm_min: {feed_mm_min:?}");
                    self.recognised.push(format!("feed {feed_mm_min} mm/min"));
                }
                None => self.stated(
                    "feed_mm_min",
                    "1000.0",
                    "feed; what follows from speed depends on it",
                ),
            },
        }
        self.column("run", run);
        self.read("angle_deg", angle);
        self.unit(angle, Unit::Deg, None)?;
        self.read("radial_um", read);
        self.unit(read, Unit::Um, likely_deviation(&[read], Unit::Um))?;
        Ok(())
    }

    /// The whole map, with a comment for each column that it does not use.
    fn finished(&mut self) -> String {
        let mut map = self.head.clone();
        if self.start_s > 0.0 {
            let _ = writeln!(map, "start_s: {:.0}", self.start_s.floor());
        } else {
            map.push_str("start_s: 0  # NEEDED: when the measurement began, s since 1970\n");
            self.assumed.push("start_s".to_owned());
            self.needed
                .push("start_s: when the measurement began, s since 1970".to_owned());
        }
        if !self.units.is_empty() {
            let _ = writeln!(map, "units: {{{}}}", self.units.join(", "));
        }
        for line in &self.needed {
            if line.starts_with("column") {
                let _ = writeln!(map, "# NEEDED: {}", in_one_line(line));
            }
        }
        let others: Vec<&str> = names(self.found)
            .into_iter()
            .filter(|name| !self.used.iter().any(|used| used == name))
            .collect();
        if !others.is_empty() {
            self.recognised.push(format!(
                "columns that were not recognised: {}",
                others.join(", ")
            ));
        }
        for line in self.recognised.iter_mut().chain(&mut self.needed) {
            *line = in_one_line(line);
        }
        map.push_str("test:\n");
        map.push_str(&self.test);
        map
    }
}

/// Stops up to which each is taken to have lasted 2 s: half a day.
const SLOW_STOPS: usize = 20_000;

/// Feed per minute and dwell, s, that nobody stated: so that many stops fit into a day too.
fn assumed_motion(found: &Recognised) -> [&'static str; 2] {
    let n_stops = found.n_rows.saturating_mul(found.passes().len().max(1));
    if n_stops > SLOW_STOPS {
        ["10000.0", "0.5"]
    } else {
        ["1000.0", "2.0"]
    }
}

/// A thermometer's name from that of its column.
fn sensor_id(name: &str, n: usize) -> String {
    let plain = name.split(['[', '(']).next().unwrap_or_default();
    let words = plain.split(|letter: char| !letter.is_ascii_alphanumeric());
    let words: Vec<String> = words
        .filter(|word| !word.is_empty())
        .map(str::to_lowercase)
        .collect();
    let id = words.join("_");
    if id.starts_with(|letter: char| letter.is_ascii_lowercase()) {
        id
    } else {
        format!("sensor_{}", n + 1)
    }
}

mod across;
#[cfg(test)]
mod cells;
mod dial;
mod epochs;
mod file_axis;
mod kinds;
mod likely;
mod looked;
mod nothing;
#[cfg(test)]
mod other_quantities;
mod passes_of;
mod radial;
mod sign;
#[cfg(test)]
mod tests;
mod time_unit;
mod touched;
#[cfg(test)]
mod way_words;
