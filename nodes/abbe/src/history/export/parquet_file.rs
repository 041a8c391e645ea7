//! Values as a Parquet file: one row a value, in groups of [`GROUP_ROWS`] rows, without compression beside dictionaries.

use std::sync::Arc;

use anyhow::{Context, Result, bail};
use history::{Kept, Series, SeriesKey, Store, Window};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::parser::parse_message_type;

/// The columns; `docs/reference/history-schema.md` describes them.
const PARQUET_SCHEMA: &str = "message abbe_history {
    REQUIRED BINARY machine (STRING);
    REQUIRED BINARY test (STRING);
    REQUIRED BINARY figure (STRING);
    REQUIRED BINARY axis (STRING);
    REQUIRED BINARY unit (STRING);
    REQUIRED INT64 time (TIMESTAMP(MILLIS,true));
    REQUIRED DOUBLE value;
    OPTIONAL DOUBLE standard_uncertainty;
    REQUIRED BINARY status (STRING);
    REQUIRED BINARY source (STRING);
}";
/// Rows of a group.
const GROUP_ROWS: usize = 100_000;
/// Most rows of a file, which is made in memory.
const MOST_PARQUET_ROWS: usize = 5_000_000;

/// A file that is made.
pub struct Made {
    /// Its content.
    pub bytes: Vec<u8>,
    /// Its rows.
    pub rows: usize,
}

/// The columns of a group.
#[derive(Default)]
struct Columns {
    /// Machine, test, figure, axis, unit.
    of_series: [Vec<ByteArray>; 5],
    times_ms: Vec<i64>,
    values: Vec<f64>,
    uncertainties: Vec<f64>,
    has_uncertainty: Vec<i16>,
    /// Status, source.
    of_value: [Vec<ByteArray>; 2],
}

impl Columns {
    fn push(&mut self, series: &Series, kept: &Kept) {
        let names = [
            &series.machine,
            &series.test,
            &series.name,
            &series.axis,
            &series.unit,
        ];
        for (column, name) in self.of_series.iter_mut().zip(names) {
            column.push(name.as_str().into());
        }
        self.times_ms.push(kept.point.at_s as i64 * 1_000);
        self.values.push(kept.point.value);
        let u = kept.point.standard_uncertainty;
        self.has_uncertainty.push(i16::from(u.is_some()));
        self.uncertainties.extend(u);
        for (column, text) in self.of_value.iter_mut().zip([&kept.status, &kept.source]) {
            column.push(text.as_str().into());
        }
    }

    /// Writes the columns in the order of [`PARQUET_SCHEMA`].
    fn write<W: std::io::Write + Send>(
        &self,
        group: &mut SerializedRowGroupWriter<'_, W>,
    ) -> Result<()> {
        for texts in &self.of_series {
            text(group, texts)?;
        }
        let mut column = group.next_column()?.context("no column time")?;
        let times = &self.times_ms;
        column.typed::<Int64Type>().write_batch(times, None, None)?;
        column.close()?;
        let mut column = group.next_column()?.context("no column value")?;
        let values = &self.values;
        column
            .typed::<DoubleType>()
            .write_batch(values, None, None)?;
        column.close()?;
        let mut column = group.next_column()?.context("no column uncertainty")?;
        let (values, levels) = (&self.uncertainties, &self.has_uncertainty);
        column
            .typed::<DoubleType>()
            .write_batch(values, Some(levels), None)?;
        column.close()?;
        for texts in &self.of_value {
            text(group, texts)?;
        }
        Ok(())
    }
}

fn text<W: std::io::Write + Send>(
    group: &mut SerializedRowGroupWriter<'_, W>,
    texts: &[ByteArray],
) -> Result<()> {
    let mut column = group.next_column()?.context("no column of text")?;
    column
        .typed::<ByteArrayType>()
        .write_batch(texts, None, None)?;
    column.close()?;
    Ok(())
}

