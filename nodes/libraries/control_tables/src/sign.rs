//! Which way a positive value of a control's table moves the axis, and how that is known.
//!
//! ```text
//!   error e = actual - commanded, to be undone by a motion -e                (1)
//!   a positive value moves towards greater positions:  value = -e            (2)
//!   a positive value moves towards smaller positions:  value = +e            (3)
//! ```
//!
//! A wrong sign doubles every error. It counts as known where the control's manual says in words which way the axis
//! moves, or where the table was tried on the control. Everything else is a guess, however near it lies, and no table is written on a
//! guess: whoever loads it finds the sign by one step at the machine and gives it.

use std::fmt;

/// Direction in which a positive value moves the axis while its display stays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sign {
    /// Towards greater positions.
    Plus,
    /// Towards smaller positions.
    Minus,
}

impl Sign {
    /// The value that undoes `error` (actual minus commanded, any unit): equations (2) and (3).
    #[must_use]
    pub fn value_of(self, error: f64) -> f64 {
        match self {
            Self::Plus => -error,
            Self::Minus => error,
        }
    }
}

impl fmt::Display for Sign {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Plus => "plus",
            Self::Minus => "minus",
        })
    }
}

/// Note on a sign that a manual says in words.
pub(super) fn proven(by: &str) -> String {
    format!("sign proven by: {by}")
}

/// Note on a sign that was seen on the control itself.
pub(super) fn tried(by: &str) -> String {
    format!("sign tried on the control: {by}")
}

/// Note on a sign that no page seen says and that the user gave.
pub(super) fn given(sign: Sign) -> String {
    let towards = match sign {
        Sign::Plus => "greater",
        Sign::Minus => "smaller",
    };
    format!(
        "sign UNPROVEN by any manual seen, given by --sign {sign}: a positive value is taken to move the axis towards {towards} positions"
    )
}

/// Note on how to try a sign.
pub(super) fn check(step: &str) -> String {
    format!("check at the machine before use: {step}")
}
