//! Lists of touches as controls write them.
//!
//! | form | a line | from |
//! |---|---|---|
//! | LinuxCNC, `(PROBEOPEN file)` | nine numbers with six decimals: X Y Z A B C U V W | `emc/task/emccanon.cc`: position in the unit and the coordinate system of the program; one that equals the one before is not written |
//! | letters with numbers: DPRNT of FANUC and Haas, FN 16 of HEIDENHAIN | `X12.345 Y-3.210 Z-50.002`, `X = 12,345; Y = -3,210` | the program that writes them chooses the form |
//!
//! An empty line, or one of text, begins another measurement: another run.

use anyhow::{Result, bail};

use super::sheet::{Cells, MOST_CELLS, Sheet};

/// Numbers of a line of LinuxCNC.
const POSE: usize = 9;
/// Decimals of each.
const DECIMALS: usize = 6;
/// Fewest lines by which a form is known.
const LEAST_LINES: usize = 2;
/// Letters of words that programs have and lists have not.
const OF_PROGRAMS: &str = "GMTSO";
const AXES: [char; 9] = ['X', 'Y', 'Z', 'A', 'B', 'C', 'U', 'V', 'W'];

/// A letter with its number, as text with a point before decimals.
type Word = (char, String);

/// Lines with their numbers; the last one may be cut where a long file was looked at from its begin.
fn lines(text: &str) -> impl Iterator<Item = (u64, &str)> {
    (1..).zip(text.lines()).map(|(n, line)| (n, line.trim()))
}

pub(super) fn filled(text: &str) -> Vec<&str> {
    let whole = match text.rfind('\n') {
        Some(end) if end > 0 => &text[..end],
        _ => text,
    };
    let all = lines(whole).map(|(_, line)| line);
    all.filter(|line| !line.is_empty()).collect()
}

/// The nine numbers of a line of LinuxCNC.
fn pose(line: &str) -> Option<Vec<&str>> {
    let cells: Vec<&str> = line.split_whitespace().collect();
    let is_one = |cell: &&str| {
        let decimals = cell.split_once('.').map(|(_, decimals)| decimals.len());
        decimals == Some(DECIMALS) && cell.parse::<f64>().is_ok_and(f64::is_finite)
    };
    (cells.len() == POSE && cells.iter().all(is_one)).then_some(cells)
}

/// Whether a text is a list of LinuxCNC: its last three axes, which hardly a machine has, stand still.
pub fn is_linuxcnc(text: &str) -> bool {
    let lines = filled(text);
    let poses: Option<Vec<Vec<&str>>> = lines.iter().map(|line| pose(line)).collect();
    poses.is_some_and(|poses| {
        let stands = |k: usize| poses.windows(2).all(|two| two[0].get(k) == two[1].get(k));
        poses.len() >= LEAST_LINES && (6..POSE).all(stands)
    })
}

/// The letters with numbers of a line; `None` for a line that has anything else.
fn words(line: &str) -> Option<Vec<Word>> {
    let mut found: Vec<Word> = vec![];
    let mut rest = line.trim();
    while let Some(letter) = rest.chars().next() {
        let is_new = found
            .iter()
            .all(|(known, _)| *known != letter.to_ascii_uppercase());
        if !letter.is_ascii_alphabetic() || !is_new {
            return None;
        }
        let behind = rest[1..].trim_start_matches([' ', '\t', '=', ':']);
        let (number, after) = number(behind)?;
        found.push((letter.to_ascii_uppercase(), number));
        rest = after.trim_start_matches([' ', '\t', ',', ';', '|']);
    }
    (!found.is_empty()).then_some(found)
}

/// A number at the begin of a text, with blanks behind its sign, and what comes after it.
fn number(text: &str) -> Option<(String, &str)> {
    let (sign, digits) = match text.chars().next()? {
        '-' => ("-", text[1..].trim_start()),
        '+' => ("", text[1..].trim_start()),
        _ => ("", text),
    };
    let is_digit = |letter: char| letter.is_ascii_digit();
    let whole = digits
        .find(|letter| !is_digit(letter))
        .unwrap_or(digits.len());
    let (front, rest) = digits.split_at(whole);
    let decimals = rest.strip_prefix('.').or_else(|| {
        // A comma before a letter parts two words.
        let behind = rest.strip_prefix(',')?;
        behind.starts_with(is_digit).then_some(behind)
    });
    let (behind, after) = match decimals {
        Some(decimals) => {
            let end = decimals.find(|letter| !is_digit(letter));
            decimals.split_at(end.unwrap_or(decimals.len()))
        }
        None => ("", rest),
    };
    if front.is_empty() && behind.is_empty() {
        return None;
    }
    let text = format!("{sign}{}.{}", zero(front), zero(behind));
    Some((text, after))
}

