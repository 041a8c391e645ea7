//! The numbers of the columns that a map names.

use anyhow::{Context, Result, bail};

use metrology::yaml::shown;

use super::again;
use super::beside;
use super::clock_parts;
use super::directions;
use super::limits::Range;
use super::map::{Column, Map, Test, What, units};
use super::measured;
use super::merged;
use super::odd::{Cost, Odd, Read, is_missing};
use super::prose;
use super::separators;
use super::shapes;
use super::sheet::Sheet;
use super::stated;
use super::times;
use super::touches;

/// One row.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Its line in the file, from 1.
    pub line: u64,
    /// Its numbers, in the order of the map's columns.
    pub cells: Vec<f64>,
}

/// Rows of numbers.
#[derive(Debug)]
pub struct Table {
    /// Rows.
    pub rows: Vec<Row>,
    /// What of the file is in no row, and why; and what is doubtful.
    pub left_out: Vec<String>,
    /// Cells that hold no value of their column, a line each; they cost a row or a reading.
    pub odd: Vec<String>,
    /// Names in a column of features, whose cells are their places here.
    pub features: Vec<String>,
}

impl Table {
    /// Reads the cells of a file. `ranges` are those of the map's columns.
    ///
    /// # Errors
    /// Names the column that is missing or there twice, or line, column and text of a cell that is no number or out of
    /// its range.
    pub fn of(sheet: &Sheet, map: &Map, ranges: &[Option<Range>]) -> Result<Self> {
        let columns = map.test.columns();
        let names: Vec<&str> = columns.iter().map(|column| column.name).collect();
        let at = sheet.head(&names).context("no rows")?;
        let (head_line, head) = &sheet.lines[at];
        let place = |name: &&str| separators::place_of(name, head, sheet.separator);
        let places: Vec<usize> = names.iter().map(place).collect::<Result<_>>()?;
        let mut left_out = beside::unnamed(head, &places, sheet.dates);
        left_out.extend((at > 0).then(|| {
            format!("{at} lines above line {head_line}, which has the names of the columns")
        }));
        let mut reader = Reader {
            map,
            columns: &columns,
            places: &places,
            ranges,
            n_missing: 0,
            first_missing: None,
            odd: Odd::default(),
            features: vec![],
            is_clock: false,
            is_whole_clock: false,
        };
        let below = sheet.lines.get(at + 1).map_or(&[][..], |(_, cells)| cells);
        let has_units = reader.is_units(below)?;
        left_out.extend(prose::check(map, sheet, at, has_units)?);
        let mut rows = vec![];
        let (mut n_empty, mut n_rows) = (0_u64, 0);
        let (lines, merged) = merged::filled(&sheet.lines, at, (&columns, &places));
        left_out.extend(merged);
        for (k, (line, cells)) in lines.iter().enumerate().skip(at + 1) {
            if cells.iter().all(String::is_empty) {
                n_empty += 1;
                continue;
            }
            if k == at + 1 && has_units {
                left_out.push(format!("line {line}: units alone"));
                continue;
            }
            again::check((head, cells), (&columns, &places), [*head_line, *line])?;
            separators::check_length(cells, head.len(), *line)?;
            n_rows += 1;
            if let Some(cells) = reader.row(cells, *line)? {
                rows.push(Row { line: *line, cells });
            }
        }
        let odd = std::mem::take(&mut reader.odd).lines(n_rows)?;
        left_out.extend(reader.missing(&rows)?);
        left_out.extend(reader.doubts(&mut rows)?);
        if n_empty > 0 {
            left_out.push(format!("{n_empty} rows: all their cells are empty"));
        }
        beside::check(map, head, &sheet.lines[at + 1..], &rows)?;
        left_out.extend(measured::check(map, head, &sheet.lines[at + 1..], &rows)?);
        Ok(Self {
            rows: shapes::shaped(rows, map),
            left_out,
            odd,
            features: reader.features,
        })
    }
}

/// Reads the cells of rows.
struct Reader<'t> {
    map: &'t Map,
    columns: &'t [Column<'t>],
    places: &'t [usize],
    ranges: &'t [Option<Range>],
    /// Readings without a number.
    n_missing: u64,
    /// Line and column of the first.
    first_missing: Option<(u64, String)>,
    odd: Odd,
    features: Vec<String>,
    /// Whether a time was no plain number, and whether it had a date or three parts.
    is_clock: bool,
    is_whole_clock: bool,
}

