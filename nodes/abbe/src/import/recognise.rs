//! What the columns of a table are, by their names and their cells.

use anyhow::Result;
use metrology::Axis;

use super::beside;
use super::deviation_names;
use super::directions;
use super::map::{Direction, Plane};
use super::odd::is_missing;
use super::pass_names;
use super::quantities;
use super::said_of_numbers;
use super::sheet::Sheet;
use super::split_decimals;
use super::stated::{self, Stated};
use super::table::number_of;
use super::times;
use super::turned;
use super::units::{Kind, Unit};
use super::unread;
use super::vocabulary::{is_correction, is_difference, is_reversed, words};

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    Run,
    Direction,
    Target,
    Deviation,
    Measured,
    Pass(Direction),
    Time,
    Displacement,
    Temperature,
    Angle,
    Radial,
}

/// A column with what it holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Known {
    /// Its name as it stands in the file.
    pub name: String,
    /// What it holds; nothing that is known.
    pub role: Option<Role>,
    /// The unit in its name, or below it.
    pub unit: Option<Unit>,
    /// A word in the place of a unit that Abbe does not know.
    pub unknown: Option<String>,
    /// Its cells that are numbers.
    pub numbers: Vec<f64>,
    /// Two cells by which its separators are those of thousands: one with and one without.
    pub thousands: Option<[String; 2]>,
    /// Its first cell that is a number or an instant.
    pub first: String,
    /// The line of that cell.
    pub first_line: u64,
    /// Its first cell that is no number, with its line.
    pub odd: Option<(u64, String)>,
}

impl Known {
    /// How many words of its name qualify what it holds.
    fn n_qualifiers(&self) -> usize {
        let role = self.role;
        role.map_or(0, |role| {
            quantities::n_qualifiers(&quantity_words(&self.name), role)
        })
    }
}

/// A table that was looked at.
#[derive(Clone, Debug)]
pub struct Recognised {
    /// Separator of a text.
    pub separator: char,
    /// Before decimals.
    pub decimal: char,
    /// Line of the file that has the names, from 1.
    pub head_line: u64,
    /// Columns in their order.
    pub columns: Vec<Known>,
    /// Rows below the names.
    pub n_rows: usize,
    /// Lines above the names, with their numbers.
    pub above: Vec<(u64, String)>,
    /// Comments above the names.
    pub comments: Vec<(u64, String)>,
    /// A column of dates, which stand before the times of their rows.
    pub date_column: Option<String>,
    /// A column of axes, with the first of them.
    pub axis_column: Option<(String, Axis)>,
    /// A column of planes, with the first of them.
    pub plane_column: Option<(String, Plane)>,
    /// What is wrong with a column of axes or planes that names no axis or plane.
    pub odd: Option<String>,
}

/// Rows that are looked at for what a column holds.
const LOOKED_AT: usize = 2000;
/// Lines of a text from which its separator and decimals are recognised.
const BEGIN: usize = 20_000;
/// Looks at the cells of a file; `None`: no line of names has rows of numbers below it.
pub fn of(sheet: &Sheet, decimal: char) -> Option<Recognised> {
    match turned::of(sheet, decimal) {
        Some(turned) => {
            let found = named_columns(&turned.sheet, decimal)?;
            let odd = turned.odd.or(found.odd);
            Some(Recognised { odd, ..found })
        }
        None => named_columns(sheet, decimal),
    }
}

