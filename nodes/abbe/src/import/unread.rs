//! Columns that a test needs by their names, whose cells are no numbers: which cell stands in the way.

use metrology::yaml::shown;

use super::recognise::{Recognised, Role, role_of_name};
use super::sheet::Sheet;

/// Names of quantities that a line of names has at least.
const LEAST_NAMES: usize = 2;

/// Whether a cell has a digit of any script.
pub fn has_digit(cell: &str) -> bool {
    cell.contains(char::is_numeric)
}

/// The line of names above cells of which hardly one is a number.
pub fn head(lines: &[(u64, Vec<String>)]) -> Option<usize> {
    let is_quantity = |cell: &&String| {
        let role = role_of_name(cell);
        let is_name = cell.chars().next().is_some_and(char::is_alphabetic);
        is_name && role.is_some_and(|role| role != Role::Run)
    };
    lines.windows(2).position(|two| {
        let [(_, names), (_, below)] = two else {
            return false;
        };
        names.iter().filter(is_quantity).count() >= LEAST_NAMES
            && below.iter().filter(|cell| has_digit(cell)).count() >= LEAST_NAMES
            && !below.iter().any(|cell| is_quantity(&cell))
    })
}

/// Whether cells have commas before decimals: not three digits alone behind each, as thousands have.
pub fn has_decimal_commas(sheet: &Sheet) -> bool {
    let mut cells = sheet.lines.iter().flat_map(|(_, cells)| cells);
    cells.any(|cell| {
        cell.split_once(',').is_some_and(|(whole, decimals)| {
            let is_digit = |letter: char| letter.is_ascii_digit();
            whole.ends_with(is_digit)
                && !decimals.is_empty()
                && decimals.len() != 3
                && decimals.chars().all(is_digit)
        })
    })
}

/// A sentence for each column that is a quantity by its name and has cells that are no numbers; none without any.
pub fn in_words(found: &Recognised) -> Option<String> {
    let columns = found.columns.iter().filter_map(|column| {
        let role = role_of_name(&column.name).filter(|role| *role != Role::Run)?;
        let (line, cell) = column.odd.as_ref().filter(|_| column.role != Some(role))?;
        let remedy = if cell.contains(',') && found.decimal == '.' {
            "; with decimal commas the map needs `decimal: \",\"`"
        } else {
            ""
        };
        Some(format!(
            "line {line}, column \"{}\": \"{}\": must be a number{remedy}",
            shown(&column.name),
            shown(cell)
        ))
    });
    let lines: Vec<String> = columns.collect();
    (!lines.is_empty()).then(|| lines.join("; "))
}

#[cfg(test)]
mod tests {
    use super::super::propose;
    use super::super::recognise::of_text;

    fn refusal(text: &str) -> String {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("a.csv");
        std::fs::write(&path, text).unwrap();
        propose::of(&path).map_or_else(|error| format!("{error:#}"), |found| found.map)
    }

    #[test]
    fn a_column_of_no_numbers_is_named_with_line_and_cell() {
        for odd in [
            "1.5D-03",
            "3.5 um",
            "(3.5)",
            "3.5-",
            "\u{ff13}.5",
            "1.5.2",
            "0x1F",
            "1'000.5",
            "=A2",
            "~3",
        ] {
            for head in [
                "run;direction;target_mm;deviation_um",
                "a;b;target_mm;error [um]",
            ] {
                let rows: String = [0, 50, 100].map(|mm| format!("1;up;{mm};{odd}\n")).concat();
                let refused = refusal(&format!("Laser X\n\n{head}\n{rows}"));
                let name = head.rsplit(';').next().unwrap_or_default();
                let words = format!("line 4, column \"{name}\": \"{odd}\": must be a number");
                assert!(refused.contains(&words), "{odd}: {refused}");
                assert!(!refused.contains("neither"), "{refused}");
            }
            let rows = format!("{odd};{odd}\n").repeat(3);
            let refused = refusal(&format!("target_mm;deviation_um\n{rows}"));
            let words = format!("line 2, column \"target_mm\": \"{odd}\"");
            assert!(refused.contains(&words), "{odd}: {refused}");
        }
    }

    #[test]
    fn decimal_commas_in_quotes_are_read_and_commas_of_thousands_are_named() {
        let text = "run,direction,target_mm,deviation_um\n\"1\",\"up\",\"-280,0\",\"-8,35\"\n\"1\",\"up\",\"-150,3\",\"-7,17\"\n";
        let found = of_text(text).unwrap().unwrap();
        assert_eq!((found.separator, found.decimal), (',', ','));
        let map = refusal(text);
        assert!(map.contains("deviation_um: \"deviation_um\""), "{map}");
        let text = "target_mm,deviation_um\n\"1,000\",1\n\"2,000\",2\n\"3,000\",4\n";
        let refused = refusal(text);
        assert!(
            refused.contains(
                "line 2, column \"target_mm\": \"1,000\": must be a number; with decimal commas"
            ),
            "{refused}"
        );
        for text in [
            "a,target_mm,deviation_um\n1,2,3\n2,3,4\n",
            "t,z_um\n1,2\n3,4\n",
        ] {
            assert_eq!(of_text(text).unwrap().unwrap().decimal, '.');
        }
    }
}
