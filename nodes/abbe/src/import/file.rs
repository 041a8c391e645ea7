//! The cells of a file: of a text with separators, of a worksheet (xlsx), or of an instrument's own form.

use std::io::Cursor;
use std::path::Path;

use anyhow::{Context, Result, anyhow, bail};
use calamine::{DataRef, ExcelDateTime, Reader, SheetVisible, Xlsx};
use node_runtime::text_file;

use super::book;
use super::dates;
use super::encoding;
use super::instrument;
use super::sheet::{Cells, MOST_CELLS, MOST_COLUMNS, Sheet};
use super::turned;

/// Begin of a ZIP archive, which an xlsx file is.
const ZIP: &[u8] = b"PK\x03\x04";
/// Begin of the files of older spreadsheet programs (xls).
const OLD: &[u8] = &[0xD0, 0xCF, 0x11, 0xE0];
/// Most rows of a worksheet that are read.
const MAX_WORKSHEET_ROWS: u32 = 1_000_000;
/// Longest file of a worksheet, bytes: it is packed.
const MAX_WORKSHEET_BYTES: usize = 32 << 20;

/// Separator, decimal sign and worksheet of a file.
#[derive(Clone, Copy, Debug)]
pub struct Form<'m> {
    /// Between the cells of a text.
    pub separator: char,
    /// Before decimals.
    pub decimal: char,
    /// Worksheet, where there are several.
    pub sheet: Option<&'m str>,
    /// Whether the columns are named by their numbers, which are those of the file.
    pub is_by_number: bool,
}

/// Whether the cells of a file are apart by separators, and neither a worksheet nor of an instrument's own form.
///
/// # Errors
/// When it cannot be read.
pub fn is_separated(path: &Path) -> Result<bool> {
    let bytes = text_file::bytes(path)?;
    let is_worksheet = bytes.starts_with(ZIP) || bytes.starts_with(OLD);
    Ok(!is_worksheet && instrument::of(&bytes).is_none())
}

/// Reads the cells of a file. Of several worksheets it is the one that `is_table`, of those that are shown.
///
/// # Errors
/// When the file cannot be read, is no table of a kind that is known, has no such worksheet, or several are tables, or a
/// hidden one alone is.
pub fn read(path: &Path, form: Form<'_>, is_table: &dyn Fn(&Sheet) -> bool) -> Result<Cells> {
    let bytes = text_file::bytes(path)?;
    if bytes.starts_with(OLD) {
        bail!("a worksheet of the older kind (xls): save it as xlsx or as CSV");
    }
    if bytes.starts_with(ZIP) {
        return of_xlsx(bytes, form, is_table);
    }
    if let Some(name) = form.sheet {
        bail!("sheet = {name}: does nothing, the file is a text: remove it");
    }
    // Numbers apart by blanks under such a map are samples of a sampler.
    let is_sampled = form.separator == ' ' || form.is_by_number;
    if let Some(instrument) = instrument::of(&bytes).filter(|_| !is_sampled) {
        return instrument.cells(&bytes, form.decimal);
    }
    let decoded = encoding::read(path)?;
    let sheet = Sheet::of_text(&decoded.text, form.separator)?;
    Ok(Cells {
        sheet: turned::applied(sheet, form.decimal)?,
        remarks: decoded.note.into_iter().collect(),
        ..Cells::default()
    })
}

/// The cells of a worksheet of an xlsx file.
fn of_xlsx(bytes: Vec<u8>, form: Form<'_>, is_table: &dyn Fn(&Sheet) -> bool) -> Result<Cells> {
    if bytes.len() > MAX_WORKSHEET_BYTES {
        bail!(
            "a worksheet of {} bytes: must be at most {MAX_WORKSHEET_BYTES}: save it as CSV",
            bytes.len()
        );
    }
    let book::Checked {
        mut hidden,
        formats,
    } = book::check(&bytes)?;
    if let Some(scaled) = formats.scaled() {
        bail!("{scaled}");
    }
    let mut cells = of_book(bytes, form, is_table)?;
    cells.sheet.shown_units = formats.units();
    hidden.extend(cells.note.take());
    cells.note = (!hidden.is_empty()).then(|| hidden.join("; "));
    Ok(cells)
}

