//! A checked program: what the control does, step by step.

use metrology::PerAxis;

use crate::error::Place;

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
}

impl Program {
    /// Most motions that follow each other without a stop in between.
    #[must_use]
    pub fn longest_chain(&self) -> usize {
        self.steps
            .split(|step| !matches!(step.action, Action::Move(_)))
            .map(<[Step]>::len)
            .max()
            .unwrap_or(0)
    }
}
