//! The numbers of the columns that a map names.

use anyhow::{Context, Result, bail};

use super::limits::Range;
use super::map::Map;

/// Rows of numbers, in the order of the map's columns.
#[derive(Debug)]
pub struct Table {
    /// Rows.
    pub rows: Vec<Vec<f64>>,
}

impl Table {
    /// Reads a CSV text; lines that begin with `#` are comments. `ranges` are those of the map's columns.
    ///
    /// # Errors
    /// Names the column that is missing, or line, column and text of a cell that is no number or out of its range.
    pub fn read(text: &str, map: &Map, ranges: &[Option<Range>]) -> Result<Self> {
        let separator = u8::try_from(map.separator).context("separator: must be one byte")?;
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(separator)
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .from_reader(text.as_bytes());
        let head = reader.headers()?.clone();
        let columns = map.test.columns();
        let place = |name: &&str| {
            head.iter().position(|cell| cell == *name).with_context(|| {
                let there: Vec<&str> = head.iter().collect();
                format!("no column \"{name}\"; there are {}", there.join(", "))
            })
        };
        let places: Vec<usize> = columns.iter().map(place).collect::<Result<_>>()?;
        let mut rows = vec![];
        for record in reader.records() {
            let record = record?;
            let line = record.position().map_or(0, csv::Position::line);
            let mut row = vec![];
            for ((place, name), range) in places.iter().zip(&columns).zip(ranges) {
                let cell = record.get(*place).unwrap_or("");
                if map.test.direction() == Some(*name) {
                    let sign = sign(cell).with_context(|| {
                        format!("line {line}, column \"{name}\": \"{cell}\": must be one of up, +, down, -")
                    })?;
                    row.push(sign);
                    continue;
                }
                let number = cell.replace(map.decimal, ".").parse::<f64>();
                match number {
                    Ok(number) if number.is_finite() => {
                        if let Some(range) = range.as_ref().filter(|range| !range.holds(number)) {
                            bail!("line {line}, column \"{name}\": {cell}: must be {range}");
                        }
                        row.push(number);
                    }
                    _ => bail!("line {line}, column \"{name}\": \"{cell}\": must be a number"),
                }
            }
            rows.push(row);
        }
        if rows.is_empty() {
            bail!("no rows");
        }
        Ok(Self { rows })
    }

    /// Rows that follow one another with one value in the first column.
    pub fn runs(&self) -> impl Iterator<Item = &[Vec<f64>]> {
        let number = |row: &Vec<f64>| row.first().map_or(0, |run| run.to_bits());
        self.rows.chunk_by(move |a, b| number(a) == number(b))
    }
}

/// Sign of a direction of approach.
fn sign(cell: &str) -> Option<f64> {
    match cell.to_lowercase().as_str() {
        "up" | "+" => Some(1.0),
        "down" | "-" => Some(-1.0),
        _ => None,
    }
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

    fn read(text: &str) -> Result<Table> {
        let deviation = Range::new(-1e5, 1e5, "µm");
        Table::read(text, &map(), &[None, None, Some(deviation)])
    }

    #[test]
    fn columns_are_found_by_name_with_the_decimals_of_the_map() {
        let table = read("# made by hand\nn;x;r;w\n1;9;0,5;10\n2;9;-1;20\n").expect("rows");
        assert_eq!(table.rows, [vec![1.0, 10.0, 0.5], vec![2.0, 20.0, -1.0]]);
        assert_eq!(table.runs().count(), 2);
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
    fn a_direction_is_a_word_or_a_sign_and_nothing_else() {
        let map: Map = serde_saphyr::from_str(
            "start_s: 1767600000\ntest:\n  positioning: {axis: X, feed_mm_min: 1000.0, dwell_s: 2.0, overrun_mm: 5.0, run: n, target_mm: t, deviation_um: d, direction: way}",
        )
        .expect("a map");
        let read = |text: &str| Table::read(text, &map, &[None; 4]);
        let table = read("way,n,t,d\nup,1,0,2\n-,1,0,3\n").expect("rows");
        assert_eq!(
            table.rows,
            [vec![1.0, 0.0, 2.0, 1.0], vec![1.0, 0.0, 3.0, -1.0]]
        );
        let said = format!(
            "{:#}",
            read("way,n,t,d\nnorth,1,0,2\n").expect_err("no way")
        );
        assert_eq!(
            said,
            "line 2, column \"way\": \"north\": must be one of up, +, down, -"
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
