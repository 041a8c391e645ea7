//! The key `base`: a file of which it is the only key has the contents of the file that it names.

use super::YamlError;
use super::places::{Kind, Places};

/// The key.
const BASE: &str = "base";

/// The path that a text names as its base; `None`: the text has contents of its own.
///
/// # Errors
/// With line and column, when other keys stand beside `base` or its value is no path.
pub fn base_of(text: &str) -> Result<Option<String>, YamlError> {
    if !text.contains(BASE) {
        return Ok(None);
    }
    let places = Places::of(text);
    let keys: Vec<usize> = places.children(0).collect();
    let base = keys.iter().find(|key| places.name(**key) == Some(BASE));
    let Some(base) = base.copied() else {
        return Ok(None);
    };
    let at = places.place(base);
    let error = |rule: String| YamlError {
        line: at.line,
        column: at.column,
        key: BASE.to_owned(),
        value: Some(places.value(base)),
        rule,
    };
    if keys.len() > 1 {
        let others = keys.iter().filter(|key| **key != base);
        let others = others.filter_map(|key| places.name(*key));
        return Err(error(format!(
            "must be the only key of its file, which has all of the base's contents, but {} stands beside it: \
             leave out base and copy its file, or leave out the other keys",
            others.take(3).collect::<Vec<_>>().join(", ")
        )));
    }
    match places.kind(base) {
        Kind::Scalar { text, .. } if !["", "~", "null"].contains(&text.trim()) => {
            Ok(Some(text.clone()))
        }
        _ => Err(error(
            "must be the path of a file, relative to the folder of this one".to_owned(),
        )),
    }
}
