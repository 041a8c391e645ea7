//! Where the blocks' faces were when the machine was cold, and how far their readings have moved.
//!
//! ```text
//!   d = x' − x                                                                   (1)
//!   u²(d) = u²(x') + u²(x)                                                       (2)
//! ```
//!
//! (2) is what is independent of every other face; what the latency makes common to them is in
//! [`crate::latency_share`].
//!
//! A block that was pushed gets a new reference, such that its drift goes on from d_prev:
//!
//! ```text
//!   x_new = x' − d_prev,   u²(x_new) = u²(x') + u²(d_prev)                       (3)
//! ```
//!
//! The face of axis i is touched at the corner, set in by the block's inset along the two other
//! directions, on the block's side; that point is where d_i is known.

use machine::file::BlockEntry;
use metrology::sample::LatencyShare;
use metrology::{Axis, Host, PerAxis, Stamp};
use nalgebra::Vector3;

use crate::latency_share::{LatencyShares, difference_variance_mm2};

/// A face's position, the mean of its touches in one cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaceReading {
    /// Position along the face's axis, mm.
    pub position_mm: f64,
    /// Standard uncertainty without the latency's share, mm.
    pub standard_uncertainty_mm: f64,
    /// Mean instant of the touches.
    pub at: Stamp<Host>,
    /// The latency taken out of them.
    pub latency: LatencyShare,
}

/// How far the reading of one face has moved since the cold reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaceDrift {
    /// Place of the block in the machine file.
    pub block: usize,
    /// The face's axis.
    pub axis: Axis,
    /// Where the face is touched, machine frame, mm, cold.
    pub point_mm: Vector3<f64>,
    /// Drift of the reading, mm: (1).
    pub drift_mm: f64,
    /// Standard uncertainty of the drift, mm: (2).
    pub standard_uncertainty_mm: f64,
    /// Share of the hot touch alone, mm; the cold one is common to all updates.
    pub hot_uncertainty_mm: f64,
    /// What the drift shares with others by the latency.
    pub latency: LatencyShares,
    /// Mean instant of the hot touches.
    pub at: Stamp<Host>,
}

impl FaceDrift {
    /// Whether both are of the same face.
    #[must_use]
    pub fn same_face(&self, other: &Self) -> bool {
        self.block == other.block && self.axis == other.axis
    }
}

/// Cold positions of one block.
#[derive(Clone, Debug)]
struct ColdBlock {
    entry: BlockEntry,
    faces: PerAxis<Option<FaceReading>>,
}

/// Cold positions of all blocks of the machine file.
#[derive(Clone, Debug)]
pub struct Reference {
    blocks: Vec<ColdBlock>,
    taken_at: Option<Stamp<Host>>,
}

impl Reference {
    /// Blocks that have not been measured yet.
    #[must_use]
    pub fn new(entries: &[BlockEntry]) -> Self {
        let blocks = entries
            .iter()
            .map(|entry| ColdBlock {
                entry: entry.clone(),
                faces: PerAxis::default(),
            })
            .collect();
        Self {
            blocks,
            taken_at: None,
        }
    }

    /// Replaces the cold positions of every block by those of one cycle.
    pub fn take(&mut self, readings: &[PerAxis<Option<FaceReading>>]) {
        for (block, faces) in self.blocks.iter_mut().zip(readings) {
            block.faces = *faces;
        }
        self.taken_at = self.readings().map(|r| r.at).max();
    }

    /// When the last cold face was touched; `None` before the first reference.
    #[must_use]
    pub fn taken_at(&self) -> Option<Stamp<Host>> {
        self.taken_at
    }

    /// Moves the reference's instants after a step of the clock.
    pub fn shift(&mut self, by: metrology::stamp::Span) {
        self.taken_at = self.taken_at.map(|at| at + by);
    }

    /// Moves one face's cold position, its block was pushed: (3). `previous` is its drift before,
    /// `pushed` the first one after.
    pub fn rebase(&mut self, previous: &FaceDrift, pushed: &FaceDrift) {
        let face = self.blocks.get_mut(pushed.block);
        if let Some(face) = face.and_then(|b| b.faces[pushed.axis].as_mut()) {
            face.position_mm += pushed.drift_mm - previous.drift_mm;
            // The cold reading cancels in x' − x, what the latency leaves between the two does not.
            let latency_mm2 = difference_variance_mm2(previous, pushed);
            face.standard_uncertainty_mm = (previous.standard_uncertainty_mm.powi(2)
                + pushed.hot_uncertainty_mm.powi(2)
                + latency_mm2)
                .sqrt();
        }
    }

    /// Standard uncertainty of a face's cold position, mm; `None` where there is none.
    #[must_use]
    pub fn standard_uncertainty_mm(&self, block: usize, axis: Axis) -> Option<f64> {
        let face = self.blocks.get(block)?.faces[axis]?;
        Some(face.standard_uncertainty_mm)
    }

    /// Number of blocks in the machine file.
    #[must_use]
    pub fn n_blocks(&self) -> usize {
        self.blocks.len()
    }

    /// Place of a block in the machine file.
    #[must_use]
    pub fn index_of(&self, block_id: &str) -> Option<usize> {
        self.blocks.iter().position(|b| b.entry.id == block_id)
    }

    /// Name of a block; empty for a place that does not exist.
    #[must_use]
    pub fn name_of(&self, block: usize) -> &str {
        self.blocks.get(block).map_or("", |b| &b.entry.id)
    }

