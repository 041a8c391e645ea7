//! Tables with the targets across, as the forms of ISO 230-2 print them: a row of targets, and below it a row for each pass.
//!
//! Such a table is turned round: a row for each target, with a column for each pass. What is made of it then is what is made of
//! any table with a column for each pass. Rows of means, standard deviations and other results are left out by their names.

use anyhow::{Result, bail};
use metrology::yaml::shown;

use super::directions;
use super::map::Direction;
use super::odd::is_missing;
use super::pass_names;
use super::quantities::is_no_reading;
use super::recognise::{Role, role_of_name};
use super::sheet::Sheet;
use super::stated::{self, Stated};
use super::table::number_of;
use super::vocabulary::words;

/// Fewest targets by which a row of them is known.
const LEAST_TARGETS: usize = 3;
/// Results of ISO 230-2, as forms abbreviate them.
const SYMBOLS: &[&str] = &[
    "x", "xi", "xm", "s", "si", "b", "bi", "r", "ri", "a", "e", "m", "u", "uk", "2s", "3s", "4s",
    "2si", "3si", "4si", "σ", "δ", "δx", "mw",
];
/// Names of a row that numbers the targets.
const INDEX_NAMES: &[&str] = &["i", "no", "nr", "n", "point", "punkt", "index"];

/// A table that was turned round.
pub struct Turned {
    /// The table with a row for each target.
    pub sheet: Sheet,
    /// Why it cannot be read.
    pub odd: Option<String>,
}

/// A row of targets.
struct Targets {
    /// Place among the lines.
    at: usize,
    /// Place of the first target among the cells.
    first: usize,
    /// How many there are.
    n: usize,
}

/// One row below the targets.
enum Kind {
    Pass(Pass),
    /// The direction of the rows below it.
    Heading(Direction),
    /// A result, by its name.
    Summary,
    /// Numbers of which nobody says what they are.
    Unknown,
    /// Units of the deviations.
    Units(Stated),
    Text,
}

/// A row of deviations.
struct Pass {
    label: String,
    direction: Direction,
    number: Option<u32>,
}

/// The table turned round; `None`: its targets are not across.
pub fn of(sheet: &Sheet, decimal: char) -> Option<Turned> {
    let targets = { 0..sheet.lines.len() }.find_map(|at| targets_at(sheet, at, decimal))?;
    let rows = Rows::of(sheet, &targets, decimal);
    let is_pass = |kind: &Kind| matches!(kind, Kind::Pass(_));
    rows.kinds.iter().position(is_pass)?;
    let odd = rows.odd(sheet, &targets);
    let names = rows.names();
    let head = target_name(sheet, &targets);
    let (head_line, target_cells) = &sheet.lines[targets.at];
    let mut lines = sheet.lines[..targets.at].to_vec();
    lines.push((*head_line, std::iter::once(head).chain(names).collect()));
    for k in targets.first..targets.first + targets.n {
        let cell = |cells: &[String]| cells.get(k).cloned().unwrap_or_default();
        let passes = rows.passes().map(|(place, _)| cell(&sheet.lines[place].1));
        let target = std::iter::once(cell(target_cells));
        // Messages name the place of a cell by its column, since its row is in the name of the pass.
        lines.push((k as u64 + 1, target.chain(passes).collect()));
    }
    let remarks = rows.remarks(sheet, &targets);
    Some(Turned {
        sheet: Sheet {
            lines,
            separator: sheet.separator,
            comments: sheet.comments.clone(),
            turned: remarks,
            ..Sheet::default()
        },
        odd,
    })
}

/// The table turned round where its targets are across, otherwise as it is.
///
/// # Errors
/// With the line of what cannot be read of a table with its targets across.
pub fn applied(sheet: Sheet, decimal: char) -> Result<Sheet> {
    match of(&sheet, decimal) {
        Some(Turned { odd: Some(odd), .. }) => bail!("{odd}"),
        Some(turned) => Ok(turned.sheet),
        None => Ok(sheet),
    }
}