/// What the columns below a line of names hold.
fn named_columns(sheet: &Sheet, decimal: char) -> Option<Recognised> {
    let is_number = |cell: &String| number_of(cell, decimal).is_some() || is_instant(cell);
    let n_numbers = |cells: &[String]| cells.iter().filter(|cell| is_number(cell)).count();
    let n_words = |cells: &[String]| {
        let words = cells.iter().filter(|cell| !cell.is_empty());
        words.filter(|cell| !is_number(cell)).count()
    };
    let lines = &sheet.lines;
    let at = unread::names_at(lines, n_words, n_numbers).or_else(|| unread::head(lines))?;
    let (head_line, head) = &lines[at];
    let has_numbers = lines[at + 1..]
        .iter()
        .any(|(_, cells)| n_numbers(cells) > 0);
    let is_row = |cells: &[String]| match has_numbers {
        true => n_numbers(cells) > 0,
        false => cells.iter().any(|cell| unread::has_digit(cell)),
    };
    let rows = lines[at + 1..].iter().filter(|(_, cells)| is_row(cells));
    let rows: Vec<&(u64, Vec<String>)> = rows.take(LOOKED_AT).collect();
    let next = lines.get(at + 1).map_or(&[][..], |(_, cells)| cells);
    let units = next
        .iter()
        .map(String::as_str)
        .filter(|cell| !cell.is_empty());
    let units = if stated::is_row(units) { next } else { &[] };
    let columns = head.iter().enumerate().filter(|(_, name)| !name.is_empty());
    let columns = columns.map(|(k, name)| {
        let cells: Vec<(u64, &str)> = rows
            .iter()
            .filter_map(|(line, row)| Some((*line, row.get(k)?.as_str())))
            .filter(|(_, cell)| !cell.is_empty())
            .collect();
        let unit = units
            .get(k)
            .or_else(|| sheet.shown_units.get(&k))
            .map_or(Stated::Nothing, |cell| stated::of_cell(cell));
        known(name, unit, &cells, decimal)
    });
    let columns = deviation_names::plain_alone(columns.collect());
    let above = lines[..at]
        .iter()
        .map(|(line, cells)| (*line, cells.join(" ")));
    let below = &lines[at + 1..];
    let odd = beside::odd(head, below)
        .or_else(|| odd_direction(&columns, head, (below, decimal)))
        .or_else(|| split_decimals::odd(&columns, head, below))
        .or_else(|| said_of_numbers::odd(&columns, head, below));
    Some(Recognised {
        separator: sheet.separator.unwrap_or(','),
        decimal,
        head_line: *head_line,
        columns,
        n_rows: lines.len() - at - 1,
        above: above.collect(),
        comments: vec![],
        date_column: sheet.dates.and_then(|place| head.get(place).cloned()),
        axis_column: beside::axis(head, below),
        plane_column: beside::plane(head, below),
        odd,
    })
}

/// What is wrong with a column of directions beside targets that is not understood.
fn odd_direction(
    columns: &[Known],
    head: &[String],
    (lines, decimal): (&[(u64, Vec<String>)], char),
) -> Option<String> {
    let is_one = |column: &Known, role: Role| column.role == Some(role);
    let target = columns.iter().find(|column| is_one(column, Role::Target))?;
    let has_direction = |column: &Known| {
        is_one(column, Role::Direction) || matches!(column.role, Some(Role::Pass(_)))
    };
    let at = head.iter().position(|name| *name == target.name)?;
    let odd = || directions::odd(head, lines, at, decimal);
    match columns.iter().any(has_direction) {
        true => None,
        false => odd(),
    }
}

/// Whether a cell looks like a time of the day, with or without its date.
fn is_instant(cell: &str) -> bool {
    cell.contains(':') && cell.starts_with(|letter: char| letter.is_ascii_digit())
}

/// The best way to cut a text into cells: the one that gives most numbers in columns that have names.
///
/// # Errors
/// When the text has more cells or columns than are read.
pub fn of_text(text: &str) -> Result<Option<Recognised>> {
    let end = text.match_indices('\n').nth(BEGIN);
    let begin = end.map_or(text, |(end, _)| &text[..end]);
    let forms = [
        (';', ','),
        ('\t', ','),
        (';', '.'),
        ('\t', '.'),
        (',', '.'),
        (',', ','),
    ];
    let mut failed = None;
    let mut looked = vec![];
    for (separator, decimal) in forms {
        match Sheet::of_text(begin, separator) {
            // In quotes cells have commas too, before decimals or between thousands.
            Ok(sheet) if separator == decimal && !unread::has_decimal_commas(&sheet) => {}
            Ok(sheet) => looked.extend(of(&sheet, decimal)),
            Err(error) => failed = Some(error),
        }
    }
    if let (true, Some(error)) = (looked.is_empty(), failed) {
        return Err(error);
    }
    let best = looked.into_iter().max_by_key(|found| {
        let numbers: usize = found
            .columns
            .iter()
            .map(|column| column.numbers.len())
            .sum();
        // Of ways that give the same cells the plain one: a point as decimal.
        (numbers, found.decimal == '.')
    });
    // Blanks are between words too, so they part cells where nothing else does.
    let of_blanks = || {
        let sheet = Sheet::of_text(begin, ' ').ok()?;
        let forms = ['.', ','].into_iter();
        forms
            .filter_map(|decimal| of(&sheet, decimal))
            .find(unread::is_even)
    };
    let best = best.or_else(of_blanks);
    let best = match best {
        Some(best) if begin.len() < text.len() => {
            of(&Sheet::of_text(text, best.separator)?, best.decimal)
        }
        best => best,
    };
    Ok(best.map(|best| {
        let above = usize::try_from(best.head_line).unwrap_or(usize::MAX);
        let lines = (1..).zip(text.lines()).take(above);
        let comments = lines.filter(|(_, line)| line.starts_with('#'));
        let comments =
            comments.map(|(n, line)| (n, line.trim_matches(['#', ' ', '\t']).to_owned()));
        let comments = comments.collect();
        Recognised { comments, ..best }
    }))
}

