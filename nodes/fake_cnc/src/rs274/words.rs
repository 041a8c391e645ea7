//! Words and comments of one line.
//!
//! A word is a letter and a number; blanks may stand anywhere, also within the number; letters are
//! of either case (RS274/NGC 3.3.2).

use super::bounds;
use crate::error::{Place, ProgramError};

/// A letter with its number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Word {
    /// Capital letter.
    pub letter: char,
    /// Number as written.
    pub value: f64,
    /// Column of the letter, from 1.
    pub column: u32,
}

impl Word {
    /// The word as a person would write it.
    #[must_use]
    pub fn text(&self) -> String {
        format!("{}{}", self.letter, self.value)
    }
}

/// Text in parentheses or after a semicolon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Comment<'a> {
    /// What stands inside, trimmed.
    pub text: &'a str,
    /// Column where it opens, from 1.
    pub column: u32,
    /// After a semicolon, up to the end of the line.
    pub is_tail: bool,
}

/// One line of a program.
#[derive(Clone, Debug, PartialEq)]
pub struct Line<'a> {
    /// From 1.
    pub number: u32,
    /// Words in their order.
    pub words: Vec<Word>,
    /// Comments in their order.
    pub comments: Vec<Comment<'a>>,
}

impl Line<'_> {
    /// Place of `word` in the program.
    #[must_use]
    pub fn place(&self, word: &Word) -> Place {
        Place {
            line: self.number,
            column: word.column,
        }
    }
}

struct Cursor<'a> {
    text: &'a str,
    byte: usize,
    at: Place,
}

impl Cursor<'_> {
    fn peek(&self) -> Option<char> {
        self.text[self.byte..].chars().next()
    }

    fn advance(&mut self, character: char) {
        self.byte += character.len_utf8();
        self.at.column += 1;
    }

    fn skip_blanks(&mut self) {
        while let Some(blank) = self.peek().filter(|c| matches!(c, ' ' | '\t' | '\r')) {
            self.advance(blank);
        }
    }
}

/// Splits one line, without its newline, into words and comments.
///
/// # Errors
/// A line beyond [`bounds::LINE_CHARACTERS`], a character outside the grammar, a malformed number or one beyond
/// [`bounds::NUMBER`], an open or nested comment.
pub fn read_line(number: u32, text: &str) -> Result<Line<'_>, ProgramError> {
    let mut line = Line {
        number,
        words: Vec::new(),
        comments: Vec::new(),
    };
    let start = Place {
        line: number,
        column: 1,
    };
    if text.len() > bounds::LINE_CHARACTERS && text.chars().count() > bounds::LINE_CHARACTERS {
        return Err(ProgramError::LineTooLong {
            line: number,
            limit: bounds::LINE_CHARACTERS,
        });
    }
    let mut cursor = Cursor {
        text,
        byte: 0,
        at: start,
    };
    loop {
        cursor.skip_blanks();
        let at = cursor.at;
        let Some(character) = cursor.peek() else {
            return Ok(line);
        };
        cursor.advance(character);
        match character {
            ';' => {
                line.comments.push(Comment {
                    text: text[cursor.byte..].trim(),
                    column: at.column,
                    is_tail: true,
                });
                return Ok(line);
            }
            '(' => line.comments.push(Comment {
                text: comment(&mut cursor, text, at)?,
                column: at.column,
                is_tail: false,
            }),
            letter if letter.is_ascii_alphabetic() => {
                let letter = letter.to_ascii_uppercase();
                line.words.push(Word {
                    letter,
                    value: value(&mut cursor, letter)?,
                    column: at.column,
                });
            }
            character => return Err(ProgramError::Character { at, character }),
        }
    }
}

fn comment<'a>(
    cursor: &mut Cursor<'_>,
    text: &'a str,
    opened: Place,
) -> Result<&'a str, ProgramError> {
    let begin = cursor.byte;
    while let Some(character) = cursor.peek() {
        let at = cursor.at;
        cursor.advance(character);
        match character {
            ')' => return Ok(text[begin..cursor.byte - 1].trim()),
            '(' => return Err(ProgramError::CommentNested { at }),
            _ => {}
        }
    }
    Err(ProgramError::CommentOpen { at: opened })
}

fn value(cursor: &mut Cursor<'_>, letter: char) -> Result<f64, ProgramError> {
    cursor.skip_blanks();
    let at = cursor.at;
    let mut number = String::new();
    loop {
        cursor.skip_blanks();
        match cursor.peek() {
            Some(c) if c.is_ascii_digit() || c == '.' || matches!(c, '+' | '-') => {
                number.push(c);
                cursor.advance(c);
            }
            _ => break,
        }
    }
    if number.is_empty() {
        return Err(ProgramError::NumberMissing { at, letter });
    }
    match number.parse::<f64>() {
        Ok(value) if value.abs() <= bounds::NUMBER => Ok(value),
        Ok(_) => Err(ProgramError::NumberTooLarge {
            at,
            letter,
            text: shortened(&number),
            limit: bounds::NUMBER,
        }),
        Err(_) => Err(ProgramError::NumberMalformed {
            at,
            letter,
            text: shortened(&number),
        }),
    }
}

/// The first characters of a number that fills a line.
fn shortened(number: &str) -> String {
    const KEPT: usize = 20;
    match number.char_indices().nth(KEPT) {
        Some((end, _)) => format!("{}...", &number[..end]),
        None => number.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blanks_may_stand_within_numbers_and_case_does_not_matter() {
        let line = read_line(1, "g0x +0. 12 34 y 7").unwrap();
        let words: Vec<_> = line.words.iter().map(|w| (w.letter, w.value)).collect();
        assert_eq!(words, [('G', 0.0), ('X', 0.1234), ('Y', 7.0)]);
    }

    #[test]
    fn columns_count_characters_not_bytes() {
        let line = read_line(3, "(µm) X1").unwrap();
        assert_eq!(line.words[0].column, 6);
        assert_eq!(line.comments[0].text, "µm");
    }

    #[test]
    fn malformed_text_is_refused_with_its_place() {
        fn message(text: &str) -> String {
            read_line(7, text).unwrap_err().to_string()
        }
        assert_eq!(message("G0 X"), "line 7, column 5: word X has no number");
        assert_eq!(
            message("G0 X1.2.3"),
            "line 7, column 5: number of word X is malformed: \"1.2.3\""
        );
        assert_eq!(
            message("G0 (a (b) c)"),
            "line 7, column 7: comment within a comment"
        );
        assert_eq!(
            message("G0 X1 (a"),
            "line 7, column 7: comment is not closed on its line"
        );
        assert_eq!(
            message("G0 X[1+2]"),
            "line 7, column 5: word X has no number"
        );
        assert_eq!(
            message("G0 ≥1"),
            "line 7, column 4: character '≥' has no meaning here"
        );
        assert!(message("X--1").contains("malformed"));
        let nines = "9".repeat(400);
        assert_eq!(
            message(&format!("X{nines}")),
            "line 7, column 2: number of word X is no finite number that this control can hold: \
             \"99999999999999999999...\", limit 1000000000000"
        );
        let zeros = "0".repeat(300);
        assert!(message(&format!("S1{zeros}")).contains("no finite number that"));
        assert_eq!(
            message(&"X".repeat(1001)),
            "line 7: longer than 1000 characters"
        );
    }
}
