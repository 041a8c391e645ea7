//! One block: its words sorted by what they mean, conflicts within it refused.

use metrology::{Axis, AxisSet};

use super::program::Plane;
use super::words::{Line, Word};
use crate::error::{Place, ProgramError};

/// Motion words of modal group 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// G0.
    Rapid,
    /// G1.
    Straight,
    /// G2 (clockwise) and G3.
    Arc { clockwise: bool },
    /// G38.2 to G38.5.
    Touch {
        until_closed: bool,
        must_happen: bool,
    },
}

/// Words of modal group 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NonModal {
    /// G4.
    Dwell,
    /// G53.
    MachineCoordinates,
}

/// Something together with the word that said it.
#[derive(Clone, Copy, Debug)]
pub struct Said<T> {
    /// What.
    pub what: T,
    /// By which word.
    pub word: Word,
}

/// A block's words by meaning.
#[derive(Debug, Default)]
pub struct Block {
    pub line: u32,
    pub mode: Option<Said<Mode>>,
    pub non_modal: Option<Said<NonModal>>,
    pub plane: Option<Said<Plane>>,
    /// G20: true.
    pub inch: Option<Said<bool>>,
    /// G91: true.
    pub incremental: Option<Said<bool>>,
    /// M3: true, M5: false.
    pub spindle: Option<Said<bool>>,
    pub end: Option<Said<()>>,
    letters: [Option<Word>; 26],
}

impl Block {
    /// Place of `word`.
    pub fn at(&self, word: &Word) -> Place {
        Place {
            line: self.line,
            column: word.column,
        }
    }

    /// The word of `letter`.
    pub fn word(&self, letter: char) -> Option<&Word> {
        self.letters[slot(letter)].as_ref()
    }

    /// The word of `axis`.
    pub fn axis(&self, axis: Axis) -> Option<&Word> {
        self.letters[slot(axis_letter(axis))].as_ref()
    }

    /// The first axis word.
    pub fn first_axis(&self) -> Option<&Word> {
        Axis::ALL.into_iter().find_map(|axis| self.axis(axis))
    }

    /// Sorts the words of `line` for a machine with `axes`.
    pub fn read(line: &Line<'_>, axes: AxisSet) -> Result<Self, ProgramError> {
        let mut block = Self {
            line: line.number,
            ..Self::default()
        };
        for (index, word) in line.words.iter().enumerate() {
            let at = line.place(word);
            match word.letter {
                'G' => block.general(at, *word)?,
                'M' => block.miscellaneous(at, *word)?,
                'N' => line_number(at, index, word)?,
                letter => block.letter(at, letter, *word, axes)?,
            }
        }
        Ok(block)
    }

    fn letter(
        &mut self,
        at: Place,
        letter: char,
        word: Word,
        axes: AxisSet,
    ) -> Result<(), ProgramError> {
        if let Some(axis) = Axis::ALL.into_iter().find(|a| axis_letter(*a) == letter) {
            if !axes.contains(axis) {
                return Err(ProgramError::NoSuchAxis { at, axis });
            }
        } else if !"FIJKPRS".contains(letter) {
            return Err(ProgramError::UnknownWord {
                at,
                word: word.text(),
            });
        }
        if self.letters[slot(letter)].is_some() {
            return Err(ProgramError::DuplicateWord {
                at,
                word: word.text(),
            });
        }
        self.letters[slot(letter)] = Some(word);
        Ok(())
    }

    fn general(&mut self, at: Place, word: Word) -> Result<(), ProgramError> {
        let touch = |until_closed, must_happen| Mode::Touch {
            until_closed,
            must_happen,
        };
        let mode = match code(&word) {
            Some(0) => Mode::Rapid,
            Some(10) => Mode::Straight,
            Some(20) => Mode::Arc { clockwise: true },
            Some(30) => Mode::Arc { clockwise: false },
            Some(382) => touch(true, true),
            Some(383) => touch(true, false),
            Some(384) => touch(false, true),
            Some(385) => touch(false, false),
            Some(40) => return set(&mut self.non_modal, at, word, NonModal::Dwell),
            Some(530) => {
                return set(&mut self.non_modal, at, word, NonModal::MachineCoordinates);
            }
            Some(170) => return set(&mut self.plane, at, word, Plane::Xy),
            Some(180) => return set(&mut self.plane, at, word, Plane::Zx),
            Some(190) => return set(&mut self.plane, at, word, Plane::Yz),
            Some(200) => return set(&mut self.inch, at, word, true),
            Some(210) => return set(&mut self.inch, at, word, false),
            Some(900) => return set(&mut self.incremental, at, word, false),
            Some(910) => return set(&mut self.incremental, at, word, true),
            _ => {
                return Err(ProgramError::UnknownWord {
                    at,
                    word: word.text(),
                });
            }
        };
        set(&mut self.mode, at, word, mode)
    }

    fn miscellaneous(&mut self, at: Place, word: Word) -> Result<(), ProgramError> {
        match code(&word) {
            Some(20) => set(&mut self.end, at, word, ()),
            Some(30) => set(&mut self.spindle, at, word, true),
            Some(50) => set(&mut self.spindle, at, word, false),
            _ => Err(ProgramError::UnknownWord {
                at,
                word: word.text(),
            }),
        }
    }
}

fn slot(letter: char) -> usize {
    usize::from(letter as u8 - b'A')
}

fn axis_letter(axis: Axis) -> char {
    char::from(axis.letter().as_bytes()[0])
}

/// Ten times a G or M number, where that is a whole number of a known size.
fn code(word: &Word) -> Option<u32> {
    let tenths = (word.value * 10.0).round();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "checked to lie in 0..=2000"
    )]
    ((0.0..=2000.0).contains(&tenths)
        && (word.value * 10.0 - tenths).abs() < 1e-6
        && word.value >= 0.0)
        .then_some(tenths as u32)
}

fn set<T>(place: &mut Option<Said<T>>, at: Place, word: Word, what: T) -> Result<(), ProgramError> {
    if let Some(before) = place {
        return Err(ProgramError::Conflict {
            at,
            word: word.text(),
            other: before.word.text(),
        });
    }
    *place = Some(Said { what, word });
    Ok(())
}

fn line_number(at: Place, index: usize, word: &Word) -> Result<(), ProgramError> {
    if index > 0 {
        return Err(ProgramError::Needs {
            at,
            word: word.text(),
            needs: "to be the first word of its block",
        });
    }
    if word.value < 0.0 {
        return Err(ProgramError::Value {
            at,
            word: 'N',
            value: word.value,
            rule: "0 or above",
        });
    }
    Ok(())
}
