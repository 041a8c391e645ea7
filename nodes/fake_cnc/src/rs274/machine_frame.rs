//! `(frame: machine)`: a program whose numbers are machine coordinates, whatever state a control is in.
//!
//! It begins with the modes of a control that was just switched on (G17 G21 G40 G49 G61 G80 G90 G91.1 G94)
//! and the first work system that has neither origin nor rotation. A shift by G92 or G52 in effect, and nine
//! systems in use, are refused: they belong to somebody. Nothing in the program may change the
//! coordinates. After the first motion the control compares the numbers of the text with where the axes are
//! ([`FirstMotion`]), and at any end it puts back the state that it found.

use metrology::PerAxis;

use super::block::{Block, Mode, Said, ToolLength};
use super::modal::Reader;
use super::program::FirstMotion;
use super::registers::{Change, Modes, SYSTEMS, is_zero, list, list_system, list_zeros};
use super::words::Word;
use crate::error::{Place, ProgramError};

impl Reader<'_> {
    /// Makes the program's coordinates those of the machine.
    pub(super) fn machine_frame(&mut self, at: Place) -> Result<(), ProgramError> {
        let found = self.registers;
        let axes = self.envelope.axes;
        if !is_zero(&found.shift) {
            let offset = list(&found.shift, axes);
            let zeros = list_zeros(&found.shift, axes);
            return Err(ProgramError::ShiftInEffect { at, offset, zeros });
        }
        let Some(system) = found.first_zero_system() else {
            let listed = |(index, system)| list_system(index, system, axes);
            let systems: Vec<String> = found.systems.iter().enumerate().map(listed).collect();
            return Err(ProgramError::NoZeroSystem {
                at,
                systems: systems.join("; "),
            });
        };
        debug_assert!(system < SYSTEMS.len());
        self.program.restored = Some(Box::new(found));
        self.change(at.line, Change::Modes(Modes::default()))?;
        self.change(at.line, Change::Select(system))?;
        self.change(at.line, Change::Tool(PerAxis::default()))
    }

    /// Refuses a word that would change the coordinates of a program in machine coordinates.
    pub(super) fn keeps_frame(&self, block: &Block, word: &Word) -> Result<(), ProgramError> {
        if self.program.restored.is_none() {
            return Ok(());
        }
        Err(ProgramError::FixedFrame {
            at: block.at(word),
            word: word.text(),
        })
    }

    /// As [`Self::keeps_frame`]; G49 changes nothing there.
    pub(super) fn keeps_length(
        &self,
        block: &Block,
        said: &Said<ToolLength>,
    ) -> Result<(), ProgramError> {
        match said.what {
            ToolLength::None => Ok(()),
            _ => self.keeps_frame(block, &said.word),
        }
    }

    /// Keeps what the text says of the first motion of a program in machine coordinates; called before its step is added.
    pub(super) fn note_first_motion(&mut self, block: &Block, mode: Mode) {
        let is_absolute = !self.registers.modes.is_incremental;
        let is_straight = matches!(mode, Mode::Rapid | Mode::Straight);
        let is_first = self.program.first_motion.is_none() && self.program.restored.is_some();
        if !(is_first && is_absolute && is_straight) || block.first_axis().is_none() {
            return;
        }
        let mm_per_unit = self.mm_per_unit();
        self.program.first_motion = Some(FirstMotion {
            step: self.program.steps.len(),
            words: PerAxis::from_fn(|axis| {
                let word = block.axis(axis)?;
                Some(if axis.is_linear() {
                    word.value * mm_per_unit
                } else {
                    word.value.to_radians()
                })
            }),
        });
    }
}
