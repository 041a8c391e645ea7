//! Modal state: turns blocks into steps and checks each against the machine.

use std::f64::consts::PI;

use metrology::{Axis, AxisSet, PerAxis};

use super::arc;
use super::block::{Block, Mode, NonModal, Said};
use super::program::{Action, Aim, Arc, Feed, Motion, Plane, Program, Step, Touch};
use super::words::{Comment, Line, Word, read_line};
use crate::error::{Place, ProgramError};
use crate::sweep::Sweep;

/// Lines that a program may have.
const LINES_LIMIT: u32 = 1_000_000;
/// Rounding that a position may exceed its limit by, mm or rad.
const TRAVEL_ROUNDING: f64 = 1e-9;
const MM_PER_INCH: f64 = 25.4;

/// What a program is checked against.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Envelope {
    /// The machine's axes.
    pub axes: AxisSet,
    /// Least and greatest command of each, mm or rad.
    pub travel: PerAxis<[f64; 2]>,
}

/// Where an axis can be at some line: one value, or anywhere that a touch may have ended.
#[derive(Clone, Copy, Debug)]
struct Reach {
    least: f64,
    greatest: f64,
}

impl Reach {
    const fn at(value: f64) -> Self {
        Self {
            least: value,
            greatest: value,
        }
    }

    fn known(self) -> Option<f64> {
        (self.greatest <= self.least).then_some(self.least)
    }

    fn hull(self, other: Self) -> Self {
        Self {
            least: self.least.min(other.least),
            greatest: self.greatest.max(other.greatest),
        }
    }
}

struct Reader<'a> {
    envelope: &'a Envelope,
    program: Program,
    reach: PerAxis<Reach>,
    mode: Option<Mode>,
    plane: Plane,
    inch: bool,
    incremental: bool,
    feed: Feed,
    feed_per_min: f64,
    spindle_rpm: f64,
    spindle_turning: bool,
    feature: usize,
    full_rate: bool,
    ended: bool,
}

