//! Whole pulses of the control, and what is left below one.
//!
//! ```text
//!   n = trunc(o/δ),   rest = o − n δ,   |rest| < δ                                (1)
//! ```
//!
//! The offset is absolute, so the rest is carried by itself: the next n is cut from the whole again.

/// Splits an offset into pulses of `pulse` (same unit, above 0) and the rest: (1).
#[must_use]
pub fn split(offset: f64, pulse: f64) -> (i64, f64) {
    let mut whole = (offset / pulse).trunc();
    let mut rest = offset - whole * pulse;
    // The quotient rounds: 0.3/0.1 is just below 3 in one build of numbers and 3 in another.
    if rest.abs() >= pulse {
        whole += rest.signum();
        rest -= pulse.copysign(rest);
    }
    #[expect(
        clippy::cast_possible_truncation,
        reason = "the size limit keeps it far inside i64"
    )]
    (whole as i64, rest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn eq1_cuts_towards_zero_on_both_sides() {
        assert_eq!(split(0.00037, 1e-4).0, 3);
        assert_eq!(split(-0.00037, 1e-4).0, -3);
        assert!((split(-0.00037, 1e-4).1 + 0.7e-4).abs() < 1e-12);
        assert_eq!(split(0.0, 1e-4), (0, 0.0));
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            cases: 5000,
            failure_persistence: None,
            rng_seed: proptest::test_runner::RngSeed::Fixed(2),
            ..ProptestConfig::default()
        })]

        #[test]
        fn prop_pulses_and_rest_make_the_offset(offset in -5.0..5.0_f64, pulse in 1e-5..1e-2_f64) {
            let (n, rest) = split(offset, pulse);
            prop_assert!(rest.abs() < pulse);
            prop_assert!((n as f64 * pulse + rest - offset).abs() < 1e-12);
        }
    }
}
