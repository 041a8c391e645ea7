//! A checked program: what the control does, step by step.

use metrology::{Axis, PerAxis};

use super::registers::{Change, Registers};
use crate::error::{Place, ProgramError};

/// Where one axis goes; mm or rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Aim {
    /// It stays.
    Keep,
    /// To this position.
    At(f64),
    /// By this distance from where a touch ended.
    By(f64),
}

/// Plane of an arc.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Plane {
    /// G17.
    Xy,
    /// G18: Z is the first axis, X the second.
    Zx,
    /// G19.
    Yz,
}

/// An arc about an axis normal to its plane, or a helix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arc {
    /// Its plane.
    pub plane: Plane,
    /// G2 rather than G3, seen against the plane's normal.
    pub clockwise: bool,
    /// Centre from the start along the plane's first and second axis, mm.
    pub centre_from_start_mm: [f64; 2],
    /// Turns: 1 is anything up to a full circle.
    pub turns: u32,
    /// Cosine and sine of the angle about Z by which the plane is turned, where it is and is not X Y.
    pub turn: Option<[f64; 2]>,
}

/// A line across the machine's X and Y on which a motion ends: one coordinate of a turned work system is given, the other
/// stays as a touch left it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slide {
    /// Point of the line nearest to the machine's zero, mm.
    pub foot_mm: [f64; 2],
    /// Direction of the line.
    pub direction: [f64; 2],
}

impl Slide {
    /// X and Y at its end, for a motion that starts at `from_mm`.
    #[must_use]
    pub fn end_mm(&self, from_mm: [f64; 2]) -> [f64; 2] {
        let [x, y] = self.direction;
        let along_mm = from_mm[0] * x + from_mm[1] * y;
        [
            self.foot_mm[0] + along_mm * x,
            self.foot_mm[1] + along_mm * y,
        ]
    }
}

/// Feed of a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Feed {
    /// As fast as the axes go.
    Rapid,
    /// The F word: along X Y Z where one of them moves, else along the rotary axes.
    Rate {
        /// For a path in X Y Z, mm/s.
        linear_mm_s: f64,
        /// For a path of rotary axes alone, rad/s.
        rotary_rad_s: f64,
    },
}

/// A motion to `aim`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Target of each axis.
    pub aim: PerAxis<Aim>,
    /// Replaces the aims of X and Y.
    pub slide: Option<Slide>,
    /// `None`: straight.
    pub arc: Option<Arc>,
    /// Speed.
    pub feed: Feed,
}

/// What a touch waits for and what happens when it does not come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Touch {
    /// The signal that ends it: closed (G38.2, G38.3) or open (G38.4, G38.5).
    pub until_closed: bool,
    /// Whether its absence ends the program (G38.2, G38.4).
    pub must_happen: bool,
    /// Index into [`Program::features`].
    pub feature: usize,
}

/// Why a program waits until somebody lets it go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "named after what a person does")]
pub enum Wait {
    /// M0.
    Stop,
    /// M1.
    OptionalStop,
    /// M60.
    PalletChange,
    FeedHold,
    SingleBlock,
}

impl std::fmt::Display for Wait {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Stop => "M0",
            Self::OptionalStop => "M1",
            Self::PalletChange => "M60",
            Self::FeedHold => "feed hold",
            Self::SingleBlock => "single block",
        })
    }
}

/// What the text of a program in machine coordinates says of the end of its first motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirstMotion {
    /// Index of its step.
    pub step: usize,
    /// Numbers of its axis words, mm or rad.
    pub words: PerAxis<Option<f64>>,
}

impl FirstMotion {
    /// The first axis whose position differs from its word by more than its tolerance, with both.
    #[must_use]
    pub fn difference(
        &self,
        position: &PerAxis<f64>,
        tolerance: &PerAxis<f64>,
    ) -> Option<(Axis, f64, f64)> {
        Axis::ALL.into_iter().find_map(|axis| {
            let wanted = self.words[axis]?;
            let is_there = (position[axis] - wanted).abs() <= tolerance[axis];
            (!is_there).then_some((axis, wanted, position[axis]))
        })
    }
}

/// One thing that the control does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Action {
    /// Moves.
    Move(Motion),
    /// Moves until the probe answers.
    Touch(Motion, Touch),
    /// Waits, s.
    Dwell(f64),
    /// Turns the spindle at this speed, 1/min; 0 stops it.
    Spindle(f64),
    /// Puts a plate or beam in place; index into [`Program::devices`].
    Mount(usize),
    /// Sets the count of the grid encoder to zero.
    ZeroGrid,
    /// Sets the count of the length reference to zero.
    ZeroLength,
    /// Changes the state that the control keeps.
    Set(Change),
    /// Waits until somebody lets it go on.
    Wait(Wait),
    /// Ends the program.
    End,
}

/// An action and where it stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Line, from 1.
    pub line: u32,
    /// Whether axis states are wanted at the full rate, `(rate: full)`.
    pub full_rate: bool,
    /// What is done.
    pub action: Action,
}

/// A whole program that was found executable.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Program {
    /// Steps in their order; the last is [`Action::End`].
    pub steps: Vec<Step>,
    /// Names of `(feature: NAME)` comments; the first is empty, for touches before any.
    pub features: Vec<String>,
    /// Names of `(mount: NAME)` comments and where they stand.
    pub devices: Vec<(String, Place)>,
    /// Number of lines.
    pub lines: u32,
    /// The state that is put back at any end: that of the start, for a program in machine coordinates.
    pub restored: Option<Box<Registers>>,
    /// What is verified when the first motion of a program in machine coordinates has ended.
    pub first_motion: Option<FirstMotion>,
}

impl Program {
    /// Line of the first touch.
    #[must_use]
    pub fn first_touch(&self) -> Option<u32> {
        let mut steps = self.steps.iter();
        let touch = steps.find(|step| matches!(step.action, Action::Touch(..)))?;
        Some(touch.line)
    }

    /// Refuses a `(mount: NAME)` of a name that `has_device` does not know, before anything moves.
    ///
    /// # Errors
    /// With the first such name and its place.
    pub fn check_devices(&self, has_device: impl Fn(&str) -> bool) -> Result<(), ProgramError> {
        let mut devices = self.devices.iter();
        match devices.find(|(name, _)| !has_device(name)) {
            None => Ok(()),
            Some((name, at)) => Err(ProgramError::CommentValue {
                at: *at,
                what: "mount",
                text: name.clone(),
                rule: "followed by a placement or beam of the machine file",
            }),
        }
    }

    /// Most motions that follow each other without a stop in between.
    #[must_use]
    pub fn longest_chain(&self) -> usize {
        self.steps
            .split(|step| !matches!(step.action, Action::Move(_) | Action::Set(_)))
            .map(<[Step]>::len)
            .max()
            .unwrap_or(0)
    }
}
