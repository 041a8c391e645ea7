//! The parts of the offset, before limits.
//!
//! ```text
//!   offset = thermal + geometric + positioning,   thermal = +d(p)                 (1)
//! ```
//!
//! The geometric part is `geometric`'s own: minus the tip's error, in machine directions.
//! The positioning part is `positioning`'s own: −Δ, the deviation of the slide from its motor.
//!
//! Sign by physics: the control reads p + d where it read p when cold, so p + d has to be commanded
//! to be at the same place again. The machine's position error is −d(p). p is the position commanded
//! by the program, compensation not included.

use std::mem::discriminant;

use machine::volumetric::PoseRefusal;
use metrology::drift::{DriftRefusal, Extrapolate, drift_at};
use metrology::sample::ThermalModel;
use metrology::{Axis, Host, Stamp};
use nalgebra::Vector3;

use crate::positioning::refusal::PositioningRefusal;

/// The parts for one axis at one pose, mm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Parts {
    /// Thermal drift.
    pub thermal: f64,
    /// Geometric errors.
    pub geometric: f64,
    /// Deviation of the slide from its motor.
    pub positioning: f64,
}

impl Parts {
    /// Whether each of them is a number.
    pub fn are_finite(&self) -> bool {
        [self.thermal, self.geometric, self.positioning]
            .iter()
            .all(|part| part.is_finite())
    }

    /// Their sum, mm: (1).
    #[must_use]
    pub fn sum(&self) -> f64 {
        self.thermal + self.geometric + self.positioning
    }
}

/// Why a part of the offset is not known.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PartRefusal {
    /// The thermal part.
    #[error("thermal model gives no drift: {source}")]
    Thermal {
        /// What the model said.
        #[from]
        source: DriftRefusal,
    },
    /// The geometric part.
    #[error("geometry model gives no offset: {source}")]
    Geometric {
        /// What the model said.
        source: PoseRefusal,
    },
    /// The positioning part.
    #[error("positioning: {source}")]
    Positioning {
        /// What the dual loop said.
        source: PositioningRefusal,
    },
    /// The parts give no number.
    #[error("the parts give an offset of axis {axis} that is not a finite number")]
    NotFinite {
        /// The axis.
        axis: Axis,
    },
}

impl PartRefusal {
    /// Whether both say the same but for their numbers.
    #[must_use]
    pub fn is_like(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Thermal { source: one }, Self::Thermal { source: two }) => {
                discriminant(one) == discriminant(two)
            }
            (Self::Positioning { source: one }, Self::Positioning { source: two }) => {
                discriminant(one) == discriminant(two)
            }
            (Self::Geometric { source: one }, Self::Geometric { source: two }) => {
                discriminant(one) == discriminant(two)
            }
            (Self::NotFinite { .. }, Self::NotFinite { .. }) => true,
            _ => false,
        }
    }
}

/// Thermal parts of X, Y and Z at a commanded pose; allocates nothing.
pub fn thermal_parts_at(
    model: &ThermalModel,
    commanded_mm: &Vector3<f64>,
    at: Stamp<Host>,
    policy: Extrapolate,
) -> [Result<Parts, DriftRefusal>; 3] {
    let [x, y, z] = drift_at(model, commanded_mm, at, policy);
    let only = |thermal| Parts {
        thermal,
        ..Parts::default()
    };
    [x.map(only), y.map(only), z.map(only)]
}
