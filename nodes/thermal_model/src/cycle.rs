//! Gathers the touches of one block cycle until every block is there or none is awaited any more.
//!
//! Repeated touches of a face in one run become their weighted mean:
//!
//! ```text
//!   x = Σ x_k/u_k² / Σ 1/u_k²,   u²(x) = 1 / Σ 1/u_k²,   t = Σ t_k/u_k² / Σ 1/u_k²       (1)
//! ```
//!
//! u_k is what is independent from touch to touch. The latency is common to all touches and does not
//! average; its share is the weighted mean of theirs.

use metrology::sample::{BlockMeasurement, FacePosition, LatencyShare};
use metrology::stamp::Span;
use metrology::{Axis, Host, PerAxis, Stamp};

use crate::latency_share::is_same;
use crate::reference::FaceReading;

/// Why a face is not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FaceRefusal {
    /// Position or uncertainty is no finite number.
    #[error("position or uncertainty is not a finite number")]
    NotFinite,
    /// The uncertainty is not above zero.
    #[error("standard uncertainty is not above 0 mm")]
    NoUncertainty,
    /// The touch is stamped later than its message.
    #[error("touched later than reported")]
    FromTheFuture,
    /// The touch is older than the last update.
    #[error("touched before the last update")]
    Old,
}

/// Touches of one cycle.
#[derive(Clone, Debug)]
pub struct Cycle {
    /// Run in which it is measured.
    pub run: u32,
    /// Whether it becomes the cold reference.
    pub cold: bool,
    sums: Vec<PerAxis<Option<Sum>>>,
    seen: Vec<bool>,
    /// When it is closed even if blocks are missing.
    pub closes_at: Stamp<Host>,
}

/// Weighted sums of (1), relative to the first touch so that nothing is lost to rounding.
#[derive(Clone, Copy, Debug)]
struct Sum {
    first: FacePosition,
    weight: f64,
    offset: f64,
    delay_s: f64,
    /// Sensitivity to the first touch's latency.
    sensitivity: f64,
    /// Squares of what other latencies make of it.
    foreign: f64,
}

impl Sum {
    fn reading(self) -> FaceReading {
        FaceReading {
            position_mm: self.first.position_mm + self.offset / self.weight,
            standard_uncertainty_mm: (self.weight + self.foreign).sqrt() / self.weight,
            at: self.first.at + Span::from_secs_f64(self.delay_s / self.weight),
            latency: LatencyShare {
                sensitivity_mm_s: self.sensitivity / self.weight,
                ..self.first.latency
            },
        }
    }
}

impl Cycle {
    /// An empty cycle of `n_blocks`.
    #[must_use]
    pub fn new(n_blocks: usize, run: u32, cold: bool, closes_at: Stamp<Host>) -> Self {
        Self {
            run,
            cold,
            sums: vec![PerAxis::default(); n_blocks],
            seen: vec![false; n_blocks],
            closes_at,
        }
    }

    /// Adds the usable faces of one measurement; the others come back with the reason.
    pub fn add(
        &mut self,
        block: usize,
        measurement: &BlockMeasurement,
        not_before: Option<Stamp<Host>>,
        not_after: Stamp<Host>,
    ) -> Vec<(Axis, FaceRefusal)> {
        let mut refused = Vec::new();
        self.seen[block] = true;
        for axis in Axis::LINEAR {
            let Some(face) = measurement.faces[axis] else {
                continue;
            };
            match usable(&face, not_before, not_after) {
                Ok(()) => accumulate(&mut self.sums[block][axis], face),
                Err(reason) => refused.push((axis, reason)),
            }
        }
        refused
    }

    /// Whether every block has been measured.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.seen.iter().all(|seen| *seen)
    }

    /// Blocks without a measurement.
    pub fn missing(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.seen.len()).filter(|&block| !self.seen[block])
    }

    /// The mean position of every face: (1).
    #[must_use]
    pub fn readings(&self) -> Vec<PerAxis<Option<FaceReading>>> {
        self.sums
            .iter()
            .map(|faces| PerAxis::from_fn(|axis| faces[axis].map(Sum::reading)))
            .collect()
    }
}

/// Whether a measurement has faces and none of them can be used: one that is old, told again, or senseless.
pub fn is_useless(
    measurement: &BlockMeasurement,
    not_before: Option<Stamp<Host>>,
    not_after: Stamp<Host>,
) -> bool {
    let mut faces = measurement.faces.0.iter().flatten().peekable();
    faces.peek().is_some() && faces.all(|face| usable(face, not_before, not_after).is_err())
}