fn zero(digits: &str) -> &str {
    if digits.is_empty() { "0" } else { digits }
}

/// The words of a line with a place, and no word of a program.
fn place(line: &str) -> Option<Vec<Word>> {
    let words = words(line)?;
    let has_axis = words.iter().any(|(letter, _)| AXES[..3].contains(letter));
    has_axis.then_some(words)
}

fn is_of_program(line: &str) -> bool {
    let found = words(line).unwrap_or_default();
    found
        .iter()
        .any(|(letter, _)| OF_PROGRAMS.contains(*letter))
}

/// Whether a text is a list of letters with numbers, and no program.
pub fn is_lettered(text: &str) -> bool {
    let lines = filled(text);
    let n = lines.iter().filter(|line| place(line).is_some()).count();
    n >= LEAST_LINES && 2 * n >= lines.len() && !lines.iter().any(|line| is_of_program(line))
}

/// The table of a list of LinuxCNC.
///
/// # Errors
/// Names the line that is damaged.
pub fn linuxcnc(text: &str) -> Result<Cells> {
    let remark = "LinuxCNC writes positions in the unit and the coordinate system of the program; a touch at the position of the one \
                  before is not in the list";
    let read = |line: &str| {
        let numbers = pose(line)?;
        let words = AXES.iter().zip(numbers);
        Some(
            words
                .map(|(letter, cell)| (*letter, cell.to_owned()))
                .collect(),
        )
    };
    table(text, &read, vec![remark.to_owned()])
}

/// The table of a list of letters with numbers.
///
/// # Errors
/// Names the line that has other letters than the ones before.
pub fn lettered(text: &str) -> Result<Cells> {
    table(text, &place, vec![])
}

pub(super) fn table(
    text: &str,
    read: &dyn Fn(&str) -> Option<Vec<Word>>,
    mut remarks: Vec<String>,
) -> Result<Cells> {
    let mut rows: Vec<(u64, u32, Vec<Word>)> = vec![];
    let (mut run, mut is_apart) = (1, false);
    let mut texts = vec![];
    for (n, line) in lines(text) {
        let Some(words) = read(line) else {
            is_apart = !rows.is_empty();
            let is_text = line.chars().any(char::is_alphanumeric);
            texts.extend(is_text.then_some((n, line)));
            continue;
        };
        if std::mem::take(&mut is_apart) {
            run += 1;
        }
        if let Some((before, _, first)) = rows.first() {
            let letters = |words: &[Word]| words.iter().map(|(letter, _)| *letter).collect();
            let (own, known): (String, String) = (letters(&words), letters(first));
            if own != known {
                bail!(
                    "line {n}: letters {own}, line {before} has {known}: a list has the same ones in every line"
                );
            }
        }
        rows.push((n, run, words));
        if rows.len() * (AXES.len() + 1) > MOST_CELLS {
            bail!("line {n}: more touches than are read: split the list");
        }
    }
    if let Some((n, first)) = texts.first() {
        remarks.push(format!(
            "{} lines of text, the first in line {n} (\"{}\"), were left out",
            texts.len(),
            metrology::yaml::shown(first)
        ));
    }
    remarks.extend(moved(&rows));
    Ok(Cells {
        sheet: sheet(rows, run > 1),
        remarks,
        ..Cells::default()
    })
}

/// A line about rotary axes that stood elsewhere at other touches, and about axes without a letter.
fn moved(rows: &[(u64, u32, Vec<Word>)]) -> Vec<String> {
    let Some((_, _, first)) = rows.first() else {
        return vec![];
    };
    let is_moved = |letter: &char| {
        let own = |words: &[Word]| words.iter().find(|(known, _)| known == letter).cloned();
        rows.iter().any(|(_, _, words)| own(words) != own(first))
    };
    let others: Vec<String> = AXES[3..]
        .iter()
        .filter(|letter| is_moved(letter))
        .map(char::to_string)
        .collect();
    let lacks: Vec<String> = AXES[..3]
        .iter()
        .filter(|letter| first.iter().all(|(known, _)| known != *letter))
        .map(char::to_string)
        .collect();
    let mut lines = vec![];
    if !others.is_empty() {
        lines.push(format!(
            "warning, {} moved between touches: their positions are not used, and points at several poses are not those of one shape",
            others.join(", ")
        ));
    }
    if !lacks.is_empty() {
        lines.push(format!(
            "no {} in the list: zero was taken",
            lacks.join(", ")
        ));
    }
    lines
}

