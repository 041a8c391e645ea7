//! Centre of an arc from its I J K or R words.
//!
//! With the start at the origin of the plane, the end at `e`, `h = |e|/2` and radius `r`:
//!
//! ```text
//!   centre = e/2 ± n √(r² - h²),   n = (-e₂, e₁)/|e|                    (1)
//! ```
//!
//! The sign is that for which the arc is at most half a circle where R is positive, and more than
//! half where it is negative. With I J K, the radii at start and end may differ by at most
//! [`ABSOLUTE_MISMATCH_MM`], or by [`RELATIVE_MISMATCH`] of the larger up to a hundred times that; the
//! arc is then a spiral that ends exactly at its programmed end.
//!
//! # References
//! LinuxCNC 2.9 `interp_internal.hh`: CENTER_ARC_RADIUS_TOLERANCE_MM, SPIRAL_RELATIVE_TOLERANCE,
//! RADIUS_TOLERANCE_MM. In inch mode LinuxCNC allows 2 * 0.001 * √2 in = 0.072 mm; here the metric value
//! holds in both.

use super::block::Block;
use super::program::Plane;
use super::words::Word;
use crate::error::ProgramError;
use metrology::Axis;

/// Difference of radii that is always accepted, mm.
pub const ABSOLUTE_MISMATCH_MM: f64 = 2.0 * 0.01 * std::f64::consts::SQRT_2;
/// Difference of radii that is accepted relative to the larger one.
pub const RELATIVE_MISMATCH: f64 = 0.001;
/// Least radius, and how far R may fall short of half the chord, mm.
pub const RADIUS_TOLERANCE_MM: f64 = 0.001_27;

impl Plane {
    /// First and second axis in the plane, then the normal.
    pub const fn axes(self) -> [Axis; 3] {
        match self {
            Self::Xy => [Axis::X, Axis::Y, Axis::Z],
            Self::Zx => [Axis::Z, Axis::X, Axis::Y],
            Self::Yz => [Axis::Y, Axis::Z, Axis::X],
        }
    }
}

/// The word that gives the centre along `axis`.
fn offset_letter(axis: Axis) -> char {
    match axis {
        Axis::X => 'I',
        Axis::Y => 'J',
        _ => 'K',
    }
}

/// Centre from the start, mm, of the arc that `block` describes; `end_mm` is its end from its start.
///
/// With `start_mm` the centre's words are a point of the same coordinates (G90.1), and both must be there.
pub fn centre_from_start(
    block: &Block,
    word: &Word,
    plane: Plane,
    clockwise: bool,
    end_mm: [f64; 2],
    mm_per_unit: f64,
    start_mm: Option<[f64; 2]>,
) -> Result<[f64; 2], ProgramError> {
    let [first, second, normal] = plane.axes();
    if let Some(stray) = block.word(offset_letter(normal)) {
        return Err(ProgramError::UnusedWord {
            at: block.at(stray),
            word: stray.text(),
        });
    }
    let offsets = [first, second].map(|axis| block.word(offset_letter(axis)));
    match (block.word('R'), offsets) {
        (Some(radius), [None, None]) => {
            if block.axis(first).is_none() && block.axis(second).is_none() {
                return Err(ProgramError::Needs {
                    at: block.at(radius),
                    word: radius.text(),
                    needs: "an end point in the plane of the arc",
                });
            }
            from_radius(block, radius, clockwise, end_mm, radius.value * mm_per_unit)
        }
        (Some(radius), [offset, other]) => {
            let offset = offset.or(other).map_or_else(String::new, Word::text);
            Err(ProgramError::Conflict {
                at: block.at(radius),
                word: radius.text(),
                other: offset,
            })
        }
        (None, [None, None]) => Err(ProgramError::Needs {
            at: block.at(word),
            word: word.text(),
            needs: "R, or the centre along an axis of its plane",
        }),
        (None, offsets) => {
            let words = offsets.map(|offset| offset.map(|word| word.value * mm_per_unit));
            let centre = match (words, start_mm) {
                (words, None) => words.map(|word| word.unwrap_or(0.0)),
                ([Some(first), Some(second)], Some(start)) => [first - start[0], second - start[1]],
                (_, Some(_)) => {
                    return Err(ProgramError::Needs {
                        at: block.at(word),
                        word: word.text(),
                        needs: "both coordinates of its centre, by G90.1",
                    });
                }
            };
            check_radii(block, word, centre, end_mm)?;
            Ok(centre)
        }
    }
}

fn check_radii(
    block: &Block,
    word: &Word,
    centre: [f64; 2],
    end: [f64; 2],
) -> Result<(), ProgramError> {
    let at = block.at(word);
    let start_mm = centre[0].hypot(centre[1]);
    let end_mm = (end[0] - centre[0]).hypot(end[1] - centre[1]);
    let least = start_mm.min(end_mm);
    if least < RADIUS_TOLERANCE_MM {
        return Err(ProgramError::ArcRadiusTooSmall {
            at,
            radius_mm: least,
            limit_mm: RADIUS_TOLERANCE_MM,
        });
    }
    let relative_mm = RELATIVE_MISMATCH * start_mm.max(end_mm);
    let limit_mm = relative_mm.clamp(ABSOLUTE_MISMATCH_MM, 100.0 * ABSOLUTE_MISMATCH_MM);
    if (start_mm - end_mm).abs() > limit_mm {
        return Err(ProgramError::ArcRadiusMismatch {
            at,
            start_mm,
            end_mm,
            limit_mm,
        });
    }
    Ok(())
}

fn from_radius(
    block: &Block,
    word: &Word,
    clockwise: bool,
    end: [f64; 2],
    radius_mm: f64,
) -> Result<[f64; 2], ProgramError> {
    let chord_mm = end[0].hypot(end[1]);
    let half_mm = chord_mm / 2.0;
    let at = block.at(word);
    if chord_mm < 1e-9 {
        return Err(ProgramError::Needs {
            at,
            word: word.text(),
            needs: "an end point away from the start; a full circle takes I J K",
        });
    }
    if radius_mm.abs() < half_mm - RADIUS_TOLERANCE_MM {
        return Err(ProgramError::ArcRadiusTooSmall {
            at,
            radius_mm: radius_mm.abs(),
            limit_mm: half_mm,
        });
    }
    let height = (radius_mm * radius_mm - half_mm * half_mm).max(0.0).sqrt();
    // A short counter-clockwise arc has its centre on the left of the chord.
    let side = if clockwise == (radius_mm > 0.0) {
        -height
    } else {
        height
    };
    Ok([
        end[0] / 2.0 - side * end[1] / chord_mm,
        end[1] / 2.0 + side * end[0] / chord_mm,
    ])
}
