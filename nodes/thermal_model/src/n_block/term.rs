//! The unknowns of an affine drift: offsets, scales, rotations and shears.

use metrology::{Axis, PerAxis};
use nalgebra::Vector3;

use crate::two_block::SlopeLimit;

/// One unknown of (1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Term {
    /// t of one axis.
    Offset(Axis),
    /// s of one axis.
    Scale(Axis),
    /// ω about one axis.
    Rotation(Axis),
    /// Shear in the plane whose normal is the axis.
    Shear(Axis),
}

impl Term {
    /// All terms in the order in which they are tried.
    pub const ALL: [Self; 12] = [
        Self::Offset(Axis::X),
        Self::Offset(Axis::Y),
        Self::Offset(Axis::Z),
        Self::Scale(Axis::X),
        Self::Scale(Axis::Y),
        Self::Scale(Axis::Z),
        Self::Rotation(Axis::Z),
        Self::Rotation(Axis::X),
        Self::Rotation(Axis::Y),
        Self::Shear(Axis::Z),
        Self::Shear(Axis::X),
        Self::Shear(Axis::Y),
    ];

    /// Contribution of a unit of this term to the drift of `axis` at `r`.
    pub(super) fn column(self, axis: Axis, r: &Vector3<f64>) -> f64 {
        match self {
            Self::Offset(own) => f64::from(own == axis),
            _ => self.gradient(axis).dot(r),
        }
    }

    /// ∂d_axis/∂r for a unit of this term.
    pub(super) fn gradient(self, axis: Axis) -> Vector3<f64> {
        let mut gradient = Vector3::zeros();
        let row = self.axis().index();
        let (next, previous) = ((row + 1) % 3, (row + 2) % 3);
        match self {
            Self::Offset(_) => {}
            Self::Scale(own) if own == axis => gradient[row] = 1.0,
            Self::Scale(_) => {}
            // ω × r about axis k: the next axis receives ω times the previous one's coordinate with
            // a minus, the previous receives ω times the next one's.
            Self::Rotation(_) | Self::Shear(_) => {
                let sign = if matches!(self, Self::Rotation(_)) {
                    -1.0
                } else {
                    1.0
                };
                if axis.index() == next {
                    gradient[previous] = sign;
                } else if axis.index() == previous {
                    gradient[next] = 1.0;
                }
            }
        }
        gradient
    }

    pub(super) fn axis(self) -> Axis {
        match self {
            Self::Offset(a) | Self::Scale(a) | Self::Rotation(a) | Self::Shear(a) => a,
        }
    }

    /// The travel over which an error of this term acts.
    pub(super) fn limit(self, limits: &PerAxis<SlopeLimit>) -> SlopeLimit {
        match self {
            Self::Offset(a) | Self::Scale(a) => limits[a],
            Self::Rotation(a) | Self::Shear(a) => Axis::LINEAR
                .into_iter()
                .filter(|other| *other != a)
                .map(|other| limits[other])
                .max_by(|a, b| a.travel_mm.total_cmp(&b.travel_mm))
                .unwrap_or(limits[a]),
        }
    }
}
