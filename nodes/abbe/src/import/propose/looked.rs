//! What is in a file, whatever its kind: a text, a worksheet, or a file of an instrument.

use std::path::Path;

use anyhow::Result;

use super::super::encoding;
use super::super::file::{self, Form};
use super::super::recognise::{self, Recognised};
use super::super::sheet::Sheet;
use super::kinds::kind;

/// What was seen in a file.
#[derive(Default)]
pub struct Looked {
    /// What was recognised in its cells.
    pub found: Option<Recognised>,
    /// Name of the worksheet, where there are several.
    pub sheet: Option<String>,
    /// The encoding of a text that is not UTF-8.
    pub encoding: Option<String>,
    /// The instrument's own form.
    pub form: Option<&'static str>,
    /// When the measurement began, s since 1970, where the file says so.
    pub start_s: Option<f64>,
}

/// Looks at a file.
///
/// # Errors
/// When it cannot be read, or holds more than is read.
pub fn at(path: &Path) -> Result<Looked> {
    let form = Form {
        separator: ',',
        decimal: '.',
        sheet: None,
        is_by_number: false,
    };
    if file::is_separated(path)? {
        let decoded = encoding::read(path)?;
        let found = recognise::of_text(&decoded.text)?;
        return Ok(Looked {
            found,
            encoding: decoded.note,
            ..Looked::default()
        });
    }
    let is_table = |sheet: &Sheet| {
        let found = recognise::of(sheet, form.decimal);
        found.is_some_and(|found| kind(&found).is_some())
    };
    let cells = file::read(path, form, &is_table)?;
    Ok(Looked {
        found: recognise::of(&cells.sheet, form.decimal),
        sheet: cells.name,
        form: cells.form,
        start_s: cells.start_s,
        ..Looked::default()
    })
}
