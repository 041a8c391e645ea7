//! Keeps back a jump of the drift that heat cannot make until a second measurement confirms it.
//!
//! ```text
//!   |d − d_prev| > r Δt + 3 √(u_hot² + u_hot,prev² + u_latency²)   ⇒   a jump     (1)
//! ```
//!
//! with r the fastest physical drift and u_latency what different latencies leave in the difference. A
//! jump that the next cycle repeats (no jump between the two) is confirmed, if that cycle's touches are
//! later ones: the same touches told twice confirm nothing; if the next cycle agrees with the state before, the first one was wrong. A jump of
//! one block alone, when others stay, is the block that moved (pushed, chip under it), not heat.

use metrology::Axis;

use crate::latency_share::difference_variance_mm2;
use crate::reference::FaceDrift;

/// One face beyond (1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jump {
    /// Place of the block in the machine file.
    pub block: usize,
    /// The face's axis.
    pub axis: Axis,
    /// Change of the drift, mm.
    pub change_mm: f64,
    /// What (1) allows, mm.
    pub limit_mm: f64,
}

/// What becomes of a cycle.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// It continues what was known.
    Plausible,
    /// It jumped: kept back.
    Quarantined {
        /// The faces that jumped.
        jumps: Vec<Jump>,
    },
    /// It repeats the cycle kept back before.
    Confirmed {
        /// The cycle kept back.
        first: Vec<FaceDrift>,
        /// The faces that jumped then.
        jumps: Vec<Jump>,
    },
    /// It continues what was known before the cycle kept back, which was wrong.
    Contradicted,
}

/// The gate.
#[derive(Clone, Debug)]
pub struct Quarantine {
    physical_rate_mm_s: f64,
    kept: Option<(Vec<FaceDrift>, Vec<Jump>)>,
}

impl Quarantine {
    /// A gate for drifts up to `physical_rate_mm_s`.
    #[must_use]
    pub fn new(physical_rate_mm_s: f64) -> Self {
        Self {
            physical_rate_mm_s,
            kept: None,
        }
    }

    /// Whether a cycle is kept back.
    #[must_use]
    pub fn is_occupied(&self) -> bool {
        self.kept.is_some()
    }

    /// Forgets the cycle kept back.
    pub fn clear(&mut self) {
        self.kept = None;
    }

    /// Moves the kept instants after a step of the clock.
    pub fn shift(&mut self, by: metrology::stamp::Span) {
        if let Some((faces, _)) = &mut self.kept {
            faces.iter_mut().for_each(|f| f.at += by);
        }
    }

    /// Judges a cycle against the last one accepted.
    pub fn judge(&mut self, accepted: &[FaceDrift], cycle: &[FaceDrift]) -> Verdict {
        let jumps = self.jumps(accepted, cycle);
        let kept = self.kept.take();
        match kept {
            _ if jumps.is_empty() && kept.is_some() => Verdict::Contradicted,
            _ if jumps.is_empty() => Verdict::Plausible,
            Some((first, first_jumps))
                if self.jumps(&first, cycle).is_empty() && is_later(&jumps, &first, cycle) =>
            {
                Verdict::Confirmed {
                    first,
                    jumps: first_jumps,
                }
            }
            _ => {
                self.kept = Some((cycle.to_vec(), jumps.clone()));
                Verdict::Quarantined { jumps }
            }
        }
    }

    /// Faces beyond (1).
    fn jumps(&self, before: &[FaceDrift], after: &[FaceDrift]) -> Vec<Jump> {
        after
            .iter()
            .filter_map(|face| {
                let last = before.iter().find(|b| b.same_face(face))?;
                let change_mm = face.drift_mm - last.drift_mm;
                let elapsed_s = (face.at - last.at).as_secs_f64().abs();
                let touches_mm = face.hot_uncertainty_mm.hypot(last.hot_uncertainty_mm);
                let u_mm = (touches_mm.powi(2) + difference_variance_mm2(face, last)).sqrt();
                let limit_mm = self.physical_rate_mm_s * elapsed_s + 3.0 * u_mm;
                (change_mm.abs() > limit_mm).then_some(Jump {
                    block: face.block,
                    axis: face.axis,
                    change_mm,
                    limit_mm,
                })
            })
            .collect()
    }
}