/// What is stated by a name and by the cell below it; two units are one that is not known.
fn both(name: Stated, below: Stated) -> Stated {
    match (name, below) {
        (Stated::Nothing, stated) | (stated, Stated::Nothing) => stated,
        (name, below) if name.unit() == below.unit() => name,
        (Stated::Unit(_, a) | Stated::Unknown(a), Stated::Unit(_, b) | Stated::Unknown(b)) => {
            Stated::Unknown(format!("{a}, {b}"))
        }
    }
}

fn known(name: &str, below: Stated, lines: &[(u64, &str)], decimal: char) -> Known {
    let cells: Vec<&str> = lines.iter().map(|(_, cell)| *cell).collect();
    let cells = cells.as_slice();
    let (_, unit_word) = parts(name);
    let words = quantity_words(name);
    let stated = both(stated::of(name), below);
    let unit = stated.unit();
    let unit = unit.or_else(|| times::named_unit(name));
    let unknown = stated.unknown();
    let is_letter = unit_word.is_some_and(|word| word == "C" || word == "c");
    let is_degree = is_letter || unit.is_some_and(|unit| unit.kind() == Kind::Temperature);
    let numbers: Vec<f64> = cells
        .iter()
        .filter_map(|cell| number_of(cell, decimal))
        .collect();
    let is_numeric = 2 * numbers.len() > cells.len();
    let role = if is_degree {
        Some(Role::Temperature)
    } else {
        role(name, &words, unit, (cells, is_numeric))
    };
    let (first_line, first) = first(lines, decimal);
    let small = || {
        let is_small = match role {
            Some(Role::Target) => matches!(unit, Some(Unit::Um | Unit::Nm)),
            Some(Role::Deviation | Role::Pass(_) | Role::Displacement | Role::Radial) => {
                unit == Some(Unit::Nm)
            }
            _ => false,
        };
        is_small.then(|| unread::thousands_of_small(cells, decimal))?
    };
    let is_bare = unit.is_none() && unknown.is_none();
    let is_place = || is_bare && is_numeric && quantities::is_warm(&words, &numbers);
    let is_open = role.is_none() || role == Some(Role::Displacement) && quantities::is_nut(&words);
    let role = role.filter(|_| !(is_open && is_place()));
    let role = role.or_else(|| is_place().then_some(Role::Temperature));
    Known {
        name: name.to_owned(),
        role,
        unit,
        unknown,
        numbers,
        thousands: unread::thousands(cells, decimal).or_else(small),
        first: first.to_owned(),
        first_line,
        odd: odd(lines, decimal),
    }
}

/// The first cell that is a number or an instant, with its line; otherwise the first cell.
fn first<'c>(lines: &[(u64, &'c str)], decimal: char) -> (u64, &'c str) {
    let is_value = |cell: &str| number_of(cell, decimal).is_some() || is_instant(cell);
    let value = lines.iter().find(|(_, cell)| is_value(cell));
    value.or(lines.first()).copied().unwrap_or_default()
}

/// The first cell that is neither a number nor an instant nor missing, with its line.
fn odd(lines: &[(u64, &str)], decimal: char) -> Option<(u64, String)> {
    let is_value =
        |cell: &str| number_of(cell, decimal).is_some() || is_instant(cell) || is_missing(cell);
    let odd = lines.iter().find(|(_, cell)| !is_value(cell));
    odd.map(|(line, cell)| (*line, (*cell).to_owned()))
}

/// The words of a name in lower case, and what stands where a unit does: in brackets, or last behind a blank, `/` or `_`.
pub fn parts(name: &str) -> (Vec<String>, Option<String>) {
    let mut rest = name.to_owned();
    let mut unit = None;
    for (open, close) in [('[', ']'), ('(', ')')] {
        if let (Some(from), Some(to)) = (rest.rfind(open), rest.rfind(close))
            && from < to
        {
            unit = Some(rest[from + open.len_utf8()..to].trim().to_owned());
            rest.replace_range(from..=to, " ");
            break;
        }
    }
    let tokens =
        rest.split(|letter: char| !letter.is_alphanumeric() && letter != 'µ' && letter != '°');
    let mut words: Vec<String> = tokens
        .filter(|word| !word.is_empty())
        .map(str::to_lowercase)
        .collect();
    if unit.is_none()
        && words.len() > 1
        && let Some(last) = words.last()
        && Unit::of_word(last).is_some()
    {
        unit = words.pop();
    }
    (words, unit)
}

