//! Programs that are not begun.

use machine::program_frame::FRAME_RULE;
use machine::program_machine::OtherMachine;
use metrology::Author;
use metrology::bound::NAME_BYTES;

use super::{Ending, Outcome};
use crate::condition::Condition;
use crate::program::ShiftingWord;

/// Why a program is not begun.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// One runs already.
    #[error("another program is running")]
    Busy,
    /// The bridge is not active.
    #[error("the bridge is not active")]
    Inactive,
    /// There is no connection.
    #[error("not connected to the controller")]
    NotConnected,
    /// The emergency stop is on, or its state is not known.
    #[error("emergency stop is on")]
    EmergencyStop,
    /// The drives are off.
    #[error("drives are off")]
    DrivesOff,
    /// Not every axis is homed.
    #[error("not homed")]
    NotHomed,
    /// Positions do not come, touches would be lost.
    #[error("no positions come from the sampler")]
    NoPositions,
    /// The interpreter runs something that was not started here.
    #[error("the controller is running something else")]
    ControllerBusy,
    /// There is nothing in it.
    #[error("the program is empty")]
    Empty,
    /// It touches while two publish offsets.
    #[error("{}", contested(*.0, *.1))]
    TwoPublishers(Author, Author),
    /// The name of a feature has more bytes than a message of its touches may have.
    #[error("line {0}: the feature's name has {1} bytes, at most {NAME_BYTES}: shorten it")]
    LongName(u32, usize),
    /// Its approaches are those of another machine file.
    #[error(transparent)]
    OtherMachine(#[from] OtherMachine),
    /// Its comment of the frame would not count.
    #[error("line {0}: a comment of the frame must be (frame: machine) and stand {FRAME_RULE}")]
    FrameComment(u32),
    /// Its coordinates are the machine's, and it would shift them.
    #[error(
        "line {line}: {word} shifts coordinates, and those of a program with (frame: machine) are the machine's: take one of both out"
    )]
    ShiftsFrame {
        /// Line of the word.
        line: u32,
        /// The word.
        word: ShiftingWord,
    },
}

fn contested(one: Author, other: Author) -> Condition {
    Condition::CompensationContested { one, other }
}

impl Refusal {
    /// The ending of a program that is not begun.
    #[must_use]
    pub fn ending(self) -> Ending {
        Ending {
            outcome: Outcome::Refused,
            message: self.to_string(),
            line: 0,
        }
    }
}
