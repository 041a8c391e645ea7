//! The YAML library's errors in this product's words.

use serde_saphyr::budget::BudgetBreach;
use serde_saphyr::{Budget, Error, Location};

use super::culprit::{Again, culprit};
use super::homes::home_of;
use super::places::{Kind, Place, Places};
use super::{YamlError, shown};
use crate::bound::COUNTS;
use crate::number::unit_of;

/// Most keys that are listed.
const LISTED: usize = 30;

/// What the library found wrong in `text`.
#[expect(
    clippy::too_many_lines,
    reason = "a table of cases, read from top to bottom"
)]
pub(super) fn in_own_words(error: &Error, text: &str, again: Again<'_>) -> YamlError {
    let location = location(error);
    let error = innermost(error);
    let places = Places::of(text);
    let place = location.and_then(|at| {
        Some(Place {
            line: usize::try_from(at.line()).ok().filter(|line| *line > 0)?,
            column: usize::try_from(at.column()).ok()?,
        })
    });
    let node = find(error, &places, place);
    let node = node.map(|node| culprit(error, &places, node, again).unwrap_or(node));
    let mut key = node.map(|node| places.path(node)).unwrap_or_default();
    let mut value = node.map(|node| places.value(node));
    let rule = match error {
        Error::SerdeMissingField { field, .. } => {
            value = None;
            let name = if key.is_empty() { "the file" } else { &key };
            let rule = match (elsewhere(&places, &key, field), unit_of(field)) {
                (Some(what), _) => format!("the key {field} is missing in {name}: {what}"),
                (None, Some(unit)) => {
                    format!("the key {field} is missing in {name}: add it, in {unit}")
                }
                (None, None) => format!("the key {field} is missing in {name}: add it"),
            };
            key = joined(&key, field);
            rule
        }
        Error::SerdeUnknownField {
            field, expected, ..
        } => {
            value = None;
            if key.rsplit('.').next() != Some(field.as_str()) {
                key = joined(&key, field);
            }
            known_keys(field, expected)
        }
        Error::UnknownAnchor { .. } => {
            value = None;
            let name = places.undefined().map_or("", |(_, name)| name);
            format!(
                "the name behind `*{name}` is not defined above by `&{name}`: define it, or write the value out"
            )
        }
        Error::DuplicateMappingKey { .. } => {
            value = None;
            let lines = node.map(|node| places.twins(node)).unwrap_or_default();
            twice(&lines)
        }
        Error::ExternalMessage { .. } | Error::Eof { .. } => {
            (key, value) = (String::new(), None);
            syntax(text, place)
        }
        Error::SerdeInvalidLength { len, expected, .. } => {
            // serde counts up to the first value that is too many.
            let n_values = node.and_then(|node| places.list_length(node));
            let remedy = decimal_commas(n_values.unwrap_or(*len), expected);
            format!("must be {}{remedy}", wanted(expected, &key))
        }
        other => {
            let among = node.map(|node| candidates(other, &places, node));
            let named: Vec<&str> = among
                .iter()
                .flatten()
                .filter_map(|at| places.name(*at))
                .collect();
            if named.is_empty() {
                rule(other, &key)
            } else {
                // Several of its values are of the kind that is refused.
                value = None;
                format!("one of {} {}", named.join(", "), rule(other, named[0]))
            }
        }
    };
    let shown_at = match error {
        Error::ExternalMessage { .. } | Error::Eof { .. } => place,
        _ => node.map(|node| places.place(node)).or(place),
    };
    let shown_at = shown_at.unwrap_or(Place { line: 1, column: 1 });
    YamlError {
        line: shown_at.line,
        column: shown_at.column,
        key,
        value,
        rule,
    }
}

/// The error itself, without what it is wrapped in.
pub(super) fn innermost(error: &Error) -> &Error {
    match error {
        Error::WithSnippet { error, .. } | Error::AliasError { error, .. } => innermost(error),
        other => other,
    }
}