/// The cells of a worksheet of a workbook that was checked.
fn of_book(bytes: Vec<u8>, form: Form<'_>, is_table: &dyn Fn(&Sheet) -> bool) -> Result<Cells> {
    let mut book = Xlsx::new(Cursor::new(bytes)).context("xlsx")?;
    let names = book.sheet_names();
    if let Some(name) = form.sheet {
        if !names.iter().any(|known| known == name) {
            bail!(
                "sheet = {name}: the file has no such worksheet, it has {}",
                names.join(", ")
            );
        }
        let sheet = worksheet(&mut book, name, form.decimal)?;
        let sheet = sheet.with_context(|| format!("sheet = {name}: the worksheet is empty"))?;
        let others = book.sheets_metadata().iter();
        let others = others.filter(|other| other.name != name).map(|other| {
            let is_shown = other.visible == SheetVisible::Visible;
            format!("{}{}", other.name, if is_shown { "" } else { " (hidden)" })
        });
        let others: Vec<String> = others.collect();
        return Ok(Cells {
            sheet,
            name: Some(name.to_owned()),
            note: note(name, &others),
            ..Cells::default()
        });
    }
    chosen(&mut book, form.decimal, is_table)
}

fn note(name: &str, others: &[String]) -> Option<String> {
    let others = (!others.is_empty()).then(|| others.join(", "))?;
    Some(format!("worksheet {name} was read, and not {others}"))
}

/// Looks at every worksheet and keeps one at a time.
fn chosen(
    book: &mut Xlsx<Cursor<Vec<u8>>>,
    decimal: char,
    is_table: &dyn Fn(&Sheet) -> bool,
) -> Result<Cells> {
    let all = book.sheets_metadata().iter();
    let all = all.map(|sheet| (sheet.name.clone(), sheet.visible == SheetVisible::Visible));
    let all: Vec<(String, bool)> = all.collect();
    let mut kept: Option<(String, Sheet)> = None;
    let (mut tables, mut hidden, mut others, mut failed) = (vec![], vec![], vec![], None);
    for (name, is_shown) in all {
        let sheet = match worksheet(book, &name, decimal) {
            Ok(Some(sheet)) => sheet,
            Ok(None) => continue,
            Err(error) => {
                others.push(format!("{name} (it cannot be read)"));
                failed = failed.or(Some(error));
                continue;
            }
        };
        let is_one = is_table(&sheet);
        if !is_shown {
            others.push(format!("{name} (hidden)"));
            hidden.extend(is_one.then_some(name));
            continue;
        }
        if is_one {
            tables.push(name.clone());
        }
        // The first that is shown, until there is a table.
        if kept.is_none() || (is_one && tables.len() == 1) {
            others.extend(kept.take().map(|(name, _)| name));
            kept = Some((name, sheet));
        } else {
            others.push(name);
        }
    }
    let state = "state `sheet: NAME` in a map, or save the one that is meant as CSV";
    if tables.len() > 1 {
        bail!("worksheets {} are tables: {state}", tables.join(", "));
    }
    if let (true, Some(name)) = (tables.is_empty(), hidden.first()) {
        bail!("the worksheet {name} alone is a table, and it is hidden: {state}, or show it");
    }
    let Some((name, sheet)) = kept else {
        return Err(failed.unwrap_or_else(|| {
            anyhow!(
                "the file has no line with the names of columns: its worksheets that are shown are empty"
            )
        }));
    };
    let note = note(&name, &others);
    Ok(Cells {
        sheet,
        name: note.is_some().then_some(name),
        note,
        ..Cells::default()
    })
}

/// A worksheet; nothing where it is empty.
fn worksheet(book: &mut Xlsx<Cursor<Vec<u8>>>, name: &str, decimal: char) -> Result<Option<Sheet>> {
    let mut lines = cells(book, name, decimal).with_context(|| format!("worksheet \"{name}\""))?;
    let width = lines.iter().map(|(_, cells)| cells.len()).max();
    let Some(width) = width else {
        return Ok(None);
    };
    for (_, cells) in &mut lines {
        cells.resize(width, String::new());
    }
    let dates = dates::join(&mut lines);
    let sheet = Sheet {
        lines,
        dates,
        ..Sheet::default()
    };
    turned::applied(sheet, decimal).map(Some)
}

