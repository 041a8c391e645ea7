//! The kinematic chain, read from its ISO 10791-6 style string and walked as rigid bodies.
//!
//! ```text
//!   workpiece_from_tool = (W_1 W_2 ... W_m)^-1 (T_1 T_2 ... T_n)        (1)
//!   linear, tool side:       T = shift(+q e)                            (2)
//!   linear, workpiece side:  W = shift(-q e)                            (3)
//!   rotary, either side:     shift(o) turn(e, q) shift(-o)              (4)
//! ```
//!
//! Joints are numbered from the bed outwards. With every rotary axis at zero the tool stands at
//! (X, Y, Z) in the workpiece frame, which then coincides with the machine frame. A positive rotary
//! position turns the body that it carries by the right-hand rule about the machine's axis, on
//! either side of the chain.

use metrology::Axis;
use nalgebra::{Isometry, IsometryMatrix3, Rotation3, Translation3, Unit, Vector3};

use super::error::PlantError;

/// A rigid motion; nalgebra's own, with a matrix inside because points are many and products few.
pub(super) type Rigid = IsometryMatrix3<f64>;

/// One joint of the chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Joint {
    pub(super) axis: Axis,
    /// Whether it moves the workpiece rather than the tool.
    pub(super) on_workpiece_side: bool,
}

/// The chain: joints of each side from the bed outwards.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Chain {
    pub(super) workpiece_side: Vec<Joint>,
    pub(super) tool_side: Vec<Joint>,
}

/// A word of the chain string and its column, from 1.
type Word<'a> = (usize, &'a str);

impl Chain {
    /// Reads a chain such as `[w C' A' Y' b X Z t]`.
    pub(super) fn parse(chain: &str) -> Result<Self, PlantError> {
        let refuse = |column: usize, found: &str, expected: &'static str| PlantError::Chain {
            chain: chain.to_owned(),
            column,
            found: found.to_owned(),
            expected,
        };
        let inner = chain
            .strip_prefix('[')
            .ok_or_else(|| refuse(1, chain.get(..1).unwrap_or(""), "[ at the beginning"))?
            .strip_suffix(']')
            .ok_or_else(|| refuse(chain.chars().count(), "", "] at the end"))?;
        let words = words(inner);
        let end = chain.chars().count();
        let mut parsed = Self {
            workpiece_side: Vec::new(),
            tool_side: Vec::new(),
        };
        let (mut seen_bed, mut seen_tool) = (false, false);
        for (place, &(column, word)) in words.iter().enumerate() {
            match (place, word) {
                (0, "w") => {}
                (0, _) => return Err(refuse(column, word, "w, the workpiece, first")),
                _ if seen_tool => return Err(refuse(column, word, "nothing after t")),
                (_, "b") if !seen_bed => seen_bed = true,
                (_, "t") if seen_bed => seen_tool = true,
                _ => {
                    let joint = joint(word, !seen_bed)
                        .map_err(|expected| refuse(column, word, expected))?;
                    if parsed.joints().any(|other| other.axis == joint.axis) {
                        return Err(refuse(column, word, "each axis once"));
                    }
                    if seen_bed {
                        parsed.tool_side.push(joint);
                    } else {
                        parsed.workpiece_side.push(joint);
                    }
                }
            }
        }
        if !seen_tool {
            return Err(refuse(end, "", "w, b and t, in this order"));
        }
        parsed.workpiece_side.reverse();
        Ok(parsed)
    }

    /// Every joint, workpiece side first.
    pub(super) fn joints(&self) -> impl Iterator<Item = &Joint> {
        self.workpiece_side.iter().chain(&self.tool_side)
    }
}

fn words(inner: &str) -> Vec<Word<'_>> {
    let mut column = 2;
    let mut found = Vec::new();
    for word in inner.split(' ') {
        if !word.is_empty() {
            found.push((column, word));
        }
        column += word.chars().count() + 1;
    }
    found
}

fn joint(word: &str, on_workpiece_side: bool) -> Result<Joint, &'static str> {
    const SIDES: &str =
        "an axis letter X Y Z A B C, primed on the workpiece side of b and plain on the tool side";
    let letter = word.strip_suffix('\'');
    if letter.is_some() != on_workpiece_side {
        return Err(SIDES);
    }
    let axis = letter.unwrap_or(word).parse().map_err(|_| SIDES)?;
    Ok(Joint {
        axis,
        on_workpiece_side,
    })
}

impl Joint {
    /// (2), (3), (4): motion of the carried body at position `q` along or about `direction`.
    pub(super) fn motion(
        &self,
        q: f64,
        direction: &Vector3<f64>,
        origin_mm: &Vector3<f64>,
    ) -> Rigid {
        if self.axis.is_linear() {
            let sign = if self.on_workpiece_side { -1.0 } else { 1.0 };
            shift(direction * (sign * q))
        } else {
            turn_about(
                origin_mm,
                &Rotation3::from_axis_angle(&Unit::new_normalize(*direction), q),
            )
        }
    }
}

/// A pure shift.
pub(super) fn shift(by_mm: Vector3<f64>) -> Rigid {
    Isometry::from_parts(Translation3::from(by_mm), Rotation3::identity())
}

/// A turn that leaves `centre_mm` in place.
pub(super) fn turn_about(centre_mm: &Vector3<f64>, turn: &Rotation3<f64>) -> Rigid {
    Isometry::from_parts(Translation3::from(centre_mm - turn * centre_mm), *turn)
}

/// Unit vector of an axis: its line for a linear, its axis of rotation for a rotary axis.
pub(super) fn nominal_direction(axis: Axis) -> Vector3<f64> {
    match axis {
        Axis::X | Axis::A => Vector3::x(),
        Axis::Y | Axis::B => Vector3::y(),
        Axis::Z | Axis::C => Vector3::z(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axes(joints: &[Joint]) -> Vec<Axis> {
        joints.iter().map(|joint| joint.axis).collect()
    }

    #[test]
    fn joints_are_numbered_from_the_bed_outwards() {
        let chain = Chain::parse("[w C' A' Y' b X Z t]").unwrap();
        assert_eq!(axes(&chain.workpiece_side), [Axis::Y, Axis::A, Axis::C]);
        assert_eq!(axes(&chain.tool_side), [Axis::X, Axis::Z]);
        let chain = Chain::parse("[w X' Y' b Z t]").unwrap();
        assert_eq!(axes(&chain.workpiece_side), [Axis::Y, Axis::X]);
        let chain = Chain::parse("[w b X Y Z C A t]").unwrap();
        assert_eq!(
            axes(&chain.tool_side),
            [Axis::X, Axis::Y, Axis::Z, Axis::C, Axis::A]
        );
    }

    #[test]
    fn a_bad_chain_is_refused_with_column_and_word() {
        let told = |chain: &str| Chain::parse(chain).unwrap_err().to_string();
        assert!(told("[w C A' Y' b X Z t]").contains("column 4: \"C\": expected an axis letter"));
        assert!(told("[w X' b Y' Z t]").contains("column 9: \"Y'\""));
        assert!(told("[w X' X' b Z t]").contains("column 7: \"X'\": expected each axis once"));
        assert!(told("[X' b Z t]").contains("expected w, the workpiece, first"));
        assert!(told("[w X' b Z t t]").contains("expected nothing after t"));
        assert!(told("[w X' b Z]").contains("expected w, b and t"));
        assert!(told("w X' b Z t]").contains("expected [ at the beginning"));
        assert!(told("[w X' b Z t").contains("expected ] at the end"));
        assert!(told("").contains("expected [ at the beginning"));
        assert!(told("ä").contains("expected ["));
    }
}