/// Where an error stands: of a value that an alias brings, where the alias stands, since its anchor belongs to another key.
fn location(error: &Error) -> Option<Location> {
    match error {
        Error::WithSnippet { error, .. } => location(error),
        Error::AliasError {
            error, locations, ..
        } => match location(error) {
            Some(at) if at != locations.defined_location => Some(at),
            _ => Some(locations.reference_location),
        },
        other => other.location(),
    }
}

/// What to do about a key that is missing at `path` and stands at a level where it does not belong.
fn elsewhere(places: &Places, path: &str, field: &str) -> Option<String> {
    let home = home_of(field)?;
    let line_of = |wanted: &str| {
        let mut values = places.values();
        let found = values.find(|(path, ..)| path == wanted);
        found.map(|(_, key, ..)| key.line)
    };
    let mut above = path;
    while !above.is_empty() {
        above = above.rsplit_once('.').map_or("", |(parent, _)| parent);
        if let Some(line) = line_of(&joined(above, field)) {
            return Some(format!("move it there from line {line}"));
        }
    }
    // If no level is known to lack the key, it stands at the wrong level.
    let below = format!(".{field}");
    let mut stands = places
        .values()
        .filter(|(at, ..)| path.is_empty() && at.ends_with(&below));
    let (at, key, ..) = stands.next()?;
    let line = key.line;
    let is_alone = stands.next().is_none();
    is_alone.then(|| format!("it stands as {at} in line {line}, and belongs under {home}"))
}

fn joined(path: &str, key: &str) -> String {
    if path.is_empty() {
        key.to_owned()
    } else {
        format!("{path}.{key}")
    }
}

/// The node that an error is about. Within a choice by name (`do: wait`) the library knows only where the choice
/// begins: there the key or the value that it complains of is looked for.
fn find(error: &Error, places: &Places, place: Option<Place>) -> Option<usize> {
    let node = match place {
        Some(place) => places.at(place)?,
        None => 0,
    };
    match error {
        Error::SerdeUnknownField { field, .. } => {
            let around = places.parent(node);
            let named = |root| {
                places
                    .below(root)
                    .map(|(at, _)| at)
                    .find(|at| places.name(*at) == Some(field))
            };
            if places.name(node) == Some(field) {
                return Some(node);
            }
            named(node).or_else(|| named(around?)).or(Some(node))
        }
        Error::UnknownAnchor { .. } => places.undefined().map(|(alias, _)| alias),
        Error::SerdeInvalidType { .. } | Error::SerdeInvalidValue { .. } => {
            match candidates(error, places, node).as_slice() {
                [one] => Some(*one),
                _ => Some(node),
            }
        }
        Error::SerdeMissingField { .. } => {
            // The library points at the first key of the map, or at the map where it is empty.
            let is_first_key = places.name(node).is_some() && place == Some(places.key_place(node));
            let map = places.parent(node).filter(|_| is_first_key);
            map.or(Some(node))
        }
        _ => Some(node),
    }
}

/// The values of a map that an error about the kind of one of them can mean.
fn candidates(error: &Error, places: &Places, node: usize) -> Vec<usize> {
    let (Error::SerdeInvalidType { unexpected, .. } | Error::SerdeInvalidValue { unexpected, .. }) =
        error
    else {
        return vec![];
    };
    if !matches!(places.kind(node), Kind::Map) {
        return vec![];
    }
    let meant = |kind: &Kind| match kind {
        Kind::Scalar { text, .. } => is_of(unexpected, text),
        Kind::List => unexpected == "sequence",
        Kind::Map => unexpected == "map",
    };
    let below = places.below(node).filter(|(at, _)| *at != node);
    let meant = below.filter(|(_, below)| meant(&below.kind));
    meant.map(|(at, _)| at).collect()
}

