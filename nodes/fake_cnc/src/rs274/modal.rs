//! Reads a program block by block: what each changes, does, and what it may not.

use machine::program_frame::{FRAME_RULE, names_frame};
use metrology::bound::NAME_BYTES;
use metrology::{AxisSet, PerAxis};

use super::block::{Block, Mode, NonModal, Said, Stop};
use super::bounds;
use super::program::{Action, Feed, Program, Step};
use super::reach::Reach;
use super::registers::{Change, Modes, Registers};
use super::words::{Comment, Line, Word, read_line};
use crate::error::{Place, ProgramError};

const MM_PER_INCH: f64 = 25.4;

/// What a program is checked against.
#[derive(Clone, Debug, PartialEq)]
pub struct Envelope {
    /// The machine's axes.
    pub axes: AxisSet,
    /// Least and greatest command of each, mm or rad.
    pub travel: PerAxis<[f64; 2]>,
    /// Greatest speed of each, mm/s or rad/s.
    pub speed: PerAxis<f64>,
    /// Greatest speed of the spindle, where there is one, 1/min.
    pub spindle_limit_rpm: Option<f64>,
    /// Length of tools H1, H2 ..., mm.
    pub tool_lengths_mm: Vec<f64>,
}

pub(super) struct Reader<'a> {
    pub(super) envelope: &'a Envelope,
    pub(super) program: Program,
    pub(super) reach: PerAxis<Reach>,
    pub(super) registers: Registers,
    mode: Option<Mode>,
    pub(super) feed: Feed,
    pub(super) feed_per_min: f64,
    spindle_rpm: f64,
    spindle_turning: bool,
    pub(super) feature: usize,
    full_rate: bool,
    ended: bool,
}

/// Reads and checks a whole program for a control that was just switched on, with the axes at `start` (mm, rad).
///
/// # Errors
/// As [`read_in`].
pub fn read(
    text: &str,
    envelope: &Envelope,
    start: &PerAxis<f64>,
) -> Result<Program, ProgramError> {
    read_in(text, envelope, start, &Registers::default())
}

/// Reads and checks a whole program that starts with the axes at `start` (mm, rad), in the state `found`.
///
/// What is not in [`Registers`] begins anew: no motion mode, no feed, spindle speed 0.
///
/// # Errors
/// The first thing that this control could not execute as written, with its place.
pub fn read_in(
    text: &str,
    envelope: &Envelope,
    start: &PerAxis<f64>,
    found: &Registers,
) -> Result<Program, ProgramError> {
    let mut reader = Reader {
        envelope,
        program: Program {
            features: vec![String::new()],
            ..Program::default()
        },
        reach: PerAxis::from_fn(|axis| Reach::at(start[axis])),
        registers: *found,
        mode: None,
        feed: Feed::Rate {
            linear_mm_s: 0.0,
            rotary_rad_s: 0.0,
        },
        feed_per_min: 0.0,
        spindle_rpm: 0.0,
        spindle_turning: false,
        feature: 0,
        full_rate: false,
        ended: false,
    };
    let mut number = 0;
    for text in text.lines() {
        number += 1;
        if number > bounds::LINES {
            return Err(ProgramError::TooLong {
                line: number,
                limit: bounds::LINES,
            });
        }
        reader.line(&read_line(number, text)?)?;
    }
    if !reader.ended {
        return Err(ProgramError::EndMissing { line: number });
    }
    reader.program.lines = number;
    Ok(reader.program)
}

