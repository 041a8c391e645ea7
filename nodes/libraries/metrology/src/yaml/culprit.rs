//! The key that a choice by name refuses.
//!
//! A choice by name (`do: wait`) is read whole before its keys are looked at, and the YAML library then knows only where
//! it begins. The text is read again with one key of it at a time: the key that is refused alone with the same words is
//! the one that is meant.

use serde_saphyr::Error;

use super::places::{Kind, Places};

/// Keys that say which of several forms stands here.
const TAGS: [&str; 3] = ["do", "is", "kind"];
/// Largest text that is read again, values; and how often at most.
const MOST_NODES_AGAIN: usize = 20_000;
const MOST_READINGS: usize = 400;

/// Reads a text again, and tells what is wrong with it.
pub(super) type Again<'a> = &'a dyn Fn(&str) -> Option<Error>;

/// The node below the choice at `node` that `error` is about; `None` where it cannot be told.
pub(super) fn culprit(
    error: &Error,
    places: &Places,
    node: usize,
    again: Again<'_>,
) -> Option<usize> {
    if places.len() > MOST_NODES_AGAIN || !is_of_one_value(error) {
        return None;
    }
    let wanted = words(error);
    let mut n_left = MOST_READINGS;
    let mut found = choice_at(places, node)?;
    let top = found;
    while let Some(child) = one_below(places, found, &wanted, again, &mut n_left) {
        found = child;
    }
    (found != top).then_some(found)
}

/// The choice that begins at a node: itself, or the keys whose first one it is.
fn choice_at(places: &Places, node: usize) -> Option<usize> {
    if places.kind(node) == &Kind::Map {
        return Some(node);
    }
    let map = places.parent(node)?;
    let is_map = places.kind(map) == &Kind::Map;
    (is_map && places.children(map).next() == Some(node)).then_some(map)
}

/// Whether an error can be of one value alone.
fn is_of_one_value(error: &Error) -> bool {
    !matches!(
        error,
        Error::SerdeMissingField { .. }
            | Error::SerdeUnknownField { .. }
            | Error::DuplicateMappingKey { .. }
            | Error::ExternalMessage { .. }
            | Error::Eof { .. }
            | Error::Budget { .. }
    )
}

fn one_below(
    places: &Places,
    node: usize,
    wanted: &str,
    again: Again<'_>,
    n_left: &mut usize,
) -> Option<usize> {
    let is_tag = |child: usize| places.name(child).is_some_and(|name| TAGS.contains(&name));
    let children: Vec<usize> = places.children(node).collect();
    let tags: Vec<usize> = children.iter().copied().filter(|at| is_tag(*at)).collect();
    let is_same = |kept: &[usize]| {
        let text = places.with_only(node, kept);
        let error = text.and_then(|text| again(&text));
        error.is_some_and(|error| words(&error) == wanted)
    };
    if is_same(&tags) {
        // It is of the name of the choice, or of the whole: of nothing below.
        return (tags.len() == 1).then(|| tags[0]);
    }
    children.into_iter().find(|child| {
        *n_left = n_left.saturating_sub(1);
        if *n_left == 0 || is_tag(*child) {
            return false;
        }
        let kept: Vec<usize> = tags.iter().copied().chain([*child]).collect();
        is_same(&kept)
    })
}

/// What an error says, without its place.
fn words(error: &Error) -> String {
    let text = super::words::innermost(error).to_string();
    let (words, place) = text.rsplit_once(" at line ").unwrap_or((&text, ""));
    let is_place = place.starts_with(|letter: char| letter.is_ascii_digit());
    if is_place { words.to_owned() } else { text }
}
