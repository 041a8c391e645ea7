//! Modal state that a control keeps between programs: work systems, shifts, tool length and modes.
//!
//! # Model
//!
//! ```text
//!   m = R(θ) (p + s) + w + t                                              (1)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | p | coordinates of the program | mm, rad |
//! | m | coordinates of the machine | mm, rad |
//! | s | [`Registers::shift`], by G92 or G52 | mm, rad |
//! | w, θ | [`WorkSystem`] in use, G54 to G59.3 | mm, rad, deg |
//! | t | [`Registers::tool`], by G43 or G43.1 | mm, rad |
//!
//! R turns X and Y about Z, counter-clockwise; the other axes add up. Without a rotation (1) is a sum,
//! so a control whose offsets are all zero moves to the very numbers of the program.
//!
//! # References
//! LinuxCNC 2.9: `rotate_and_offset_pos` in `emccanon.cc` for the order of (1); `convert_axis_offsets`,
//! `convert_setup` and `convert_stop` in `interp_convert.cc` for the rules.

use metrology::{Axis, AxisSet, PerAxis};

use super::program::Plane;

/// Names of the work systems, in the order of G10 L2 P1 to P9.
pub const SYSTEMS: [&str; 9] = [
    "G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3",
];

/// Origin and rotation of one work system.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WorkSystem {
    /// Its origin in machine coordinates, mm or rad.
    pub origin: PerAxis<f64>,
    /// Rotation about Z, counter-clockwise, deg.
    pub rotation_deg: f64,
}

impl WorkSystem {
    /// Whether its coordinates are those of the machine.
    #[must_use]
    pub fn is_zero(&self) -> bool {
        is_zero(&self.origin) && self.rotation_deg == 0.0
    }
}

/// How motions follow each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PathMode {
    /// G61 and G64: along the exact path, without a stop.
    #[default]
    ExactPath,
    /// G61.1: with a stop after each motion.
    ExactStop,
}

/// Modes that a word sets and another word replaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Modes {
    /// G17, G18 or G19.
    pub plane: Plane,
    /// G20.
    pub is_inch: bool,
    /// G91.
    pub is_incremental: bool,
    /// G90.1: centres of arcs are points of the work system.
    pub has_absolute_centres: bool,
    /// G61, G61.1 or G64.
    pub path: PathMode,
}

impl Default for Modes {
    fn default() -> Self {
        Self {
            plane: Plane::Xy,
            is_inch: false,
            is_incremental: false,
            has_absolute_centres: false,
            path: PathMode::ExactPath,
        }
    }
}

/// One change of the state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Change {
    /// G10 L2: a work system becomes this one.
    System {
        /// Index into [`SYSTEMS`].
        index: usize,
        /// What it becomes.
        to: WorkSystem,
    },
    /// G54 to G59.3: index into [`SYSTEMS`].
    Select(usize),
    /// G52 and the G92 family.
    Shift {
        /// What is added from now on.
        to: PerAxis<f64>,
        /// What G92.3 takes up again.
        stored: PerAxis<f64>,
    },
    /// G43, G43.1 and G49.
    Tool(PerAxis<f64>),
    /// Plane, units, distance modes and path mode.
    Modes(Modes),
}

/// The state of a control.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Registers {
    /// Work systems in the order of [`SYSTEMS`].
    pub systems: [WorkSystem; SYSTEMS.len()],
    /// Index of the one in use.
    pub system: usize,
    /// Shift in effect, by G92 or G52, mm or rad.
    pub shift: PerAxis<f64>,
    /// Shift that G92.3 takes up again, mm or rad.
    pub stored_shift: PerAxis<f64>,
    /// Tool length offset in effect, mm or rad.
    pub tool: PerAxis<f64>,
    /// Modes.
    pub modes: Modes,
}

impl Registers {
    /// Makes `change`.
    pub const fn apply(&mut self, change: &Change) {
        match *change {
            Change::System { index, to } => self.systems[index] = to,
            Change::Select(index) => self.system = index,
            Change::Shift { to, stored } => {
                self.shift = to;
                self.stored_shift = stored;
            }
            Change::Tool(to) => self.tool = to,
            Change::Modes(to) => self.modes = to,
        }
    }

    /// What M2 resets: G54, G17, G90; offsets, units, centres and path mode stay.
    pub const fn end_program(&mut self) {
        self.system = 0;
        self.modes.plane = Plane::Xy;
        self.modes.is_incremental = false;
    }

    /// The work system in use.
    #[must_use]
    pub const fn in_use(&self) -> &WorkSystem {
        &self.systems[self.system]
    }

