//! Words of a column of directions, and columns of directions whose words are not known.
//!
//! Without its directions a table whose passes are all listed by ascending target is one of runs upwards, with the reversal in
//! their scatter. Such a column is therefore read or refused.

use std::collections::BTreeSet;

use metrology::yaml::shown;

use super::map::Direction;
use super::table::number_of;
use super::vocabulary::words;

/// Lines of cells with their numbers.
type Lines = [(u64, Vec<String>)];

/// Words in a cell of a column of directions, beside those that names of columns have too.
const UP_WORDS: &[&str] = &[
    "u",
    "+ve",
    ">",
    "->",
    "-->",
    "f",
    "fw",
    "upward",
    "upwards",
    "forwards",
    "forth",
    "plus",
    "hin",
    "vor",
    "vorwärts",
    "vorwaerts",
    "hinweg",
    "aufwärts",
    "aufwaerts",
    "auf",
    "hoch",
    "steigend",
    "ansteigend",
    "aufsteigend",
    "positiv",
    "ascending",
    "rising",
    "increasing",
    "aller",
    "avant",
    "montée",
    "montee",
    "montant",
    "croissant",
    "positif",
    "ida",
    "subida",
    "ascendente",
    "creciente",
    "positivo",
    "andata",
    "avanti",
    "salita",
    "crescente",
    "往",
    "正",
    "正向",
    "正方向",
    "去程",
];
const DOWN_WORDS: &[&str] = &[
    "d",
    "-ve",
    "<",
    "<-",
    "<--",
    "r",
    "rv",
    "b",
    "downward",
    "downwards",
    "back",
    "minus",
    "rück",
    "rueck",
    "zurück",
    "zurueck",
    "rückwärts",
    "rueckwaerts",
    "rückweg",
    "abwärts",
    "abwaerts",
    "ab",
    "runter",
    "herunter",
    "fallend",
    "absteigend",
    "negativ",
    "descending",
    "falling",
    "decreasing",
    "retour",
    "arrière",
    "descente",
    "descendant",
    "décroissant",
    "decroissant",
    "négatif",
    "vuelta",
    "bajada",
    "descendente",
    "decreciente",
    "negativo",
    "ritorno",
    "indietro",
    "discesa",
    "decrescente",
    "復",
    "复",
    "返",
    "負",
    "负",
    "反向",
    "負方向",
    "负方向",
    "回程",
];
/// Words beside one of a direction in a cell.
const BESIDE_DIRECTIONS: &[&str] = &[
    "run",
    "pass",
    "stroke",
    "travel",
    "approach",
    "direction",
    "move",
    "lauf",
    "richtung",
    "weg",
    "fahrt",
    "way",
    "cycle",
];
/// Words that are known, as a message lists them.
pub const KNOWN_WORDS: &str = "up, +, +X, 1, u, forward, hin, auf, aller, ↑ or down, -, -X, -1, d, reverse, back, zurück, ab, retour, ↓";
/// Begins and parts of words of a name of directions, and whole ones.
const NAME_BEGINS: &[&str] = &["direct", "approach", "anfahr"];
const NAME_PARTS: &[&str] = &["richtung", "方向"];
const NAMES: &[&str] = &[
    "dir",
    "dirn",
    "way",
    "sens",
    "sense",
    "richt",
    "senso",
    "sentido",
    "direzione",
    "dirección",
    "direccion",
];
/// Most words of a column of directions: more are no sides.
const MOST_WORDS: usize = 6;
/// Fewest changes of the word from pass to pass by which two words part them, and fewest targets of a pass.
const LEAST_CHANGES: usize = 3;
const LEAST_TARGETS: usize = 3;

/// Whether a name is that of a column of directions.
pub fn is_name(name: &str) -> bool {
    words(name).iter().any(|word| {
        NAMES.contains(&word.as_str())
            || NAME_BEGINS.iter().any(|begin| word.starts_with(begin))
            || NAME_PARTS.iter().any(|part| word.contains(part))
    })
}

/// The side that a cell of a column of directions names; `+X` and `X-` with the letter of an axis too.
pub fn of_cell(cell: &str) -> Option<Direction> {
    let lower = cell.trim().to_lowercase();
    let known = |word: &str| {
        let among = |all: &[&str]| all.contains(&word);
        match (among(UP_WORDS), among(DOWN_WORDS)) {
            (true, _) => Some(Direction::Up),
            (_, true) => Some(Direction::Down),
            _ => None,
        }
    };
    let signed = || {
        let signs = ['+', '-', '\u{2212}', '\u{2013}'];
        let bare = lower.trim_matches(signs);
        let is_axis = bare.len() == 1 && "xyzabcuvw".contains(bare);
        let sign = lower.replace(bare, "");
        Direction::of_word(&sign).filter(|_| is_axis)
    };
    // `Forward run 2`, `hin 1`.
    let among_others = || {
        let all = words(&lower);
        let is_beside = |word: &String| {
            BESIDE_DIRECTIONS.contains(&word.as_str())
                || word.bytes().all(|byte| byte.is_ascii_digit())
        };
        let mut own = all.iter().filter(|word| !is_beside(word));
        let word = own.next()?;
        let is_alone = own.next().is_none() && word.chars().count() > 1;
        let is_number = word.parse::<f64>().is_ok();
        let found = Direction::of_word(word).or_else(|| known(word));
        found.filter(|_| is_alone && !is_number)
    };
    Direction::of_word(&lower)
        .or_else(|| known(&lower))
        .or_else(signed)
        .or_else(among_others)
}