/// The words of a name and of a note in its brackets, without the unit.
fn quantity_words(name: &str) -> Vec<String> {
    let (mut all, inner) = parts(name);
    let note = inner.filter(|inner| Unit::of_word(inner).is_none());
    all.extend(note.iter().flat_map(|note| words(note)));
    all
}

/// Whether a column is that of the directions; one odd cell makes no other of it.
fn is_direction(cells: &[&str], is_named: bool, is_numeric: bool) -> bool {
    // A letter or a word of another language is a direction under a name that says so.
    let way = |cell: &&str| match is_named {
        true => directions::of_cell(cell),
        false => Direction::of_word(cell),
    };
    let ways = cells.iter().filter_map(way);
    let ways: Vec<Direction> = ways.collect();
    let has_both = ways.contains(&Direction::Up) && ways.contains(&Direction::Down);
    let are_all = ways.len() == cells.len();
    let are_most = 10 * ways.len() >= 9 * cells.len() && (is_named || has_both);
    !ways.is_empty() && (are_all || are_most) && (is_named || !is_numeric)
}

fn role(
    name: &str,
    words: &[String],
    unit: Option<Unit>,
    (cells, is_numeric): (&[&str], bool),
) -> Option<Role> {
    if is_direction(cells, directions::is_name(name), is_numeric) {
        return Some(Role::Direction);
    }
    let kind = unit.map(Unit::kind);
    let has_clock = 2 * cells.iter().filter(|cell| is_instant(cell)).count() > cells.len();
    if has_clock || kind == Some(Kind::Time) {
        return Some(Role::Time);
    }
    if !is_numeric || is_correction(name) || is_reversed(name) {
        return None;
    }
    if is_difference(name) {
        return Some(Role::Deviation);
    }
    if let Some(pass) = pass_names::of(name) {
        return Some(Role::Pass(pass.direction));
    }
    // One of a side is no quantity of both.
    let role = quantities::of(words, kind == Some(Kind::Length), cells)?;
    let is_of_both = matches!(role, Role::Temperature | Role::Time | Role::Run);
    (is_of_both || !pass_names::has_direction(name)).then_some(role)
}

/// What a column of numbers holds by its name alone.
pub fn role_of_name(name: &str) -> Option<Role> {
    role(name, &quantity_words(name), None, (&[], true))
}

impl Recognised {
    /// The column of a role whose name says least beside it; of several the first.
    pub fn first(&self, role: Role) -> Option<&Known> {
        self.all(role).min_by_key(|column| column.n_qualifiers())
    }

    /// The other columns of the same role whose names say as little beside it.
    pub fn as_plain<'c>(&'c self, read: &'c Known) -> impl Iterator<Item = &'c Known> {
        let columns = self
            .columns
            .iter()
            .filter(|column| column.role == read.role);
        columns.filter(|column| {
            column.name != read.name && column.n_qualifiers() == read.n_qualifiers()
        })
    }

    /// Every column of a role.
    pub fn all(&self, role: Role) -> impl Iterator<Item = &Known> {
        let columns = self.columns.iter();
        columns.filter(move |column| column.role == Some(role))
    }

    /// The columns of passes with their directions, in their order.
    pub fn passes(&self) -> Vec<(&Known, Direction)> {
        let columns = self.columns.iter();
        let pass = |column: &'_ Known| match column.role {
            Some(Role::Pass(direction)) => Some(direction),
            _ => None,
        };
        columns
            .filter_map(|column| Some((column, pass(column)?)))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn roles(text: &str) -> Vec<(String, Option<Role>)> {
        let found = of_text(text).unwrap().expect("a table");
        let columns = found.columns.into_iter();
        columns.map(|column| (column.name, column.role)).collect()
    }

