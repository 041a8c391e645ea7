//! Eyes on a running program: where its first moves really lead, and whether the probe is touched outside a touch.
//!
//! The first moves of a machine-frame program go up and away. At the end of each of its leading G0 the axes must
//! stand where the program says; what still shifts them then (an external offset, a remap, the kinematics) is no
//! offset that LinuxCNC reports. Where the machine has rotary axes, positions are compared once the program has
//! them at zero.

use std::collections::VecDeque;
use std::fmt;

use metrology::{Axis, AxisSet, PerAxis};

use crate::samples::{PROBING, Record};

/// Leading moves that are compared.
const MOST_CHECKS: usize = 16;
/// Commanded and programmed position are equal to within this, mm or rad, and within a servo period's travel.
const EQUAL_POSITIONS: f64 = 0.01;

/// Something that ends a program at once.
#[derive(Clone, Debug, PartialEq)]
pub enum Trouble {
    /// The probe was touched while no touch was under way.
    Tripped {
        /// Line that was being executed.
        line: u32,
        /// Motor positions, mm.
        motor_mm: [f64; 3],
    },
    /// An axis does not go where the program says.
    Astray {
        /// Line whose end it is.
        line: u32,
        /// Axis.
        axis: Axis,
        /// Where the program sends it, mm or rad.
        programmed: f64,
        /// Where it was sent, mm or rad.
        commanded: f64,
    },
}

impl fmt::Display for Trouble {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tripped {
                line,
                motor_mm: [x, y, z],
            } => write!(
                f,
                "line {line}: the probe was touched outside a touch, at X {x:.3} Y {y:.3} Z {z:.3} mm: the program \
                 is stopped; move the probe away by hand and see what stands there"
            ),
            Self::Astray {
                line,
                axis,
                programmed,
                commanded,
            } => {
                let (unit, scale) = if axis.is_linear() {
                    ("mm", 1.0)
                } else {
                    ("deg", 1f64.to_degrees())
                };
                let (programmed, commanded) = (programmed * scale, commanded * scale);
                write!(
                    f,
                    "line {line}: the program sends axis {axis} to {programmed:.3} {unit} and the machine went to \
                     {commanded:.3} {unit}, {:.3} {unit} beyond: something shifts the axes that is no work offset, \
                     G92, G52 or tool length (an external offset, a remap, the kinematics); take it off at the control",
                    commanded - programmed
                )
            }
        }
    }
}

/// Where axes must be at the end of a line.
#[derive(Clone, Debug, PartialEq)]
struct Check {
    line: u32,
    targets: Vec<(Axis, f64)>,
}

/// What is watched of one program.
#[derive(Clone, Debug, Default)]
pub struct Watch {
    checks: VecDeque<Check>,
    before: Option<Record>,
    step: f64,
}

impl Watch {
    /// Of a program; where its coordinates are not the machine's, no position is compared.
    #[must_use]
    pub fn new(text: &str, is_machine_frame: bool, axes: AxisSet) -> Self {
        Self {
            checks: if is_machine_frame {
                leading_moves(text, axes)
            } else {
                VecDeque::new()
            },
            ..Self::default()
        }
    }

    /// Records are missing.
    pub fn gap(&mut self) {
        self.before = None;
    }

    /// Takes the next record of the running program.
    pub fn step(&mut self, record: &Record) -> Option<Trouble> {
        let moves = record.motion_type != 0;
        let Some(before) = self.before.replace(*record) else {
            // The line of a program before this one may still be told while nothing moves.
            let line = if moves { record.line } else { 0 };
            self.before = Some(Record { line, ..*record });
            return None;
        };
        let tripped = record.probe_closed && !before.probe_closed;
        if tripped && moves && record.motion_type != PROBING {
            return Some(Trouble::Tripped {
                line: record.line,
                motor_mm: Axis::LINEAR.map(|axis| record.motor[axis]),
            });
        }
        // What stands still after a move may have been stopped in it; that the next line moves says that it ended.
        if !moves || record.line == 0 {
            self.before = Some(Record {
                line: before.line,
                ..*record
            });
            return None;
        }
        let trouble = (record.line != before.line)
            .then(|| self.arrived(&before))
            .flatten();
        self.step = Axis::ALL.into_iter().fold(0.0, |greatest: f64, axis| {
            greatest.max((record.commanded[axis] - before.commanded[axis]).abs())
        });
        trouble
    }

