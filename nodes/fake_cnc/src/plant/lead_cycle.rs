//! What a screw repeats with its turns: run-out of its thrust bearing and a drunken thread.
//!
//! ```text
//!   e(q) = (1 + g x) [a sin(t + p) + b sin(2 (t + p))],   t = 2 pi n q / lead              (1)
//!   x = 2 (q - middle) / travel                                                            (2)
//! ```
//!
//! n is 1 for what turns with the screw; the cage of a bearing and a toothed belt have ratios of their own.
//! A screw that is bent or set up askew has another amplitude at its other end (g). The nut is carried by e,
//! which the motor's encoder does not see and a linear scale does.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | a, b | `once_um`, `twice_um` | µm |
//! | p | `phase_deg` | deg |
//! | n | `per_turn` | 1 |
//! | g | `growth`, from the middle to the high end | 1 |

use std::f64::consts::TAU;

use super::error::{PlantError, require_finite, require_positive};
use super::file::LeadCycleEntry;

/// The cyclic error of one screw.
#[derive(Clone, Copy, Debug)]
pub(super) struct LeadCycle {
    once_mm: f64,
    twice_mm: f64,
    phase_rad: f64,
    angle_per_mm: f64,
    growth: f64,
    middle_mm: f64,
    half_travel_mm: f64,
}

impl LeadCycle {
    /// The cycle of a screw of some lead over a travel; `place` stands in errors.
    pub(super) fn new(
        place: &str,
        entry: &LeadCycleEntry,
        lead_mm: f64,
        travel_mm: [f64; 2],
    ) -> Result<Self, PlantError> {
        let at = |key: &str| format!("{place}.{key}");
        for (key, value) in [
            ("once_um", entry.once_um),
            ("twice_um", entry.twice_um),
            ("phase_deg", entry.phase_deg),
            ("growth", entry.growth),
        ] {
            require_finite(at(key), value)?;
        }
        require_positive(at("per_turn"), entry.per_turn)?;
        Ok(Self {
            once_mm: entry.once_um / 1e3,
            twice_mm: entry.twice_um / 1e3,
            phase_rad: entry.phase_deg.to_radians(),
            angle_per_mm: TAU * entry.per_turn / lead_mm,
            growth: entry.growth,
            middle_mm: 0.5 * (travel_mm[0] + travel_mm[1]),
            half_travel_mm: 0.5 * (travel_mm[1] - travel_mm[0]),
        })
    }

    /// (1) at a nut that stands at `nut_mm`, mm.
    pub(super) fn at_mm(&self, nut_mm: f64) -> f64 {
        let angle = nut_mm * self.angle_per_mm + self.phase_rad;
        let size = 1.0 + self.growth * (nut_mm - self.middle_mm) / self.half_travel_mm;
        size * (self.once_mm * angle.sin() + self.twice_mm * (2.0 * angle).sin())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry() -> LeadCycleEntry {
        LeadCycleEntry {
            once_um: 2.0,
            twice_um: 0.5,
            phase_deg: 90.0,
            per_turn: 1.0,
            growth: 0.0,
        }
    }

    #[test]
    fn eq1_the_error_repeats_with_every_turn() {
        let cycle = LeadCycle::new("screw", &entry(), 10.0, [-100.0, 100.0]).unwrap();
        for q in [-73.0, 0.0, 2.5, 31.0] {
            assert!((cycle.at_mm(q) - cycle.at_mm(q + 10.0)).abs() < 1e-12);
        }
        // A quarter of a turn behind the crest of the first wave the second one has turned half.
        assert!((cycle.at_mm(0.0) * 1e3 - 2.0).abs() < 1e-12);
        assert!(cycle.at_mm(2.5).abs() < 1e-12);
    }

    #[test]
    fn eq2_a_bent_screw_errs_more_at_its_far_end() {
        let bent = LeadCycleEntry {
            growth: 0.5,
            ..entry()
        };
        let cycle = LeadCycle::new("screw", &bent, 10.0, [-100.0, 100.0]).unwrap();
        assert!((cycle.at_mm(100.0) * 1e3 - 3.0).abs() < 1e-9);
        assert!((cycle.at_mm(-100.0) * 1e3 - 1.0).abs() < 1e-9);
    }
}
