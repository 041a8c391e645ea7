//! Touching cycles: programs that touch a surface, and what each touch should find.
//!
//! A cycle is RS-274 text that any control behind the suite's boundary runs, and the list of touches
//! in the order in which it makes them. Every touch is one straight move along the surface normal:
//!
//! ```text
//!   ball at contact  b = p - n r                                             (1)
//!   start            s = b - n standoff,  target  e = b + n overtravel        (2)
//!   standoff   >= f^2/(2 a) + f ln((1-k)/0.01)/Kv + 0.2 mm                    (3)
//!   overtravel >= f^2/(2 a) + 0.2 mm                                          (4)
//!   overtravel  = g^2/(2 a) + g (T + D + (1-k)/Kv)                            (5)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | p | `contact_mm`, nominal surface point, machine frame | mm |
//! | n | `approach`, direction of the tool's motion, into the material | 1 |
//! | r | effective radius of the stylus ball | mm |
//! | f | feed | mm/s |
//! | a | smallest acceleration limit, seen along n | mm/s² |
//! | g | guarded feed: of every move that may meet a surface and is no touch | mm/s |
//! | T, D | latest that the probe's signal arrives: 20 ms, or `probe.latency_ms` where that is more; servo period | s |
//! | Kv, k | position gain and velocity feed-forward of the slowest axis that moves | 1/s, 1 |
//!
//! (3): the feed is reached after f²/(2a); a position loop of first order then closes the share
//! (1-k) of the feed that feed-forward does not supply, down to 1 %. (4): a control plans to stop at
//! the target, so it brakes before it. 0.2 mm is how far a surface may lie from its nominal place.
//! A touch that breaks (3) or (4) is made below its feed, and its latency is estimated too small;
//! such a cycle is refused.
//!
//! (5): after a contact that nobody expects the axis goes on until the control sees it, by its lag, and by the way of
//! its braking; the probe takes as much as its overtravel. G0 is written only where no surface is: at the
//! top of Z, straight up, and from a contact back to the start of its touch. Not even a machine whose zero is
//! wrong meets a surface in G0, as long as the top of Z is above everything.
//!
//! Each program begins with [`crate::program_frame::HEAD`]: its coordinates are the machine's.
//!
//! Positions are those of the ball's centre with rotary axes at zero: axes read the machine
//! coordinates of the ball's centre, no work or tool offset is active. A stylus is vertical and its
//! shaft thinner than its ball. Between features the tool travels at the top of Z, since the file
//! does not say what else stands on the table; around one block it stays low above its corner. A
//! block's body fills the octant behind its faces.
//!
//! # Holds when
//! Compensation and drift are below 0.2 mm; the mounted stylus is the one named in the machine file.

mod block;
mod bore;
mod feature;
mod latency;
mod plane;
mod pointed;
pub(crate) mod program;
mod reach;
mod rotary;
mod sphere;
mod touch;

use metrology::sample::TestKind;
use nalgebra::Vector3;

pub use block::blocks;
pub use bore::bores;
pub use feature::{FeatureId, artefact_id};
pub use latency::latency;
pub use plane::planes;
pub use pointed::{PointedOrder, pointed};
pub use reach::{guarded_feed_mm_min, needed_overtravel_mm, needed_standoff_mm};
pub use rotary::{RotaryOrder, rotary};
pub use sphere::spheres;
pub use touch::touches;

/// A program and the touches it makes.
#[derive(Clone, Debug, PartialEq)]
pub struct Cycle {
    /// RS-274 text, ends with M2.
    pub program: String,
    /// The touches, in order.
    pub touches: Vec<PlannedTouch>,
    /// What a test segment around it is called.
    pub kind: TestKind,
    /// Blocks, faces or artefacts that it touches, in order, each once.
    pub features: Vec<String>,
}

/// One touch as planned.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedTouch {
    /// `<block>.x|y|z` or `<artefact>.<k>`, the program's `(feature: NAME)` before the touch.
    pub feature_id: String,
    /// Unit vector of the tool's motion.
    pub approach: Vector3<f64>,
    /// Nominal surface point, machine frame with rotary axes at zero, mm.
    pub contact_mm: Vector3<f64>,
    /// Programmed feed, mm/min.
    pub feed_mm_min: f64,
    /// Distance from the start of the move to contact, mm.
    pub standoff_mm: f64,
}
