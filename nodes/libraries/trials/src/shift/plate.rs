//! A plate that does not stay where it was put: a holder that slips, a glue or a magnet that gives way.
//!
//! ```text
//!   reading(p, t) += (w(t) - w(t_zero)) (s + a e_z x p)                   (1)
//!   w = 0 before t_0, 1 after t_0 + T, evenly in between                  (2)
//! ```
//!
//! The count is set to zero where the plate is then, so that nothing is seen of what it has done before.

use metrology::sample::GridSample;
use metrology::stamp::Span;

/// A move of the plate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlateMove {
    /// t_0 of (2), since the session began, s.
    pub from_s: f64,
    /// T of (2), s; 0: at once.
    pub over_s: f64,
    /// s of (1), along both directions of the plate, mm.
    pub shift_mm: [f64; 2],
    /// a of (1), rad.
    pub turn_rad: f64,
}

/// The same with the zero that is counted from.
#[derive(Clone, Debug)]
pub(crate) struct PlateWay<'a> {
    plate: Option<&'a PlateMove>,
    zero_id: Option<u32>,
    at_zero: f64,
}

impl PlateMove {
    /// (2).
    fn share(&self, since_s: f64) -> f64 {
        let after_s = since_s - self.from_s;
        if after_s < 0.0 {
            0.0
        } else if after_s >= self.over_s {
            1.0
        } else {
            after_s / self.over_s
        }
    }
}

impl<'a> PlateWay<'a> {
    pub(crate) const fn new(plate: Option<&'a PlateMove>) -> Self {
        Self {
            plate,
            zero_id: None,
            at_zero: 0.0,
        }
    }

    /// (1) of a reading, mm.
    pub(crate) fn moved_mm(&mut self, since: Span, sample: &GridSample) -> [f64; 2] {
        let Some(plate) = self.plate else {
            return [0.0; 2];
        };
        let share = plate.share(since.as_secs_f64());
        if self.zero_id.replace(sample.zero_id) != Some(sample.zero_id) {
            self.at_zero = share;
        }
        let moved = share - self.at_zero;
        let [u, v] = plate.shift_mm;
        let turned_mm = [-plate.turn_rad * sample.v_mm, plate.turn_rad * sample.u_mm];
        [moved * (u + turned_mm[0]), moved * (v + turned_mm[1])]
    }
}

#[cfg(test)]
mod tests {
    use metrology::Stamp;
    use metrology::sample::TestPlane;

    use super::*;

    fn sample(zero_id: u32, [u_mm, v_mm]: [f64; 2]) -> GridSample {
        GridSample {
            at: Stamp::default(),
            plane: TestPlane::Xy,
            u_mm,
            v_mm,
            zero_id,
        }
    }

    #[test]
    fn eq1_a_plate_that_has_slipped_is_seen_until_the_next_zero() {
        let plate = PlateMove {
            from_s: 100.0,
            over_s: 40.0,
            shift_mm: [4e-3, -2e-3],
            turn_rad: 1e-4,
        };
        let mut way = PlateWay::new(Some(&plate));
        let mut at = |since_s: f64, zero_id: u32| {
            way.moved_mm(Span::from_secs_f64(since_s), &sample(zero_id, [50.0, 20.0]))
        };
        let is = |found: [f64; 2], wanted: [f64; 2]| {
            let off = [found[0] - wanted[0], found[1] - wanted[1]];
            assert!(off.iter().all(|off| off.abs() < 1e-12), "{found:?}");
        };
        is(at(99.0, 1), [0.0; 2]);
        // 4 - 0.1 x 20 and -2 + 0.1 x 50 µm, and half of it halfway.
        is(at(120.0, 1), [1e-3, 1.5e-3]);
        is(at(150.0, 1), [2e-3, 3e-3]);
        is(at(160.0, 2), [0.0; 2]);
    }
}