/// Whether serde's words for a value (`string "a"`, ``integer `5` ``) mean the scalar `text`.
fn is_of(unexpected: &str, text: &str) -> bool {
    if matches!(unexpected, "unit value" | "Option value" | "unit") {
        return text == "~" || text.is_empty();
    }
    let quoted = unexpected.split_once(['"', '`']);
    let value = quoted.map(|(_, rest)| rest.trim_end_matches(['"', '`']));
    match value {
        Some(value) if value == text => true,
        Some(value) => matches!(
            (value.parse::<f64>(), text.parse::<f64>()),
            (Ok(a), Ok(b)) if a.total_cmp(&b).is_eq()
        ),
        None => false,
    }
}

/// What to say of a key that nobody knows.
#[must_use]
pub fn known_keys(field: &str, expected: &[&str]) -> String {
    if let Some(home) = home_of(field) {
        return format!(
            "the key {field} does not belong here: it belongs under {home}; the keys here are {}",
            listed(expected)
        );
    }
    if expected.is_empty() {
        return "unknown key: no key belongs here, remove it".to_owned();
    }
    let near = expected.iter().min_by_key(|known| distance(field, known));
    let near = near.filter(|known| distance(field, known) <= 1 + field.len() / 4);
    let listed = listed(expected);
    match near {
        Some(near) => format!("unknown key, is {near} meant? the keys here are {listed}"),
        None => format!("unknown key: the keys here are {listed}"),
    }
}

fn listed(expected: &[&str]) -> String {
    let mut listed = expected[..expected.len().min(LISTED)].join(", ");
    if expected.len() > LISTED {
        listed.push_str(", …");
    }
    if listed.is_empty() {
        listed.push_str("none");
    }
    listed
}

/// Letters to change, add or leave out (Levenshtein).
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().take(80).collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, letter) in a.chars().take(80).enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, other) in b.iter().enumerate() {
            let changed = diagonal + usize::from(letter != *other);
            diagonal = row[j + 1];
            row[j + 1] = changed.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row.last().copied().unwrap_or(0)
}

fn twice(lines: &[usize]) -> String {
    match lines {
        [first, .., last] => {
            format!("the key is there twice, in line {first} and line {last}: keep one of them")
        }
        _ => "the key is there twice: keep one of them".to_owned(),
    }
}

/// A text that is no YAML, with the line that breaks it.
fn syntax(text: &str, place: Option<Place>) -> String {
    if text.trim().is_empty() {
        return "the file is empty".to_owned();
    }
    let line = place.and_then(|at| text.lines().nth(at.line.checked_sub(1)?));
    let line = line.map(str::trim).filter(|line| !line.is_empty());
    // A tab is noticed where it begins or at the end of the line above.
    let tab = place.and_then(|at| {
        let near = [at.line, at.line + 1].into_iter();
        let is_tab = |number: &usize| {
            let line = number
                .checked_sub(1)
                .and_then(|above| text.lines().nth(above));
            line.is_some_and(|line| line.starts_with('\t'))
        };
        near.into_iter().find(is_tab)
    });
    let remedy = match tab {
        Some(number) => {
            format!("line {number} begins with a tab, and YAML is indented by spaces alone")
        }
        None => {
            "check colons, quotes, brackets and the indentation of this line and of those above it"
                .to_owned()
        }
    };
    match line {
        Some(line) => format!("the text is no YAML at `{}`: {remedy}", shown(line)),
        None => format!("the text is no YAML here: {remedy}"),
    }
}