/// What is wrong with a column of directions that is not understood: one of that name, or one of two words that part passes in
/// one order. `targets` is the place of the targets.
pub fn odd(head: &[String], lines: &Lines, targets: usize, decimal: char) -> Option<String> {
    let is_read = |k: usize| {
        let mut all = cells(lines, k).peekable();
        all.peek().is_some() && all.filter(|(_, cell)| of_cell(cell).is_none()).count() == 0
    };
    let is_way = |k: &usize| head.get(*k).is_some_and(|name| is_name(name));
    if (0..head.len()).filter(is_way).any(is_read) {
        return None;
    }
    let at = (0..head.len()).find(|k| {
        let n = distinct(lines, *k).len();
        let is_named = is_way(k) && (2..=MOST_WORDS).contains(&n) && hardly_known(lines, *k);
        is_named || (n == 2 && parts_passes(lines, *k, targets, decimal))
    })?;
    let (line, cell) = cells(lines, at).find(|(_, cell)| of_cell(cell).is_none())?;
    Some(format!(
        "line {line}, column \"{}\": \"{}\": seems to be a direction of approach that is not known. Write {KNOWN_WORDS}. Otherwise \
         rename the column",
        shown(head.get(at)?),
        shown(cell)
    ))
}

/// Cells of a column that hold anything, with their lines.
fn cells(lines: &Lines, k: usize) -> impl Iterator<Item = (u64, &str)> {
    let cells = lines
        .iter()
        .filter_map(move |(line, cells)| Some((*line, cells.get(k)?.as_str())));
    cells.filter(|(_, cell)| !cell.is_empty())
}

/// The words of a column, at most one more than it may have.
fn distinct(lines: &Lines, k: usize) -> BTreeSet<&str> {
    let mut found = BTreeSet::new();
    for (_, cell) in cells(lines, k) {
        found.insert(cell);
        if found.len() > MOST_WORDS {
            break;
        }
    }
    found
}

/// Whether more cells of a column than slips are no direction.
fn hardly_known(lines: &Lines, k: usize) -> bool {
    let (mut n, mut n_known) = (0_usize, 0_usize);
    for (_, cell) in cells(lines, k) {
        n += 1;
        n_known += usize::from(of_cell(cell).is_some());
    }
    10 * n_known < 9 * n
}

/// Whether two words alternate from pass to pass, where every pass has its targets in one order.
fn parts_passes(lines: &Lines, k: usize, targets: usize, decimal: char) -> bool {
    let rows: Vec<(&str, f64)> = lines
        .iter()
        .filter_map(|(_, cells)| {
            let target = number_of(cells.get(targets)?, decimal)?;
            Some((cells.get(k)?.as_str(), target))
        })
        .collect();
    let is_word = |(word, _): &(&str, f64)| !word.is_empty() && number_of(word, decimal).is_none();
    let passes: Vec<&[(&str, f64)]> = rows.chunk_by(|a, b| a.0 == b.0).collect();
    let is_pass = |rows: &&[(&str, f64)]| {
        rows.len() >= LEAST_TARGETS && rows.windows(2).all(|two| two[0].1 < two[1].1)
    };
    let are_alike = passes.windows(2).all(|two| two[0].len() == two[1].len());
    rows.iter().all(is_word)
        && passes.len() > LEAST_CHANGES
        && are_alike
        && passes.iter().all(is_pass)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_columns_of_two_words_are_no_directions() {
        let lines = |word: fn(usize) -> &'static str| -> Vec<(u64, Vec<String>)> {
            let row = |k: usize| {
                let cells = vec![word(k).to_owned(), (k % 4).to_string()];
                (k as u64 + 2, cells)
            };
            (0..40).map(row).collect()
        };
        let head = ["remark".to_owned(), "target".to_owned()];
        for word in [
            (|k| if k < 20 { "cold" } else { "warm" }) as fn(usize) -> &'static str,
            |_| "cold",
            |k| if k % 2 == 0 { "a" } else { "b" },
        ] {
            assert_eq!(odd(&head, &lines(word), 1, '.'), None);
        }
    }
}
