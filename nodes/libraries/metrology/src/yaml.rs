//! YAML files that people write: machine files, plans, parameters, maps, limits, budgets.
//!
//! One place reads them, and one place turns what the YAML library finds wrong into an error of this product: line and
//! column, the whole path of the key, what stands there, what belongs there in which unit. Checks that come after
//! reading know a key and no line; [`Places`] gives them the line.

mod base;
mod culprit;
mod homes;
mod places;
mod words;

use std::fmt;

use serde::de::DeserializeOwned;

pub use base::base_of;
pub use places::{Place, Places};
pub use words::{known_keys, wanted};

/// Longest value that is shown, characters.
const SHOWN: usize = 60;

/// A YAML text that is not what it should be.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct YamlError {
    /// Line, from 1; 0 where it is not known.
    pub line: usize,
    /// Column, from 1; 0 where it is not known.
    pub column: usize,
    /// Path of the key, such as `axes.X.travel_mm[1]`; empty for the whole file.
    pub key: String,
    /// What stands there, where that helps.
    pub value: Option<String>,
    /// What is wrong and what belongs there.
    pub rule: String,
}

impl fmt::Display for YamlError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.line > 0 {
            write!(f, "{}:{}: ", self.line, self.column)?;
        }
        match (self.key.as_str(), &self.value) {
            ("", None) => write!(f, "{}", self.rule),
            ("", Some(value)) => write!(f, "{value}: {}", self.rule),
            (key, None) => write!(f, "{key}: {}", self.rule),
            (key, Some(value)) => write!(f, "{key} = {value}: {}", self.rule),
        }
    }
}

impl std::error::Error for YamlError {}

/// Reads a value of `T`; `y`, `yes`, `on` and their opposites are truth values where one is wanted.
///
/// # Errors
/// Place, key, what stands there and what belongs there.
pub fn read<T: DeserializeOwned>(text: &str) -> Result<T, YamlError> {
    let again = |text: &str| serde_saphyr::from_str::<T>(text).err();
    serde_saphyr::from_str(text).map_err(|error| words::in_own_words(&error, text, &again))
}

/// The same, where `axis: Y` is a letter and not the truth value that YAML 1.1 takes it for.
///
/// # Errors
/// As [`read`].
pub fn read_letters<T: DeserializeOwned>(text: &str) -> Result<T, YamlError> {
    let options = || serde_saphyr::options! { strict_booleans: true };
    let again = |text: &str| serde_saphyr::from_str_with_options::<T>(text, options()).err();
    serde_saphyr::from_str_with_options(text, options())
        .map_err(|error| words::in_own_words(&error, text, &again))
}

/// A message about the text of a file with the file's name and, where the message begins with a place or with a key of
/// the text (`axes.X.lead_mm = …`, `steps[3]: …`), with line and column in front: `machine.yaml:12:5: axes.X.lead_mm = …`.
#[must_use]
pub fn placed(file: &str, text: &str, message: &str) -> String {
    let place = message.split_once(": ").map_or("", |(place, _)| place);
    let is_number = |part: &str| !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit());
    if place.split(':').count() == 2 && place.split(':').all(is_number) {
        return format!("{file}:{message}");
    }
    let key = message.split([' ', ',']).next().unwrap_or_default();
    let key = key.trim_end_matches(':');
    match Places::of(text).known(key) {
        Some(at) => format!("{file}:{}:{}: {message}", at.line, at.column),
        None => format!("{file}: {message}"),
    }
}

/// At most 60 characters of a text, in one line: a cell, a value, an argument as a message shows it.
#[must_use]
pub fn shown(text: &str) -> String {
    let line: String = text
        .chars()
        .map(|letter| if letter.is_control() { ' ' } else { letter })
        .take(SHOWN)
        .collect();
    if text.chars().count() > SHOWN {
        format!("{line}…")
    } else {
        line
    }
}

#[cfg(test)]
mod tests;
