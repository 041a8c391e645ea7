//! The kinematic chain from workpiece to tool, written as in ISO 10791-6.
//!
//! `[w C' A' Y' b X Z t]` reads: the workpiece sits on C, C on A, A on Y, Y on the bed; the tool sits
//! on Z, Z on X, X on the bed. Axes that move the workpiece carry a prime. A spindle in parentheses
//! may stand directly before `t`, e.g. `(C1)`; it moves nothing.
//!
//! # References
//! \[1\] ISO 10791-6:2014, structural codes of machining centres.

use std::fmt;
use std::str::FromStr;

use metrology::{Axis, AxisSet};

/// Order of the axes from workpiece to tool.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Chain {
    workpiece_side: Vec<Axis>,
    tool_side: Vec<Axis>,
}

/// A chain string that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("column {column}, \"{token}\": {rule}")]
pub struct ChainError {
    /// Column of the token in the string, from 1.
    pub column: usize,
    /// The token; empty at the end of the string.
    pub token: String,
    /// What holds there.
    pub rule: &'static str,
}

impl Chain {
    /// Axes that move the workpiece, from the workpiece to the bed.
    #[must_use]
    pub fn workpiece_side(&self) -> &[Axis] {
        &self.workpiece_side
    }

    /// Axes that move the tool, from the bed to the tool.
    #[must_use]
    pub fn tool_side(&self) -> &[Axis] {
        &self.tool_side
    }

    /// All axes.
    #[must_use]
    pub fn axes(&self) -> AxisSet {
        self.workpiece_side
            .iter()
            .chain(&self.tool_side)
            .copied()
            .collect()
    }
}

impl fmt::Display for Chain {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("[w")?;
        for axis in &self.workpiece_side {
            write!(f, " {axis}'")?;
        }
        f.write_str(" b")?;
        for axis in &self.tool_side {
            write!(f, " {axis}")?;
        }
        f.write_str(" t]")
    }
}

impl FromStr for Chain {
    type Err = ChainError;

    fn from_str(text: &str) -> Result<Self, ChainError> {
        let tokens = tokens(text)?;
        let mut reader = Reader {
            chain: Self {
                workpiece_side: Vec::new(),
                tool_side: Vec::new(),
            },
            place: Place::BeforeWorkpiece,
        };
        for token in &tokens {
            reader.read(token.text).map_err(|rule| token.error(rule))?;
        }
        if reader.place != Place::AfterTool {
            return Err(ChainError {
                column: text.chars().count(),
                token: String::from("]"),
                rule: "the chain must end with t",
            });
        }
        Ok(reader.chain)
    }
}

struct Token<'a> {
    text: &'a str,
    column: usize,
}

impl Token<'_> {
    fn error(&self, rule: &'static str) -> ChainError {
        ChainError {
            column: self.column,
            token: self.text.to_owned(),
            rule,
        }
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Place {
    BeforeWorkpiece,
    WorkpieceSide,
    ToolSide,
    AfterSpindle,
    AfterTool,
}

struct Reader {
    chain: Chain,
    place: Place,
}

impl Reader {
    fn read(&mut self, token: &str) -> Result<(), &'static str> {
        self.place = match (self.place, token) {
            (Place::BeforeWorkpiece, "w") => Place::WorkpieceSide,
            (Place::BeforeWorkpiece, _) => return Err("the chain must begin with w"),
            (Place::WorkpieceSide, "b") => Place::ToolSide,
            (Place::WorkpieceSide, "t") => return Err("the bed b must stand between w and t"),
            (Place::ToolSide | Place::AfterSpindle, "t") => Place::AfterTool,
            (Place::AfterSpindle, _) => return Err("only t may follow the spindle"),
            (Place::AfterTool, _) => return Err("nothing may follow t"),
            (Place::ToolSide, spindle) if spindle.starts_with('(') && spindle.ends_with(')') => {
                Place::AfterSpindle
            }
            (place, axis) => {
                self.push(place, axis)?;
                place
            }
        };
        Ok(())
    }

    fn push(&mut self, place: Place, token: &str) -> Result<(), &'static str> {
        let (letter, primed) = token
            .strip_suffix('\'')
            .map_or((token, false), |letter| (letter, true));
        let axis: Axis = letter
            .parse()
            .map_err(|_| "must be w, b, t or one of X Y Z A B C, primed between w and b")?;
        if self.chain.axes().contains(axis) {
            return Err("this axis stands in the chain already");
        }
        match (place, primed) {
            (Place::WorkpieceSide, true) => self.chain.workpiece_side.push(axis),
            (Place::WorkpieceSide, false) => {
                return Err("an axis between w and b moves the workpiece and needs a prime");
            }
            (_, false) => self.chain.tool_side.push(axis),
            (_, true) => return Err("an axis between b and t moves the tool and takes no prime"),
        }
        Ok(())
    }
}