    /// Name and corner of each block, machine frame, mm; of a face without a cold position its nominal place.
    #[must_use]
    pub fn corners(&self) -> Vec<(&str, Vector3<f64>)> {
        let corner = |block: &ColdBlock| {
            Vector3::from_fn(|row, _| {
                let face = block.faces[Axis::LINEAR[row]];
                face.map_or(block.entry.corner_mm[row], |face| face.position_mm)
            })
        };
        let blocks = self.blocks.iter();
        blocks
            .map(|block| (block.entry.id.as_str(), corner(block)))
            .collect()
    }

    /// Faces that have a cold position.
    pub fn faces(&self) -> impl Iterator<Item = (usize, Axis)> + '_ {
        self.blocks.iter().enumerate().flat_map(|(index, block)| {
            Axis::LINEAR
                .into_iter()
                .filter(|axis| block.faces[*axis].is_some())
                .map(move |axis| (index, axis))
        })
    }

    fn readings(&self) -> impl Iterator<Item = FaceReading> + '_ {
        self.blocks
            .iter()
            .flat_map(|b| Axis::LINEAR.into_iter().filter_map(|axis| b.faces[axis]))
    }

    /// Where the face of `axis` is touched, machine frame, mm.
    #[must_use]
    pub fn touch_point_mm(&self, block: usize, axis: Axis) -> Option<Vector3<f64>> {
        let block = self.blocks.get(block)?;
        let own_mm = block.faces[axis]?.position_mm;
        Some(Vector3::from_fn(|row, _| {
            if row == axis.index() {
                return own_mm;
            }
            let corner_mm = block.faces[Axis::LINEAR[row]]
                .map_or(block.entry.corner_mm[row], |face| face.position_mm);
            corner_mm + f64::from(block.entry.approach_sign[row]) * block.entry.inset_mm
        }))
    }

    /// Mean of all touch points, mm: the fixed origin of the N-block model.
    #[must_use]
    pub fn origin_mm(&self) -> Vector3<f64> {
        let points: Vec<_> = self
            .faces()
            .filter_map(|(block, axis)| self.touch_point_mm(block, axis))
            .collect();
        if points.is_empty() {
            return Vector3::zeros();
        }
        points.iter().sum::<Vector3<f64>>() / points.len() as f64
    }

    /// Drifts of the faces that have a cold and a hot position: (1), (2).
    #[must_use]
    pub fn drifts(&self, hot: &[PerAxis<Option<FaceReading>>]) -> Vec<FaceDrift> {
        self.faces()
            .filter_map(|(block, axis)| {
                let cold = self.blocks[block].faces[axis]?;
                let hot = hot.get(block)?[axis]?;
                Some(FaceDrift {
                    block,
                    axis,
                    point_mm: self.touch_point_mm(block, axis)?,
                    drift_mm: hot.position_mm - cold.position_mm,
                    standard_uncertainty_mm: hot
                        .standard_uncertainty_mm
                        .hypot(cold.standard_uncertainty_mm),
                    hot_uncertainty_mm: hot.standard_uncertainty_mm,
                    latency: LatencyShares::of_difference(&hot.latency, &cold.latency),
                    at: hot.at,
                })
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reading(position_mm: f64) -> Option<FaceReading> {
        Some(FaceReading {
            position_mm,
            standard_uncertainty_mm: 3e-4,
            at: Stamp::from_nanos(0),
            latency: LatencyShare::default(),
        })
    }

    fn reference() -> Reference {
        let mut reference = Reference::new(&[BlockEntry {
            id: "low".to_owned(),
            corner_mm: [-200.0, -150.0, 20.0],
            approach_sign: [1, 1, -1],
            inset_mm: 6.0,
        }]);
        reference.take(&[PerAxis([
            reading(-200.5),
            None,
            reading(20.25),
            None,
            None,
            None,
        ])]);
        reference
    }

    #[test]
    fn a_face_is_touched_beside_the_corner_on_the_blocks_side() {
        let point = reference().touch_point_mm(0, Axis::X).unwrap();
        assert_eq!(point, Vector3::new(-200.5, -144.0, 14.25));
        assert_eq!(reference().touch_point_mm(0, Axis::Y), None);
    }

    #[test]
    fn eq3_a_pushed_block_goes_on_from_its_drift_with_the_uncertainty_of_the_new_reading() {
        let mut reference = reference();
        let drift = |reference: &Reference, x_mm| {
            reference.drifts(&[PerAxis([reading(x_mm), None, None, None, None, None])])[0]
        };
        let previous = drift(&reference, -200.49);
        let pushed = drift(&reference, -200.40);
        reference.rebase(&previous, &pushed);
        let after = drift(&reference, -200.40);
        assert!((after.drift_mm - previous.drift_mm).abs() < 1e-12);
        // Cold, the hot reading before the push, the one after it: three readings instead of one.
        let reference_mm = reference.standard_uncertainty_mm(0, Axis::X).unwrap();
        assert!((reference_mm - 3e-4 * 3_f64.sqrt()).abs() < 1e-12);
        assert!((after.standard_uncertainty_mm - 3e-4 * 2.0).abs() < 1e-12);
    }

    #[test]
    fn eq1_eq2_the_drift_is_hot_minus_cold_with_both_uncertainties() {
        let hot = PerAxis([reading(-200.49), reading(7.0), None, None, None, None]);
        let drifts = reference().drifts(&[hot]);
        assert_eq!(drifts.len(), 1);
        assert!((drifts[0].drift_mm - 0.01).abs() < 1e-12);
        assert!((drifts[0].standard_uncertainty_mm - 3e-4 * 2_f64.sqrt()).abs() < 1e-12);
    }
}