impl Reader<'_> {
    fn cell<'c>(&self, cells: &'c [String], k: usize) -> &'c str {
        let place = self.places.get(k);
        place
            .and_then(|place| cells.get(*place))
            .map_or("", String::as_str)
    }

    /// Whether a line below the names has units.
    ///
    /// # Errors
    /// As [`stated::check_row`].
    fn is_units(&self, cells: &[String]) -> Result<bool> {
        let words = (0..self.columns.len()).map(|k| (self.columns[k], self.cell(cells, k)));
        let stated = || {
            words
                .clone()
                .filter(|(column, _)| column.what.unit().is_some())
        };
        if !stated::is_row(stated().map(|(_, word)| word)) {
            return Ok(false);
        }
        stated().try_for_each(|(column, word)| stated::check_row(self.map, column, word))?;
        Ok(true)
    }

    /// The numbers of a row; a reading that is not there is no number (NaN). `None`: a cell holds no value of its column.
    fn row(&mut self, cells: &[String], line: u64) -> Result<Option<Vec<f64>>> {
        let mut numbers: Vec<f64> = vec![];
        for (k, column) in self.columns.iter().enumerate() {
            let cell = self.cell(cells, k);
            let is_reading = column.what.is_reading();
            if is_reading && is_missing(cell) {
                self.n_missing += 1;
                let first = (line, column.name.to_owned());
                self.first_missing.get_or_insert(first);
                numbers.push(f64::NAN);
                continue;
            }
            if column.what == What::Feature {
                numbers.push(touches::feature_of(cell, &mut self.features));
                continue;
            }
            let range = self.ranges.get(k).and_then(Option::as_ref);
            let before = numbers.last().copied();
            let read = read_cell(cell, *column, self.map, range, before);
            match read.with_context(|| format!("line {line}, column \"{}\"", column.name))? {
                Read::Number(number) => numbers.push(number),
                Read::Clock(time_s) => {
                    self.is_clock = true;
                    self.is_whole_clock |= !clock_parts::has_two_parts(cell);
                    numbers.push(time_s);
                }
                Read::Odd(why) => {
                    let cost = if is_reading { Cost::Reading } else { Cost::Row };
                    self.odd.note((line, column.name), &why, cost);
                    if !is_reading {
                        return Ok(None);
                    }
                    numbers.push(f64::NAN);
                }
            }
        }
        Ok(Some(numbers))
    }

    /// Counts times of the day on over midnight. What was done with the times of a log, and what is doubtful about them.
    fn doubts(&self, rows: &mut [Row]) -> Result<Vec<String>> {
        let mut columns = self.columns.iter();
        let Some(place) = columns.position(|column| column.what == What::Time) else {
            return Ok(vec![]);
        };
        let name = self.columns[place].name;
        let mut found = vec![];
        if self.is_clock {
            found.extend(clock_parts::over_midnight(name, place, rows)?);
        }
        let times_s: Vec<f64> = rows.iter().map(|row| row.cells[place]).collect();
        let has_period = matches!(
            &self.map.test,
            Test::Log {
                period_ms: Some(_),
                ..
            }
        );
        let is_stated = has_period || self.map.units.contains_key(name);
        found.extend(match (self.is_whole_clock, self.is_clock) {
            (true, _) => None,
            (_, true) => clock_parts::of_two_parts(name, &times_s)?,
            _ => times::of_column(name, &times_s, is_stated)?,
        });
        Ok(found)
    }

    /// How many readings are not there.
    fn missing(&self, rows: &[Row]) -> Result<Option<String>> {
        if rows.is_empty() {
            bail!("no rows");
        }
        let Some((line, name)) = &self.first_missing else {
            return Ok(None);
        };
        let is_read = |row: &Row| {
            let pairs = row.cells.iter().zip(self.columns);
            pairs
                .filter(|(_, column)| column.what.is_reading())
                .any(|(cell, _)| cell.is_finite())
        };
        if !rows.iter().any(is_read) {
            bail!(
                "line {line}, column \"{name}\": the cell is empty, and no other row has a reading"
            );
        }
        Ok(Some(format!(
            "{} readings: their cells are empty or no number (NaN), the first in line {line}, column \"{name}\"",
            self.n_missing
        )))
    }
}

/// A number as a person or a program writes it: with a typographic minus, and spaces that mark thousands.
pub fn number_of(cell: &str, decimal: char) -> Option<f64> {
    let mut text: String = cell
        .chars()
        .filter(|letter| !matches!(letter, '\u{a0}' | '\u{2009}' | '\u{202f}'))
        .map(|letter| match letter {
            '\u{2212}' | '\u{2013}' => '-',
            letter if letter == decimal => '.',
            letter => letter,
        })
        .collect();
    if text.starts_with("- ") {
        text.remove(1);
    }
    let is_digit = |letter: char| letter.is_ascii_digit();
    let number = text.parse::<f64>().ok();
    // "inf" and "nan" are words of the parser and no readings.
    number.filter(|number| number.is_finite() && text.contains(is_digit))
}

