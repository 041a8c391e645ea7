//! One block: its words sorted by what they mean, conflicts within it refused.

use metrology::{Axis, AxisSet};

use super::bounds;
use super::program::{Plane, Wait};
use super::registers::PathMode;
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
    /// G80: no motion.
    Cancelled,
}

/// Words of modal group 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NonModal {
    /// G4.
    Dwell,
    /// G10.
    SetSystem,
    /// G52.
    Local,
    /// G53.
    MachineCoordinates,
    /// G92.
    Shift,
    /// G92.1.
    ClearShift,
    /// G92.2.
    SuspendShift,
    /// G92.3.
    RestoreShift,
}

impl NonModal {
    /// Whether the axis words of its block are its own.
    pub const fn takes_axes(self) -> bool {
        matches!(self, Self::SetSystem | Self::Local | Self::Shift)
    }
}

/// Words of modal group 8.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ToolLength {
    /// G43.
    Table,
    /// G43.1.
    Given,
    /// G49.
    None,
}

/// Words of modal group 4.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// M2.
    End,
    /// M0, M1 and M60.
    Wait(Wait),
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
    /// G90.1: true.
    pub absolute_centres: Option<Said<bool>>,
    pub path: Option<Said<PathMode>>,
    pub tool_length: Option<Said<ToolLength>>,
    /// Index of the work system.
    pub system: Option<Said<usize>>,
    /// G40 and G94, which are always in effect.
    cutter: Option<Said<()>>,
    feed_mode: Option<Said<()>>,
    /// M3: true, M5: false.
    pub spindle: Option<Said<bool>>,
    pub stop: Option<Said<Stop>>,
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

    /// The word that takes the axis words of this block for something else than a motion.
    pub fn takes_axes(&self) -> Option<Word> {
        let group = self.non_modal.filter(|said| said.what.takes_axes());
        let tool = self
            .tool_length
            .filter(|said| said.what == ToolLength::Given);
        group
            .map(|said| said.word)
            .or_else(|| tool.map(|said| said.word))
    }

    /// Whether it has G64, with its tolerances.
    pub fn is_blend(&self) -> bool {
        self.path.is_some_and(|said| code(&said.word) == Some(640))
    }

    /// Whether it has G43.
    pub fn is_tool_from_table(&self) -> bool {
        self.tool_length
            .is_some_and(|said| said.what == ToolLength::Table)
    }

    /// Sorts the words of `line` for a machine with `axes`.
    pub fn read(line: &Line<'_>, axes: AxisSet) -> Result<Self, ProgramError> {
        let mut block = Self {
            line: line.number,
            ..Self::default()
        };
        let mut words = line.words.iter();
        let is_dwell = words.any(|word| word.letter == 'G' && code(word) == Some(40));
        for (index, word) in line.words.iter().enumerate() {
            let at = line.place(word);
            bounds::check(at, word, is_dwell)?;
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
        } else if !"FHIJKLPQRS".contains(letter) {
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
        let Some(code) = code(&word) else {
            return Err(unknown(at, &word));
        };
        if let Some(mode) = motion(code) {
            return set(&mut self.mode, at, word, mode);
        }
        if let Some(non_modal) = non_modal(code) {
            return set(&mut self.non_modal, at, word, non_modal);
        }
        if let Some(system) = system(code) {
            return set(&mut self.system, at, word, system);
        }
        match code {
            170 => set(&mut self.plane, at, word, Plane::Xy),
            180 => set(&mut self.plane, at, word, Plane::Zx),
            190 => set(&mut self.plane, at, word, Plane::Yz),
            200 => set(&mut self.inch, at, word, true),
            210 => set(&mut self.inch, at, word, false),
            400 => set(&mut self.cutter, at, word, ()),
            430 => set(&mut self.tool_length, at, word, ToolLength::Table),
            431 => set(&mut self.tool_length, at, word, ToolLength::Given),
            490 => set(&mut self.tool_length, at, word, ToolLength::None),
            610 | 640 => set(&mut self.path, at, word, PathMode::ExactPath),
            611 => set(&mut self.path, at, word, PathMode::ExactStop),
            900 => set(&mut self.incremental, at, word, false),
            910 => set(&mut self.incremental, at, word, true),
            901 => set(&mut self.absolute_centres, at, word, true),
            911 => set(&mut self.absolute_centres, at, word, false),
            940 => set(&mut self.feed_mode, at, word, ()),
            _ => Err(remedy(code).map_or_else(
                || unknown(at, &word),
                |remedy| ProgramError::NotExecuted {
                    at,
                    word: word.text(),
                    remedy,
                },
            )),
        }
    }

    fn miscellaneous(&mut self, at: Place, word: Word) -> Result<(), ProgramError> {
        let wait = |wait| Stop::Wait(wait);
        match code(&word) {
            Some(0) => set(&mut self.stop, at, word, wait(Wait::Stop)),
            Some(10) => set(&mut self.stop, at, word, wait(Wait::OptionalStop)),
            Some(20) => set(&mut self.stop, at, word, Stop::End),
            Some(30) => set(&mut self.spindle, at, word, true),
            Some(50) => set(&mut self.spindle, at, word, false),
            Some(600) => set(&mut self.stop, at, word, wait(Wait::PalletChange)),
            _ => Err(unknown(at, &word)),
        }
    }
}

fn unknown(at: Place, word: &Word) -> ProgramError {
    ProgramError::UnknownWord {
        at,
        word: word.text(),
    }
}

/// Modal group 1.
const fn motion(code: u32) -> Option<Mode> {
    let (until_closed, must_happen) = match code {
        0 => return Some(Mode::Rapid),
        10 => return Some(Mode::Straight),
        20 => return Some(Mode::Arc { clockwise: true }),
        30 => return Some(Mode::Arc { clockwise: false }),
        800 => return Some(Mode::Cancelled),
        382 => (true, true),
        383 => (true, false),
        384 => (false, true),
        385 => (false, false),
        _ => return None,
    };
    Some(Mode::Touch {
        until_closed,
        must_happen,
    })
}

/// Modal group 0.
const fn non_modal(code: u32) -> Option<NonModal> {
    Some(match code {
        40 => NonModal::Dwell,
        100 => NonModal::SetSystem,
        520 => NonModal::Local,
        530 => NonModal::MachineCoordinates,
        920 => NonModal::Shift,
        921 => NonModal::ClearShift,
        922 => NonModal::SuspendShift,
        923 => NonModal::RestoreShift,
        _ => return None,
    })
}

/// Modal group 12: index of the work system.
const fn system(code: u32) -> Option<usize> {
    Some(match code {
        540 => 0,
        550 => 1,
        560 => 2,
        570 => 3,
        580 => 4,
        590 => 5,
        591 => 6,
        592 => 7,
        593 => 8,
        _ => return None,
    })
}

/// What to write instead of a word that other controls execute.
const fn remedy(code: u32) -> Option<&'static str> {
    Some(match code {
        410 | 411 | 420 | 421 => "cutter compensation is always off (G40)",
        432 => "give the whole offset by G43.1",
        930 | 950 => "feeds are per minute (G94)",
        _ => return None,
    })
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
