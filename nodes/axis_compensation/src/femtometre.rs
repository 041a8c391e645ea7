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
#[inline]
pub fn fm_from_mm(length_mm: f64) -> Option<i64> {
    (length_mm.abs() <= GREATEST_MM).then(|| rounded(length_mm * FM_PER_MM))
}

/// The nearest whole number, halves away from zero, of a number inside ±2⁶²: `f64::round` without the call into the
/// platform's library that most processors' baseline needs.
#[inline]
pub(crate) fn rounded(number: f64) -> i64 {
    #[expect(clippy::cast_possible_truncation, reason = "inside i64")]
    let whole = number as i64;
    // Exact: below 2⁵² both have the same grid, and above nothing is left.
    let left = number - whole as f64;
    whole + i64::from(left >= 0.5) - i64::from(left <= -0.5)
}

/// Millimetres of a whole number of femtometres.
#[must_use]
#[inline]
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
    fn rounding_is_that_of_the_standard_library() {
        let halves = (-40..=40).map(|k| 0.5 * f64::from(k));
        let near = [0.5, 1.5, 2.5, 1e3 + 0.5, 4_503_599_627_370_495.5, 9e15];
        let near = near
            .into_iter()
            .flat_map(|x: f64| [x.next_down(), x, x.next_up()]);
        let scaled = (0..2000).map(|k| (f64::from(k) * 0.731).sin() * 1e18);
        for number in halves.chain(near).chain(scaled) {
            for number in [number, -number] {
                #[expect(clippy::cast_possible_truncation, reason = "below 2⁶²")]
                let expected = number.round() as i64;
                assert_eq!(rounded(number), expected, "{number}");
            }
        }
    }

    #[test]
    fn lengths_that_cannot_be_counted_are_refused() {
        for length_mm in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1.1e6, -1e300] {
            assert_eq!(fm_from_mm(length_mm), None, "{length_mm}");
        }
        assert_eq!(fm_from_mm(1e6), Some(1_000_000_000_000_000_000));
    }
}