/// A cell. Errors are of cells that show a wrong map, or that no instrument reads.
fn read_cell(
    cell: &str,
    column: Column<'_>,
    map: &Map,
    range: Option<&Range>,
    before: Option<f64>,
) -> Result<Read> {
    if cell.is_empty() {
        let why = "the cell is empty: write what was measured, or remove the row";
        return Ok(Read::Odd(why.to_owned()));
    }
    if column.what == What::Direction {
        return Ok(match directions::of_cell(cell) {
            Some(direction) => Read::Number(direction.sign()),
            None => Read::Odd(format!(
                "\"{}\": must be one of {}",
                shown(cell),
                directions::KNOWN_WORDS
            )),
        });
    }
    if column.what == What::Time {
        match times::of_text(cell) {
            Ok(Some(time_s)) => return Ok(Read::Clock(time_s)),
            Ok(None) => {}
            Err(error) => return Ok(Read::Odd(format!("{error:#}"))),
        }
    }
    if map.decimal != '.' && cell.contains('.') {
        bail!(
            "\"{}\": has a point, and the map says `decimal: \"{}\"`: remove points that mark thousands, or correct the map",
            shown(cell),
            map.decimal
        );
    }
    let Some(read) = number_of(cell, map.decimal) else {
        let has_digit = cell.contains(|letter: char| letter.is_ascii_digit());
        if cell.contains(',') && map.decimal == '.' && has_digit {
            bail!(
                "\"{}\": must be a number; with decimal commas the map needs `decimal: \",\"`",
                shown(cell)
            );
        }
        return Ok(Read::Odd(format!("\"{}\": must be a number", shown(cell))));
    };
    let number = converted(read, column, map, before);
    match range.filter(|range| !range.holds(number)) {
        Some(range) if matches!(column.what, What::Measured(_)) => bail!(
            "{}: lies {} beside its target: must be {range}",
            shown(cell),
            metrology::number::number(number)
        ),
        Some(range) if number.total_cmp(&read).is_ne() => bail!(
            "{}, {} here: must be {range}{}",
            shown(cell),
            metrology::number::number(number),
            range.remedy(number)
        ),
        Some(range) => bail!("{}: must be {range}{}", shown(cell), range.remedy(number)),
        None => Ok(Read::Number(number)),
    }
}

/// A number in the unit that its column is wanted in; a measured position as its deviation from the target `before` it.
fn converted(read: f64, column: Column<'_>, map: &Map, before: Option<f64>) -> f64 {
    let stated = map.units.get(column.name);
    if let (
        What::Time,
        Test::Log {
            period_ms: Some(period_ms),
            ..
        },
    ) = (column.what, &map.test)
    {
        return read * period_ms / 1e3;
    }
    let number = match (stated, column.what.unit()) {
        (Some(stated), Some(wanted)) if *stated != wanted => stated.convert(read, wanted),
        _ => read,
    };
    let (What::Measured(_), Test::Positioning { axis, .. }) = (column.what, &map.test) else {
        return number;
    };
    let units = units(*axis);
    let deviation = number - before.unwrap_or(0.0);
    let deviation = match units.turn {
        // 359.999 deg at the target 0 deg.
        Some(turn) => deviation - turn * (deviation / turn).round(),
        None => deviation,
    };
    deviation / units.deviation_in_targets()
}

#[cfg(test)]
mod tests {
    use super::*;

    const MAP: &str = "
separator: ';'
decimal: ','
start_s: 1767600000
test:
  circle: {plane: XY, centre_mm: [0.0, 0.0, 0.0], radius_mm: 100.0, feed_mm_min: 1000.0, run: n, angle_deg: w, radial_um: r}
";

    fn map() -> Map {
        serde_saphyr::from_str(MAP).expect("a map")
    }

    fn read_by(text: &str, map: &Map, ranges: &[Option<Range>]) -> Result<Table> {
        Table::of(&Sheet::of_text(text, map.separator)?, map, ranges)
    }

    fn read(text: &str) -> Result<Table> {
        let deviation = Range::new(-1e5, 1e5, "µm");
        read_by(text, &map(), &[None, None, Some(deviation)])
    }

