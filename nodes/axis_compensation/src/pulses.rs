//! Whole pulses of the control, and what is left below one, carried to the next cycle.
//!
//! # Model
//!
//! In each cycle k a motion Δx and its compensation ε are owed to the motor, which takes whole pulses δ:
//!
//! ```text
//!   N(k) = trunc[(ρ(k−1) + Δx(k) + ε(k))/δ],   ρ(k) = ρ(k−1) + Δx(k) + ε(k) − N(k) δ   (1)
//!   Σ N δ + ρ = Σ (Δx + ε),   |ρ| < δ                                                 (2)
//! ```
//!
//! All lengths are whole femtometres (`femtometre`), so (2) holds exactly, however long it goes on: no
//! compensation below one pulse is lost. A target that trembles by less than a pulse moves nothing to
//! and fro, since after each pulse almost two pulses lie between the next one up and the next one down.
//!
//! # Holds when
//! The control takes each N(k) once. Who reads only the sum of all pulses may miss cycles.
//!
//! # Agreement
//! `prop_eq2_pulses_and_remainder_are_all_that_was_owed`: exact over 5,000 random trains.
//!
//! # References
//! CN 1562563 A, claim 1: pulse equivalent δ and pre-compensation ε. (1) is DERIVED: the published text
//! breaks off before it.

use crate::femtometre::{fm_from_mm, mm_from_fm};

/// Pulses sent to one axis so far, and what is left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PulseTrain {
    pulse_fm: i64,
    pulses: i64,
    remainder_fm: i64,
}

impl PulseTrain {
    /// Nothing sent, nothing left; `None` where the pulse is not from 1 fm to 1 km.
    #[must_use]
    pub fn new(pulse_mm: f64) -> Option<Self> {
        let pulse_fm = fm_from_mm(pulse_mm).filter(|pulse_fm| *pulse_fm >= 1)?;
        Some(Self {
            pulse_fm,
            pulses: 0,
            remainder_fm: 0,
        })
    }

    /// One cycle of (1); returns N. `None`, and nothing changed, where a sum does not fit into `i64`.
    pub fn advance(&mut self, motion_fm: i64, compensation_fm: i64) -> Option<i64> {
        let owed_fm = self
            .remainder_fm
            .checked_add(motion_fm)?
            .checked_add(compensation_fm)?;
        let pulses = owed_fm / self.pulse_fm;
        self.pulses = self.pulses.checked_add(pulses)?;
        self.remainder_fm = owed_fm % self.pulse_fm;
        Some(pulses)
    }

    /// One cycle towards an absolute offset: ε is what it differs from all that was owed before.
    /// `None`, and nothing changed, where the offset is not a length up to 1 km.
    pub fn follow(&mut self, offset_mm: f64) -> Option<i64> {
        let owed_fm = self
            .pulses
            .checked_mul(self.pulse_fm)?
            .checked_add(self.remainder_fm)?;
        self.advance(0, fm_from_mm(offset_mm)?.checked_sub(owed_fm)?)
    }

    /// Pulse equivalent, fm.
    #[must_use]
    pub fn pulse_fm(&self) -> i64 {
        self.pulse_fm
    }

    /// Sum of all N.
    #[must_use]
    pub fn pulses(&self) -> i64 {
        self.pulses
    }

    /// What is left, fm.
    #[must_use]
    pub fn remainder_fm(&self) -> i64 {
        self.remainder_fm
    }

    /// What is left, mm.
    #[must_use]
    pub fn remainder_mm(&self) -> f64 {
        mm_from_fm(self.remainder_fm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn train() -> PulseTrain {
        PulseTrain::new(1e-4).unwrap()
    }

    #[test]
    fn eq1_cuts_towards_zero_on_both_sides() {
        for sign in [1, -1] {
            let mut train = train();
            assert_eq!(train.advance(sign * 370_000_000, 0), Some(sign * 3));
            assert_eq!(train.remainder_fm(), sign * 70_000_000);
        }
        assert_eq!(train().advance(0, 0), Some(0));
    }

    #[test]
    fn eq1_a_compensation_below_one_pulse_is_not_lost() {
        let mut train = train();
        let sent: i64 = (0..1000)
            .map(|_| train.advance(0, 1_234_567).unwrap())
            .sum();
        assert_eq!((sent, train.remainder_fm()), (12, 34_567_000));
    }

    #[test]
    fn a_trembling_offset_moves_nothing_to_and_fro() {
        let mut train = train();
        train.follow(5.0e-4).unwrap();
        let moved: i64 = (0..1000)
            .map(|k| {
                train
                    .follow(if k % 2 == 0 { 4.6e-4 } else { 5.4e-4 })
                    .unwrap()
            })
            .map(i64::abs)
            .sum();
        assert_eq!((moved, train.pulses()), (0, 5));
    }

    #[test]
    fn pulses_and_offsets_that_cannot_be_counted_are_refused() {
        for pulse_mm in [0.0, -1e-4, f64::NAN, 1e-13, 1e7] {
            assert_eq!(PulseTrain::new(pulse_mm), None, "{pulse_mm}");
        }
        let mut train = train();
        train.follow(0.25).unwrap();
        let before = train;
        assert_eq!(train.follow(f64::NAN), None);
        assert_eq!(train.advance(i64::MAX, i64::MAX), None);
        assert_eq!(train.advance(i64::MAX, 0).map(|_| ()), Some(()));
        assert_eq!(before.pulses(), 2500);
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            cases: 5000,
            failure_persistence: None,
            rng_seed: proptest::test_runner::RngSeed::Fixed(2),
            ..ProptestConfig::default()
        })]

        #[test]
        fn prop_eq2_pulses_and_remainder_are_all_that_was_owed(
            pulse_fm in 1_000_000..10_000_000_000_i64,
            cycles in prop::collection::vec((-400_000_000_000..400_000_000_000_i64, -50_000_000..50_000_000_i64), 1..200),
        ) {
            let mut train = PulseTrain::new(mm_from_fm(pulse_fm)).unwrap();
            prop_assert_eq!(train.pulse_fm(), pulse_fm);
            let (mut owed_fm, mut sent) = (0, 0);
            for (motion_fm, compensation_fm) in cycles {
                sent += train.advance(motion_fm, compensation_fm).unwrap();
                owed_fm += motion_fm + compensation_fm;
                prop_assert_eq!(sent * pulse_fm + train.remainder_fm(), owed_fm);
                prop_assert!(train.remainder_fm().abs() < pulse_fm);
                prop_assert_eq!(sent, train.pulses());
            }
        }

        #[test]
        fn prop_eq2_followed_offsets_are_pulses_and_remainder(
            pulse_mm in 1e-5..1e-2_f64,
            offsets_mm in prop::collection::vec(-5.0..5.0_f64, 1..50),
        ) {
            let mut train = PulseTrain::new(pulse_mm).unwrap();
            for offset_mm in offsets_mm {
                train.follow(offset_mm).unwrap();
                let owed_fm = train.pulses() * train.pulse_fm() + train.remainder_fm();
                prop_assert_eq!(Some(owed_fm), fm_from_mm(offset_mm));
                prop_assert!(train.remainder_fm().abs() < train.pulse_fm());
            }
        }
    }
}