/// Everything else: what belongs there.
fn rule(error: &Error, key: &str) -> String {
    let must = |words: &str| format!("must be {words}");
    match error {
        Error::SerdeInvalidType { expected, .. } | Error::SerdeInvalidValue { expected, .. } => {
            must(&wanted(expected, key))
        }
        Error::InvalidScalar { ty, .. } => must(&wanted(ty, key)),
        Error::Unexpected { expected, .. } => must(&wanted(expected, key)),
        Error::SerdeUnknownVariant {
            variant, expected, ..
        } => {
            let home = home_of(variant).map_or_else(String::new, |home| {
                format!("; the key {variant} belongs under {home}: move it there")
            });
            format!(
                "\"{}\" is not known here: must be one of {}{home}",
                shown(variant),
                expected.join(", ")
            )
        }
        Error::NullIntoString { .. } => must("text, and nothing stands there"),
        Error::InvalidBooleanStrict { .. } => must("true or false"),
        Error::InvalidCharNull { .. } | Error::InvalidCharNotSingleScalar { .. } => {
            must("one character, in quotes")
        }
        Error::NonFiniteFloat { .. } => match unit_of(key) {
            Some(unit) => must(&format!("a finite number, in {unit}")),
            None => must("a finite number"),
        },
        Error::MultipleDocuments { .. } => {
            "a second document begins here (`---`): a file holds one".to_owned()
        }
        Error::RecursiveReferencesRequireWeakTypes { .. } => {
            "the alias `*` stands inside of its own anchor `&`: write the values out".to_owned()
        }
        Error::MergeValueNotMapOrSeqOfMaps { .. } | Error::MergeKeyNotAllowed { .. } => {
            "the merge key `<<` needs an alias of keys with values: write the keys out".to_owned()
        }
        Error::Message { msg, .. } | Error::SerdeVariantId { msg, .. } => own(msg, key),
        Error::Budget { breach, .. } => too_large(breach),
        Error::AliasReplayLimitExceeded { .. }
        | Error::AliasExpansionLimitExceeded { .. }
        | Error::AliasReplayStackDepthExceeded { .. } => {
            "the aliases `*` bring more values than any file that belongs here: write the values out".to_owned()
        }
        Error::ExternallyTaggedEnumExpectedScalarOrMapping { .. }
        | Error::ExpectedStringKeyForExternallyTaggedEnum { .. }
        | Error::ExpectedMappingEndAfterEnumVariantValue { .. } => {
            must("one name, or one key with its values")
        }
        Error::UnexpectedValueForUnitEnumVariant { .. } => must("a name without values"),
        _ => "is not what belongs here: see the README for what does".to_owned(),
    }
}

/// How a list came to twice its values.
fn decimal_commas(n_values: usize, expected: &str) -> &'static str {
    if list_length(expected).is_some_and(|n| n_values == 2 * n) {
        "; a comma separates values, decimals have a point"
    } else {
        ""
    }
}

/// The length of a list that is expected, by serde's words.
fn list_length(expected: &str) -> Option<usize> {
    let beginnings = ["an array of length ", "a tuple of size "];
    let mut lengths = beginnings
        .iter()
        .filter_map(|beginning| expected.strip_prefix(beginning));
    lengths.next()?.trim().parse().ok()
}

/// A file that is larger or deeper than what is read, with what it has and the limit.
fn too_large(breach: &BudgetBreach) -> String {
    let limits = Budget::default();
    let (value, what, limit) = match breach {
        BudgetBreach::Nodes { nodes } => (*nodes, "keys and values", limits.max_nodes),
        BudgetBreach::Events { events } => (*events, "parts", limits.max_events),
        BudgetBreach::Depth { depth } => (*depth, "levels below each other", limits.max_depth),
        BudgetBreach::Aliases { aliases } => (*aliases, "aliases `*`", limits.max_aliases),
        BudgetBreach::Anchors { anchors } => (*anchors, "anchors `&`", limits.max_anchors),
        BudgetBreach::Documents { documents } => (*documents, "documents", limits.max_documents),
        BudgetBreach::ScalarBytes { total_scalar_bytes } => (
            *total_scalar_bytes,
            "bytes of keys and values",
            limits.max_total_scalar_bytes,
        ),
        BudgetBreach::CommentBytes {
            total_comment_bytes,
        } => (
            *total_comment_bytes,
            "bytes of comments",
            limits.max_total_comment_bytes,
        ),
        BudgetBreach::MergeKeys { merge_keys } => {
            (*merge_keys, "merge keys `<<`", limits.max_merge_keys)
        }
        _ => {
            return "the file is larger or deeper than any that belongs here: simplify it"
                .to_owned();
        }
    };
    format!(
        "the file has {value} {what} up to here, at most {limit} are read: simplify or split it"
    )
}