/// Lines of a worksheet that hold anything.
fn cells(
    book: &mut Xlsx<Cursor<Vec<u8>>>,
    name: &str,
    decimal: char,
) -> Result<Vec<(u64, Vec<String>)>> {
    let mut reader = book.worksheet_cells_reader(name)?;
    let mut lines: Vec<(u64, Vec<String>)> = vec![];
    let mut width = 0;
    while let Some(cell) = reader.next_cell()? {
        let (row, column) = cell.get_position();
        if row >= MAX_WORKSHEET_ROWS || column >= MOST_COLUMNS {
            bail!(
                "row {}, column {}: must be at most {MAX_WORKSHEET_ROWS} rows and {MOST_COLUMNS} columns",
                u64::from(row) + 1,
                u64::from(column) + 1
            );
        }
        let text = text_of(cell.get_value(), decimal);
        if text.is_empty() {
            continue;
        }
        let line = u64::from(row) + 1;
        if lines.last().is_none_or(|(last, _)| *last != line) {
            lines.push((line, vec![]));
        }
        width = width.max(column as usize + 1);
        if lines.len() * width > MOST_CELLS {
            bail!(
                "row {line}: {} rows of {width} columns: must be at most {MOST_CELLS} cells",
                lines.len()
            );
        }
        if let Some((_, cells)) = lines.last_mut() {
            let place = column as usize;
            if cells.len() <= place {
                cells.resize(place + 1, String::new());
            }
            cells[place] = text;
        }
    }
    Ok(lines)
}

/// A value as a text file would have it.
fn text_of(value: &DataRef<'_>, decimal: char) -> String {
    let number = |number: f64| number.to_string().replace('.', &decimal.to_string());
    match value {
        DataRef::Int(whole) => whole.to_string(),
        DataRef::Float(value) => number(*value),
        DataRef::String(text) => text.trim().to_owned(),
        DataRef::SharedString(text) => text.trim().to_owned(),
        DataRef::Bool(is_true) => is_true.to_string(),
        DataRef::DateTime(time) => instant(time, &number),
        DataRef::DateTimeIso(text) | DataRef::DurationIso(text) => text.clone(),
        // #DIV/0! and its like are no readings.
        DataRef::Error(_) => "NaN".to_owned(),
        DataRef::Empty => String::new(),
    }
}