impl Reader<'_> {
    fn line(&mut self, line: &Line<'_>) -> Result<(), ProgramError> {
        if let Some(word) = line.words.first().filter(|_| self.ended) {
            return Err(ProgramError::AfterEnd {
                at: line.place(word),
                word: word.text(),
            });
        }
        for comment in &line.comments {
            self.comment(line, comment)?;
        }
        let block = Block::read(line, self.envelope.axes)?;
        self.feed_word(&block)?;
        self.spindle(&block)?;
        let mode = self.mode_of(&block)?;
        if let Some(Said {
            what: NonModal::Dwell,
            word,
        }) = block.non_modal
        {
            self.dwell(&block, &word, mode.as_ref())?;
        }
        self.modes(&block)?;
        self.unused(&block, mode.as_ref())?;
        self.settings(&block)?;
        self.machine_coordinates(&block, mode.as_ref())?;
        if let Some(said) = mode {
            self.motion(&block, &said)?;
        }
        if let Some(said) = block.mode {
            self.mode = Some(said.what).filter(|mode| *mode != Mode::Cancelled);
        }
        match block.stop.map(|said| said.what) {
            None => Ok(()),
            Some(Stop::Wait(why)) => self.push(block.line, Action::Wait(why)),
            Some(Stop::End) => {
                self.ended = true;
                self.push(block.line, Action::End)
            }
        }
    }

    pub(super) fn push(&mut self, line: u32, action: Action) -> Result<(), ProgramError> {
        bounds::check_count(line, "steps", self.program.steps.len())?;
        self.program.steps.push(Step {
            line,
            full_rate: self.full_rate,
            action,
        });
        Ok(())
    }

    /// Makes a change of the state, where it is one, here and when the program runs.
    pub(super) fn change(&mut self, line: u32, change: Change) -> Result<(), ProgramError> {
        let before = self.registers;
        self.registers.apply(&change);
        if self.registers == before {
            return Ok(());
        }
        self.push(line, Action::Set(change))
    }

    fn comment(&mut self, line: &Line<'_>, comment: &Comment<'_>) -> Result<(), ProgramError> {
        let at = Place {
            line: line.number,
            column: comment.column,
        };
        let refuse = |what, rule| {
            Err(ProgramError::CommentValue {
                at,
                what,
                text: comment.text.to_owned(),
                rule,
            })
        };
        if comment.is_tail && names_frame(comment.text) {
            return refuse("frame", FRAME_RULE);
        }
        let Some((key, value)) = comment.text.split_once(':') else {
            return Ok(());
        };
        let bytes = value.trim().len();
        let too_long = |what| ProgramError::NameTooLong { at, what, bytes };
        match (key.trim(), value.trim()) {
            ("feature", _) if bytes > NAME_BYTES => return Err(too_long("feature")),
            ("mount", _) if bytes > NAME_BYTES => return Err(too_long("mount")),
            ("feature", "") => return refuse("feature", "followed by a name"),
            ("feature", name) => {
                self.feature = self.program.features.len();
                bounds::check_count(at.line, "feature comments", self.feature)?;
                self.program.features.push(name.to_owned());
            }
            ("rate", "full") => self.full_rate = true,
            ("rate", "background") => self.full_rate = false,
            ("rate", _) => return refuse("rate", "full or background"),
            ("mount", "") => return refuse("mount", "followed by a placement or beam"),
            ("mount", name) => {
                let index = self.program.devices.len();
                self.push(at.line, Action::Mount(index))?;
                self.program.devices.push((name.to_owned(), at));
            }
            ("zero", "grid") => self.push(at.line, Action::ZeroGrid)?,
            ("zero", "length") => self.push(at.line, Action::ZeroLength)?,
            ("zero", _) => return refuse("zero", "grid or length"),
            (key, frame) if key.eq_ignore_ascii_case("frame") => {
                if !frame.eq_ignore_ascii_case("machine") {
                    let rule = "machine; without it a program is in the work system in use";
                    return refuse("frame", rule);
                }
                if !self.may_choose_frame(line, comment) {
                    return refuse("frame", FRAME_RULE);
                }
                self.machine_frame(at)?;
            }
            _ => {}
        }
        Ok(())
    }

    fn may_choose_frame(&self, line: &Line<'_>, comment: &Comment<'_>) -> bool {
        let is_first = line
            .words
            .first()
            .is_none_or(|word| comment.column < word.column);
        let is_single = self.program.restored.is_none();
        line.number == 1 && is_first && is_single && !comment.is_tail
    }

    fn feed_word(&mut self, block: &Block) -> Result<(), ProgramError> {
        let Some(word) = block.word('F') else {
            return Ok(());
        };
        not_negative(block, word)?;
        self.feed_per_min = word.value;
        self.feed = Feed::Rate {
            linear_mm_s: word.value * self.mm_per_unit() / 60.0,
            rotary_rad_s: word.value.to_radians() / 60.0,
        };
        Ok(())
    }

    fn spindle(&mut self, block: &Block) -> Result<(), ProgramError> {
        if let Some(word) = block.word('S') {
            self.spindle_rpm = self.spindle_speed(block, word)?;
        }
        self.spindle_turning = block.spindle.map_or(self.spindle_turning, |s| s.what);
        if block.spindle.is_some() || (block.word('S').is_some() && self.spindle_turning) {
            let rpm = if self.spindle_turning {
                self.spindle_rpm
            } else {
                0.0
            };
            self.push(block.line, Action::Spindle(rpm))?;
        }
        Ok(())
    }

    fn spindle_speed(&self, block: &Block, word: &Word) -> Result<f64, ProgramError> {
        not_negative(block, word)?;
        let (at, speed_rpm) = (block.at(word), word.value);
        match self.envelope.spindle_limit_rpm {
            Some(limit_rpm) if speed_rpm > limit_rpm => Err(ProgramError::SpindleSpeed {
                at,
                speed_rpm,
                limit_rpm,
            }),
            None if speed_rpm > 0.0 => Err(ProgramError::NoSpindle { at, speed_rpm }),
            _ => Ok(speed_rpm),
        }
    }

    /// The motion of this block: said in it, or modal where there are axis words that nothing else takes.
    fn mode_of(&self, block: &Block) -> Result<Option<Said<Mode>>, ProgramError> {
        let taken = block.takes_axes();
        if let Some(said) = block.mode {
            let stray = match (said.what, taken) {
                (Mode::Cancelled, None) => block.first_axis(),
                (Mode::Cancelled, Some(_)) | (_, None) => None,
                (_, Some(other)) => {
                    return Err(ProgramError::Conflict {
                        at: block.at(&said.word),
                        word: said.word.text(),
                        other: other.text(),
                    });
                }
            };
            if let Some(word) = stray {
                return Err(ProgramError::UnusedWord {
                    at: block.at(word),
                    word: word.text(),
                });
            }
            return Ok(Some(said).filter(|said| said.what != Mode::Cancelled));
        }
        match (block.first_axis(), self.mode) {
            (None, _) => Ok(None),
            (Some(_), _) if taken.is_some() => Ok(None),
            (Some(&word), Some(what)) => Ok(Some(Said { what, word })),
            (Some(word), None) => Err(ProgramError::Needs {
                at: block.at(word),
                word: word.text(),
                needs: "a motion: G0 G1 G2 G3 or G38",
            }),
        }
    }

    fn dwell(
        &mut self,
        block: &Block,
        word: &Word,
        mode: Option<&Said<Mode>>,
    ) -> Result<(), ProgramError> {
        if let Some(said) = mode.filter(|said| matches!(said.what, Mode::Arc { .. })) {
            return Err(ProgramError::Conflict {
                at: block.at(word),
                word: word.text(),
                other: said.word.text(),
            });
        }
        let Some(seconds) = block.word('P') else {
            return Err(ProgramError::Needs {
                at: block.at(word),
                word: word.text(),
                needs: "P, its time in seconds",
            });
        };
        self.push(block.line, Action::Dwell(seconds.value))
    }

    fn modes(&mut self, block: &Block) -> Result<(), ProgramError> {
        let now = self.registers.modes;
        let modes = Modes {
            plane: block.plane.map_or(now.plane, |said| said.what),
            is_inch: block.inch.map_or(now.is_inch, |said| said.what),
            is_incremental: block.incremental.map_or(now.is_incremental, |s| s.what),
            has_absolute_centres: block
                .absolute_centres
                .map_or(now.has_absolute_centres, |said| said.what),
            path: block.path.map_or(now.path, |said| said.what),
        };
        self.change(block.line, Change::Modes(modes))
    }

    /// Refuses words that nothing in the block uses.
    fn unused(&self, block: &Block, mode: Option<&Said<Mode>>) -> Result<(), ProgramError> {
        let arc = matches!(mode.map(|said| said.what), Some(Mode::Arc { .. }));
        let non_modal = block.non_modal.map(|said| said.what);
        let dwell = non_modal == Some(NonModal::Dwell);
        let system = non_modal == Some(NonModal::SetSystem);
        let blend = block.is_blend();
        let used = |letter| match letter {
            'I' | 'J' | 'K' => arc,
            'R' => arc || system,
            'P' => arc || dwell || system || blend,
            'Q' => blend,
            'L' => system,
            _ => block.is_tool_from_table(),
        };
        match "IJKRPQLH"
            .chars()
            .filter(|letter| !used(*letter))
            .find_map(|letter| block.word(letter))
        {
            None => Ok(()),
            Some(word) => Err(ProgramError::UnusedWord {
                at: block.at(word),
                word: word.text(),
            }),
        }
    }

    fn machine_coordinates(
        &self,
        block: &Block,
        mode: Option<&Said<Mode>>,
    ) -> Result<(), ProgramError> {
        let Some(Said {
            what: NonModal::MachineCoordinates,
            word,
        }) = block.non_modal
        else {
            return Ok(());
        };
        let needs = match mode.map(|said| said.what) {
            Some(Mode::Rapid | Mode::Straight) if !self.registers.modes.is_incremental => {
                return Ok(());
            }
            Some(Mode::Rapid | Mode::Straight) => "G90",
            _ => "a motion by G0 or G1",
        };
        Err(ProgramError::Needs {
            at: block.at(&word),
            word: word.text(),
            needs,
        })
    }

    pub(super) const fn mm_per_unit(&self) -> f64 {
        if self.registers.modes.is_inch {
            MM_PER_INCH
        } else {
            1.0
        }
    }
}

pub(super) fn not_negative(block: &Block, word: &Word) -> Result<(), ProgramError> {
    if word.value < 0.0 {
        return Err(ProgramError::Value {
            at: block.at(word),
            word: word.letter,
            value: word.value,
            rule: "0 or above",
        });
    }
    Ok(())
}
