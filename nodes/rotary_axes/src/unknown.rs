//! What may be asked of the visits: location errors, and harmonics of error motions.
//!
//! ```text
//!   E(q) = a (cos m q - 1) + b sin m q          harmonic m of an error motion, zero at q = 0   (1)
//! ```
//!
//! A motion is zero where the axis is at zero, as the location errors are: the workpiece is set up there.

use std::fmt;

use machine::SphereDesign;
use machine::poses::PoseRow;
use metrology::{Axis, ErrorComponent, PerAxis};
use nalgebra::Vector3;

/// One number to be estimated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unknown {
    /// A location error.
    Location(ErrorComponent),
    /// The coefficient a of (1).
    Cosine {
        /// The error motion.
        motion: ErrorComponent,
        /// m.
        order: u8,
    },
    /// The coefficient b of (1).
    Sine {
        /// The error motion.
        motion: ErrorComponent,
        /// m.
        order: u8,
    },
}

impl Unknown {
    /// The location errors of a machine's rotary axes.
    #[must_use]
    pub fn locations(design: &SphereDesign) -> Vec<Self> {
        let components = design.components().iter();
        components.copied().map(Self::Location).collect()
    }

    /// Every pair of cosine and sine up to an order.
    #[must_use]
    pub fn harmonics(design: &SphereDesign, greatest_order: u8) -> Vec<[Self; 2]> {
        let axes = design.rotary_axes().iter();
        axes.flat_map(|&axis| ErrorComponent::motions_of(axis))
            .flat_map(|motion| {
                (1..=greatest_order).map(move |order| {
                    [Self::Cosine { motion, order }, Self::Sine { motion, order }]
                })
            })
            .collect()
    }

    /// The error component that it belongs to.
    #[must_use]
    pub const fn component(self) -> ErrorComponent {
        match self {
            Self::Location(component) => component,
            Self::Cosine { motion, .. } | Self::Sine { motion, .. } => motion,
        }
    }

    /// What it adds to its component per unit, at a position of the component's axis (rad).
    #[must_use]
    pub fn share(self, position_rad: f64) -> f64 {
        match self {
            Self::Location(_) => 1.0,
            Self::Cosine { order, .. } => (f64::from(order) * position_rad).cos() - 1.0,
            Self::Sine { order, .. } => (f64::from(order) * position_rad).sin(),
        }
    }

    /// Change of the reading per unit, machine frame, mm.
    #[must_use]
    pub(crate) fn effect(
        self,
        design: &SphereDesign,
        row: &PoseRow,
        pose_rad: &PerAxis<f64>,
    ) -> Vector3<f64> {
        let component = self.component();
        design.effect(row, component) * self.share(pose_rad[component.of])
    }

    /// Whether it is in rad rather than mm.
    #[must_use]
    pub const fn is_angular(self) -> bool {
        self.component().is_angular()
    }

    /// The axis whose error it is.
    #[must_use]
    pub const fn axis(self) -> Axis {
        self.component().of
    }
}

impl fmt::Display for Unknown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Location(component) => component.fmt(f),
            Self::Cosine { motion, order } => write!(f, "{motion} cos {order}{}", motion.of),
            Self::Sine { motion, order } => write!(f, "{motion} sin {order}{}", motion.of),
        }
    }
}