/// A date with its time, a time of the day, or a duration in s.
fn instant(time: &ExcelDateTime, number: &dyn Fn(f64) -> String) -> String {
    if time.is_duration() {
        return number(time.as_f64() * 86_400.0);
    }
    let (year, month, day, hour, minute, second, milli) = time.to_ymd_hms_milli();
    let clock = format!("{hour:02}:{minute:02}:{second:02}.{milli:03}");
    if time.as_f64() < 1.0 {
        return clock;
    }
    format!("{year:04}-{month:02}-{day:02} {clock}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn form(decimal: char) -> Form<'static> {
        Form {
            separator: ',',
            decimal,
            sheet: None,
            is_by_number: false,
        }
    }

    fn file(name: &str, bytes: &[u8]) -> Result<Sheet> {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        super::read(&path, form('.'), &any).map(|cells| cells.sheet)
    }

    fn any(_: &Sheet) -> bool {
        true
    }

    fn read(path: &Path, form: Form<'_>) -> Result<Sheet> {
        super::read(path, form, &any).map(|cells| cells.sheet)
    }

    #[test]
    fn a_worksheet_has_the_cells_that_it_was_made_with() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/import/wide.xlsx");
        let sheet = read(&path, form(',')).unwrap();
        let texts =
            |k: usize| -> Vec<&str> { sheet.lines[k].1[..3].iter().map(String::as_str).collect() };
        assert_eq!(sheet.lines[0].0, 1);
        assert_eq!(texts(0), ["Positioning of X", "", ""]);
        assert_eq!(texts(1), ["Date", "2026-01-05 08:00:00.000", ""]);
        // An empty row between them.
        assert_eq!(sheet.lines[2].0, 4);
        assert_eq!(texts(2), ["Position [mm]", "Run 1 ↑", "Run 1 ↓"]);
        assert_eq!(texts(3), ["-280", "-3,45", "1,47"]);
        let named = Form {
            sheet: Some("Laser"),
            ..form('.')
        };
        assert_eq!(read(&path, named).unwrap().lines.len(), sheet.lines.len());
        let absent = Form {
            sheet: Some("laser 2"),
            ..form('.')
        };
        let said = format!("{:#}", read(&path, absent).unwrap_err());
        assert!(
            said.contains("no such worksheet, it has Empty, Laser"),
            "{said}"
        );
    }

    #[test]
    fn hidden_rows_and_columns_are_said_with_their_number() {
        let cells = "<cols><col min='2' max='9' hidden='1'/></cols><sheetData><row r='1'><c r='A1'><v>1</v></c><c r='B1'><v>1</v></c></row><row r='2' hidden='1'><c r='A2'><v>1</v></c></row></sheetData>";
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("a.xlsx");
        std::fs::write(&path, workbook(cells)).unwrap();
        let note = super::read(&path, form('.'), &any).unwrap().note.unwrap();
        let begin = "warning, xl/worksheets/sheet1.xml: 1 rows and 1 columns are hidden";
        assert!(note.starts_with(begin), "{note}");
        std::fs::write(&path, workbook(&numbered(7))).unwrap();
        assert_eq!(super::read(&path, form('.'), &any).unwrap().note, None);
    }

    #[test]
    fn what_is_no_table_is_refused_with_its_remedy() {
        let said = format!(
            "{:#}",
            file("a.xls", &[0xD0, 0xCF, 0x11, 0xE0, 1]).unwrap_err()
        );
        assert!(said.contains("save it as xlsx or as CSV"), "{said}");
        assert!(file("a.xlsx", b"PK\x03\x04 and no archive").is_err());
    }

    /// A workbook with one worksheet of this text.
    fn workbook(sheet: &str) -> Vec<u8> {
        workbook_of(&[("Laser", "visible", sheet)])
    }

    /// A workbook with worksheets: name, state, text.
    fn workbook_of(sheets: &[(&str, &str, &str)]) -> Vec<u8> {
        use std::io::Write as _;
        const RELS: &str = "http://schemas.openxmlformats.org/package/2006/relationships";
        const DOC: &str = "http://schemas.openxmlformats.org/officeDocument/2006/relationships";
        const MAIN: &str = "http://schemas.openxmlformats.org/spreadsheetml/2006/main";
        let (mut listed, mut related, mut parts) = (String::new(), String::new(), vec![]);
        for (k, (name, state, text)) in (1..).zip(sheets) {
            listed += &format!("<sheet name='{name}' state='{state}' sheetId='{k}' r:id='r{k}'/>");
            related += &format!(
                "<Relationship Id='r{k}' Type='{DOC}/worksheet' Target='worksheets/sheet{k}.xml'/>"
            );
            let text = format!("<worksheet xmlns='{MAIN}'>{text}</worksheet>");
            parts.push((format!("xl/worksheets/sheet{k}.xml"), text));
        }
        parts.extend([
            (
                "_rels/.rels".to_owned(),
                format!(
                    "<Relationships xmlns='{RELS}'><Relationship Id='r1' Type='{DOC}/officeDocument' Target='xl/workbook.xml'/></Relationships>"
                ),
            ),
            (
                "xl/workbook.xml".to_owned(),
                format!(
                    "<workbook xmlns='{MAIN}' xmlns:r='{DOC}'><sheets>{listed}</sheets></workbook>"
                ),
            ),
            (
                "xl/_rels/workbook.xml.rels".to_owned(),
                format!("<Relationships xmlns='{RELS}'>{related}</Relationships>"),
            ),
        ]);
        let mut writer = zip::ZipWriter::new(Cursor::new(vec![]));
        let options = zip::write::SimpleFileOptions::default();
        for (name, text) in parts {
            writer.start_file(name, options).unwrap();
            writer.write_all(text.as_bytes()).unwrap();
        }
        writer.finish().unwrap().into_inner()
    }

    /// A worksheet with one number; from 10 on it is a table here, and a note before.
    fn numbered(number: u32) -> String {
        format!("<sheetData><row r='1'><c r='A1'><v>{number}</v></c></row></sheetData>")
    }

    fn chosen_of(sheets: &[(&str, &str, &str)], sheet: Option<&str>) -> Result<Cells, String> {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("a.xlsx");
        std::fs::write(&path, workbook_of(sheets)).unwrap();
        let form = Form { sheet, ..form('.') };
        let is_table = |sheet: &Sheet| sheet.lines[0].1[0].len() > 1;
        super::read(&path, form, &is_table).map_err(|error| format!("{error:#}"))
    }

    #[test]
    fn of_several_worksheets_the_shown_table_is_read() {
        let [note, a, b] = [1, 10, 11].map(numbered);
        let (shown, hidden) = ("visible", "hidden");
        for (sheets, wanted, name, note) in [
            (
                [("H", hidden, &a), ("S", shown, &b)],
                None,
                Some("S"),
                "not H (hidden)",
            ),
            (
                [("S", shown, &a), ("H", "veryHidden", &b)],
                None,
                Some("S"),
                "not H (hidden)",
            ),
            (
                [("N", shown, &note), ("S", shown, &b)],
                None,
                Some("S"),
                "S was read, and not N",
            ),
            (
                [("S", shown, &b), ("N", shown, &note)],
                None,
                Some("S"),
                "S was read, and not N",
            ),
            (
                [("A", shown, &a), ("B", shown, &b)],
                Some("B"),
                Some("B"),
                "not A",
            ),
            (
                [("H", hidden, &a), ("N", shown, &note)],
                Some("H"),
                Some("H"),
                "not N",
            ),
            (
                [("N", shown, &note), ("M", shown, &note)],
                None,
                Some("N"),
                "not M",
            ),
        ] {
            let sheets = sheets.map(|(name, state, text)| (name, state, text.as_str()));
            let cells = chosen_of(&sheets, wanted).unwrap();
            assert_eq!(cells.name.as_deref(), name, "{sheets:?}");
            let said = cells.note.unwrap_or_default();
            assert!(
                said.contains(note) && said.is_empty() == note.is_empty(),
                "{said}"
            );
        }
    }

    #[test]
    fn two_tables_and_a_hidden_one_alone_are_refused_with_the_way_to_choose() {
        let [note, a] = [1, 10].map(numbered);
        let (shown, hidden) = ("visible", "hidden");
        let two = [("A", shown, a.as_str()), ("B", shown, a.as_str())];
        let said = chosen_of(&two, None).unwrap_err();
        assert!(
            said.contains("worksheets A, B are tables: state `sheet: NAME`"),
            "{said}"
        );
        let none = [("H", hidden, a.as_str()), ("N", shown, note.as_str())];
        let said = chosen_of(&none, None).unwrap_err();
        assert!(
            said.contains("the worksheet H alone is a table, and it is hidden"),
            "{said}"
        );
        let one = chosen_of(&[("S", shown, a.as_str())], None).unwrap();
        assert_eq!((one.name, one.note), (None, None));
    }

    #[test]
    fn no_reference_of_a_cell_makes_the_reader_fail_and_few_cells_far_apart_take_no_room() {
        let cell = |reference: &str| {
            format!("<sheetData><row r='1'><c r='{reference}'><v>1</v></c></row></sheetData>")
        };
        let read = |sheet: &str| file("a.xlsx", &workbook(sheet));
        assert_eq!(
            read(&cell("B7")).unwrap().lines,
            [(7, vec![String::new(), "1".to_owned()])]
        );
        for reference in [
            "A99999999999999",
            "ZZZZZZZZZZZZZZZ1",
            "A4294967297",
            "XFE1",
            "A0",
            "1",
            "A",
            "",
            "A1:B2",
            "Á1",
            "-1",
        ] {
            for sheet in [
                cell(reference),
                format!("<dimension ref='A1:{reference}'/>{}", cell("A1")),
                format!("<sheetData><row r='{reference}'><c><v>1</v></c></row></sheetData>"),
            ] {
                // Whatever is said of it, it is said by an error or read.
                if let Err(error) = read(&sheet) {
                    assert!(!format!("{error:#}").is_empty());
                }
            }
        }
        let wide = |k: u32| format!("<row r='{k}'><c r='ALL{k}'><v>1</v></c></row>");
        let wide: String = (1..5_000).map(wide).collect();
        let refused = read(&format!("<sheetData>{wide}</sheetData>")).unwrap_err();
        let refused = format!("{refused:#}");
        assert!(refused.contains("worksheet \"Laser\": row 4001: 4001 rows of 1000 columns: must be at most 4000000 cells"), "{refused}");
    }

    #[test]
    fn a_line_of_more_columns_than_a_table_has_is_refused_with_its_number() {
        let line = |columns: usize| vec!["1"; columns].join(",");
        assert!(Sheet::of_text(&line(1_000), ',').is_ok());
        let text = format!("a,b\n{}", line(1_001));
        let refused = Sheet::of_text(&text, ',').unwrap_err().to_string();
        assert!(
            refused.starts_with("line 2: 1001 columns: must be at most 1000"),
            "{refused}"
        );
    }
}
