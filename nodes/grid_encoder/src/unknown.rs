//! The unknowns of an identification: coefficients of error components, and what the set-up leaves open.
//!
//! # Nuisances
//!
//! ```text
//!   reading = (1 + θ J) p + E(p) + o_zero + τ v − ½ b_a sign_a e_a,   J = turn by 90° from u to v       (1)
//!   radial:  n · (reading − p) = n · E + n · o_zero + ρ_recording                                       (2)
//! ```
//!
//! | symbol | unknown | one for each | unit |
//! |---|---|---|---|
//! | o | offset of the zero, along u and v | `zero_id` | mm |
//! | θ | turn of the plate in its plane | `setup_id` | rad |
//! | ρ | radius | recording, where only radii are used | mm |
//! | b | lost motion | linear axis that moved both ways | mm |
//! | τ | time between a reading's stamp and the positions' | all moving recordings | s |
//!
//! The two tilts of the plate out of its plane act in second order (1 − cos: 0.5 µm/m for 1 mrad) and are
//! not unknowns: level the plate to 1 mrad. Large turns in the plane are taken out before (1).

use std::collections::BTreeMap;
use std::fmt;

use metrology::{Axis, ErrorComponent};

use crate::basis::{Basis, ModelComponent};
use crate::recording::{Recording, plane_axes};

/// One unknown.
#[derive(Clone, Debug, PartialEq)]
pub enum Unknown {
    /// Coefficient of a power; power 0 is a location error.
    Power {
        /// Component.
        component: ErrorComponent,
        /// Power.
        power: u8,
    },
    /// Value at a knot of a table.
    Knot {
        /// Component.
        component: ErrorComponent,
        /// Position of the knot, mm or rad.
        position: f64,
    },
    /// Offset of a zero, mm.
    ZeroOffset {
        /// The zero.
        zero_id: u32,
        /// 0: along u, 1: along v.
        along: usize,
    },
    /// Turn of the plate, rad.
    PlateRotation {
        /// The set-up.
        setup_id: u32,
    },
    /// Radius beyond the nominal one, mm.
    Radius {
        /// Index of the recording.
        recording: usize,
    },
    /// Lost motion, mm.
    LostMotion {
        /// Axis.
        axis: Axis,
    },
    /// Positions are read this much later than the grid, s.
    StampOffset,
}

impl fmt::Display for Unknown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Power {
                component,
                power: 0,
            } => write!(f, "{component}"),
            Self::Power { component, power } => write!(f, "{component}{power}"),
            Self::Knot {
                component,
                position,
            } => write!(f, "{component}({position})"),
            Self::ZeroOffset { zero_id, along } => {
                let letter = if *along == 0 { "u" } else { "v" };
                write!(f, "offset {letter} of zero {zero_id}")
            }
            Self::PlateRotation { setup_id } => write!(f, "plate rotation of set-up {setup_id}"),
            Self::Radius { recording } => write!(f, "radius of recording {recording}"),
            Self::LostMotion { axis } => write!(f, "lost motion of {axis}"),
            Self::StampOffset => f.write_str("stamp offset"),
        }
    }
}

/// Which nuisances are unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nuisances {
    /// o of (1).
    pub zero_offset: bool,
    /// θ of (1).
    pub plate_rotation: bool,
    /// ρ of (2).
    pub radius: bool,
    /// b of (1).
    pub lost_motion: bool,
    /// τ of (1).
    pub stamp_offset: bool,
}

impl Nuisances {
    /// Offsets and rotation: stations on a plate.
    pub const PLATE: Self = Self {
        zero_offset: true,
        plate_rotation: true,
        radius: false,
        lost_motion: false,
        stamp_offset: false,
    };
    /// Nothing is unknown but the components.
    pub const NONE: Self = Self {
        zero_offset: false,
        plate_rotation: false,
        radius: false,
        lost_motion: false,
        stamp_offset: false,
    };
}

