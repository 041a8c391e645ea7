//! Poses of the rotary axes at which one sphere tells where these axes lie.
//!
//! A sphere stands on the table and its centre is probed at several rotary poses. `design` says how
//! the centre that is read moves with the sphere's place and with each location error, `reach`
//! which poses the machine can probe it at, `merit` what a set of poses would tell before anything is
//! measured, and `choice` picks the poses that tell most out of a grid.
//!
//! ```text
//!   c_k = p_k(w) - R_k E(pose k, w)                                                    (1)
//!   dc_k = R_k dw - R_k sum_j s_jk b_j                                                 (2)
//! ```
//!
//! (1): the tool meets the sphere where its nominal place and its error E add up to w, so the reading
//! is off by the error with its sign turned. (2) is its first order.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | c_k | centre that is read at pose k, machine frame, with the nominal turn of a head | mm |
//! | w, p_k(w) | centre of the sphere in the workpiece frame; the same in the machine frame at pose k | mm |
//! | R_k | turns directions of the workpiece frame into machine directions at pose k | 1 |
//! | b_j, s_jk | error component j; its `volumetric::sensitivity`, workpiece frame | mm or rad |
//!
//! # Holds when
//! Rotary axes stand outside the linear ones (no linear axis is moved by a rotary one); the probe's
//! ball is where the machine file says: an offset of the ball that is the same at every pose reads as
//! a displacement of all lines together.

mod choice;
mod design;
mod merit;
mod reach;

use metrology::{Axis, AxisSet};

pub use choice::{calibration_poses, verification_poses};
pub use design::{PoseRow, SphereDesign};
pub use merit::{Merit, WANTED_MERIT, merit};
pub use reach::{Reach, ReachLimits};

pub(crate) use design::sphere_of;
pub(crate) use reach::reach;

/// Why poses cannot be planned or used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PoseError {
    /// The chain string cannot be read.
    #[error("chain: {error}")]
    Chain {
        /// Where and why.
        #[source]
        error: crate::chain::ChainError,
    },
    /// There is no rotary axis, or no complete set of linear ones.
    #[error("chain {chain}: poses need X, Y, Z and one or two rotary axes")]
    Axes {
        /// The chain.
        chain: String,
    },
    /// A rotary axis moves a linear one.
    #[error("chain {chain}: linear axis {axis} is moved by a rotary axis")]
    LinearOnRotary {
        /// The chain.
        chain: String,
        /// The linear axis.
        axis: Axis,
    },
    /// The machine file has no such sphere.
    #[error("sphere \"{sphere}\": the machine file has no sphere of this name")]
    UnknownSphere {
        /// The name.
        sphere: String,
    },
    /// A pose with a number that is no number.
    #[error("poses[{index}]: the position of axis {axis} is not finite")]
    NotFinite {
        /// Place in the list.
        index: usize,
        /// The axis.
        axis: Axis,
    },
    /// A pose outside the travel of a rotary axis.
    #[error("poses[{index}]: axis {axis} would go to {position_deg:.4} deg, travel is [{}, {}] deg", travel_deg[0], travel_deg[1])]
    OutsideTravel {
        /// Place in the list.
        index: usize,
        /// The axis.
        axis: Axis,
        /// Where it would go, deg.
        position_deg: f64,
        /// Travel, deg.
        travel_deg: [f64; 2],
    },
    /// Fewer poses than unknowns need.
    #[error("{n} poses were given: {unknowns} unknowns need at least {least}")]
    TooFew {
        /// How many.
        n: usize,
        /// Location errors and the sphere's place.
        unknowns: usize,
        /// How many are needed.
        least: usize,
    },
    /// The grid of candidates has fewer reachable poses than wanted.
    #[error(
        "sphere \"{sphere}\": {wanted} poses are wanted, {reachable} of {candidates} candidates can be reached; most of the others because {most_common}"
    )]
    Unreachable {
        /// The sphere.
        sphere: String,
        /// How many are wanted.
        wanted: usize,
        /// How many can be reached.
        reachable: usize,
        /// How many were looked at.
        candidates: usize,
        /// Why most of the others cannot.
        most_common: &'static str,
    },
}

/// The rotary axes among `axes`, A B C.
fn rotary(axes: AxisSet) -> impl Iterator<Item = Axis> {
    Axis::ROTARY
        .into_iter()
        .filter(move |axis| axes.contains(*axis))
}
