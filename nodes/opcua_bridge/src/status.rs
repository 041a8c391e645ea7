//! Status codes of values.
//!
//! ```text
//!   severity = bits 30, 31: 0 good, 1 uncertain, 2 and 3 bad                                  (1)
//!   overflow = bit 7, where bits 10 and 11 are 01 (a status of a value)                       (2)
//! ```
//!
//! # References
//! \[1\] OPC 10000-4, 7.39 StatusCode.

use std::fmt;

/// Quality of a value by its status, (1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Quality {
    /// It can be used.
    Good,
    /// Its quality is uncertain, for a reason that the code gives.
    Uncertain,
    /// It cannot be used.
    Bad,
}

/// A status code.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Status(pub u32);

/// Names of the codes that machines send for values, without the info bits.
const NAMES: [(u32, &str); 18] = [
    (0x0000_0000, "Good"),
    (0x0096_0000, "GoodLocalOverride"),
    (0x4000_0000, "Uncertain"),
    (0x408F_0000, "UncertainNoCommunicationLastUsableValue"),
    (0x4090_0000, "UncertainLastUsableValue"),
    (0x4092_0000, "UncertainInitialValue"),
    (0x4093_0000, "UncertainSensorNotAccurate"),
    (0x4094_0000, "UncertainEngineeringUnitsExceeded"),
    (0x8000_0000, "Bad"),
    (0x8031_0000, "BadNoCommunication"),
    (0x8032_0000, "BadWaitingForInitialData"),
    (0x8033_0000, "BadNodeIdInvalid"),
    (0x8034_0000, "BadNodeIdUnknown"),
    (0x8089_0000, "BadConfigurationError"),
    (0x808A_0000, "BadNotConnected"),
    (0x808B_0000, "BadDeviceFailure"),
    (0x808C_0000, "BadSensorFailure"),
    (0x808D_0000, "BadOutOfService"),
];

impl Status {
    /// By (1).
    #[must_use]
    pub const fn quality(self) -> Quality {
        match self.0 >> 30 {
            0 => Quality::Good,
            1 => Quality::Uncertain,
            _ => Quality::Bad,
        }
    }

    /// Whether the server's queue ran over before this value, by (2).
    #[must_use]
    pub const fn has_overflow(self) -> bool {
        self.0 & 0x0C80 == 0x0480
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let code = self.0 & 0xFFFF_0000;
        match NAMES.iter().find(|(known, _)| *known == code) {
            Some((_, name)) => f.write_str(name),
            None => write!(f, "status 0x{:08X}", self.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq1_the_two_highest_bits_are_the_quality() {
        for (bits, quality) in [
            (0, Quality::Good),
            (0x3FFF_FFFF, Quality::Good),
            (0x4000_0000, Quality::Uncertain),
            (0x7FFF_FFFF, Quality::Uncertain),
            (0x8000_0000, Quality::Bad),
            (0xC000_0000, Quality::Bad),
            (u32::MAX, Quality::Bad),
        ] {
            assert_eq!(Status(bits).quality(), quality, "{bits:08X}");
        }
    }

    #[test]
    fn eq2_the_overflow_bit_counts_in_a_status_of_a_value_alone() {
        assert!(Status(0x0480).has_overflow());
        assert!(Status(0x4000_0480).has_overflow());
        for bits in [0, 0x0080, 0x0400, 0x0C80, 0x0880] {
            assert!(!Status(bits).has_overflow(), "{bits:04X}");
        }
    }

    #[test]
    fn a_status_has_its_name_whatever_its_info_bits_and_else_its_number() {
        assert_eq!(Status(0x808C_0480).to_string(), "BadSensorFailure");
        assert_eq!(Status(0x8123_0001).to_string(), "status 0x81230001");
    }
}