    #[test]
    fn columns_are_known_by_their_names_and_cells() {
        for (text, wanted) in [
            (
                "run,direction,target_mm,deviation_um\n1,up,0,0.5\n1,down,0,2\n",
                vec![Role::Run, Role::Direction, Role::Target, Role::Deviation],
            ),
            (
                "Laser\n\nLauf;Richtung;Sollposition [mm];Abweichung [µm]\n1;+;0,000;-1,5\n1;-;0,000;2,5\n",
                vec![Role::Run, Role::Direction, Role::Target, Role::Deviation],
            ),
            (
                "Position [mm]\t1 up\t1 down\tRun 2 ↑\t2-\n0\t1.5\t2.5\t1.0\t3\n",
                vec![
                    Role::Target,
                    Role::Pass(Direction::Up),
                    Role::Pass(Direction::Down),
                    Role::Pass(Direction::Up),
                    Role::Pass(Direction::Down),
                ],
            ),
            (
                "time_s,z_um,spindle [°C],room (degC)\n0,0.1,20.5,20.0\n",
                vec![
                    Role::Time,
                    Role::Displacement,
                    Role::Temperature,
                    Role::Temperature,
                ],
            ),
            (
                "time_s,x_um,spindle,spindle speed,room\n0,0.1,20.5,6000,20.0\n",
                vec![
                    Role::Time,
                    Role::Displacement,
                    Role::Temperature,
                    Role::Temperature,
                ],
            ),
            (
                "cycle,angle_deg,radial_um\n1,0,2\n1,10,3\n",
                vec![Role::Run, Role::Angle, Role::Radial],
            ),
            (
                "Target position (inch),Measured position (inch)\n1,1.0001\n2,2.0001\n",
                vec![Role::Target, Role::Measured],
            ),
        ] {
            let found: Vec<Role> = roles(text)
                .into_iter()
                .filter_map(|(_, role)| role)
                .collect();
            assert_eq!(found, wanted, "{text}");
        }
    }

    #[test]
    fn separators_decimals_and_units_are_those_of_the_text() {
        let found = of_text("n;Position [mm];Error [µm]\n1;0,5;-1,25\n1;1,5;2,5\n")
            .unwrap()
            .expect("a table");
        assert_eq!((found.separator, found.decimal), (';', ','));
        let units: Vec<Option<Unit>> = found.columns.iter().map(|column| column.unit).collect();
        assert_eq!(units, [None, Some(Unit::Mm), Some(Unit::Um)]);
        let found = of_text("# made\nAxis Y\nn,t,d\n1,0,1.5\n")
            .unwrap()
            .expect("a table");
        assert_eq!(
            (found.separator, found.decimal, found.head_line),
            (',', '.', 3)
        );
        assert_eq!(found.axis("table", false).expect("an axis"), Some(Axis::Y));
        let found = of_text("# made\n# units: mm\n\nn,t,d\n1,0,1.5\n")
            .unwrap()
            .expect("a table");
        assert_eq!(found.head_line, 4, "below two comments and an empty line");
        let found =
            of_text("Units;inch\nrun;direction;target;deviation\n1;up;0;0.5\n1;up;10;0.7\n");
        assert_eq!(found.unwrap().expect("a table").head_line, 2);
        assert_eq!(
            of_text("no numbers\nat all\n")
                .unwrap()
                .map(|found| found.n_rows),
            None
        );
        let found = of_text("time_s,z_um\n0,1\n60,2\n")
            .unwrap()
            .expect("a table");
        assert_eq!(
            ["log", "lead_X"].map(|stem| found.axis(stem, true).expect("an axis")),
            [Some(Axis::Z); 2],
            "a column says more than the name of a file"
        );
    }

    #[test]
    fn one_odd_cell_makes_no_other_column_of_the_directions_and_times() {
        for odd in ["x", "?", "north", "0", "n/a"] {
            for (up, down) in [("up", "down"), ("+", "-"), ("1", "-1"), ("↑", "↓")] {
                let rows = (0..20).map(|k| {
                    let way = if k % 2 == 0 { up } else { down };
                    let way = if k == 7 { odd } else { way };
                    format!("1,{way},{k},0.5\n")
                });
                let rows: String = rows.collect();
                let found = roles(&format!("run,direction,target_mm,deviation_um\n{rows}"));
                assert_eq!(found[1].1, Some(Role::Direction), "{odd} {up}");
            }
        }
        let rows: String = (10..40).map(|k| format!("08:{k}:00,0.{k}\n")).collect();
        let found = of_text(&format!("when,z_um\nbegin,0.1\n{rows}"))
            .unwrap()
            .unwrap();
        let time = found.first(Role::Time).unwrap();
        assert_eq!(time.first, "08:10:00");
        // Remarks are no directions.
        let notes: String = (0..20)
            .map(|k| format!("{k},0.5,{}\n", if k == 3 { "slow" } else { "-" }))
            .collect();
        let found = roles(&format!("target_mm,deviation_um,remark\n{notes}"));
        assert_eq!(found[2].1, None);
    }
}
