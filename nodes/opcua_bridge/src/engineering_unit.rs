//! What a server says of the unit of a number (`EngineeringUnits`, OPC 10000-8), compared with the mapping.

use machine_report::unit::Unit;

use crate::proposal::UNITS;

/// Units by their codes of UN/CEFACT Recommendation 20, whose letters a server sends as the bytes of a number.
const CODES: [(&[u8], Unit); 11] = [
    (b"MMT", Unit::Millimeter),
    (b"INH", Unit::Inch),
    (b"DD", Unit::Degree),
    (b"C81", Unit::Radian),
    (b"C16", Unit::MillimeterPerSecond),
    (b"H81", Unit::MillimeterPerMinute),
    (b"RPM", Unit::RevolutionPerMinute),
    (b"RPS", Unit::RevolutionPerSecond),
    (b"CEL", Unit::Celsius),
    (b"FAH", Unit::Fahrenheit),
    (b"P1", Unit::Percent),
];

/// Units by their names in words.
const UNIT_NAMES: [(&str, Unit); 10] = [
    ("millimetre", Unit::Millimeter),
    ("inch", Unit::Inch),
    ("degree", Unit::Degree),
    ("degrees", Unit::Degree),
    ("rad", Unit::Radian),
    ("revolutions per minute", Unit::RevolutionPerMinute),
    ("r/s", Unit::RevolutionPerSecond),
    ("degree celsius", Unit::Celsius),
    ("degree fahrenheit", Unit::Fahrenheit),
    ("per cent", Unit::Percent),
];

/// The unit that a server shows of a node.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ShownUnit {
    /// As people read it.
    pub text: String,
    /// Code as a number; 0 or -1: none.
    pub code: i32,
}

impl ShownUnit {
    /// Whether the number is in this unit; `None`: the server says nothing.
    #[must_use]
    pub fn is(&self, unit: Unit) -> Option<bool> {
        let text = self.text.trim();
        let by_code = CODES.iter().find(|(code, _)| number_of(code) == self.code);
        if text.is_empty() && by_code.is_none() {
            return None;
        }
        let lower = text.to_lowercase();
        let is_so_called = UNITS.contains(&(text, unit))
            || UNIT_NAMES.contains(&(lower.as_str(), unit))
            || unit.word().to_lowercase() == lower;
        Some(is_so_called || by_code.is_some_and(|(_, known)| *known == unit))
    }

    /// For people: the text, else the code.
    #[must_use]
    pub fn shown(&self) -> String {
        if self.text.trim().is_empty() {
            format!("code {}", self.code)
        } else {
            format!("{:?}", self.text.trim())
        }
    }
}

fn number_of(code: &[u8]) -> i32 {
    let bytes = code.iter();
    bytes.fold(0, |number, byte| (number << 8) | i32::from(*byte))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(text: &str, code: i32) -> ShownUnit {
        let text = text.to_owned();
        ShownUnit { text, code }
    }

    #[test]
    fn units_are_known_by_text_or_code() {
        for (text, code, unit) in [
            ("mm", 5_066_068, Unit::Millimeter),
            ("mm", -1, Unit::Millimeter),
            ("", 5_066_068, Unit::Millimeter),
            ("MILLIMETER", 0, Unit::Millimeter),
            ("Zoll", 4_804_168, Unit::Inch),
            ("Inch", 0, Unit::Inch),
            ("°F", 4_604_232, Unit::Fahrenheit),
            ("°C", 4_408_652, Unit::Celsius),
            ("%", 20_529, Unit::Percent),
            ("°", 17_476, Unit::Degree),
            ("1/min", 0, Unit::RevolutionPerMinute),
        ] {
            let found = shown(text, code);
            assert_eq!(found.is(unit), Some(true), "{text} {code}");
            for other in Unit::ALL.into_iter().filter(|other| *other != unit) {
                assert_eq!(found.is(other), Some(false), "{text} {code} {other:?}");
            }
        }
    }

    #[test]
    fn a_unit_that_is_not_known_is_another_one_and_none_is_none() {
        for text in ["µm", "m", "K", "furlong", "mm²"] {
            for unit in Unit::ALL {
                assert_eq!(shown(text, 0).is(unit), Some(false), "{text}");
            }
        }
        for (text, code) in [("", 0), (" ", -1), ("", 77)] {
            assert_eq!(shown(text, code).is(Unit::Millimeter), None);
        }
    }
}