/// A row of targets with a pass as the next row of numbers.
fn targets_at(sheet: &Sheet, at: usize, decimal: char) -> Option<Targets> {
    let (_, cells) = sheet.lines.get(at)?;
    let number = |cell: &String| number_of(cell, decimal);
    let first = cells.iter().position(|cell| number(cell).is_some())?;
    let all: Vec<f64> = cells[first..].iter().map_while(number).collect();
    let n = all.len();
    let is_up = |two: &[f64]| two[1] > two[0];
    let is_down = |two: &[f64]| two[1] < two[0];
    let is_ordered = all.windows(2).all(is_up) || all.windows(2).all(is_down);
    let lead = &cells[..first];
    let is_way = |cell: &String| {
        role_of_name(cell) != Some(Role::Target) && directions::of_cell(cell).is_some()
    };
    let has_way = lead.iter().any(is_way);
    if first == 0 || n < LEAST_TARGETS || !is_ordered || has_way {
        return None;
    }
    let targets = Targets { at, first, n };
    let below = sheet.lines[at + 1..].iter();
    let mut group = None;
    for (_, cells) in below {
        match kind_of(&label(cells, first), cells, (&targets, decimal, group)) {
            Kind::Pass(_) => return Some(targets),
            Kind::Heading(way) => group = Some(way),
            Kind::Units(_) | Kind::Text => {}
            Kind::Summary | Kind::Unknown => return None,
        }
    }
    None
}

/// What stands before the targets of a row.
fn label(cells: &[String], first: usize) -> String {
    let lead = cells.iter().take(first).map(|cell| cell.trim());
    lead.filter(|cell| !cell.is_empty())
        .collect::<Vec<_>>()
        .join(" ")
}

fn kind_of(
    label: &str,
    cells: &[String],
    (targets, decimal, group): (&Targets, char, Option<Direction>),
) -> Kind {
    let values = || cells.iter().skip(targets.first).take(targets.n);
    let n_numbers = values()
        .filter(|cell| number_of(cell, decimal).is_some())
        .count();
    let n_filled = values().filter(|cell| !is_missing(cell)).count();
    if n_numbers == 0 {
        let filled = cells
            .iter()
            .map(String::as_str)
            .filter(|cell| !cell.is_empty());
        if stated::is_row(filled) {
            let mut units = values().map(|cell| stated::of_cell(cell));
            let unit = units.find(|unit| unit.unit().is_some());
            return Kind::Units(unit.unwrap_or(Stated::Nothing));
        }
    }
    let pass = (!is_summary(label)).then(|| pass(label, group)).flatten();
    let is_blank = n_filled == 0 && values().all(String::is_empty);
    match pass {
        Some(pass) if is_blank && pass.number.is_none() => Kind::Heading(pass.direction),
        Some(pass) if n_numbers > 0 || !is_blank => Kind::Pass(pass),
        Some(_) => Kind::Text,
        None if n_numbers == 0 => Kind::Text,
        None if is_summary(label) => Kind::Summary,
        None => Kind::Unknown,
    }
}

/// Whether a name is that of a result.
fn is_summary(label: &str) -> bool {
    let all = words(label);
    let is_way = |word: &String| Direction::of_word(word).is_some() && word.parse::<f64>().is_err();
    let mut own = all
        .iter()
        .filter(|word| !is_way(word) && *word != "i")
        .peekable();
    is_no_reading(&all)
        || (own.peek().is_some() && own.all(|word| SYMBOLS.contains(&word.as_str())))
}

/// The pass of a name; `group`: the direction that stands above rows with a number alone.
fn pass(label: &str, group: Option<Direction>) -> Option<Pass> {
    let bare = label.split(['[', '(']).next().unwrap_or_default();
    let digits = bare.split(|letter: char| !letter.is_ascii_digit());
    let mut numbers = digits.filter_map(|digits| digits.parse().ok());
    let number = numbers.next();
    let is_number = bare.trim().parse::<f64>().is_ok();
    let direction = match (is_number, group) {
        (true, group) => group,
        (false, _) => pass_names::of(label)
            .map(|pass| pass.direction)
            .or_else(|| directions::of_cell(bare))
            .or_else(|| of_cells(bare)),
    }?;
    Some(Pass {
        label: label.to_owned(),
        direction,
        number,
    })
}