/// Where each unknown stands, coefficients first.
#[derive(Clone, Debug, PartialEq)]
pub struct Unknowns {
    /// All unknowns in the order of the columns.
    pub all: Vec<Unknown>,
    /// Number of coefficients.
    pub n_coefficients: usize,
    pub(crate) zero_at: BTreeMap<u32, usize>,
    pub(crate) setup_at: BTreeMap<u32, usize>,
    /// First radius column.
    pub(crate) radius_at: Option<usize>,
    pub(crate) lost_motion_at: [Option<usize>; 3],
    pub(crate) stamp_offset_at: Option<usize>,
}

impl Unknowns {
    /// Lists what is unknown for these recordings.
    #[must_use]
    pub fn of(
        components: &[ModelComponent],
        recordings: &[Recording],
        nuisances: &Nuisances,
    ) -> Self {
        let mut all: Vec<Unknown> = components.iter().flat_map(coefficients_of).collect();
        let n_coefficients = all.len();
        let mut zero_at = BTreeMap::new();
        let mut setup_at = BTreeMap::new();
        for recording in recordings {
            let fixture = recording.place.fixture;
            if nuisances.zero_offset {
                zero_at.entry(fixture.zero_id).or_insert(0);
            }
            if nuisances.plate_rotation {
                setup_at.entry(fixture.setup_id).or_insert(0);
            }
        }
        for (zero_id, at) in &mut zero_at {
            *at = all.len();
            let zero_id = *zero_id;
            all.extend([0, 1].map(|along| Unknown::ZeroOffset { zero_id, along }));
        }
        for (setup_id, at) in &mut setup_at {
            *at = all.len();
            let setup_id = *setup_id;
            all.push(Unknown::PlateRotation { setup_id });
        }
        let radius_at = nuisances.radius.then_some(all.len());
        if nuisances.radius {
            all.extend((0..recordings.len()).map(|recording| Unknown::Radius { recording }));
        }
        let mut lost_motion_at = [None; 3];
        if nuisances.lost_motion {
            for (at, axis) in lost_motion_at.iter_mut().zip(Axis::LINEAR) {
                if moved_both_ways(recordings, axis) {
                    *at = Some(all.len());
                    all.push(Unknown::LostMotion { axis });
                }
            }
        }
        let moving = recordings.iter().any(|r| r.place.stations == 0);
        let stamp_offset_at = (nuisances.stamp_offset && moving).then_some(all.len());
        all.extend(stamp_offset_at.map(|_| Unknown::StampOffset));
        Self {
            all,
            n_coefficients,
            zero_at,
            setup_at,
            radius_at,
            lost_motion_at,
            stamp_offset_at,
        }
    }

    /// Number of unknowns.
    #[must_use]
    pub fn len(&self) -> usize {
        self.all.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }
}

/// The unknowns of one component, in the order of its basis.
fn coefficients_of(model: &ModelComponent) -> Vec<Unknown> {
    let component = model.component;
    match &model.basis {
        Basis::Constant => vec![Unknown::Power {
            component,
            power: 0,
        }],
        Basis::Polynomial { powers, .. } => powers
            .iter()
            .map(|&power| Unknown::Power { component, power })
            .collect(),
        Basis::Table { knots, free } => free
            .iter()
            .map(|&idx| Unknown::Knot {
                component,
                position: knots[idx],
            })
            .collect(),
    }
}

/// Whether both senses of an axis that lies in the plane were recorded.
fn moved_both_ways(recordings: &[Recording], axis: Axis) -> bool {
    let seen = |sense: f64| {
        recordings
            .iter()
            .filter(|r| plane_axes(r.place.plane).is_some_and(|axes| axes.contains(&axis)))
            .flat_map(|r| &r.points)
            .any(|point| point.sense[axis.index()] * sense > 0.5)
    };
    seen(1.0) && seen(-1.0)
}