fn sheet(rows: Vec<(u64, u32, Vec<Word>)>, has_runs: bool) -> Sheet {
    let names = has_runs.then(|| "run".to_owned());
    let names = names.into_iter().chain(["x", "y", "z"].map(str::to_owned));
    let mut lines = vec![(1, names.collect())];
    for (line, run, words) in rows {
        let cell = |letter: &char| {
            let own = words.iter().find(|(known, _)| known == letter);
            own.map_or_else(|| "0".to_owned(), |(_, number)| number.clone())
        };
        let run = has_runs.then(|| run.to_string());
        let cells = run.into_iter().chain(AXES[..3].iter().map(cell));
        lines.push((line, cells.collect()));
    }
    Sheet {
        lines,
        ..Sheet::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OF_LINUXCNC: &str = "\
12.345000 -3.210000 -50.002000 0.000000 0.000000 0.000000 0.000000 0.000000 0.000000
12.345000 -3.210000 -50.001500 0.000000 0.000000 0.000000 0.000000 0.000000 0.000000
";

    fn rows(cells: &Cells) -> Vec<String> {
        let lines = cells.sheet.lines.iter();
        lines
            .map(|(line, cells)| format!("{line}: {}", cells.join(" ")))
            .collect()
    }

    #[test]
    fn nine_numbers_with_six_decimals_are_of_linuxcnc() {
        assert!(is_linuxcnc(OF_LINUXCNC));
        let read = linuxcnc(OF_LINUXCNC).unwrap();
        assert_eq!(
            rows(&read),
            [
                "1: x y z",
                "1: 12.345000 -3.210000 -50.002000",
                "2: 12.345000 -3.210000 -50.001500"
            ]
        );
        let line = "1.0 2.0 3.0 0 0 0 0 0 0\n";
        let sampled = OF_LINUXCNC.replace("0.000000\n", "0.000100\n");
        for other in [
            line.repeat(3),
            sampled + OF_LINUXCNC,
            String::new(),
            "x y z\n1 2 3\n".into(),
        ] {
            assert!(!is_linuxcnc(&other), "{other}");
        }
        let turned = format!(
            "{OF_LINUXCNC}\n{}",
            OF_LINUXCNC.replacen("0.000000", "90.000000", 1)
        );
        let read = linuxcnc(&turned).unwrap();
        assert!(
            read.remarks
                .iter()
                .any(|line| line.starts_with("warning, A moved"))
        );
        assert_eq!(rows(&read)[3], "4: 2 12.345000 -3.210000 -50.002000");
    }

    #[test]
    fn letters_with_numbers_are_read_as_their_programs_write_them() {
        for line in [
            "X12.345 Y-3.210 Z-50.002",
            "X   12.345 Y-   3.210 Z-  50.002",
            "N10 X12.345Y-3.210Z-50.002",
            "X=12.345, Y=-3.210, Z=-50.002",
            "X = 12,345; Y = -3,210; Z = -50,002",
            "X: 12.345 | Y: -3.210 | Z: -50.002",
        ] {
            let text = format!("%\nSPHERE 1\n{line}\n{line}\n{line}\n\n{line}\n{line}\n");
            assert!(is_lettered(&text), "{line}");
            let read = lettered(&text).unwrap();
            assert_eq!(rows(&read)[1], "3: 1 12.345 -3.210 -50.002", "{line}");
            assert_eq!(rows(&read)[5], "8: 2 12.345 -3.210 -50.002", "{line}");
            assert!(
                read.remarks[0].starts_with("1 lines of text"),
                "{:?}",
                read.remarks
            );
        }
        for other in [
            "G0 X1 Y2\nX2 Y3\nX3 Y4\n",
            "O1000\nX1 Y2\nX2 Y3\n",
            "X,Y,Z\n1,2,3\n2,3,4\n",
            "X1\n",
            "X1 X2\nX1 X2\n",
            "",
        ] {
            assert!(!is_lettered(other), "{other}");
        }
        let said = lettered("X1 Y2 Z3\nX1 Y2\n").unwrap_err().to_string();
        assert!(
            said.starts_with("line 2: letters XY, line 1 has XYZ"),
            "{said}"
        );
        assert!(lettered("Z-5.001\nZ-5.002\n").unwrap().remarks[0].contains("no X, Y"));
    }

    #[test]
    fn no_bytes_make_it_fail() {
        for text in [
            "X", "X=", "X-", "X1.", "X.5 Y", "é1", "X1é", "X1,", "X1,,Y2", "\n", "X１",
        ] {
            let _ = words(text);
            assert!(!is_linuxcnc(text));
            let _ = lettered(text);
        }
    }
}
