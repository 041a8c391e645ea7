//! Text from outside as a terminal, a log or a page may show it: every character that is not seen is written out.
//!
//! Alarm texts, names of files, topics and frames, and comments of programs come from outside. A terminal obeys the
//! control characters in them (ESC and C1 move the cursor, clear lines, set the title), and marks of direction show text in
//! an order in which it does not stand. In their place stands `\u001b` and the like, which JSON and YAML read as the same
//! character.

use std::borrow::Cow;
use std::fmt::Write as _;

/// Whether a character changes how the text around it is shown: control characters but line feed and tab, ends of lines and
/// paragraphs, marks of direction.
#[must_use]
pub fn is_unseen(letter: char) -> bool {
    match letter {
        '\n' | '\t' => false,
        '\u{61C}' | '\u{200E}' | '\u{200F}' | '\u{2028}'..='\u{202E}' | '\u{2066}'..='\u{2069}' => {
            true
        }
        letter => letter.is_control(),
    }
}

/// The text with every unseen character written out.
#[must_use]
pub fn visible(text: &str) -> Cow<'_, str> {
    if !text.contains(is_unseen) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 8);
    for letter in text.chars() {
        if is_unseen(letter) {
            // Writing to a string does not fail.
            let _ = write!(shown, "\\u{:04x}", u32::from(letter));
        } else {
            shown.push(letter);
        }
    }
    Cow::Owned(shown)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn what_a_terminal_obeys_is_written_out() {
        for (text, shown) in [
            (
                "spindle hot, 43 °C\n\tcheck\n",
                "spindle hot, 43 °C\n\tcheck\n",
            ),
            ("\u{1b}[2Jgone", "\\u001b[2Jgone"),
            ("\u{9b}31mred\u{7f}\u{7}", "\\u009b31mred\\u007f\\u0007"),
            ("part\rtrap", "part\\u000dtrap"),
            (
                "a\u{202e}b\u{2066}c\u{200f}d\u{2028}e",
                "a\\u202eb\\u2066c\\u200fd\\u2028e",
            ),
        ] {
            assert_eq!(visible(text), shown);
        }
    }

    proptest! {
        /// Nothing unseen is left, and as the inside of a string of JSON it is the same text.
        #[test]
        fn prop_nothing_unseen_is_left_and_a_second_time_changes_nothing(text in any::<String>()) {
            let once = visible(&text).into_owned();
            prop_assert!(!once.contains(is_unseen));
            prop_assert_eq!(visible(&once), once.as_str());
        }
    }
}
