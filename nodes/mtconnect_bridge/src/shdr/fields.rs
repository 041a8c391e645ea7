//! The fields of a line, as the reference agent cuts it.
//!
//! A bar ends a field; white space around a field is no part of it. A field whose first letter is a double quote and
//! whose last is one too has its text between them, and there, and there alone, a backslash takes the next letter as it
//! is: `"a \| b"` is `a | b`. A backslash elsewhere is a backslash (`C:\NC\|` ends in one). Quotes that do not end:
//! the opening one is dropped, and where the line had such a backslash the field is taken as it stands.
//!
//! A quote that does not end is reported, since the fields behind it may not be what their writer meant.
//!
//! One thing differs on purpose: a quote that ends before its field does (`"a" b|c`) makes two fields of one in the
//! reference, so that everything behind it is shifted. Here the field is taken as it stands.
//!
//! # References
//! \[1\] `mtconnect/cppagent`, `src/mtconnect/pipeline/shdr_tokenizer.hpp` and `test_package/shdr_tokenizer_test.cpp`.

/// Cuts a line.
#[must_use]
pub fn fields(line: &str) -> Vec<String> {
    cut(line).0
}

/// Cuts a line; also the first field, from 1 on, that opens a quote which does not end.
#[must_use]
pub fn cut(line: &str) -> (Vec<String>, Option<usize>) {
    let (mut found, mut open) = (Vec::new(), None);
    let (mut rest, mut has_escape) = (line, false);
    loop {
        rest = rest.trim_start();
        let behind_quote = rest.strip_prefix('"');
        if behind_quote.is_some_and(|text| !has_end(text)) {
            open.get_or_insert(found.len() + 1);
        }
        let (field, behind) = match behind_quote.and_then(|text| quoted(text, &mut has_escape)) {
            Some(quoted) => quoted,
            None => plain(rest),
        };
        found.push(field);
        match behind {
            Some(behind) => rest = behind,
            None => return (found, open),
        }
    }
}

/// Whether a quote ends before the next bar, from behind the quote on.
fn has_end(text: &str) -> bool {
    let mut letters = text.chars();
    while let Some(letter) = letters.next() {
        match letter {
            '"' => return true,
            '|' => return false,
            '\\' => {
                letters.next();
            }
            _ => {}
        }
    }
    false
}

/// A field and what stands behind its bar; `None`: the line has ended.
type Cut<'a> = (String, Option<&'a str>);

fn plain(text: &str) -> Cut<'_> {
    match text.split_once('|') {
        Some((field, behind)) => (field.trim_end().to_owned(), Some(behind)),
        None => (text.trim_end().to_owned(), None),
    }
}

