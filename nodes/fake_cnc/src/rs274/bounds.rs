//! Bounds of everything that a program can ask for by a number, checked before anything is made of it.

use super::words::Word;
use crate::error::{Place, ProgramError};

/// Lines that a program may have.
pub const LINES: u32 = 1_000_000;
/// Characters that a line may have.
pub const LINE_CHARACTERS: usize = 1000;
/// Steps, features and devices that a program may have.
pub const STEPS: usize = 1_000_000;
/// Greatest number that any word may have.
pub const NUMBER: f64 = 1e12;
/// Longest dwell, s.
pub const DWELL_S: f64 = 86_400.0;
/// Turns of one arc.
pub const TURNS: f64 = 10_000.0;

/// What the number of a word may be, in its own unit; G and M are checked by their lists.
const fn range(letter: char) -> (f64, f64, &'static str) {
    match letter {
        'N' => (0.0, 999_999_999.0, "from 0 to 999999999"),
        'F' => (0.0, 1e6, "from 0 to 1000000"),
        // The machine file has the limit.
        'S' => (0.0, NUMBER, "0 or above"),
        'P' | 'Q' => (0.0, 1e6, "from 0 to 1000000"),
        'H' | 'L' => (0.0, 1e6, "a whole number from 0 to 1000000"),
        _ => (-1e6, 1e6, "from -1000000 to 1000000"),
    }
}

/// What P of a dwell may be, s.
const DWELL: (f64, f64, &str) = (0.0, DWELL_S, "from 0 to 86400 s, a day, of a dwell");

/// Refuses a number outside the range of its letter; `is_dwell`: in a block with G4.
pub fn check(at: Place, word: &Word, is_dwell: bool) -> Result<(), ProgramError> {
    if matches!(word.letter, 'G' | 'M') {
        return Ok(());
    }
    let (least, greatest, rule) = match word.letter {
        'P' if is_dwell => DWELL,
        letter => range(letter),
    };
    let is_whole = !matches!(word.letter, 'H' | 'L') || word.value.fract() == 0.0;
    if (least..=greatest).contains(&word.value) && is_whole {
        return Ok(());
    }
    Err(ProgramError::Value {
        at,
        word: word.letter,
        value: word.value,
        rule,
    })
}

/// The whole number from 0 to `greatest` that `value` is, if it is one.
pub fn whole(value: f64, greatest: usize) -> Option<usize> {
    let is_whole = value.fract() == 0.0;
    (0..=greatest).find(|number| is_whole && (value - *number as f64).abs() < 0.5)
}

/// Refuses one more of something of which a program may have [`STEPS`].
pub fn check_count(line: u32, what: &'static str, count: usize) -> Result<(), ProgramError> {
    if count < STEPS {
        return Ok(());
    }
    Err(ProgramError::TooMany {
        line,
        what,
        limit: STEPS,
    })
}