/// The direction of a number and a word of it in two cells, such as `2 hin` or `1 +X`.
fn of_cells(label: &str) -> Option<Direction> {
    let (one, other) = label.trim().split_once(char::is_whitespace)?;
    let is_number = |word: &str| word.parse::<u32>().is_ok();
    let way = match (is_number(one), is_number(other)) {
        // Of two numbers the second is the direction: 1 and -1.
        (true, _) => other,
        (false, true) => one,
        (false, false) => return None,
    };
    directions::of_cell(way).or_else(|| Direction::of_word(way))
}

/// The rows below the targets with what they are.
struct Rows {
    /// Place of the first among the lines.
    begin: usize,
    kinds: Vec<Kind>,
}

impl Rows {
    fn of(sheet: &Sheet, targets: &Targets, decimal: char) -> Self {
        let begin = targets.at + 1;
        let mut group = None;
        let mut above: Vec<String> = vec![];
        let mut kinds = vec![];
        for (_, cells) in &sheet.lines[begin..] {
            let lead: Vec<String> = cells.iter().take(targets.first).cloned().collect();
            let has_any = lead.iter().any(|cell| !cell.is_empty());
            // A merged cell has its text in the first of its rows.
            let carried: Vec<String> = lead
                .iter()
                .enumerate()
                .map(|(k, cell)| match above.get(k) {
                    Some(before) if cell.is_empty() && has_any => before.clone(),
                    _ => cell.clone(),
                })
                .collect();
            let own = label(cells, targets.first);
            let full = label(&carried, targets.first);
            let name = if is_summary(&own) { own } else { full };
            let kind = kind_of(&name, cells, (targets, decimal, group));
            if let Kind::Heading(way) = &kind {
                group = Some(*way);
            }
            if matches!(kind, Kind::Pass(_)) {
                above = carried;
            }
            kinds.push(kind);
        }
        Self { begin, kinds }
    }

    /// The passes with their places among the lines.
    fn passes(&self) -> impl Iterator<Item = (usize, &Pass)> {
        let rows = (self.begin..).zip(&self.kinds);
        rows.filter_map(|(place, kind)| match kind {
            Kind::Pass(pass) => Some((place, pass)),
            _ => None,
        })
    }

    /// Names of the columns of passes: their labels where each has a number and a known word, otherwise made ones.
    fn names(&self) -> Vec<String> {
        let has_numbers = self.passes().any(|(_, pass)| pass.number.is_some());
        let unit = self.kinds.iter().find_map(|kind| match kind {
            Kind::Units(Stated::Unit(_, word)) => Some(word.clone()),
            _ => None,
        });
        let mut counted = [0_u32; 2];
        let name = |pass: &Pass| {
            let (word, place) = match pass.direction {
                Direction::Up => ("up", 0),
                Direction::Down => ("down", 1),
            };
            counted[place] += 1;
            let own = match (stated::of(&pass.label), &unit) {
                (Stated::Unit(_, word), _) => Some(word),
                (_, unit) => unit.clone(),
            };
            let behind = own.map_or_else(String::new, |unit| format!(" [{unit}]"));
            let is_known = pass_names::of(&pass.label).is_some();
            match (has_numbers, pass.number, is_known) {
                (true, _, true) if stated::of(&pass.label) == Stated::Nothing => {
                    format!("{}{behind}", pass.label)
                }
                (true, _, true) => pass.label.clone(),
                (true, Some(number), false) => format!("{number} {word}{behind}"),
                _ => format!("{} {word}{behind}", counted[place]),
            }
        };
        self.passes().map(|(_, pass)| pass).map(name).collect()
    }

