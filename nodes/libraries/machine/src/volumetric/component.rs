//! Which geometric error components a chain has, and which of them describe it without repetition.
//!
//! | axis | needed | has an effect but says nothing new |
//! |---|---|---|
//! | linear | six error motions; EC0Y, EB0Z, EA0Z where both axes exist | other tilts of linear axes: gauge |
//! | rotary on the table | six error motions, two displacements and two tilts of its line | its zero position (E A 0 A and the like) |
//! | rotary in the head | the same, and the zero position of A and B: it tilts the tool | the zero position of C: about the tool |
//!
//! Location errors of rotary axes leave out what does not move a line: the displacement along it.
//! All these are needed where the tool offset is free. With one offset only, some error motions act
//! alike (for `[w X' Y' b Z t]`: EXY and the yaw ECY at one height), which recordings must show.

use metrology::{Axis, ErrorComponent};
use nalgebra::Vector3;

use super::member::members;
use crate::chain::Chain;
use crate::kinematics::direction_of;

/// The components that describe a chain without repetition: error motions in the order X Y Z A B C,
/// squareness, then location errors of rotary axes. For three linear axes, the 21.
#[must_use]
pub fn components_of(chain: &Chain) -> Vec<ErrorComponent> {
    let axes = chain.axes();
    let motions = axes.iter().flat_map(ErrorComponent::motions_of);
    let squareness = ErrorComponent::SQUARENESS
        .into_iter()
        .filter(|component| has_component(chain, *component));
    let lines = axes
        .iter()
        .filter(|axis| !axis.is_linear())
        .flat_map(|axis| Axis::ALL.map(|direction| ErrorComponent::location(direction, axis)))
        .filter(|component| moves_line(*component) || tilts_tool(chain, *component));
    motions.chain(squareness).chain(lines).collect()
}

/// Whether a component has a meaning for a chain: [`components_of`], and the zero position of every
/// rotary axis.
#[must_use]
pub fn has_component(chain: &Chain, component: ErrorComponent) -> bool {
    let axes = chain.axes();
    if !axes.contains(component.of) {
        return false;
    }
    if !component.is_location {
        return true;
    }
    if !component.of.is_linear() {
        return moves_line(component) || component.direction == component.of;
    }
    let against = match component {
        c if c == ErrorComponent::SQUARENESS[0] || c == ErrorComponent::SQUARENESS[1] => Axis::X,
        c if c == ErrorComponent::SQUARENESS[2] => Axis::Y,
        _ => return false,
    };
    axes.contains(against)
}

/// Way of the tip per rad of a squareness and mm of the axis' position, first order: the axis is turned
/// about the direction of its first letter.
#[must_use]
pub fn lean(squareness: ErrorComponent) -> Vector3<f64> {
    direction_of(squareness.direction).cross(&direction_of(squareness.of))
}

/// Whether it displaces or tilts the line of a rotary axis.
fn moves_line(component: ErrorComponent) -> bool {
    component.is_location && direction_of(component.direction) != direction_of(component.of)
}

/// Whether it is the zero position of an axis that tilts the tool against a spindle along Z.
fn tilts_tool(chain: &Chain, component: ErrorComponent) -> bool {
    component.direction == component.of
        && component.of != Axis::C
        && members(chain).any(|m| m.axis == component.of && !m.carries_workpiece)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(chain: &str) -> Vec<String> {
        let chain = chain.parse().expect("a chain");
        components_of(&chain)
            .iter()
            .map(ToString::to_string)
            .collect()
    }

    #[test]
    fn three_linear_axes_have_the_21() {
        for chain in ["[w X' Y' b Z t]", "[w b X Y Z t]", "[w X' Y' Z' b t]"] {
            let expected: Vec<_> = ErrorComponent::twenty_one()
                .map(|c| c.to_string())
                .collect();
            assert_eq!(names(chain), expected);
        }
    }

    #[test]
    fn a_table_table_machine_has_eight_location_errors_of_its_rotary_axes() {
        let found = names("[w C' A' Y' b X Z t]");
        assert_eq!(found.len(), 30 + 3 + 8);
        assert_eq!(
            found[33..],
            [
                "EY0A", "EZ0A", "EB0A", "EC0A", "EX0C", "EY0C", "EA0C", "EB0C"
            ]
        );
    }

    #[test]
    fn a_head_has_the_zero_position_that_tilts_the_tool() {
        let found = names("[w b X Y Z C A t]");
        assert_eq!(found.len(), 30 + 3 + 9);
        assert!(found.contains(&String::from("EA0A")));
        assert!(!found.contains(&String::from("EC0C")));
        let mixed = names("[w C' X' b Y Z B t]");
        assert_eq!(
            mixed[33..],
            [
                "EX0B", "EZ0B", "EA0B", "EB0B", "EC0B", "EX0C", "EY0C", "EA0C", "EB0C"
            ]
        );
    }

    #[test]
    fn location_errors_without_a_meaning_are_not_there() {
        let chain: Chain = "[w C' A' Y' b X Z t]".parse().expect("a chain");
        let has = |name: &str| has_component(&chain, name.parse().expect("a component"));
        for name in ["EC0C", "EA0A", "EC0Y", "EXC"] {
            assert!(has(name), "{name}");
        }
        for name in [
            "EZ0C", "EX0A", "EX0Y", "EC0X", "EA0Y", "EC0Z", "EXB", "EX0B",
        ] {
            assert!(!has(name), "{name}");
        }
        let two: Chain = "[w X' b Z t]".parse().expect("a chain");
        assert!(!has_component(&two, ErrorComponent::SQUARENESS[2]));
        assert_eq!(components_of(&two).len(), 13);
    }

    #[test]
    fn a_squareness_leans_as_its_sign_is_stated() {
        for (component, against) in ErrorComponent::SQUARENESS.into_iter().zip([0, 0, 1]) {
            let opens = metrology::squareness::opening(component);
            // Towards the plus of the other axis closes the angle.
            let towards = lean(component)[against];
            assert!((towards + opens).abs() < 1e-12, "{component}: {towards}");
        }
    }
}