    /// The first work system without origin and rotation.
    #[must_use]
    pub fn first_zero_system(&self) -> Option<usize> {
        self.systems.iter().position(WorkSystem::is_zero)
    }

    /// The coordinates in use.
    #[must_use]
    pub fn frame(&self) -> Frame {
        let system = self.in_use();
        let turned = system.rotation_deg != 0.0;
        let (sin, cos) = system.rotation_deg.to_radians().sin_cos();
        Frame {
            turn: turned.then_some([cos, sin]),
            shift: self.shift,
            origin: PerAxis::from_fn(|axis| system.origin[axis] + self.tool[axis]),
        }
    }
}

/// Coordinates of a program against those of the machine, by (1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Cosine and sine of the rotation about Z, where there is one.
    turn: Option<[f64; 2]>,
    shift: PerAxis<f64>,
    origin: PerAxis<f64>,
}

impl Frame {
    /// Cosine and sine of the rotation about Z, where there is one.
    #[must_use]
    pub const fn turn(&self) -> Option<[f64; 2]> {
        self.turn
    }

    /// Machine coordinate of an axis that no rotation touches.
    #[must_use]
    pub fn machine_of(&self, axis: Axis, program: f64) -> f64 {
        program + self.shift[axis] + self.origin[axis]
    }

    /// Machine coordinates of a point of the program.
    #[must_use]
    pub fn machine(&self, program: &PerAxis<f64>) -> PerAxis<f64> {
        let shifted = PerAxis::from_fn(|axis| program[axis] + self.shift[axis]);
        let turned = turn(&shifted, self.turn, 1.0);
        PerAxis::from_fn(|axis| turned[axis] + self.origin[axis])
    }

    /// Coordinates of the program at a point of the machine, mm and rad: the inverse of `machine`.
    #[must_use]
    pub fn program(&self, machine: &PerAxis<f64>) -> PerAxis<f64> {
        let from_origin = PerAxis::from_fn(|axis| machine[axis] - self.origin[axis]);
        let turned = turn(&from_origin, self.turn, -1.0);
        PerAxis::from_fn(|axis| turned[axis] - self.shift[axis])
    }

    /// A way of the program along the machine's axes.
    #[must_use]
    pub fn machine_way(&self, program: &PerAxis<f64>) -> PerAxis<f64> {
        turn(program, self.turn, 1.0)
    }

    /// A way of the machine along the program's axes.
    #[must_use]
    pub fn program_way(&self, machine: &PerAxis<f64>) -> PerAxis<f64> {
        turn(machine, self.turn, -1.0)
    }
}

fn turn(of: &PerAxis<f64>, turn: Option<[f64; 2]>, sense: f64) -> PerAxis<f64> {
    let Some([cos, sin]) = turn else {
        return *of;
    };
    let sin = sense * sin;
    let mut turned = *of;
    turned[Axis::X] = of[Axis::X] * cos - of[Axis::Y] * sin;
    turned[Axis::Y] = of[Axis::X] * sin + of[Axis::Y] * cos;
    turned
}

pub(super) fn is_zero(of: &PerAxis<f64>) -> bool {
    of.0.iter().all(|value| *value == 0.0)
}

/// The word that takes such offsets away: G52 with zero for each axis that has one.
pub(super) fn list_zeros(of: &PerAxis<f64>, axes: AxisSet) -> String {
    let with_offset = axes.iter().filter(|axis| of[*axis] != 0.0);
    with_offset.fold("G52".to_owned(), |text, axis| format!("{text} {axis}0"))
}

/// Lists values of `axes` that are not zero, as the words that set them: `X10 Y-2.5`, mm and deg.
pub(super) fn list(of: &PerAxis<f64>, axes: AxisSet) -> String {
    let mut text = String::new();
    for axis in axes.iter().filter(|axis| of[*axis] != 0.0) {
        let value = if axis.is_linear() {
            of[axis]
        } else {
            of[axis].to_degrees()
        };
        let rounded = (value * 1e6).round() / 1e6;
        let value = if rounded == 0.0 { value } else { rounded };
        let separator = if text.is_empty() { "" } else { " " };
        text = format!("{text}{separator}{axis}{value}");
    }
    text
}

/// A work system with its name and values: `G55 X10 R30`.
pub(super) fn list_system(index: usize, system: &WorkSystem, axes: AxisSet) -> String {
    let origin = list(&system.origin, axes);
    let rotation = if system.rotation_deg == 0.0 {
        String::new()
    } else {
        format!("R{}", system.rotation_deg)
    };
    [SYSTEMS[index], &origin, &rotation]
        .into_iter()
        .filter(|part| !part.is_empty())
        .collect::<Vec<_>>()
        .join(" ")
}
