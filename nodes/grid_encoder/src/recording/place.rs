//! Where and how a recording is made: plane, circle, tool offset, zero and set-up.
//!
//! Two facts of procedure decide what can be told apart later. The *zero* of the grid is a pair of
//! unknowns for all recordings made between two zeroings. The *set-up* is an unknown turn of the plate for
//! all recordings made without mounting it anew. Two circles under one zero tell more than two zeroed
//! each by itself.

use metrology::sample::{Sense, TestKind, TestPlane, TestSegment};
use metrology::{Axis, PerAxis};
use nalgebra::Vector3;

/// Where and how a recording is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Trajectory.
    pub kind: TestKind,
    /// Plane of plate and trajectory.
    pub plane: TestPlane,
    /// Centre in the machine frame, mm.
    pub centre_mm: Vector3<f64>,
    /// Nominal radius, mm; zero where there is none.
    pub radius_mm: f64,
    /// Feed, mm/s.
    pub feed_mm_s: f64,
    /// Sense.
    pub sense: Sense,
    /// Stops; zero: recorded while moving.
    pub stations: u32,
    /// From the point that the axis positions name to the head, mm.
    pub tool_offset_mm: Vector3<f64>,
    /// What stays as it is from recording to recording.
    pub fixture: Fixture,
}

/// Zero and set-up of the plate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Fixture {
    /// Changes whenever the grid is zeroed anew.
    pub zero_id: u32,
    /// Changes whenever the plate is mounted anew.
    pub setup_id: u32,
}

impl From<&TestSegment> for Place {
    fn from(segment: &TestSegment) -> Self {
        Self {
            kind: segment.kind,
            plane: segment.plane,
            centre_mm: segment.centre_mm,
            radius_mm: segment.radius_mm,
            feed_mm_s: segment.feed_mm_s,
            sense: segment.sense,
            stations: segment.stations,
            tool_offset_mm: segment.tool_offset_mm,
            fixture: Fixture {
                zero_id: segment.zero_id,
                setup_id: segment.setup_id,
            },
        }
    }
}

impl Place {
    /// A full circle, counter-clockwise, by `stations` stops.
    #[must_use]
    pub fn circle(
        plane: TestPlane,
        centre_mm: Vector3<f64>,
        radius_mm: f64,
        stations: u32,
    ) -> Self {
        Self {
            kind: TestKind::Circle,
            plane,
            centre_mm,
            radius_mm,
            feed_mm_s: 25.0,
            sense: Sense::CounterClockwise,
            stations,
            tool_offset_mm: Vector3::zeros(),
            fixture: Fixture {
                zero_id: 0,
                setup_id: 0,
            },
        }
    }

    /// Whether it lies on a circle about its centre.
    #[must_use]
    pub fn is_round(&self) -> bool {
        matches!(self.kind, TestKind::Circle | TestKind::Arc) && self.radius_mm > 0.0
    }

    /// Whether the grid encoder records this kind of trajectory.
    #[must_use]
    pub fn is_recorded(kind: TestKind) -> bool {
        matches!(
            kind,
            TestKind::Circle
                | TestKind::Arc
                | TestKind::Line
                | TestKind::Spike
                | TestKind::Corner
                | TestKind::ArcWithLine
                | TestKind::TwoArcs
        )
    }

    /// Positions of the linear axes at the angle `angle_rad` from u towards v.
    #[must_use]
    pub fn on_circle_mm(&self, angle_rad: f64) -> PerAxis<f64> {
        let mut positions = PerAxis::default();
        for axis in Axis::LINEAR {
            positions[axis] = self.centre_mm[axis.index()];
        }
        if let Some([u, v]) = plane_axes(self.plane) {
            positions[u] += self.radius_mm * angle_rad.cos();
            positions[v] += self.radius_mm * angle_rad.sin();
        }
        positions
    }
}

/// The axes along u and v: X Y, Y Z, Z X.
#[must_use]
pub const fn plane_axes(plane: TestPlane) -> Option<[Axis; 2]> {
    match plane {
        TestPlane::None => None,
        TestPlane::Xy => Some([Axis::X, Axis::Y]),
        TestPlane::Yz => Some([Axis::Y, Axis::Z]),
        TestPlane::Zx => Some([Axis::Z, Axis::X]),
    }
}

/// Components of a vector along u and v; zero without a plane.
#[must_use]
pub fn in_plane(plane: TestPlane, vector: &Vector3<f64>) -> [f64; 2] {
    plane_axes(plane).map_or([0.0; 2], |[u, v]| [vector[u.index()], vector[v.index()]])
}

/// The plane in which a turn about A, B or C lies.
#[must_use]
pub(crate) const fn plane_of_turn(direction: Axis) -> TestPlane {
    match direction {
        Axis::A => TestPlane::Yz,
        Axis::B => TestPlane::Zx,
        Axis::C => TestPlane::Xy,
        _ => TestPlane::None,
    }
}