fn tokens(text: &str) -> Result<Vec<Token<'_>>, ChainError> {
    let whole = |rule| ChainError {
        column: 1,
        token: text.to_owned(),
        rule,
    };
    let inner = text
        .strip_prefix('[')
        .and_then(|rest| rest.strip_suffix(']'))
        .ok_or_else(|| whole("must stand in square brackets"))?;
    let tokens: Vec<_> = inner
        .split_whitespace()
        .map(|token| {
            // A token is a part of `text`, so its offset is the difference of the addresses.
            let offset = token.as_ptr() as usize - text.as_ptr() as usize;
            Token {
                text: token,
                column: text[..offset].chars().count() + 1,
            }
        })
        .collect();
    if tokens.is_empty() {
        return Err(whole("the chain is empty"));
    }
    Ok(tokens)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_table_chain_is_read_in_order() {
        let chain: Chain = "[w C' A' Y' b X Z t]".parse().unwrap();
        assert_eq!(chain.workpiece_side(), [Axis::C, Axis::A, Axis::Y]);
        assert_eq!(chain.tool_side(), [Axis::X, Axis::Z]);
        assert_eq!(chain.axes().len(), 5);
    }

    #[test]
    fn chains_of_every_order_round_trip() {
        for text in [
            "[w X' Y' b Z t]",
            "[w Y' X' b Z t]",
            "[w b X Y Z t]",
            "[w b X Y Z C A t]",
            "[w C' B' X' b Y Z t]",
            "[w X' b Y Z C B t]",
        ] {
            assert_eq!(text.parse::<Chain>().unwrap().to_string(), text);
        }
        let spindle: Chain = "[w X' Y' b Z (C1) t]".parse().unwrap();
        assert_eq!(spindle.to_string(), "[w X' Y' b Z t]");
    }

    #[test]
    fn errors_name_column_and_token() {
        let message = |text: &str| text.parse::<Chain>().unwrap_err().to_string();
        assert_eq!(
            message("[w C' A Y' b X Z t]"),
            "column 7, \"A\": an axis between w and b moves the workpiece and needs a prime"
        );
        assert_eq!(
            message("[w Y' b X' Z t]"),
            "column 9, \"X'\": an axis between b and t moves the tool and takes no prime"
        );
        assert_eq!(
            message("[w Y' b X X t]"),
            "column 11, \"X\": this axis stands in the chain already"
        );
        assert_eq!(
            message("[w Y' b X Q t]"),
            "column 11, \"Q\": must be w, b, t or one of X Y Z A B C, primed between w and b"
        );
        assert_eq!(
            message("[w Y' b X Z]"),
            "column 12, \"]\": the chain must end with t"
        );
        assert!(message("w X' b Z t").contains("square brackets"));
        assert!(message("[]").contains("empty"));
        assert!(message("[X' b Z t]").contains("must begin with w"));
        assert!(message("[w X' t]").contains("bed b"));
        assert!(message("[w b X t Z]").contains("nothing may follow t"));
        assert!(message("[w b X (C1) Z t]").contains("only t may follow"));
    }
}