    /// Why the table cannot be read.
    fn odd(&self, sheet: &Sheet, targets: &Targets) -> Option<String> {
        let (line, cells) = &sheet.lines[targets.at];
        let name = label(cells, targets.first);
        let numbers = cells[targets.first..].iter().take(targets.n);
        let are_counted = (1..)
            .zip(numbers)
            .all(|(k, cell): (usize, _)| *cell == k.to_string());
        if are_counted && INDEX_NAMES.contains(&name.to_lowercase().as_str()) {
            return Some(format!(
                "line {line}: \"{}\" numbers the targets, and no row has their positions: add one below it, such as `target [mm]`",
                shown(&name)
            ));
        }
        let last = self.passes().last().map_or(0, |(place, _)| place);
        let mut rows = (self.begin..last).zip(&self.kinds);
        let (place, _) = rows.find(|(_, kind)| matches!(kind, Kind::Unknown))?;
        let (line, cells) = &sheet.lines[place];
        Some(format!(
            "line {line}: \"{}\": a row of numbers between passes, and no pass by its name: name it as its neighbours, such as `3 up` or \
             `3 down`, or take it away",
            shown(&label(cells, targets.first))
        ))
    }

    /// What was done with the rows.
    fn remarks(&self, sheet: &Sheet, targets: &Targets) -> Vec<String> {
        let line = sheet.lines[targets.at].0;
        let n = self.passes().count();
        let mut remarks = vec![format!(
            "targets across: {} of them in line {line}, {n} passes below; they were turned round, and \"line N\" of a cell is column N of the file",
            targets.n
        )];
        let mut names = vec![];
        for (place, kind) in (self.begin..).zip(&self.kinds) {
            let (line, cells) = &sheet.lines[place];
            let name = label(cells, targets.first);
            match kind {
                Kind::Summary => names.push(format!("\"{}\" (line {line})", shown(&name))),
                Kind::Unknown => remarks.push(format!(
                    "warning, line {line}: \"{}\": a row of numbers that is no pass by its name: left out",
                    shown(&name)
                )),
                _ => {}
            }
        }
        if !names.is_empty() {
            remarks.push(format!("rows of results, left out: {}", names.join(", ")));
        }
        remarks
    }
}

