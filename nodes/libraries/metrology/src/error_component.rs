//! Names of geometric error components after ISO 230-1.
//!
//! An *error motion* `E` + direction + axis changes with the position of its axis: `EXY` is the
//! straightness error of Y in the direction of X, `ECX` the yaw of X. A *location error* `E` +
//! direction + `0` + axis is one number: `EC0Y` is the squareness of Y to X, `EX0C` the shift of the
//! axis of rotation C along X. The standard writes them with subscripts, E_{XY} and E_{C(0X)Y}.
//!
//! # References
//! \[1\] ISO 230-1:2012, 3.4 (error motions), 3.6 (location errors), annex A.

use std::fmt;
use std::str::FromStr;

use crate::axis::Axis;

/// One geometric error component.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ErrorComponent {
    /// X Y Z: a shift along it (mm); A B C: a turn about X Y Z (rad).
    pub direction: Axis,
    /// The axis whose error it is.
    pub of: Axis,
    /// Whether it is one number (location error) rather than a function of the axis' position.
    pub is_location: bool,
}

/// A text that names no error component.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("error component \"{name}\": must be E, direction and axis such as EXX, or such as EC0Y")]
pub struct UnknownErrorComponent {
    /// The text that was read.
    pub name: String,
}

impl ErrorComponent {
    /// The three squareness errors in the gauge used throughout: X is primary, Y second, Z third.
    pub const SQUARENESS: [Self; 3] = [
        Self::location(Axis::C, Axis::Y),
        Self::location(Axis::B, Axis::Z),
        Self::location(Axis::A, Axis::Z),
    ];

    /// Error motion of `of` in `direction`.
    #[must_use]
    pub const fn motion(direction: Axis, of: Axis) -> Self {
        Self {
            direction,
            of,
            is_location: false,
        }
    }

    /// Location error of `of` in `direction`.
    #[must_use]
    pub const fn location(direction: Axis, of: Axis) -> Self {
        Self {
            direction,
            of,
            is_location: true,
        }
    }

    /// The six error motions of an axis: EX_, EY_, EZ_, EA_, EB_, EC_.
    #[must_use]
    pub fn motions_of(of: Axis) -> [Self; 6] {
        Axis::ALL.map(|direction| Self::motion(direction, of))
    }

    /// The 21 components of three linear axes: 18 error motions, then [`Self::SQUARENESS`].
    pub fn twenty_one() -> impl Iterator<Item = Self> {
        Axis::LINEAR
            .into_iter()
            .flat_map(Self::motions_of)
            .chain(Self::SQUARENESS)
    }

    /// Whether it is a turn (rad) rather than a shift (mm).
    #[must_use]
    pub const fn is_angular(self) -> bool {
        !self.direction.is_linear()
    }

    /// In words for who does not know the symbols of ISO 230-1: `straightness of X along Y`, `squareness of Y to X`.
    #[must_use]
    pub fn in_words(self) -> String {
        let of = self.of;
        let about = match self.direction {
            Axis::X | Axis::A => Axis::X,
            Axis::Y | Axis::B => Axis::Y,
            Axis::Z | Axis::C => Axis::Z,
        };
        let is_own = self.direction == of;
        match (self.is_location, self.is_angular(), of.is_linear()) {
            // Two linear axes lie in the plane that stands upright on the axis of the turn.
            (true, true, true) => Axis::LINEAR
                .into_iter()
                .find(|other| *other != of && *other != about)
                .map_or_else(
                    || format!("orientation of {of} about {about}"),
                    |other| format!("squareness of {of} to {other}"),
                ),
            (true, true, false) => format!("orientation of axis {of} about {about}"),
            (true, false, _) => format!("location of axis {of} along {about}"),
            (false, _, _) if is_own => format!("positioning of {of}"),
            (false, false, true) => format!("straightness of {of} along {about}"),
            (false, true, true) if of == about => format!("roll of {of}"),
            (false, true, true) => format!("rotation of {of} about {about}"),
            (false, false, false) => format!("error motion of {of} along {about}"),
            (false, true, false) => format!("tilt of {of} about {about}"),
        }
    }
}

impl fmt::Display for ErrorComponent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let zero = if self.is_location { "0" } else { "" };
        write!(f, "E{}{zero}{}", self.direction, self.of)
    }
}

impl FromStr for ErrorComponent {
    type Err = UnknownErrorComponent;

    fn from_str(name: &str) -> Result<Self, UnknownErrorComponent> {
        let read = || {
            let letters = name.strip_prefix('E')?;
            let direction = letters.get(..1)?.parse().ok()?;
            let rest = letters.get(1..)?;
            let of = rest.strip_prefix('0').unwrap_or(rest);
            Some(Self {
                direction,
                of: of.parse().ok()?,
                is_location: of.len() < rest.len(),
            })
        };
        read().ok_or_else(|| UnknownErrorComponent {
            name: name.to_owned(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_iso_230_1_and_round_trip() {
        for name in ["EXX", "EYX", "ECX", "EC0Y", "EX0C", "EA0Z", "EAC"] {
            assert_eq!(name.parse::<ErrorComponent>().unwrap().to_string(), name);
        }
    }

    /// Names of ISO 230-1:2012, 3.4 to 3.6, of linear axes and of the axis C of a spindle.
    #[test]
    fn val_iso_230_1_components_have_words() {
        for (name, words) in [
            ("EXX", "positioning of X"),
            ("EYX", "straightness of X along Y"),
            ("EAX", "roll of X"),
            ("ECY", "rotation of Y about Z"),
            ("EC0Y", "squareness of Y to X"),
            ("EB0Z", "squareness of Z to X"),
            ("EA0Z", "squareness of Z to Y"),
            ("ECC", "positioning of C"),
            ("EXC", "error motion of C along X"),
            ("EAC", "tilt of C about X"),
            ("EX0C", "location of axis C along X"),
            ("EA0C", "orientation of axis C about X"),
        ] {
            let component: ErrorComponent = name.parse().unwrap();
            assert_eq!(component.in_words(), words);
        }
    }

    #[test]
    fn twenty_one_components_are_all_different() {
        let mut names: Vec<_> = ErrorComponent::twenty_one()
            .map(|c| c.to_string())
            .collect();
        assert_eq!(names.len(), 21);
        names.sort();
        names.dedup();
        assert_eq!(names.len(), 21);
    }

    #[test]
    fn a_wrong_name_is_refused_with_the_name() {
        for name in ["", "E", "EX", "XX", "EXQ", "E0XY", "EXYZ", "Exx", "EX00Y"] {
            let message = name.parse::<ErrorComponent>().unwrap_err().to_string();
            assert!(message.contains(&format!("\"{name}\"")), "{message}");
        }
    }
}
