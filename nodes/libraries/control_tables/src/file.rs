//! A finished file for a control.

/// A file as the control loads it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExportFile {
    /// File name as the control expects it.
    pub name: String,
    /// Its text, line feeds only.
    pub text: String,
    /// What whoever loads it must know: sign, unit, rounding, what is derived, what must be switched on. Also in
    /// the text where the format has comments.
    pub notes: Vec<String>,
}

impl ExportFile {
    pub(super) fn new(name: String, text: String, notes: Vec<String>) -> Self {
        Self { name, text, notes }
    }
}

/// A note as every control reads it: one line, and letters of ASCII alone.
pub(super) fn one_line(note: &str) -> String {
    let note = note.replace("°C", "degC").replace('µ', "u");
    let plain = |letter: char| match letter {
        letter if letter.is_control() => ' ',
        letter if letter.is_ascii() => letter,
        _ => '?',
    };
    note.chars().map(plain).collect()
}

/// Each note as a comment line that begins with `mark`.
pub(super) fn comments(mark: &str, notes: &[String]) -> String {
    notes
        .iter()
        .map(|note| format!("{mark} {note}\n"))
        .collect()
}
