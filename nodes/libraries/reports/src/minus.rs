//! One minus sign in everything that people read: U+2212, where a number begins.
//!
//! Figures for machines keep their hyphen.

use std::borrow::Cow;

/// The minus sign.
const MINUS: char = '\u{2212}';
/// Elements whose text is copied, or no text at all.
const AS_IT_IS: [&str; 4] = ["style", "script", "code", "pre"];

/// Letters before which a hyphen is part of a word, a date, a path or a norm, such as `230-2`.
fn belongs_to_a_word(before: char) -> bool {
    before.is_alphanumeric() || "-_/\\.%+".contains(before)
}

/// Whether the hyphen between these texts is the sense of an axis, as in `X-` and `-X`.
fn is_sense(before: &str, after: &str) -> bool {
    let is_axis = |c: char| "XYZABC".contains(c);
    let ends = |c: Option<char>| c.is_none_or(|c| !c.is_alphanumeric() && c != '-');
    let (mut left, mut right) = (before.chars().rev(), after.chars());
    let (near, next) = (left.next(), right.next());
    let is_behind = near.is_some_and(is_axis) && ends(left.next()) && ends(next);
    let is_ahead = next.is_some_and(is_axis) && ends(right.next()) && ends(near);
    is_behind || is_ahead
}

/// Whether the hyphen between these texts is the sign of a number or of an axis; one behind an option such as `--sign` is copied.
fn is_sign(before: &str, after: &str) -> bool {
    let mut letters = after.chars();
    let is_number = match letters.next() {
        Some('.') => letters.next().is_some_and(|c| c.is_ascii_digit()),
        first => first.is_some_and(|c| c.is_ascii_digit()),
    };
    let is_of_word = before.chars().next_back().is_some_and(belongs_to_a_word);
    let word = before.split_whitespace().next_back();
    let is_number = is_number && !is_of_word;
    (is_number || is_sense(before, after)) && !word.is_some_and(|word| word.starts_with("--"))
}

/// A text with minus signs.
#[must_use]
pub fn with_minus_signs(text: &str) -> Cow<'_, str> {
    let signs = text.match_indices('-').map(|(at, _)| at);
    let mut signs = signs.filter(|at| is_sign(&text[..*at], &text[at + 1..]));
    let Some(first) = signs.next() else {
        return Cow::Borrowed(text);
    };
    let mut written = String::with_capacity(text.len() + 16);
    let mut from = 0;
    for at in std::iter::once(first).chain(signs) {
        written.push_str(&text[from..at]);
        written.push(MINUS);
        from = at + 1;
    }
    written.push_str(&text[from..]);
    Cow::Owned(written)
}

/// A page with minus signs in its texts, and not in its tags, styles and commands.
#[must_use]
pub fn page_with_minus_signs(page: &str) -> String {
    let mut written = String::with_capacity(page.len() + 256);
    let mut kept: Option<&str> = None;
    for (place, piece) in page.split('<').enumerate() {
        // Behind each '<' stands a tag, and behind its '>' a text.
        let (tag, text) = match (place, piece.split_once('>')) {
            (0, _) => ("", piece),
            (_, Some((tag, text))) => {
                written.push('<');
                written.push_str(tag);
                written.push('>');
                (tag, text)
            }
            (_, None) => {
                written.push('<');
                (piece, piece)
            }
        };
        let name = tag.split([' ', '\n']).next().unwrap_or_default();
        match kept {
            Some(element) if name.strip_prefix('/') == Some(element) => kept = None,
            None => kept = AS_IT_IS.into_iter().find(|element| *element == name),
            Some(_) => {}
        }
        match kept {
            Some(_) => written.push_str(text),
            None => written.push_str(&with_minus_signs(text)),
        }
    }
    written
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_a_minus_sign_and_words_keep_their_hyphen() {
        for (text, wanted) in [
            ("-0.30 µm", "−0.30 µm"),
            ("from -300 to -.5 mm (-2)", "from −300 to −.5 mm (−2)"),
            ("a = -4, b:-1", "a = −4, b:−1"),
            ("± 3; −2", "± 3; −2"),
            ("ISO 230-2 and 2026-01-05", "ISO 230-2 and 2026-01-05"),
            (
                "runs/x-1 X-2 1e-5 well-known",
                "runs/x-1 X-2 1e-5 well-known",
            ),
            ("give --sign -1", "give --sign -1"),
            ("- item -x", "- item -x"),
            ("backlash X- 3.99", "backlash X− 3.99"),
            ("corner -X +Y, -Y", "corner −X +Y, −Y"),
            ("X-Y, X-ray, -Xx, 3-A", "X-Y, X-ray, -Xx, 3-A"),
        ] {
            assert_eq!(with_minus_signs(text), wanted);
        }
    }

    #[test]
    fn tags_styles_and_commands_of_a_page_stay_as_they_are() {
        let page = "<style>a { top: -3px; }</style><svg><path d=\"M -1 -2\"/><text x=\"-4\">-5</text></svg><code>-6</code><p>-7 <code>-8</code> -9</p>";
        assert_eq!(
            page_with_minus_signs(page),
            "<style>a { top: -3px; }</style><svg><path d=\"M -1 -2\"/><text x=\"-4\">−5</text></svg><code>-6</code><p>−7 <code>-8</code> −9</p>"
        );
        assert_eq!(page_with_minus_signs("a -1 < b"), "a −1 < b");
    }
}
