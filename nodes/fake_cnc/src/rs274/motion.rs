//! Motions: where they lead in machine coordinates, and whether the machine can.

use std::f64::consts::PI;

use metrology::{Axis, PerAxis};

use super::arc::centre_from_start;
use super::block::{Block, Mode, NonModal, Said};
use super::bounds;
use super::modal::Reader;
use super::program::{Action, Aim, Arc, Feed, Motion, Plane, Slide, Touch};
use super::reach::{Reach, image_of_rectangle};
use super::registers::{Frame, PathMode};
use super::words::Word;
use crate::error::{Place, ProgramError};
use crate::sweep::Sweep;

/// Rounding that a position may exceed its limit by, mm or rad.
const TRAVEL_ROUNDING: f64 = 1e-9;
/// Rounding that a feed may exceed the axes' speeds by, as a share.
const FEED_ROUNDING: f64 = 1e-9;

/// Where a motion leads: each axis, and the line on which X and Y end where only one of them is given.
type Aims = (PerAxis<Aim>, Option<Slide>);

impl Reader<'_> {
    pub(super) fn motion(&mut self, block: &Block, said: &Said<Mode>) -> Result<(), ProgramError> {
        let word = &said.word;
        if said.what != Mode::Rapid {
            self.check_feed(block, word, said.what)?;
        }
        let is_machine = matches!(
            block.non_modal.map(|said| said.what),
            Some(NonModal::MachineCoordinates)
        );
        let frame = self.registers.frame();
        let (aim, slide) = self.aims(block, &frame, is_machine);
        let mut motion = Motion {
            aim,
            slide,
            arc: None,
            feed: self.feed,
        };
        match said.what {
            Mode::Rapid => motion.feed = Feed::Rapid,
            Mode::Straight | Mode::Cancelled => {}
            Mode::Arc { clockwise } => {
                motion.arc = Some(self.arc(block, word, &frame, &motion, clockwise)?);
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
        self.reach = self.target(block, word, &motion)?;
        self.note_first_motion(block, said.what);
        self.push(block.line, Action::Move(motion))?;
        if self.registers.modes.path == PathMode::ExactStop {
            self.push(block.line, Action::Dwell(0.0))?;
        }
        Ok(())
    }

    /// F must be above 0, and within what the axes reach together.
    fn check_feed(&self, block: &Block, word: &Word, mode: Mode) -> Result<(), ProgramError> {
        let at = block.at(word);
        if self.feed_per_min <= 0.0 {
            return Err(ProgramError::Feed {
                at,
                word: word.text(),
                feed: self.feed_per_min,
            });
        }
        let Feed::Rate {
            linear_mm_s,
            rotary_rad_s,
        } = self.feed
        else {
            return Ok(());
        };
        let has_linear = Axis::LINEAR.iter().any(|axis| block.axis(*axis).is_some());
        let (feed, axes, scale, unit) = if has_linear || matches!(mode, Mode::Arc { .. }) {
            (linear_mm_s, Axis::LINEAR, 60.0, "mm/min")
        } else {
            (rotary_rad_s, Axis::ROTARY, 60.0 * 180.0 / PI, "deg/min")
        };
        let together = axes
            .into_iter()
            .filter(|axis| self.envelope.axes.contains(*axis))
            .fold(0.0_f64, |sum, axis| sum.hypot(self.envelope.speed[axis]));
        if block.first_axis().is_none() || feed <= together * (1.0 + FEED_ROUNDING) {
            return Ok(());
        }
        Err(ProgramError::FeedTooFast {
            at,
            word: word.text(),
            feed: round(feed * scale),
            limit: round(together * scale),
            unit,
        })
    }

    fn aims(&self, block: &Block, frame: &Frame, is_machine: bool) -> Aims {
        let is_incremental = self.registers.modes.is_incremental;
        let mut aim = PerAxis::from_fn(|axis| {
            let Some(value) = self.axis_value(block, axis) else {
                return Aim::Keep;
            };
            match (is_incremental, self.reach[axis].known()) {
                _ if is_machine => Aim::At(value),
                (false, _) => Aim::At(frame.machine_of(axis, value)),
                (true, Some(from)) => Aim::At(from + value),
                (true, None) => Aim::By(value),
            }
        });
        let words = [Axis::X, Axis::Y].map(|axis| self.axis_value(block, axis));
        let Some(turn) = frame
            .turn()
            .filter(|_| !is_machine && words != [None, None])
        else {
            return (aim, None);
        };
        let mut slide = None;
        let [x, y] = if is_incremental {
            self.turned_step(frame, words)
        } else {
            match self.turned_point(frame, words) {
                Ok(point) => point,
                Err(given) => {
                    slide = Some(sliding(frame, turn, given));
                    [Aim::Keep, Aim::Keep]
                }
            }
        };
        (aim[Axis::X], aim[Axis::Y]) = (x, y);
        (aim, slide)
    }

    fn turned_step(&self, frame: &Frame, words: [Option<f64>; 2]) -> [Aim; 2] {
        let mut way = PerAxis::default();
        (way[Axis::X], way[Axis::Y]) = (words[0].unwrap_or(0.0), words[1].unwrap_or(0.0));
        let way = frame.machine_way(&way);
        [Axis::X, Axis::Y].map(|axis| match self.reach[axis].known() {
            Some(from) => Aim::At(from + way[axis]),
            None => Aim::By(way[axis]),
        })
    }

    /// Where X and Y of a turned system lead; the error is the one word, where the other coordinate is not known.
    fn turned_point(
        &self,
        frame: &Frame,
        words: [Option<f64>; 2],
    ) -> Result<[Aim; 2], (Axis, f64)> {
        let known = [Axis::X, Axis::Y].map(|axis| self.reach[axis].known());
        let mut point = PerAxis::default();
        match (words, known) {
            ([Some(x), Some(y)], _) => (point[Axis::X], point[Axis::Y]) = (x, y),
            ([x, y], [Some(at_x), Some(at_y)]) => {
                let mut here = PerAxis::default();
                (here[Axis::X], here[Axis::Y]) = (at_x, at_y);
                let here = frame.program(&here);
                point[Axis::X] = x.unwrap_or(here[Axis::X]);
                point[Axis::Y] = y.unwrap_or(here[Axis::Y]);
            }
            ([Some(x), None], _) => return Err((Axis::X, x)),
            ([None, y], _) => return Err((Axis::Y, y.unwrap_or(0.0))),
        }
        let machine = frame.machine(&point);
        Ok([Aim::At(machine[Axis::X]), Aim::At(machine[Axis::Y])])
    }

    /// Where `motion` leads each axis, refused beyond its travel.
    fn target(
        &self,
        block: &Block,
        word: &Word,
        motion: &Motion,
    ) -> Result<PerAxis<Reach>, ProgramError> {
        let mut target = PerAxis::from_fn(|axis| match (motion.aim[axis], self.reach[axis]) {
            (Aim::Keep, reach) => reach,
            (Aim::At(value), _) => Reach::at(value),
            (Aim::By(step), reach) => reach.by(Reach::at(step)),
        });
        let mut moves = PerAxis::from_fn(|axis| motion.aim[axis] != Aim::Keep);
        if let Some(slide) = motion.slide {
            let [x, y] = image_of_rectangle(self.reach[Axis::X], self.reach[Axis::Y], |from| {
                slide.end_mm(from)
            });
            (target[Axis::X], target[Axis::Y]) = (x, y);
            (moves[Axis::X], moves[Axis::Y]) = (true, true);
        }
        for axis in self.envelope.axes.iter() {
            let word = block.axis(axis).or(block.first_axis()).unwrap_or(word);
            if moves[axis] {
                self.within(block.at(word), axis, target[axis])?;
            }
        }
        Ok(target)
    }

    fn within(&self, at: Place, axis: Axis, reach: Reach) -> Result<(), ProgramError> {
        let [least, greatest] = self.envelope.travel[axis];
        // Written so that a position that is no number is refused as well.
        let is_above = reach.least >= least - TRAVEL_ROUNDING;
        let is_below = reach.greatest <= greatest + TRAVEL_ROUNDING;
        let (value, limit) = match (is_above, is_below) {
            (true, true) => return Ok(()),
            (false, _) => (reach.least, least),
            (true, false) => (reach.greatest, greatest),
        };
        let (scale, unit) = if axis.is_linear() {
            (1.0, "mm")
        } else {
            (180.0 / PI, "deg")
        };
        Err(ProgramError::Travel {
            at,
            axis,
            value: round(value * scale),
            limit: limit * scale,
            unit,
        })
    }

    /// How far an arc ends from its start along the machine's axis.
    fn way(&self, at: Place, motion: &Motion, axis: Axis) -> Result<f64, ProgramError> {
        if motion.slide.is_some() && matches!(axis, Axis::X | Axis::Y) {
            return Err(ProgramError::ArcAfterTouch { at });
        }
        match (motion.aim[axis], self.reach[axis].known()) {
            (Aim::Keep, _) => Ok(0.0),
            (Aim::By(step), _) => Ok(step),
            (Aim::At(value), Some(from)) => Ok(value - from),
            (Aim::At(_), None) => Err(ProgramError::ArcAfterTouch { at }),
        }
    }

    fn arc(
        &self,
        block: &Block,
        word: &Word,
        frame: &Frame,
        motion: &Motion,
        clockwise: bool,
    ) -> Result<Arc, ProgramError> {
        let at = block.at(word);
        let plane = self.registers.modes.plane;
        let [first, second, normal] = plane.axes();
        let mut way = PerAxis::default();
        way[first] = self.way(at, motion, first)?;
        way[second] = self.way(at, motion, second)?;
        let is_turned = frame.turn().is_some();
        if is_turned && plane != Plane::Xy {
            way[normal] = self.way(at, motion, normal)?;
        }
        let along = frame.program_way(&way);
        let start = self.start_of_centres(block, word, frame)?;
        let [c1, c2] = centre_from_start(
            block,
            word,
            plane,
            clockwise,
            [along[first], along[second]],
            self.mm_per_unit(),
            start.map(|start| [start[first], start[second]]),
        )?;
        let arc = |centre_from_start_mm, turn| -> Result<Arc, ProgramError> {
            Ok(Arc {
                plane,
                clockwise,
                centre_from_start_mm,
                turns: turns(block)?,
                turn,
            })
        };
        if plane != Plane::Xy
            && let Some(turn) = frame.turn()
        {
            let arc = arc([c1, c2], Some(turn))?;
            let ways = Sweep::new(&arc, [along[first], along[second]]).extremes_from_start();
            self.turned_arc_within(at, frame, plane, ways, along[normal])?;
            return Ok(arc);
        }
        let mut centre = PerAxis::default();
        (centre[first], centre[second]) = (c1, c2);
        let centre = frame.machine_way(&centre);
        let arc = arc([centre[first], centre[second]], None)?;
        let extremes = Sweep::new(&arc, [way[first], way[second]]).extremes_from_start();
        for (axis, [least, greatest]) in [first, second].into_iter().zip(extremes) {
            self.within(at, axis, self.reach[axis].by(Reach { least, greatest }))?;
        }
        Ok(arc)
    }

    /// Where an arc with absolute centres starts, in coordinates of the program.
    fn start_of_centres(
        &self,
        block: &Block,
        word: &Word,
        frame: &Frame,
    ) -> Result<Option<PerAxis<f64>>, ProgramError> {
        if !self.registers.modes.has_absolute_centres || block.word('R').is_some() {
            return Ok(None);
        }
        let known = PerAxis::from_fn(|axis| self.reach[axis].known());
        if Axis::LINEAR.iter().any(|axis| known[*axis].is_none()) {
            return Err(ProgramError::ArcAfterTouch { at: block.at(word) });
        }
        let machine = PerAxis::from_fn(|axis| known[axis].unwrap_or(0.0));
        Ok(Some(frame.program(&machine)))
    }

    /// Travel of an arc across a plane that is turned about Z.
    fn turned_arc_within(
        &self,
        at: Place,
        frame: &Frame,
        plane: Plane,
        ways: [[f64; 2]; 2],
        along_normal: f64,
    ) -> Result<(), ProgramError> {
        let [first, second, normal] = plane.axes();
        let mut along = PerAxis::from_fn(|_| Reach::at(0.0));
        for (axis, [least, greatest]) in [first, second].into_iter().zip(ways) {
            along[axis] = Reach { least, greatest };
        }
        along[normal] = Reach::at(0.0).hull(Reach::at(along_normal));
        let [x, y] = image_of_rectangle(along[Axis::X], along[Axis::Y], |[x, y]| {
            let mut way = PerAxis::default();
            (way[Axis::X], way[Axis::Y]) = (x, y);
            let way = frame.machine_way(&way);
            [way[Axis::X], way[Axis::Y]]
        });
        for (axis, way) in [(Axis::X, x), (Axis::Y, y), (Axis::Z, along[Axis::Z])] {
            self.within(at, axis, self.reach[axis].by(way))?;
        }
        Ok(())
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
        let target = self.target(block, word, &motion)?;
        let stays = motion.slide.is_none()
            && Axis::LINEAR.into_iter().all(|axis| match motion.aim[axis] {
                Aim::Keep => true,
                Aim::By(step) => step == 0.0,
                Aim::At(value) => self.reach[axis].known() == Some(value),
            });
        if stays {
            return Err(ProgramError::TouchWithoutLength { at });
        }
        // The touch may end anywhere on its way.
        self.reach = PerAxis::from_fn(|axis| self.reach[axis].hull(target[axis]));
        self.push(block.line, Action::Touch(motion, touch))
    }
}

/// The line on which one coordinate of a turned system has its given value.
fn sliding(frame: &Frame, [cos, sin]: [f64; 2], (axis, value): (Axis, f64)) -> Slide {
    let mut point = PerAxis::default();
    point[axis] = value;
    let point = frame.machine(&point);
    let direction = if axis == Axis::X {
        [-sin, cos]
    } else {
        [cos, sin]
    };
    let along = point[Axis::X] * direction[0] + point[Axis::Y] * direction[1];
    Slide {
        foot_mm: [
            point[Axis::X] - along * direction[0],
            point[Axis::Y] - along * direction[1],
        ],
        direction,
    }
}

/// As a person would write it: to six decimals.
fn round(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

fn turns(block: &Block) -> Result<u32, ProgramError> {
    let Some(word) = block.word('P') else {
        return Ok(1);
    };
    let whole = word.value.round();
    if (word.value - whole).abs() > 0.001 || !(1.0..=bounds::TURNS).contains(&whole) {
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
