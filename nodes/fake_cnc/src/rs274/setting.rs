//! Words that set coordinates: work systems, G92 and G52, tool length.

use metrology::{Axis, PerAxis};

use super::block::{Block, NonModal, Said, ToolLength};
use super::bounds;
use super::modal::Reader;
use super::registers::{Change, SYSTEMS};
use super::words::Word;
use crate::error::ProgramError;

impl Reader<'_> {
    /// Tool length, work system, then G10, G52 and the G92 family.
    pub(super) fn settings(&mut self, block: &Block) -> Result<(), ProgramError> {
        if let Some(said) = block.tool_length {
            self.keeps_length(block, &said)?;
            let to = self.tool(block, &said)?;
            self.change(block.line, Change::Tool(to))?;
        }
        if let Some(said) = block.system {
            self.keeps_frame(block, &said.word)?;
            self.change(block.line, Change::Select(said.what))?;
        }
        let Some(said) = block.non_modal else {
            return Ok(());
        };
        let change = match said.what {
            NonModal::Dwell | NonModal::MachineCoordinates => return Ok(()),
            NonModal::SetSystem => self.system(block, &said.word)?,
            NonModal::Local => self.local(block, &said.word)?,
            NonModal::Shift => self.shift(block, &said.word)?,
            NonModal::ClearShift => Change::Shift {
                to: PerAxis::default(),
                stored: PerAxis::default(),
            },
            NonModal::SuspendShift => Change::Shift {
                to: PerAxis::default(),
                stored: self.registers.stored_shift,
            },
            NonModal::RestoreShift => Change::Shift {
                to: self.registers.stored_shift,
                stored: self.registers.stored_shift,
            },
        };
        self.keeps_frame(block, &said.word)?;
        self.change(block.line, change)
    }

    /// The number of `axis` in this block, mm or rad.
    pub(super) fn axis_value(&self, block: &Block, axis: Axis) -> Option<f64> {
        let word = block.axis(axis)?;
        Some(if axis.is_linear() {
            word.value * self.mm_per_unit()
        } else {
            word.value.to_radians()
        })
    }

    fn tool(&self, block: &Block, said: &Said<ToolLength>) -> Result<PerAxis<f64>, ProgramError> {
        match said.what {
            ToolLength::None => Ok(PerAxis::default()),
            ToolLength::Given => Ok(PerAxis::from_fn(|axis| {
                self.axis_value(block, axis)
                    .unwrap_or(self.registers.tool[axis])
            })),
            ToolLength::Table => {
                let Some(word) = block.word('H') else {
                    return Err(ProgramError::Needs {
                        at: block.at(&said.word),
                        word: said.word.text(),
                        needs: "H, the number of a tool; this control has no tool changer",
                    });
                };
                let mut tool = PerAxis::default();
                tool[Axis::Z] = self.tool_length_mm(block, word)?;
                Ok(tool)
            }
        }
    }

    fn tool_length_mm(&self, block: &Block, word: &Word) -> Result<f64, ProgramError> {
        let lengths_mm = &self.envelope.tool_lengths_mm;
        match bounds::whole(word.value, lengths_mm.len()) {
            Some(0) => Ok(0.0),
            Some(number) => Ok(lengths_mm[number - 1]),
            None => Err(ProgramError::NoSuchTool {
                at: block.at(word),
                number: word.value,
                greatest: lengths_mm.len(),
            }),
        }
    }

    fn system(&self, block: &Block, word: &Word) -> Result<Change, ProgramError> {
        let needs = |needs| ProgramError::Needs {
            at: block.at(word),
            word: word.text(),
            needs,
        };
        let table = block.word('L').ok_or_else(|| needs("L2"))?;
        if bounds::whole(table.value, 2) != Some(2) {
            return Err(ProgramError::NotExecuted {
                at: block.at(table),
                word: format!("{} {}", word.text(), table.text()),
                remedy: "set work systems by G10 L2, tool lengths by the parameter tool_lengths_mm",
            });
        }
        let number = block
            .word('P')
            .ok_or_else(|| needs("P, the number of a work system"))?;
        let chosen = bounds::whole(number.value, SYSTEMS.len());
        let index = match chosen {
            Some(0) => self.registers.system,
            Some(number) => number - 1,
            None => {
                return Err(ProgramError::Value {
                    at: block.at(number),
                    word: 'P',
                    value: number.value,
                    rule: "a whole number from 0 to 9, the number of a work system",
                });
            }
        };
        let mut to = self.registers.systems[index];
        for axis in Axis::ALL {
            to.origin[axis] = self.axis_value(block, axis).unwrap_or(to.origin[axis]);
        }
        if let Some(rotation) = block.word('R') {
            to.rotation_deg = rotation.value;
        }
        Ok(Change::System { index, to })
    }

    fn local(&self, block: &Block, word: &Word) -> Result<Change, ProgramError> {
        needs_axis(block, word)?;
        let to = PerAxis::from_fn(|axis| {
            self.axis_value(block, axis)
                .unwrap_or(self.registers.shift[axis])
        });
        Ok(Change::Shift { to, stored: to })
    }

    /// The point where the axes are gets the coordinates of the block.
    fn shift(&self, block: &Block, word: &Word) -> Result<Change, ProgramError> {
        needs_axis(block, word)?;
        let frame = self.registers.frame();
        let known = PerAxis::from_fn(|axis| self.reach[axis].known());
        let program = frame.program(&PerAxis::from_fn(|axis| known[axis].unwrap_or(0.0)));
        let mut to = self.registers.shift;
        for axis in Axis::ALL {
            let Some(value) = self.axis_value(block, axis) else {
                continue;
            };
            let is_turned = frame.turn().is_some() && matches!(axis, Axis::X | Axis::Y);
            let is_known = if is_turned {
                known[Axis::X].is_some() && known[Axis::Y].is_some()
            } else {
                known[axis].is_some()
            };
            if !is_known {
                return Err(ProgramError::PositionUnknown {
                    at: block.at(word),
                    word: word.text(),
                });
            }
            to[axis] = program[axis] + self.registers.shift[axis] - value;
        }
        Ok(Change::Shift { to, stored: to })
    }
}

fn needs_axis(block: &Block, word: &Word) -> Result<(), ProgramError> {
    if block.first_axis().is_some() {
        return Ok(());
    }
    Err(ProgramError::Needs {
        at: block.at(word),
        word: word.text(),
        needs: "an axis word",
    })
}