/// Whether every face that jumps was touched after `first`.
fn is_later(jumps: &[Jump], first: &[FaceDrift], cycle: &[FaceDrift]) -> bool {
    jumps.iter().all(|jump| {
        let of = |faces: &[FaceDrift]| {
            let mut own = faces
                .iter()
                .filter(|f| f.block == jump.block && f.axis == jump.axis);
            own.next().map(|f| f.at)
        };
        matches!((of(first), of(cycle)), (Some(before), Some(after)) if after > before)
    })
}

/// The only block among `jumps`, if it is only one.
#[must_use]
pub fn single_block(jumps: &[Jump]) -> Option<usize> {
    let first = jumps.first()?.block;
    jumps.iter().all(|j| j.block == first).then_some(first)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::latency_share::LatencyShares;
    use metrology::Stamp;
    use nalgebra::Vector3;

    fn cycle(at_s: i64, drifts_mm: [f64; 2]) -> Vec<FaceDrift> {
        let face = |(block, drift_mm)| FaceDrift {
            block,
            axis: Axis::X,
            point_mm: Vector3::zeros(),
            drift_mm,
            standard_uncertainty_mm: 4e-4,
            hot_uncertainty_mm: 3e-4,
            latency: LatencyShares::default(),
            at: Stamp::from_nanos(at_s * 1_000_000_000),
        };
        drifts_mm.into_iter().enumerate().map(face).collect()
    }

    #[test]
    fn eq1_a_pushed_block_is_kept_back_until_the_next_cycle_repeats_it() {
        let mut gate = Quarantine::new(1e-3 / 60.0);
        let accepted = cycle(0, [0.010, 0.012]);
        assert_eq!(
            gate.judge(&accepted, &cycle(600, [0.014, 0.016])),
            Verdict::Plausible
        );
        let Verdict::Quarantined { jumps } = gate.judge(&accepted, &cycle(600, [0.014, 0.066]))
        else {
            panic!("a jump of 54 µm in 10 min passed")
        };
        assert_eq!(single_block(&jumps), Some(1));
        assert!((jumps[0].change_mm - 0.054).abs() < 1e-12);
        let Verdict::Confirmed { first, .. } = gate.judge(&accepted, &cycle(660, [0.014, 0.0665]))
        else {
            panic!("the repeated jump was not confirmed")
        };
        assert!((first[1].drift_mm - 0.066).abs() < 1e-12);
        assert!(!gate.is_occupied());
    }

    #[test]
    fn the_same_touches_told_twice_confirm_nothing() {
        let mut gate = Quarantine::new(3e-3 / 60.0);
        let accepted = cycle(0, [0.0, 0.0]);
        gate.judge(&accepted, &cycle(600, [0.1, 0.1]));
        let again = gate.judge(&accepted, &cycle(600, [0.1, 0.1]));
        assert!(matches!(again, Verdict::Quarantined { .. }), "{again:?}");
        let measured = gate.judge(&accepted, &cycle(660, [0.1, 0.1]));
        assert!(
            matches!(measured, Verdict::Confirmed { .. }),
            "{measured:?}"
        );
    }

    #[test]
    fn a_wrong_cycle_is_contradicted_by_the_next() {
        let mut gate = Quarantine::new(1e-3 / 60.0);
        let accepted = cycle(0, [0.0, 0.0]);
        gate.judge(&accepted, &cycle(600, [0.1, 0.1]));
        assert_eq!(
            gate.judge(&accepted, &cycle(660, [0.001, 0.001])),
            Verdict::Contradicted
        );
        gate.judge(&accepted, &cycle(720, [0.1, 0.1]));
        let third = gate.judge(&accepted, &cycle(780, [0.3, 0.3]));
        assert!(matches!(third, Verdict::Quarantined { .. }) && gate.is_occupied());
    }
}
