//! Numbers as controls read them.

use metrology::Axis;

/// `value` with so many decimals, without a negative zero, which some readers take for text.
pub(super) fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(size) if size.bytes().all(|c| c == b'0' || c == b'.') => size.to_owned(),
        _ => text,
    }
}

/// mm as they are; rad in degrees, the unit of rotary axes on every control here.
pub(super) fn mm_or_deg(axis: Axis, value: f64) -> f64 {
    if axis.is_linear() {
        value
    } else {
        value.to_degrees()
    }
}

/// Name of that unit.
pub(super) const fn unit(axis: Axis) -> &'static str {
    if axis.is_linear() { "mm" } else { "deg" }
}

/// Whether a control can have this name.
pub(super) fn is_name(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_alphabetic())
        && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_leaves_no_negative_zero() {
        assert_eq!(fixed(-0.000_000_4, 6), "0.000000");
        assert_eq!(fixed(-0.000_000_6, 6), "-0.000001");
        assert_eq!(fixed(12.5, 3), "12.500");
    }

    #[test]
    fn names_are_words() {
        for good in ["X1", "AX2", "z_1"] {
            assert!(is_name(good), "{good}");
        }
        for bad in ["", "1X", "X 1", "X]", "\u{b5}"] {
            assert!(!is_name(bad), "{bad}");
        }
    }
}
