//! One column of the stacked design, and the row of the report to which it belongs.

use serde::{Deserialize, Serialize};

use super::scene::{Point, Scene, Trace};
use super::{
    backlash, centre, cyclic, drift, lateral, scale, servo, spike, squareness, straightness, tone,
};
use metrology::Axis;

/// At which end of its travel an axis reverses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[expect(missing_docs, reason = "self-evident")]
pub enum BacklashEnd {
    Positive,
    Negative,
}

/// What a row of a breakdown is about. Planes are apart, so a plane is not part of it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[expect(
    missing_docs,
    reason = "axis is the axis that errs; zero and reference count as in the plane"
)]
pub enum RowKey {
    /// Setting up: actual centre minus nominal.
    CentreOffset {
        axis: Axis,
        zero: usize,
    },
    /// Setting up: what the reference adds to every radius.
    ReferenceLength {
        reference: usize,
    },
    RadialExpansion,
    ScalingMismatch,
    Squareness,
    ServoMismatch,
    RadiusContraction,
    Backlash {
        axis: Axis,
        end: BacklashEnd,
    },
    LateralPlay {
        axis: Axis,
    },
    /// Deviation across `axis`, quadratic along it.
    Straightness {
        axis: Axis,
    },
    /// Deviation along `axis`, quadratic along it.
    QuadraticPitch {
        axis: Axis,
    },
    Drift,
    ReversalSpike {
        axis: Axis,
        feed_mm_s: f64,
        radius_mm: f64,
    },
    Cyclic {
        axis: Axis,
        pitch_mm: f64,
    },
    /// Same frequency at every feed; of one axis, or of the radius itself.
    Vibration {
        hz: f64,
        along: Option<Axis>,
    },
    /// Same number of lobes at every feed.
    Lobes {
        per_turn: f64,
        along: Option<Axis>,
    },
    /// A tone seen at one angular speed only.
    VibrationOrLobes {
        hz: f64,
        per_turn: f64,
        along: Option<Axis>,
    },
}

impl RowKey {
    /// Whether it is about setting up, not about the machine.
    #[must_use]
    pub const fn is_setting_up(&self) -> bool {
        matches!(
            self,
            Self::CentreOffset { .. } | Self::ReferenceLength { .. }
        )
    }
}

/// Which of two quadratures a column is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Quadrature {
    Sine,
    Cosine,
}

/// One column. Axes count 0 and 1 within the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Term {
    Centre {
        axis: usize,
        zero: usize,
    },
    Reference {
        reference: usize,
    },
    RadialExpansion,
    ScalingMismatch,
    Squareness,
    ServoMismatch,
    RadiusContraction,
    /// `width_mm` is the play that is taken up after a reversal; 0 makes a step.
    Backlash {
        axis: usize,
        end: BacklashEnd,
        width_mm: f64,
    },
    LateralPlay {
        axis: usize,
    },
    Straightness {
        axis: usize,
    },
    QuadraticPitch {
        axis: usize,
    },
    Drift,
    Spike {
        axis: usize,
        condition: usize,
        /// k of the pulse.
        rise: u8,
        decay_s: f64,
    },
    Cyclic {
        axis: usize,
        pitch_mm: f64,
        part: Quadrature,
    },
    /// In one recording; `key` tells what is held the same over recordings.
    Tone {
        trace: usize,
        hz: f64,
        along: Option<usize>,
        key: RowKey,
        part: Quadrature,
    },
}

impl Term {
    /// Setting up first, then the rows of the table that are linear, in its order.
    pub fn linear(scene: &Scene) -> Vec<Self> {
        let mut terms = Vec::new();
        for zero in 0..scene.n_zeros {
            terms.extend([0, 1].map(|axis| Self::Centre { axis, zero }));
        }
        terms.extend((0..scene.n_references).map(|reference| Self::Reference { reference }));
        terms.extend([
            Self::RadialExpansion,
            Self::ScalingMismatch,
            Self::Squareness,
            Self::ServoMismatch,
            Self::RadiusContraction,
        ]);
        for axis in [0, 1] {
            let ends = [BacklashEnd::Positive, BacklashEnd::Negative];
            terms.extend(ends.map(|end| Self::Backlash {
                axis,
                end,
                width_mm: 0.0,
            }));
        }
        terms.extend([0, 1].map(|axis| Self::LateralPlay { axis }));
        terms.extend([0, 1].map(|axis| Self::Straightness { axis }));
        terms.extend([0, 1].map(|axis| Self::QuadraticPitch { axis }));
        terms.push(Self::Drift);
        terms
    }

    /// Radial deviation that a value of 1 makes at a point, mm.
    pub fn at(&self, scene: &Scene, trace: &Trace, point: &Point) -> f64 {
        match *self {
            Self::Centre { axis, zero } => centre::offset(axis, zero, trace, point),
            Self::Reference { reference } => centre::reference_length(reference, trace),
            Self::RadialExpansion => scale::radial_expansion(point),
            Self::ScalingMismatch => scale::mismatch(point),
            Self::QuadraticPitch { axis } => scale::quadratic_pitch(axis, point),
            Self::Squareness => squareness::squareness(scene.axes, point),
            Self::ServoMismatch => servo::mismatch(trace, point),
            Self::RadiusContraction => servo::contraction(trace),
            Self::Backlash {
                axis,
                end,
                width_mm,
            } => backlash::backlash(axis, end, width_mm, scene.largest_radius_mm, trace, point),
            Self::LateralPlay { axis } => lateral::play(axis, trace, point),
            Self::Straightness { axis } => straightness::quadratic(axis, point),
            Self::Drift => drift::ramp(point),
            Self::Spike {
                axis,
                condition,
                rise,
                decay_s,
            } => spike::pulse(axis, condition, rise, decay_s, trace, point),
            Self::Cyclic {
                axis,
                pitch_mm,
                part,
            } => cyclic::cyclic(axis, pitch_mm, part, point),
            Self::Tone {
                trace: only,
                hz,
                along,
                part,
                ..
            } => tone::tone(only, hz, along, part, scene, trace, point),
        }
    }

    /// The row to which it belongs.
    pub fn row(&self, scene: &Scene) -> RowKey {
        let axes = scene.axes;
        match *self {
            Self::Centre { axis, zero } => RowKey::CentreOffset {
                axis: axes[axis],
                zero,
            },
            Self::Reference { reference } => RowKey::ReferenceLength { reference },
            Self::RadialExpansion => RowKey::RadialExpansion,
            Self::ScalingMismatch => RowKey::ScalingMismatch,
            Self::Squareness => RowKey::Squareness,
            Self::ServoMismatch => RowKey::ServoMismatch,
            Self::RadiusContraction => RowKey::RadiusContraction,
            Self::Backlash { axis, end, .. } => RowKey::Backlash {
                axis: axes[axis],
                end,
            },
            Self::LateralPlay { axis } => RowKey::LateralPlay { axis: axes[axis] },
            Self::Straightness { axis } => RowKey::Straightness { axis: axes[axis] },
            Self::QuadraticPitch { axis } => RowKey::QuadraticPitch { axis: axes[axis] },
            Self::Drift => RowKey::Drift,
            Self::Spike {
                axis, condition, ..
            } => {
                let (feed_mm_s, radius_mm) = scene.conditions[condition];
                RowKey::ReversalSpike {
                    axis: axes[axis],
                    feed_mm_s,
                    radius_mm,
                }
            }
            Self::Cyclic { axis, pitch_mm, .. } => RowKey::Cyclic {
                axis: axes[axis],
                pitch_mm,
            },
            Self::Tone { key, .. } => key,
        }
    }
}