fn usable(
    face: &FacePosition,
    not_before: Option<Stamp<Host>>,
    not_after: Stamp<Host>,
) -> Result<(), FaceRefusal> {
    let uncertainty_mm = face.independent_uncertainty_mm();
    let latency = &face.latency;
    let shared_mm = latency.latency_s + latency.standard_uncertainty_mm();
    // The weight 1/u² must stay a finite number above zero too.
    let is_finite = [
        face.position_mm,
        face.standard_uncertainty_mm,
        uncertainty_mm,
        shared_mm,
    ]
    .iter()
    .all(|x| x.is_finite());
    if !is_finite || uncertainty_mm > 1e100 {
        Err(FaceRefusal::NotFinite)
    } else if uncertainty_mm <= 1e-100 {
        Err(FaceRefusal::NoUncertainty)
    } else if face.at > not_after {
        Err(FaceRefusal::FromTheFuture)
    } else if not_before.is_some_and(|limit| face.at < limit) {
        Err(FaceRefusal::Old)
    } else {
        Ok(())
    }
}

fn accumulate(sum: &mut Option<Sum>, face: FacePosition) {
    let weight = face.independent_uncertainty_mm().powi(-2);
    let sum = sum.get_or_insert(Sum {
        first: face,
        weight: 0.0,
        offset: 0.0,
        delay_s: 0.0,
        sensitivity: 0.0,
        foreign: 0.0,
    });
    sum.weight += weight;
    sum.offset += weight * (face.position_mm - sum.first.position_mm);
    sum.delay_s += weight * (face.at - sum.first.at).as_secs_f64();
    if is_same(&face.latency, &sum.first.latency) {
        sum.sensitivity += weight * face.latency.sensitivity_mm_s;
    } else {
        sum.foreign += (weight * face.latency.standard_uncertainty_mm()).powi(2);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn face(position_mm: f64, at_s: i64) -> FacePosition {
        FacePosition {
            position_mm,
            standard_uncertainty_mm: 4e-4,
            at: Stamp::from_nanos(at_s * 1_000_000_000),
            latency: LatencyShare::default(),
        }
    }

    fn measurement(x: FacePosition) -> BlockMeasurement {
        let mut faces = PerAxis::default();
        faces[Axis::X] = Some(x);
        BlockMeasurement {
            at: x.at,
            block_id: "low".to_owned(),
            faces,
            cold: false,
            run: 1,
        }
    }

    #[test]
    fn eq1_repeated_touches_are_averaged() {
        let late = Stamp::from_nanos(100_000_000_000);
        let mut cycle = Cycle::new(1, 1, false, late);
        assert!(!cycle.is_complete());
        for (position_mm, at_s) in [(10.0, 4), (10.002, 6)] {
            assert!(
                cycle
                    .add(0, &measurement(face(position_mm, at_s)), None, late)
                    .is_empty()
            );
        }
        let mean = cycle.readings()[0][Axis::X].unwrap();
        assert!((mean.position_mm - 10.001).abs() < 1e-12);
        assert!((mean.standard_uncertainty_mm - 4e-4 / 2_f64.sqrt()).abs() < 1e-12);
        assert_eq!(mean.at, Stamp::from_nanos(5_000_000_000));
        assert!(cycle.is_complete());
    }

    #[test]
    fn what_the_latency_makes_common_does_not_average_away() {
        let late = Stamp::from_nanos(100_000_000_000);
        let mut cycle = Cycle::new(1, 1, false, late);
        let latency = LatencyShare {
            latency_s: 0.008,
            standard_uncertainty_s: 25e-6,
            sensitivity_mm_s: -12.0,
        };
        for at_s in 1..=4 {
            let touched = FacePosition {
                standard_uncertainty_mm: 4e-4_f64.hypot(3e-4),
                latency,
                ..face(10.0, at_s)
            };
            cycle.add(0, &measurement(touched), None, late);
        }
        let mean = cycle.readings()[0][Axis::X].unwrap();
        assert!((mean.standard_uncertainty_mm - 2e-4).abs() < 1e-12);
        assert!((mean.latency.standard_uncertainty_mm() - 3e-4).abs() < 1e-12);
    }

    #[test]
    fn unusable_faces_come_back_with_the_reason() {
        let now = Stamp::from_nanos(10_000_000_000);
        let mut cycle = Cycle::new(1, 1, false, now);
        let mut refusal =
            |face| cycle.add(0, &measurement(face), Some(Stamp::from_nanos(1)), now)[0].1;
        assert_eq!(refusal(face(f64::NAN, 5)), FaceRefusal::NotFinite);
        assert_eq!(refusal(face(1.0, 11)), FaceRefusal::FromTheFuture);
        assert_eq!(refusal(face(1.0, -1)), FaceRefusal::Old);
        let exact = FacePosition {
            standard_uncertainty_mm: 0.0,
            ..face(1.0, 5)
        };
        assert_eq!(refusal(exact), FaceRefusal::NoUncertainty);
    }
}