    #[test]
    fn a_point_in_a_table_of_decimal_commas_is_no_decimal_point() {
        let of = |cell: &str| read(&format!("n;w;r\n1;0,0;{cell}\n"));
        assert_eq!(
            of("-1,5").expect("a number").rows[0].cells,
            [1.0, 0.0, -1.5]
        );
        for cell in ["-1.292", "1.280,000", "0.5"] {
            let error = format!("{:#}", of(cell).expect_err("a point"));
            let words = format!("line 2, column \"r\": \"{cell}\": has a point");
            assert!(error.contains(&words), "{error}");
        }
    }

    #[test]
    fn a_file_without_a_line_is_said_to_be_empty() {
        for text in ["", "\n\n", "# a comment\n"] {
            let error = read(text).expect_err("empty");
            assert!(format!("{error:#}").contains("it is empty"), "{error:#}");
        }
    }

    #[test]
    fn columns_are_found_by_name_with_the_decimals_of_the_map() {
        let table = read("# made by hand\nn;x;r;w\n1;9;0,5;10\n2;9;-1;20\n").expect("rows");
        let rows: Vec<(u64, &[f64])> = table.rows.iter().map(|r| (r.line, &r.cells[..])).collect();
        assert_eq!(rows, [(3, &[1.0, 10.0, 0.5][..]), (4, &[2.0, 20.0, -1.0])]);
        assert_eq!(table.left_out, ["column \"x\": the map does not name it"]);
    }

    #[test]
    fn a_missing_column_and_a_broken_cell_are_named() {
        let missing = read("n;r\n1;2\n").expect_err("no angle");
        assert!(format!("{missing:#}").contains("no column \"w\"; there are n, r"));
        let broken = read("n;w;r\n1;2;abc\n").expect_err("no number");
        assert_eq!(
            format!("{broken:#}"),
            "line 2, column \"r\": \"abc\": must be a number"
        );
    }

    #[test]
    fn empty_rows_are_counted_and_everything_else_that_is_no_number_is_refused() {
        let table = read("n;w;r\n1;2;3\n;;\n\n1;3;4\n;;\n").expect("rows");
        assert_eq!(table.rows.len(), 2);
        assert_eq!(table.left_out, ["2 rows: all their cells are empty"]);
        for (text, wanted) in [
            ("n;w;r\n1;2;\n", "line 2, column \"r\": the cell is empty"),
            ("n;w;r\n1;;3\n", "line 2, column \"w\": the cell is empty"),
            ("n;w;r\n1;2\n", "line 2: 2 cells, the first line has 3"),
            ("n;w;r\n1;2;3;4\n", "line 2: 4 cells, the first line has 3"),
            ("n;w;r;w\n1;2;3;4\n", "column \"w\" is there twice"),
            ("n,w,r\n1,2,3\n", "is the separator \";\"?"),
            ("n;w;r\n", "no rows"),
        ] {
            let words = format!("{:#}", read(text).expect_err(text));
            assert!(words.contains(wanted), "{text}: {words}");
        }
    }

    #[test]
    fn a_direction_is_a_word_or_a_sign_and_nothing_else() {
        let map: Map = serde_saphyr::from_str(
            "start_s: 1767600000\ntest:\n  positioning: {axis: X, feed_mm_min: 1000.0, dwell_s: 2.0, overrun_mm: 5.0, run: n, target_mm: t, deviation_um: d, direction: way}",
        )
        .expect("a map");
        let read = |text: &str| read_by(text, &map, &[None; 4]);
        let table = read("way,n,t,d\nup,1,0,2\n-,1,0,3\n").expect("rows");
        let rows: Vec<&[f64]> = table.rows.iter().map(|row| &row.cells[..]).collect();
        assert_eq!(rows, [[1.0, 0.0, 2.0, 1.0], [1.0, 0.0, 3.0, -1.0]]);
        let said = format!(
            "{:#}",
            read("way,n,t,d\nnorth,1,0,2\n").expect_err("no way")
        );
        assert_eq!(
            said,
            format!(
                "line 2, column \"way\": \"north\": must be one of {}",
                directions::KNOWN_WORDS
            )
        );
    }

    const STOPS: &str = "{axis: AXIS, feed_mm_min: 1000.0, dwell_s: 2.0, overrun_mm: 5.0, ";

    fn stops(head: &str, axis: &str, keys: &str) -> Map {
        let test = STOPS.replace("AXIS", axis);
        let text = format!("start_s: 1767600000\n{head}\ntest:\n  positioning: {test}{keys}}}\n");
        serde_saphyr::from_str(&text).expect("a map")
    }

