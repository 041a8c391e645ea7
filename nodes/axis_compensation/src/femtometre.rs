//! Lengths as whole femtometres, in which sums are exact.
//!
//! ```text
//!   1 fm = 1e-12 mm                                                               (1)
//! ```
//!
//! Pulses and what is left of them are counted for hours at 1 kHz. In floating point each sum rounds,
//! and a remainder that is carried on carries its rounding with it. Counted in `i64` nothing rounds
//! but the way in, once for each length:
//!
//! - *decimal*, because a control's pulse equivalent is a decimal fraction of a millimetre: 0.1 µm is
//!   100 000 000 fm exactly, but no whole number of 2^-k mm;
//! - *this fine*, because a position of 500 mm in `f64` has steps of 0.06 fm: rounding it to whole
//!   femtometres adds less than 1e-8 of such a pulse;
//! - *this coarse*, because `i64` then reaches 9.2 km. Lengths up to 1 km are taken, so that a few may be
//!   added without leaving it.

/// Femtometres of one millimetre: (1).
pub const FM_PER_MM: f64 = 1e12;

/// Greatest length that is taken, mm: 1 km.
pub const GREATEST_MM: f64 = 1e6;

/// The nearest whole number of femtometres; `None` where the length is not finite or above 1 km.
#[must_use]
pub fn fm_from_mm(length_mm: f64) -> Option<i64> {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "1e18 is inside i64, and other lengths are refused"
    )]
    (length_mm.abs() <= GREATEST_MM).then(|| (length_mm * FM_PER_MM).round() as i64)
}

/// Millimetres of a whole number of femtometres.
#[must_use]
pub fn mm_from_fm(length_fm: i64) -> f64 {
    length_fm as f64 / FM_PER_MM
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq1_decimal_pulse_equivalents_are_whole_femtometres() {
        assert_eq!(fm_from_mm(0.1e-3), Some(100_000_000));
        assert_eq!(fm_from_mm(0.05e-3), Some(50_000_000));
        assert_eq!(fm_from_mm(-320.0), Some(-320_000_000_000_000));
        assert_eq!(mm_from_fm(2_500_000_000_000).to_bits(), 2.5_f64.to_bits());
    }

    #[test]
    fn lengths_that_cannot_be_counted_are_refused() {
        for length_mm in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1.1e6, -1e300] {
            assert_eq!(fm_from_mm(length_mm), None, "{length_mm}");
        }
        assert_eq!(fm_from_mm(1e6), Some(1_000_000_000_000_000_000));
    }
}