/// Name of the column of targets, with the unit that its row states.
fn target_name(sheet: &Sheet, targets: &Targets) -> String {
    let (_, cells) = &sheet.lines[targets.at];
    let mut lead = cells.iter().take(targets.first);
    if let Some(name) = lead
        .clone()
        .find(|name| role_of_name(name) == Some(Role::Target))
    {
        return name.clone();
    }
    let unit = lead.find_map(|name| match (stated::of(name), stated::of_cell(name)) {
        (Stated::Unit(_, word) | Stated::Unknown(word), _)
        | (Stated::Nothing, Stated::Unit(_, word)) => Some(word),
        (Stated::Nothing, _) => None,
    });
    unit.map_or_else(|| "target".to_owned(), |unit| format!("target [{unit}]"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turned(text: &str) -> Option<Turned> {
        of(&Sheet::of_text(text, ',').unwrap(), '.')
    }

    fn cells(turned: &Turned) -> Vec<String> {
        let lines = turned.sheet.lines.iter();
        lines.map(|(_, cells)| cells.join("|")).collect()
    }

    #[test]
    fn rows_of_passes_become_columns_whatever_they_are_called() {
        for (text, head) in [
            (
                "Pi [mm],0,10,20\n1 ↑,1,2,3\n1 ↓,4,5,6\n",
                "target [mm]|1 ↑|1 ↓",
            ),
            (
                "Target (mm),0,10,20\nup 1,1,2,3\ndown 1,4,5,6\n",
                "Target (mm)|up 1|down 1",
            ),
            (
                "Position,0,10,20\nRun 1 forward,1,2,3\nRun 1 reverse,4,5,6\n",
                "Position|Run 1 forward|Run 1 reverse",
            ),
            (
                "Run,Direction,0,10,20\n1,up,1,2,3\n1,down,4,5,6\n",
                "target|1 up|1 down",
            ),
            (
                "Run,Direction,0,10,20\n1,up,1,2,3\n,down,4,5,6\n",
                "target|1 up|1 down",
            ),
            (
                "Lauf,Richtung,0,10,20\n1,hin,1,2,3\n1,zurück,4,5,6\n",
                "target|1 up|1 down",
            ),
            (
                "n,way,0,10,20\n1,1,1,2,3\n1,-1,4,5,6\n",
                "target|1 up|1 down",
            ),
            (",0,10,20\n↑,1,2,3\n↓,4,5,6\n", "target|1 up|1 down"),
            (
                "mm,0,10,20\n↑,,,\n1,1,2,3\n↓,,,\n1,4,5,6\n",
                "target [mm]|1 up|1 down",
            ),
            (
                "i,1,2,3\ntarget mm,0,10,20\n,um,um,um\n1 up,1,2,3\n1 down,4,5,6\n",
                "target mm|1 up [um]|1 down [um]",
            ),
        ] {
            let turned = turned(text).expect(text);
            assert_eq!(turned.odd, None, "{text}");
            let all = cells(&turned);
            let rows = all.len() - 4;
            assert_eq!(all[rows..], [head, "0|1|4", "10|2|5", "20|3|6"], "{text}");
        }
    }

    #[test]
    fn rows_of_results_are_left_out_by_their_names() {
        let results = [
            "x̄↑",
            "x̄ ↓",
            "s↑",
            "Mean up",
            "2s",
            "B_i",
            "A ↑",
            "R",
            "E",
            "M",
            "U",
            "Mittelwert ↓",
            "Std. dev. up",
            "x̄↑ + 2s↑",
            "Umkehrspanne",
        ];
        let rows: String = results.map(|name| format!("{name},7,8,9\n")).concat();
        let text = format!("target mm,0,10,20\n1 ↑,1,2,3\n1 ↓,4,5,6\n{rows}");
        let turned = turned(&text).expect("targets across");
        assert_eq!(cells(&turned)[1], "0|1|4", "{:?}", cells(&turned));
        let said = turned.sheet.turned.join("\n");
        for name in results {
            assert!(said.contains(&format!("\"{name}\"")), "{name}: {said}");
        }
        assert!(!said.contains("warning"), "{said}");
    }

    #[test]
    fn what_is_no_pass_is_named_and_other_tables_are_left_alone() {
        let strange = "target mm,0,10,20\n1 ↑,1,2,3\nhello,7,8,9\n1 ↓,4,5,6\n";
        let odd = turned(strange).and_then(|turned| turned.odd).unwrap();
        assert!(odd.starts_with("line 3: \"hello\""), "{odd}");
        let behind = "target mm,0,10,20\n1 ↑,1,2,3\n1 ↓,4,5,6\nhello,7,8,9\n";
        let said = turned(behind).unwrap().sheet.turned.join("\n");
        assert!(said.contains("warning, line 4: \"hello\""), "{said}");
        let counted = "i,1,2,3\n1 ↑,1,2,3\n1 ↓,4,5,6\n";
        let odd = turned(counted).and_then(|turned| turned.odd).unwrap();
        assert!(odd.contains("no row has their positions"), "{odd}");
        for other in [
            "direction,target_mm,deviation_um,degc\nup,0,0.5,20\nup,10,0.7,20.1\ndown,10,0.9,20.2\n",
            "name,x,y,z\nP1,0,1,2\nP2,1,2,3\n",
            "target_mm,1 up,1 down\n0,1,2\n10,2,3\n",
            "way,t,d\n1 up,0,0.5\n1 up,10,0.7\n",
            "target mm,0,10,20\n1,1,2,3\n2,4,5,6\n",
            "",
        ] {
            let sheet = Sheet::of_text(other, ',');
            assert!(
                sheet.is_err() || of(&sheet.unwrap(), '.').is_none(),
                "{other}"
            );
        }
    }
}