/// A field from behind its opening quote on; `None`: it is to be taken as it stands, with the quote. `has_escape`:
/// whether the line had an escape so far.
fn quoted<'a>(text: &'a str, has_escape: &mut bool) -> Option<Cut<'a>> {
    let mut field = String::new();
    let mut letters = text.char_indices();
    while let Some((at, letter)) = letters.next() {
        match letter {
            '\\' => {
                *has_escape = true;
                field.extend(letters.next().map(|(_, letter)| letter));
            }
            // It does not end: without an escape the quote alone is dropped.
            '|' => {
                let dropped = || (field.trim_end().to_owned(), Some(&text[at + 1..]));
                return (!*has_escape).then(dropped);
            }
            '"' => {
                let behind = text[at + 1..].trim_start();
                if behind.is_empty() {
                    return Some((field.trim_end().to_owned(), None));
                }
                let behind = behind.strip_prefix('|')?;
                return Some((field.trim_end().to_owned(), Some(behind)));
            }
            other => field.push(other),
        }
    }
    (!*has_escape).then(|| (field.trim_end().to_owned(), None))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The reference's own cases, line and fields.
    const REFERENCE: [(&str, &[&str]); 38] = [
        (
            "   |hello   |   kitty| cat | ",
            &["", "hello", "kitty", "cat", ""],
        ),
        ("hello|kitty", &["hello", "kitty"]),
        ("hello|kitty|", &["hello", "kitty", ""]),
        ("|hello|kitty|", &["", "hello", "kitty", ""]),
        (
            r#"hello|xxx={b="12345", c="xxxxx"}}|bbb"#,
            &["hello", r#"xxx={b="12345", c="xxxxx"}}"#, "bbb"],
        ),
        (r#""a\|b""#, &["a|b"]),
        (r#""a\|b"|z"#, &["a|b", "z"]),
        (r#"y|"a\|b""#, &["y", "a|b"]),
        (r#"y|"a\|b"|z"#, &["y", "a|b", "z"]),
        (r#""a\|b\|c""#, &["a|b|c"]),
        (r#""a\|b\|c"|z"#, &["a|b|c", "z"]),
        (r#"y|"a\|b\|c""#, &["y", "a|b|c"]),
        (r#"y|"a\|b\|c"|z"#, &["y", "a|b|c", "z"]),
        (r#""\|b\|c""#, &["|b|c"]),
        (r#""\|b\|c"|z"#, &["|b|c", "z"]),
        (r#"y|"\|b\|c""#, &["y", "|b|c"]),
        (r#"y|"\|b\|c"|z"#, &["y", "|b|c", "z"]),
        (r#""a\|b\|""#, &["a|b|"]),
        (r#""a\|b\|"|z"#, &["a|b|", "z"]),
        (r#"y|"a\|b\|""#, &["y", "a|b|"]),
        (r#"y|"a\|b\|"|z"#, &["y", "a|b|", "z"]),
        (r#"a\|b""#, &["a\\", "b\""]),
        (r#"a\|b"|z"#, &["a\\", "b\"", "z"]),
        (r#"y|a\|b""#, &["y", "a\\", "b\""]),
        (r#"y|a\|b"|z"#, &["y", "a\\", "b\"", "z"]),
        (r#"a\|b\|c""#, &["a\\", "b\\", "c\""]),
        (r#"a\|b\|c"|z"#, &["a\\", "b\\", "c\"", "z"]),
        (r#"y|a\|b\|c""#, &["y", "a\\", "b\\", "c\""]),
        (r#"y|a\|b\|c"|z"#, &["y", "a\\", "b\\", "c\"", "z"]),
        (r#""a\|b"#, &["\"a\\", "b"]),
        (r#""a\|b|z"#, &["\"a\\", "b", "z"]),
        (r#"y|"a\|b"#, &["y", "\"a\\", "b"]),
        (r#"y|"a\|b|z"#, &["y", "\"a\\", "b", "z"]),
        (r#""a\|"#, &["\"a\\", ""]),
        (r#"y|"a\|"#, &["y", "\"a\\", ""]),
        (r#"y|"a\|z"#, &["y", "\"a\\", "z"]),
        (r#"y|"a\|"z"#, &["y", "\"a\\", "\"z"]),
        ("x|y||z", &["x", "y", "", "z"]),
    ];

    #[test]
    fn val_cppagent_every_line_of_the_references_own_tests_is_cut_as_there() {
        for (line, wanted) in REFERENCE {
            assert_eq!(fields(line), wanted, "{line}");
        }
    }

    #[test]
    fn a_quote_that_ends_early_leaves_the_field_as_it_stands() {
        assert_eq!(fields(r#"k|"a" b|c"#), ["k", r#""a" b"#, "c"]);
        assert_eq!(
            fields(r#"k|"O1000 \| op 20"  |c"#),
            ["k", "O1000 | op 20", "c"]
        );
        assert_eq!(fields(r#"k|"open|c"#), ["k", "open", "c"]);
        assert_eq!(fields(r#"k|"C:\\NC""#), ["k", r"C:\NC"]);
    }

    #[test]
    fn a_quote_that_does_not_end_is_found_and_one_that_does_is_not() {
        for (line, open) in [
            (r#"k|"open|c"#, Some(2)),
            (r#"t|k|v|program|"O1000"#, Some(5)),
            (r#"t|program|"O1000 \| op 20|Stemp|30"#, Some(3)),
            (r#""a\""#, Some(1)),
            (r#"t|k|""#, Some(3)),
            (r#"t|k|"a"|m|"b|n|"c"#, Some(5)),
            (r#"t|k|"a \| b"|m|1"#, None),
            (r#"t|k|"""#, None),
            (r#"t|k|5" pipe"#, None),
            (r#"t|k|"a" b|m|1"#, None),
        ] {
            assert_eq!(cut(line).1, open, "{line}");
        }
    }

    /// What an adapter writes in quotes, with quotes, backslashes and bars escaped, comes back.
    fn written(field: &str) -> String {
        let mut text = String::from("\"");
        for letter in field.chars() {
            if "\\|\"".contains(letter) {
                text.push('\\');
            }
            text.push(letter);
        }
        text + "\""
    }

    proptest! {
        #[test]
        fn prop_quoted_fields_come_back(all in proptest::collection::vec("[a-z|\\\\\"ö]{0,8}", 1..6)) {
            let line: Vec<String> = all.iter().map(|field| written(field)).collect();
            prop_assert_eq!(fields(&line.join("|")), all);
        }

        #[test]
        fn prop_no_line_panics_or_grows(line in "[|\\\\\" aö\\t]{0,60}") {
            let found = fields(&line);
            prop_assert!(found.iter().map(String::len).sum::<usize>() <= line.len());
            prop_assert!(found.len() <= line.matches('|').count() + 1);
        }
    }
}