    fn arrived(&mut self, last: &Record) -> Option<Trouble> {
        while let Some(check) = self.checks.front() {
            if check.line > last.line {
                return None;
            }
            let check = self.checks.pop_front()?;
            if check.line < last.line {
                // It moved nothing.
                continue;
            }
            let near = EQUAL_POSITIONS + self.step;
            let astray = { check.targets.iter() }
                .find(|(axis, target)| (last.commanded[*axis] - target).abs() > near);
            return astray.map(|(axis, target)| Trouble::Astray {
                line: check.line,
                axis: *axis,
                programmed: *target,
                commanded: last.commanded[*axis],
            });
        }
        None
    }
}

/// The moves before the first line that is no plain G0, with all that is known of the axes at their ends.
fn leading_moves(text: &str, axes: AxisSet) -> VecDeque<Check> {
    let mut known = PerAxis::<Option<f64>>::default();
    let mut checks = VecDeque::new();
    let mut rapid = false;
    for (line, text) in (1..).zip(text.lines()) {
        let Some(words) = plain_words(text) else {
            break;
        };
        let mut moves = false;
        for (letter, value) in words {
            match (
                letter,
                Axis::ALL.into_iter().find(|axis| axis.letter() == letter),
            ) {
                (_, Some(axis)) => {
                    moves = true;
                    let inner = if axis.is_linear() {
                        value
                    } else {
                        value.to_radians()
                    };
                    known[axis] = Some(inner);
                }
                ("G", None) if tenths(value) == Some(0) => rapid = true,
                ("G", None) if tenths(value).is_some_and(|code| HARMLESS.contains(&code)) => {}
                ("N" | "F" | "S", None) => {}
                ("M", None) if matches!(tenths(value), Some(30 | 40 | 50)) => {}
                _ => return checks,
            }
        }
        if !moves {
            continue;
        }
        let level = { axes.iter() }.all(|axis| axis.is_linear() || known[axis] == Some(0.0));
        if !rapid || checks.len() == MOST_CHECKS {
            return checks;
        }
        if level {
            let targets = { axes.iter() }
                .filter_map(|axis| Some((axis, known[axis]?)))
                .collect();
            checks.push_back(Check { line, targets });
        }
    }
    checks
}

/// G words that neither move nor change what a position means, times ten.
const HARMLESS: [u32; 12] = [170, 180, 190, 210, 400, 490, 610, 611, 800, 900, 911, 940];

/// Ten times the number of a G or M word, where that is a whole number of a known size.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "checked to lie in 0..=2000"
)]
pub fn tenths(value: f64) -> Option<u32> {
    let tenths = (value * 10.0).round();
    let whole = (value * 10.0 - tenths).abs() < 1e-6;
    (whole && (0.0..=2000.0).contains(&tenths)).then_some(tenths as u32)
}

/// Letter and number of each word outside comments; `None` where a block has anything else.
pub fn plain_words(block: &str) -> Option<Vec<(&str, f64)>> {
    let mut words = Vec::new();
    let mut rest = block.trim();
    while let Some(first) = rest.chars().next() {
        if first == '(' {
            rest = rest.split_once(')')?.1.trim_start();
            continue;
        }
        if first == ';' {
            break;
        }
        if !first.is_ascii_alphabetic() {
            return None;
        }
        let (letter, behind) = rest.split_at(1);
        let behind = behind.trim_start();
        let end = behind
            .find(|c: char| !(c.is_ascii_digit() || "+-.".contains(c)))
            .unwrap_or(behind.len());
        words.push((letter, behind[..end].parse().ok()?));
        rest = behind[end..].trim_start();
    }
    Some(words)
}
