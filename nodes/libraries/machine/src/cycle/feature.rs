//! Names of touched features: which face of which block, which point of which artefact.

use std::fmt;

use metrology::Axis;

use crate::error::CycleError;
use crate::file::{ArtefactEntry, MachineFile};

/// What one touch touches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FeatureId<'a> {
    /// A face of a block, by the axis along its normal.
    Face {
        /// Block name.
        block: &'a str,
        /// X, Y or Z.
        axis: Axis,
    },
    /// A point of an artefact.
    Point {
        /// Artefact name.
        artefact: &'a str,
        /// Which point, from 1.
        index: u32,
    },
}

impl<'a> FeatureId<'a> {
    /// Reads `block_1.x` or `sphere_1.3`; `None` for anything else.
    #[must_use]
    pub fn parse(name: &'a str) -> Option<Self> {
        let (owner, part) = name.rsplit_once('.')?;
        if owner.is_empty() {
            return None;
        }
        let axis =
            match part {
                "x" => Axis::X,
                "y" => Axis::Y,
                "z" => Axis::Z,
                digits => {
                    return digits.parse().ok().filter(|index| *index > 0).map(|index| {
                        Self::Point {
                            artefact: owner,
                            index,
                        }
                    });
                }
            };
        Some(Self::Face { block: owner, axis })
    }

    /// Name of the block or artefact.
    #[must_use]
    pub const fn owner(&self) -> &'a str {
        match self {
            Self::Face { block, .. } => block,
            Self::Point { artefact, .. } => artefact,
        }
    }
}

impl fmt::Display for FeatureId<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Face { block, axis } => {
                let letter = match axis {
                    Axis::X => "x",
                    Axis::Y => "y",
                    _ => "z",
                };
                write!(f, "{block}.{letter}")
            }
            Self::Point { artefact, index } => write!(f, "{artefact}.{index}"),
        }
    }
}

/// Name of an artefact.
#[must_use]
pub fn artefact_id(entry: &ArtefactEntry) -> &str {
    match entry {
        ArtefactEntry::Sphere { id, .. }
        | ArtefactEntry::Bore { id, .. }
        | ArtefactEntry::Boss { id, .. }
        | ArtefactEntry::Plane { id, .. } => id,
    }
}

/// Artefacts of one kind by name; `ids` empty: all of the kind.
pub(super) fn chosen<'a>(
    file: &'a MachineFile,
    ids: &[String],
    wanted: &'static str,
    is_wanted: impl Fn(&ArtefactEntry) -> bool,
) -> Result<Vec<&'a ArtefactEntry>, CycleError> {
    let all: Vec<_> = file.artefacts.iter().filter(|e| is_wanted(e)).collect();
    if all.is_empty() {
        return Err(CycleError::NothingToTouch { wanted });
    }
    if ids.is_empty() {
        return Ok(all);
    }
    ids.iter()
        .map(|id| {
            all.iter()
                .find(|entry| artefact_id(entry) == id)
                .copied()
                .ok_or_else(|| CycleError::UnknownFeature {
                    feature: id.clone(),
                    wanted,
                })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn feature_names_round_trip() {
        for name in ["block_1.x", "block_1.z", "sphere_1.12"] {
            assert_eq!(FeatureId::parse(name).unwrap().to_string(), name);
        }
    }

    #[test]
    fn other_names_are_no_features() {
        for name in ["block_1", ".x", "block_1.", "block_1.a", "s.0", "s.-1", ""] {
            assert_eq!(FeatureId::parse(name), None, "{name}");
        }
    }
}
