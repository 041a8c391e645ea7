//! Marks of where a test begins and ends, from whoever runs the program.

use nalgebra::Vector3;

use crate::stamp::{Host, Stamp};

/// What kind of test a segment is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "named after the trajectory")]
pub enum TestKind {
    /// Touches of one surface at several feeds.
    Latency,
    /// Three faces of each block.
    Block,
    /// One touch.
    Touch,
    Plane,
    /// Bore or boss.
    Bore,
    Sphere,
    Circle,
    Line,
    Corner,
    Positioning,
    Dwell,
    /// Ordinary work: nothing is measured.
    Production,
    /// Poses visited to check the tool error.
    Verification,
    Arc,
    /// Out and back along one line, the turn being what is looked at.
    Spike,
    /// A line that runs on into an arc.
    ArcWithLine,
    /// Two arcs that meet tangentially.
    TwoArcs,
    /// A line through the working space along its diagonal.
    Diagonal,
    /// A sphere touched at several poses of the rotary axes, to find their errors.
    Rotary,
    /// The same at other poses, to judge a model that was found.
    RotaryVerification,
}

/// Plane of a planar test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the planes of G17, G19 and G18")]
pub enum TestPlane {
    None,
    Xy,
    Yz,
    Zx,
}

/// Sense of rotation of a circular test, seen against the plane's normal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "self-evident")]
pub enum Sense {
    None,
    Clockwise,
    CounterClockwise,
}

/// Begin or end of one test.
#[derive(Clone, Debug, PartialEq)]
pub struct TestSegment {
    /// When.
    pub at: Stamp<Host>,
    /// Number of the run, unique in the bag.
    pub run: u32,
    /// True at the begin, false at the end.
    pub begin: bool,
    /// What is tested.
    pub kind: TestKind,
    /// Plane.
    pub plane: TestPlane,
    /// Centre in the machine frame, mm.
    pub centre_mm: Vector3<f64>,
    /// Nominal radius, mm; zero where there is none.
    pub radius_mm: f64,
    /// Programmed feed, mm/s.
    pub feed_mm_s: f64,
    /// Sense.
    pub sense: Sense,
    /// Which repetition of the same test, from 0.
    pub repeat: u32,
    /// Stylus name in the machine file; empty: none.
    pub stylus: String,
    /// From the point that the axis positions name to the point that is measured, mm; zero for a
    /// touch, whose positions name the ball's centre.
    pub tool_offset_mm: Vector3<f64>,
    /// Stops at which readings are averaged; zero: recorded while moving.
    pub stations: u32,
    /// Zero of the grid encoder or length reference.
    pub zero_id: u32,
    /// Changes whenever something was set up anew.
    pub setup_id: u32,
    /// Whether what is measured becomes the cold reference.
    pub cold: bool,
    /// Names of the features (blocks, faces, spheres) that are touched.
    pub features: Vec<String>,
    /// Whether the test ran to its end (meaningful at the end).
    pub completed: bool,
}

impl TestSegment {
    /// The begin of a test that has kind, number and instant alone: no plane, radius, feed, sense, stylus, stations or
    /// features; centre and offset zero; first repetition, not cold, completed. Tests add the fields that differ.
    #[must_use]
    pub fn of_kind(kind: TestKind, run: u32, at: Stamp<Host>) -> Self {
        Self {
            at,
            run,
            begin: true,
            kind,
            plane: TestPlane::None,
            centre_mm: Vector3::zeros(),
            radius_mm: 0.0,
            feed_mm_s: 0.0,
            sense: Sense::None,
            repeat: 0,
            stylus: String::new(),
            tool_offset_mm: Vector3::zeros(),
            stations: 0,
            zero_id: 0,
            setup_id: 0,
            cold: false,
            features: Vec::new(),
            completed: true,
        }
    }
}