/// The values of a store as a file.
///
/// # Errors
/// When the store cannot be read, or has no value or too many.
pub fn of(store: &Store, key: &SeriesKey, window: Window) -> Result<Made> {
    let schema = Arc::new(parse_message_type(PARQUET_SCHEMA)?);
    let properties = WriterProperties::builder()
        .set_created_by(concat!("abbe ", env!("CARGO_PKG_VERSION")).to_owned())
        .build();
    let mut writer = SerializedFileWriter::new(Vec::new(), schema, Arc::new(properties))?;
    let (mut columns, mut rows) = (Columns::default(), 0_usize);
    for series in store.series(key)? {
        for kept in store.points(series.id, window)? {
            columns.push(&series, &kept);
            rows += 1;
            if rows > MOST_PARQUET_ROWS {
                bail!(
                    "more than {MOST_PARQUET_ROWS} values: choose less with --machine, --since or --until"
                );
            }
            if columns.values.len() >= GROUP_ROWS {
                flush(&mut writer, &mut columns)?;
            }
        }
    }
    if rows == 0 {
        bail!("the history has no such value: check --machine, --since and --until");
    }
    flush(&mut writer, &mut columns)?;
    let bytes = writer.into_inner()?;
    Ok(Made { bytes, rows })
}

/// Writes the columns as a group, where they have rows.
fn flush(writer: &mut SerializedFileWriter<Vec<u8>>, columns: &mut Columns) -> Result<()> {
    let columns = std::mem::take(columns);
    if columns.values.is_empty() {
        return Ok(());
    }
    let mut group = writer.next_row_group()?;
    columns.write(&mut group)?;
    group.close()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use history::{Entry, Figure, Kind, Options};
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::RowAccessor;

    use super::*;

    fn figure(name: &str, value: f64, u: Option<f64>) -> Figure {
        Figure {
            test: "Positioning X".to_owned(),
            name: name.to_owned(),
            axis: "X".to_owned(),
            value,
            unit: "mm".to_owned(),
            standard_uncertainty: u,
            interval: None,
            status: String::new(),
        }
    }

    fn entry(machine: &str, at_s: i64, figures: Vec<Figure>) -> Entry {
        Entry {
            machine: machine.to_owned(),
            at_s,
            kind: Kind::Report,
            sha256: format!("{at_s:064x}"),
            machine_sha256: None,
            source: format!("bag_{at_s}"),
            instruments: String::new(),
            operator: String::new(),
            software: "abbe".to_owned(),
            figures,
        }
    }

    #[test]
    fn a_file_gives_back_every_value_with_its_columns() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("history.sqlite");
        let mut store = Store::open(&path, Options::default()).unwrap();
        let of = |value| {
            let known = figure("iso230_2.accuracy", value, Some(0.001));
            vec![known, figure("gap.rms", -value, None)]
        };
        for (machine, at_s) in [("fräse", 2_000), ("b", 1_000), ("fräse", 4_294_967_295)] {
            let one = entry(machine, at_s, of(at_s as f64 * 1e-8));
            store.add(&one).unwrap();
        }
        let made = super::of(&store, &SeriesKey::default(), Window::ALL).unwrap();
        assert_eq!(made.rows, 6);
        let reader = SerializedFileReader::new(bytes::Bytes::from(made.bytes)).unwrap();
        let names = reader.metadata().file_metadata().schema_descr();
        let names: Vec<&str> = names.columns().iter().map(|it| it.name()).collect();
        assert_eq!(names[5..8], ["time", "value", "standard_uncertainty"]);
        let rows: Vec<_> = reader
            .get_row_iter(None)
            .unwrap()
            .map(Result::unwrap)
            .collect();
        assert_eq!(rows.len(), 6);
        let row = &rows[5];
        let texts: Vec<&str> = [0, 1, 2, 3, 4, 8, 9]
            .map(|place| row.get_string(place).unwrap().as_str())
            .to_vec();
        let wanted = [
            "fräse",
            "Positioning X",
            "iso230_2.accuracy",
            "X",
            "mm",
            "",
            "bag_4294967295",
        ];
        assert_eq!(texts, wanted);
        assert_eq!(row.get_timestamp_millis(5).unwrap(), 4_294_967_295_000);
        assert!((row.get_double(6).unwrap() - 42.949_672_95).abs() < 1e-12);
        assert!((row.get_double(7).unwrap() - 0.001).abs() < 1e-15);
        // Without an uncertainty there is none, and not zero.
        assert_eq!(rows[0].get_string(2).unwrap(), "gap.rms");
        assert!(rows[0].get_double(7).is_err());
    }

    #[test]
    fn a_choice_without_a_value_is_refused_with_the_options() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("history.sqlite");
        let store = Store::open(&path, Options::default()).unwrap();
        let refused = super::of(&store, &SeriesKey::default(), Window::ALL);
        let words = refused.err().unwrap().to_string();
        assert!(words.contains("--machine, --since and --until"), "{words}");
    }
}
