//! The order for one measuring cycle.

/// What a cycle touches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CycleKind {
    /// Three faces of each block.
    Blocks,
    /// One face at several feeds.
    Latency,
    /// Single points: a block's face or a plane's middle.
    Touch,
    /// A plane, on a grid of points.
    Plane,
    /// A bore or boss.
    Bore,
    /// A sphere.
    Sphere,
}

/// An order for one measuring cycle.
#[derive(Clone, Debug, PartialEq)]
pub struct CycleOrder {
    /// What kind.
    pub kind: CycleKind,
    /// Blocks, faces or artefacts of the machine file; empty: all of the kind.
    pub features: Vec<String>,
    /// Feeds for latency; empty otherwise.
    pub feeds_mm_min: Vec<f64>,
    /// Points on a bore or sphere, or on the side of a plane's grid; 0: the least that the shape needs.
    pub points: u32,
    /// Touches of each point (at each feed); 0 means 1.
    pub repeats: u32,
    /// Whether blocks become the cold reference.
    pub cold: bool,
}
