//! Machine axes by their ISO 841 letters, and values held per axis without allocation.

use std::fmt;
use std::ops::{Index, IndexMut};
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A machine axis by its ISO 841 letter: X Y Z linear, A B C rotary about them.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema,
)]
#[expect(missing_docs, reason = "the letters are the documentation")]
pub enum Axis {
    X,
    Y,
    Z,
    A,
    B,
    C,
}

/// A letter that names no axis.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("axis \"{name}\": must be one of X Y Z A B C")]
pub struct UnknownAxis {
    /// The text that was read.
    pub name: String,
}

impl Axis {
    /// Every axis, in the order in which [`PerAxis`] stores them.
    pub const ALL: [Self; 6] = [Self::X, Self::Y, Self::Z, Self::A, Self::B, Self::C];
    /// The linear axes.
    pub const LINEAR: [Self; 3] = [Self::X, Self::Y, Self::Z];
    /// The rotary axes.
    pub const ROTARY: [Self; 3] = [Self::A, Self::B, Self::C];

    /// Whether positions along this axis are lengths (mm) rather than angles (rad).
    #[must_use]
    #[inline]
    pub const fn is_linear(self) -> bool {
        matches!(self, Self::X | Self::Y | Self::Z)
    }

    /// Place in [`PerAxis`]; 0, 1, 2 for X, Y, Z.
    #[must_use]
    #[inline]
    pub const fn index(self) -> usize {
        self as usize
    }

    /// The capital letter.
    #[must_use]
    pub const fn letter(self) -> &'static str {
        ["X", "Y", "Z", "A", "B", "C"][self as usize]
    }
}

impl fmt::Display for Axis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.letter())
    }
}

impl FromStr for Axis {
    type Err = UnknownAxis;

    fn from_str(name: &str) -> Result<Self, UnknownAxis> {
        Self::ALL
            .into_iter()
            .find(|axis| axis.letter() == name)
            .ok_or_else(|| UnknownAxis {
                name: name.to_owned(),
            })
    }
}

/// Which axes a machine or a sample has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AxisSet(u8);

impl AxisSet {
    /// No axis.
    pub const EMPTY: Self = Self(0);
    /// X, Y and Z.
    pub const XYZ: Self = Self(0b111);

    /// This set and one more axis.
    #[must_use]
    pub const fn with(self, axis: Axis) -> Self {
        Self(self.0 | 1 << axis.index())
    }

    /// Whether `axis` is in the set.
    #[must_use]
    pub const fn contains(self, axis: Axis) -> bool {
        self.0 & (1 << axis.index()) != 0
    }

    /// Number of axes.
    #[must_use]
    pub const fn len(self) -> usize {
        self.0.count_ones() as usize
    }

    /// Whether there is none.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The axes in the order X Y Z A B C.
    pub fn iter(self) -> impl Iterator<Item = Axis> {
        Axis::ALL
            .into_iter()
            .filter(move |axis| self.contains(*axis))
    }
}

impl FromIterator<Axis> for AxisSet {
    fn from_iter<I: IntoIterator<Item = Axis>>(axes: I) -> Self {
        axes.into_iter().fold(Self::EMPTY, Self::with)
    }
}

/// One value for each of the six possible axes, indexed by [`Axis`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PerAxis<T>(pub [T; 6]);

impl<T> Index<Axis> for PerAxis<T> {
    type Output = T;

    fn index(&self, axis: Axis) -> &T {
        &self.0[axis.index()]
    }
}

impl<T> IndexMut<Axis> for PerAxis<T> {
    fn index_mut(&mut self, axis: Axis) -> &mut T {
        &mut self.0[axis.index()]
    }
}

impl<T> PerAxis<T> {
    /// Builds each value from its axis.
    pub fn from_fn(f: impl FnMut(Axis) -> T) -> Self {
        Self(Axis::ALL.map(f))
    }
}

impl PerAxis<f64> {
    /// The linear part (mm).
    #[must_use]
    pub fn xyz(&self) -> nalgebra::Vector3<f64> {
        nalgebra::Vector3::new(self.0[0], self.0[1], self.0[2])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_round_trip() {
        for axis in Axis::ALL {
            assert_eq!(axis.letter().parse::<Axis>(), Ok(axis));
        }
        assert_eq!(
            "x".parse::<Axis>().unwrap_err().to_string(),
            "axis \"x\": must be one of X Y Z A B C"
        );
    }

    #[test]
    fn a_set_lists_its_axes_in_machine_order() {
        let set: AxisSet = [Axis::C, Axis::X, Axis::A].into_iter().collect();
        assert_eq!(set.iter().collect::<Vec<_>>(), [Axis::X, Axis::A, Axis::C]);
        assert_eq!(set.len(), 3);
    }
}