    /// Cells of a table of numbers; what is no number is -999.
    fn cells(text: &str, map: &Map) -> Vec<Vec<f64>> {
        let ranges = vec![None; map.test.columns().len()];
        let table = read_by(text, map, &ranges).expect("rows");
        let number = |cell: &f64| if cell.is_nan() { -999.0 } else { *cell };
        let rows = table.rows.iter();
        rows.map(|row| row.cells.iter().map(number).collect())
            .collect()
    }

    fn near(found: &[Vec<f64>], wanted: &[&[f64]]) {
        assert_eq!(found.len(), wanted.len(), "{found:?}");
        for (found, wanted) in found.iter().zip(wanted) {
            assert_eq!(found.len(), wanted.len(), "{found:?}");
            let mut pairs = found.iter().zip(*wanted);
            assert!(
                pairs.all(|(a, b)| (a - b).abs() < 1e-9),
                "{found:?} {wanted:?}"
            );
        }
    }

    #[test]
    fn a_measured_position_gives_its_deviation_in_the_units_that_are_stated() {
        let map = stops("", "X", "run: n, target_mm: t, measured_mm: m");
        near(
            &cells("n,t,m\n1,100,100.0035\n1,200,199.998\n", &map),
            &[&[1.0, 100.0, 3.5], &[1.0, 200.0, -2.0]],
        );
        // 0.0001 inch are 2.54 µm.
        let map = stops(
            "units: {t: inch, m: inch}",
            "X",
            "run: n, target_mm: t, measured_mm: m",
        );
        near(&cells("n,t,m\n1,2,2.0001\n", &map), &[&[1.0, 50.8, 2.54]]);
        let map = stops("", "C", "run: n, target_deg: t, measured_deg: m");
        // 0.001 deg are 3.6 arcsec; 359.999 deg lie 0.001 deg before 0 deg.
        near(
            &cells("n,t,m\n1,30,30.001\n1,0,359.999\n", &map),
            &[&[1.0, 30.0, 3.6], &[1.0, 0.0, -3.6]],
        );
        let map = stops(
            "units: {d: mm}",
            "X",
            "run: n, target_mm: t, deviation_um: d",
        );
        near(&cells("n,t,d\n1,5,0.0042\n", &map), &[&[1.0, 5.0, 4.2]]);
    }

    #[test]
    fn lines_above_the_names_units_below_them_and_readings_that_are_missing_do_no_harm() {
        let map = stops(
            "separator: \"\\t\"\ndecimal: \",\"",
            "X",
            "run: n, target_mm: t, deviation_um: d, direction: w",
        );
        let text = "Report\tof X\nDate\t05.01.2026\t\nn\tw\tt\td\t\n\t\tmm\tµm\t\n1\tforward\t0,5\t\u{2212}1,25\t\n1\t↑\t9\tNaN\t\n1\t\u{2212}1\t9\t\t\n";
        near(
            &cells(text, &map),
            &[
                &[1.0, 0.5, -1.25, 1.0],
                &[1.0, 9.0, -999.0, 1.0],
                &[1.0, 9.0, -999.0, -1.0],
            ],
        );
        let table = read_by(text, &map, &[None; 4]).expect("rows");
        assert_eq!(
            table.left_out,
            [
                "2 lines above line 3, which has the names of the columns",
                "line 4: units alone",
                "2 readings: their cells are empty or no number (NaN), the first in line 6, column \"d\"",
            ]
        );
    }

    #[test]
    fn a_column_for_each_pass_gives_rows_in_the_order_of_the_measurement() {
        let map = stops(
            "",
            "X",
            "target_mm: Position, passes_um: [{column: 1 up, direction: up}, {column: 1 down, direction: down}]",
        );
        near(
            &cells("Position,1 up,1 down\n0,1,2\n100,3,4\n50,5,6\n", &map),
            &[
                &[1.0, 0.0, 1.0, 1.0],
                &[1.0, 50.0, 5.0, 1.0],
                &[1.0, 100.0, 3.0, 1.0],
                &[2.0, 100.0, 4.0, -1.0],
                &[2.0, 50.0, 6.0, -1.0],
                &[2.0, 0.0, 2.0, -1.0],
            ],
        );
    }

    #[test]
    fn a_number_that_no_instrument_reads_is_refused_with_its_range() {
        let absurd = read("n;w;r\n1;2;3\n1;3;1e300\n").expect_err("out of range");
        assert_eq!(
            format!("{absurd:#}"),
            "line 3, column \"r\": 1e300: must be from -100000 to 100000 µm"
        );
    }
}