/// A message of one of our own types; serde's own phrases are turned.
fn own(message: &str, key: &str) -> String {
    if let Some(rest) = message.strip_prefix("invalid type: ")
        && let Some((_, expected)) = rest.rsplit_once(", expected ")
    {
        return format!("must be {}", wanted(expected, key));
    }
    if let Some(field) = message.strip_prefix("missing field `") {
        let field = field.trim_end_matches('`');
        return format!("the key {field} is missing: add it");
    }
    if message.starts_with("data did not match any variant") {
        return "has none of the forms that belong here: see the README for them".to_owned();
    }
    message.to_owned()
}

/// What serde expects, in words; a number with the unit of its key.
#[must_use]
pub fn wanted(expected: &str, key: &str) -> String {
    let number = |words: &str| match unit_of(key) {
        Some(unit) => format!("{words}, in {unit}"),
        None => words.to_owned(),
    };
    match expected {
        // A list or keys where one value belongs: the unit says that it is a number.
        "scalar" | "string scalar" if unit_of(key).is_some() => number("a number"),
        "f64" | "f32" | "floating point" | "a double" => number("a number"),
        "u8" => number(&count(key, "a whole number from 0 to 255")),
        "u16" => number(&count(key, "a whole number from 0 to 65535")),
        "u32" => number(&count(key, "a whole number from 0 to 4294967295")),
        "u64" | "u128" | "usize" => number(&count(key, "a whole number, 0 or above")),
        "i8" => number("a whole number from -128 to 127"),
        "i16" => number("a whole number from -32768 to 32767"),
        "i32" => number("a whole number from -2.1e9 to 2.1e9"),
        "i64" | "i128" | "isize" => number("a whole number"),
        "a string" | "string" | "string scalar" | "a borrowed string" | "str" => "text".to_owned(),
        "a boolean" | "boolean" | "bool" => "true or false".to_owned(),
        "a character" | "char" => "one character, in quotes".to_owned(),
        "scalar" => "one value".to_owned(),
        "a sequence" | "sequence start" | "a list" => "a list, as [a, b]".to_owned(),
        "a map" | "mapping start" | "map" => "keys with values".to_owned(),
        "unit" | "unit variant" => "nothing".to_owned(),
        "string or map" => "one name, or one key with its values".to_owned(),
        other => by_beginning(other, key),
    }
}

/// A whole number that counts, with the range of its key where that is known.
fn count(key: &str, of_type: &str) -> String {
    let name = key.rsplit('.').next().unwrap_or(key);
    match COUNTS.iter().find(|(known, ..)| *known == name) {
        Some((_, least, greatest)) => format!("a whole number from {least} to {greatest}"),
        None => of_type.to_owned(),
    }
}

fn by_beginning(expected: &str, key: &str) -> String {
    let unit = unit_of(key).map(|unit| format!(", in {unit}"));
    if let Some(n) = list_length(expected) {
        return format!("a list of {n}{}", unit.unwrap_or_default());
    }
    let is_of = |word: &str| expected.starts_with(word);
    if is_of("struct ") || is_of("struct variant") {
        "keys with values".to_owned()
    } else if is_of("tuple ") {
        "a list".to_owned()
    } else if is_of("enum ")
        || is_of("internally tagged enum")
        || is_of("adjacently tagged enum")
        || is_of("variant")
    {
        "one of the names that belong here".to_owned()
    } else {
        expected.to_owned()
    }
}