/// Reads and checks a whole program that starts with the axes at `start` (mm, rad).
///
/// Modal state at the start is G17 G21 G90, no motion mode, no feed, spindle speed 0.
///
/// # Errors
/// The first thing that this control could not execute as written, with its place.
pub fn read(
    text: &str,
    envelope: &Envelope,
    start: &PerAxis<f64>,
) -> Result<Program, ProgramError> {
    let mut reader = Reader {
        envelope,
        program: Program {
            features: vec![String::new()],
            ..Program::default()
        },
        reach: PerAxis::from_fn(|axis| Reach::at(start[axis])),
        mode: None,
        plane: Plane::Xy,
        inch: false,
        incremental: false,
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
        if number > LINES_LIMIT {
            return Err(ProgramError::TooLong {
                line: number,
                limit: LINES_LIMIT,
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
            self.comment(line.number, comment)?;
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
        self.plane = block.plane.map_or(self.plane, |said| said.what);
        self.inch = block.inch.map_or(self.inch, |said| said.what);
        self.incremental = block.incremental.map_or(self.incremental, |said| said.what);
        self.unused(&block, mode.as_ref())?;
        self.machine_coordinates(&block, mode.as_ref())?;
        if let Some(said) = mode {
            self.motion(&block, &said)?;
        }
        self.mode = block.mode.map_or(self.mode, |said| Some(said.what));
        if block.end.is_some() {
            self.push(&block, Action::End);
            self.ended = true;
        }
        Ok(())
    }

    fn push(&mut self, block: &Block, action: Action) {
        self.program.steps.push(Step {
            line: block.line,
            full_rate: self.full_rate,
            action,
        });
    }

    fn push_comment(&mut self, line: u32, action: Action) {
        self.program.steps.push(Step {
            line,
            full_rate: self.full_rate,
            action,
        });
    }

    fn comment(&mut self, line: u32, comment: &Comment<'_>) -> Result<(), ProgramError> {
        let at = Place {
            line,
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
        let Some((key, value)) = comment.text.split_once(':') else {
            return Ok(());
        };
        match (key.trim(), value.trim()) {
            ("feature", "") => return refuse("feature", "followed by a name"),
            ("feature", name) => {
                self.feature = self.program.features.len();
                self.program.features.push(name.to_owned());
            }
            ("rate", "full") => self.full_rate = true,
            ("rate", "background") => self.full_rate = false,
            ("rate", _) => return refuse("rate", "full or background"),
            ("mount", "") => return refuse("mount", "followed by a placement or beam"),
            ("mount", name) => {
                let index = self.program.devices.len();
                self.program.devices.push((name.to_owned(), at));
                self.push_comment(line, Action::Mount(index));
            }
            ("zero", "grid") => self.push_comment(line, Action::ZeroGrid),
            ("zero", "length") => self.push_comment(line, Action::ZeroLength),
            ("zero", _) => return refuse("zero", "grid or length"),
            _ => {}
        }
        Ok(())
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
            not_negative(block, word)?;
            self.spindle_rpm = word.value;
        }
        self.spindle_turning = block.spindle.map_or(self.spindle_turning, |s| s.what);
        if block.spindle.is_some() || (block.word('S').is_some() && self.spindle_turning) {
            let rpm = if self.spindle_turning {
                self.spindle_rpm
            } else {
                0.0
            };
            self.push(block, Action::Spindle(rpm));
        }
        Ok(())
    }

    /// The motion of this block: said in it, or modal where there are axis words.
    fn mode_of(&self, block: &Block) -> Result<Option<Said<Mode>>, ProgramError> {
        if block.mode.is_some() {
            return Ok(block.mode);
        }
        match (block.first_axis(), self.mode) {
            (None, _) => Ok(None),
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
        not_negative(block, seconds)?;
        self.push(block, Action::Dwell(seconds.value));
        Ok(())
    }

    /// Refuses words that nothing in the block uses.
    fn unused(&self, block: &Block, mode: Option<&Said<Mode>>) -> Result<(), ProgramError> {
        let arc = matches!(mode.map(|said| said.what), Some(Mode::Arc { .. }));
        let dwell = matches!(block.non_modal.map(|s| s.what), Some(NonModal::Dwell));
        let strays = "IJKR".chars().filter(|_| !arc);
        let stray_p = Some('P').filter(|_| !arc && !dwell);
        match strays.chain(stray_p).find_map(|letter| block.word(letter)) {
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
            Some(Mode::Rapid | Mode::Straight) if !self.incremental => return Ok(()),
            Some(Mode::Rapid | Mode::Straight) => "G90",
            _ => "a motion by G0 or G1",
        };
        Err(ProgramError::Needs {
            at: block.at(&word),
            word: word.text(),
            needs,
        })
    }

    fn mm_per_unit(&self) -> f64 {
        if self.inch { MM_PER_INCH } else { 1.0 }
    }

    fn motion(&mut self, block: &Block, said: &Said<Mode>) -> Result<(), ProgramError> {
        let word = &said.word;
        if said.what != Mode::Rapid && self.feed_per_min <= 0.0 {
            return Err(ProgramError::Feed {
                at: block.at(word),
                word: word.text(),
                feed: self.feed_per_min,
            });
        }
        let aim = self.aim(block);
        let mut motion = Motion {
            aim,
            arc: None,
            feed: self.feed,
        };
        match said.what {
            Mode::Rapid => motion.feed = Feed::Rapid,
            Mode::Straight => {}
            Mode::Arc { clockwise } => {
                motion.arc = Some(self.arc(block, word, &aim, clockwise)?);
            }
            Mode::Touch {
                until_closed,
                must_happen,
            } => {
                let touch = Touch {
                    until_closed,
                    must_happen,
                    feature: self.feature,
                };
                return self.touch(block, word, motion, touch);
            }
        }
        self.go(block, word, &aim)?;
        self.push(block, Action::Move(motion));
        Ok(())
    }

    fn aim(&self, block: &Block) -> PerAxis<Aim> {
        PerAxis::from_fn(|axis| {
            let Some(word) = block.axis(axis) else {
                return Aim::Keep;
            };
            let value = if axis.is_linear() {
                word.value * self.mm_per_unit()
            } else {
                word.value.to_radians()
            };
            match (self.incremental, self.reach[axis].known()) {
                (false, _) => Aim::At(value),
                (true, Some(from)) => Aim::At(from + value),
                (true, None) => Aim::By(value),
            }
        })
    }

    /// Where `aim` leads each axis, refused beyond its travel.
    fn target(
        &self,
        block: &Block,
        word: &Word,
        aim: &PerAxis<Aim>,
    ) -> Result<PerAxis<Reach>, ProgramError> {
        let target = PerAxis::from_fn(|axis| match (aim[axis], self.reach[axis]) {
            (Aim::Keep, reach) => reach,
            (Aim::At(value), _) => Reach::at(value),
            (Aim::By(step), reach) => Reach {
                least: reach.least + step,
                greatest: reach.greatest + step,
            },
        });
        for axis in self.envelope.axes.iter() {
            let word = block.axis(axis).unwrap_or(word);
            if aim[axis] != Aim::Keep {
                self.within(block.at(word), axis, target[axis])?;
            }
        }
        Ok(target)
    }

    fn within(&self, at: Place, axis: Axis, reach: Reach) -> Result<(), ProgramError> {
        let [least, greatest] = self.envelope.travel[axis];
        let (value, limit) = if reach.least < least - TRAVEL_ROUNDING {
            (reach.least, least)
        } else if reach.greatest > greatest + TRAVEL_ROUNDING {
            (reach.greatest, greatest)
        } else {
            return Ok(());
        };
        let (scale, unit) = if axis.is_linear() {
            (1.0, "mm")
        } else {
            (180.0 / PI, "deg")
        };
        Err(ProgramError::Travel {
            at,
            axis,
            value: value * scale,
            limit: limit * scale,
            unit,
        })
    }

    fn go(&mut self, block: &Block, word: &Word, aim: &PerAxis<Aim>) -> Result<(), ProgramError> {
        self.reach = self.target(block, word, aim)?;
        Ok(())
    }

    fn arc(
        &self,
        block: &Block,
        word: &Word,
        aim: &PerAxis<Aim>,
        clockwise: bool,
    ) -> Result<Arc, ProgramError> {
        let at = block.at(word);
        let [first, second, _] = self.plane.axes();
        let step = |axis: Axis| match (aim[axis], self.reach[axis].known()) {
            (Aim::Keep, _) => Ok(0.0),
            (Aim::By(step), _) => Ok(step),
            (Aim::At(value), Some(from)) => Ok(value - from),
            (Aim::At(_), None) => Err(ProgramError::ArcAfterTouch { at }),
        };
        let end_mm = [step(first)?, step(second)?];
        let centre_from_start_mm = arc::centre_from_start(
            block,
            word,
            self.plane,
            clockwise,
            end_mm,
            self.mm_per_unit(),
        )?;
        let arc = Arc {
            plane: self.plane,
            clockwise,
            centre_from_start_mm,
            turns: turns(block)?,
        };
        let extremes = Sweep::new(&arc, end_mm).extremes_from_start();
        for (axis, [least, greatest]) in [first, second].into_iter().zip(extremes) {
            let from = self.reach[axis];
            let reach = Reach {
                least: from.least + least,
                greatest: from.greatest + greatest,
            };
            self.within(at, axis, reach)?;
        }
        Ok(arc)
    }

    fn touch(
        &mut self,
        block: &Block,
        word: &Word,
        motion: Motion,
        touch: Touch,
    ) -> Result<(), ProgramError> {
        let at = block.at(word);
        if let Some(axis) = Axis::ROTARY.into_iter().find(|a| block.axis(*a).is_some()) {
            return Err(ProgramError::RotaryTouch { at, axis });
        }
        if block.first_axis().is_none() {
            return Err(ProgramError::Needs {
                at,
                word: word.text(),
                needs: "an axis word",
            });
        }
        let target = self.target(block, word, &motion.aim)?;
        let stays = Axis::LINEAR.into_iter().all(|axis| match motion.aim[axis] {
            Aim::Keep => true,
            Aim::By(step) => step == 0.0,
            Aim::At(value) => self.reach[axis].known() == Some(value),
        });
        if stays {
            return Err(ProgramError::TouchWithoutLength { at });
        }
        // The touch may end anywhere on its way.
        self.reach = PerAxis::from_fn(|axis| self.reach[axis].hull(target[axis]));
        self.push(block, Action::Touch(motion, touch));
        Ok(())
    }
}

fn not_negative(block: &Block, word: &Word) -> Result<(), ProgramError> {
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

fn turns(block: &Block) -> Result<u32, ProgramError> {
    let Some(word) = block.word('P') else {
        return Ok(1);
    };
    let whole = word.value.round();
    if (word.value - whole).abs() > 0.001 || !(1.0..=10_000.0).contains(&whole) {
        return Err(ProgramError::Value {
            at: block.at(word),
            word: 'P',
            value: word.value,
            rule: "a whole number of turns from 1 to 10000",
        });
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "checked to lie in 1..=10000"
    )]
    Ok(whole as u32)
}
