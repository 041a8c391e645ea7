//! A folder in place of a bag that holds tables and no recording.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use recorder::{Bag, RecorderError};

use super::from_table;

/// Tables that are named one by one.
const TABLES_NAMED: usize = 3;

/// Refuses a folder that holds tables and no bag, with the command that reads them; `verb` is that of the call.
///
/// # Errors
/// With the first tables.
pub fn check(path: &Path, verb: &str) -> Result<()> {
    let is_without_bag = || {
        matches!(
            Bag::open(path),
            Err(RecorderError::NoFiles { inside: None, .. })
        )
    };
    if !path.is_dir() || !is_without_bag() {
        return Ok(());
    }
    let tables = tables_in(path);
    let Some(first) = tables.first() else {
        return Ok(());
    };
    let names = tables.iter().take(TABLES_NAMED);
    let names = names.filter_map(|table| Some(table.file_name()?.to_string_lossy().into_owned()));
    let names = names.collect::<Vec<_>>().join(", ");
    let more = match tables.len().saturating_sub(TABLES_NAMED) {
        0 => String::new(),
        n => format!(" and {n} more"),
    };
    bail!(
        "{}: a folder without a bag (no .mcap file), with tables: {names}{more}: name a table by its file: abbe {verb} {}",
        path.display(),
        in_a_shell(first)
    )
}

/// The tables in a folder, in the order of their names.
fn tables_in(path: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(path) else {
        return vec![];
    };
    let paths = entries.flatten().map(|entry| entry.path());
    let mut tables: Vec<PathBuf> = paths
        .filter(|path| path.is_file() && from_table::is_table(path))
        .collect();
    tables.sort();
    tables
}

/// A path as a shell reads it.
fn in_a_shell(path: &Path) -> String {
    let text = path.display().to_string();
    let is_plain = |letter: char| letter.is_alphanumeric() || "/._-+,@".contains(letter);
    if text.chars().all(is_plain) {
        return text;
    }
    format!("'{}'", text.replace('\'', "'\\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_of_tables_is_refused_with_the_command_that_reads_one() {
        let home = tempfile::tempdir().unwrap();
        let folder = home.path().join("laser run");
        std::fs::create_dir_all(folder.join("old.csv")).unwrap();
        let shown = folder.display();
        let said = || check(&folder, "report").map_err(|error| error.to_string());
        assert_eq!(said(), Ok(()));
        for name in ["notes.md", "b.xlsx", "a.csv"] {
            std::fs::write(folder.join(name), "n,x\n").unwrap();
        }
        let words = format!(
            "{shown}: a folder without a bag (no .mcap file), with tables: a.csv, b.xlsx: name a table by its file: abbe report '{shown}/a.csv'"
        );
        assert_eq!(said(), Err(words));
        for name in ["c.txt", "d.TSV"] {
            std::fs::write(folder.join(name), "n,x\n").unwrap();
        }
        let found = said().unwrap_err();
        assert!(
            found.contains("a.csv, b.xlsx, c.txt and 1 more:"),
            "{found}"
        );
        // A bag beside tables is read.
        std::fs::write(folder.join("run.mcap"), "").unwrap();
        assert_eq!(said(), Ok(()));
        assert!(check(&folder.join("a.csv"), "report").is_ok());
    }
}
