//! Rules of the diagnosis that can be switched off, to see what each is worth.
//!
//! A diagnosis that people rely on has them all. Trials switch one off at a time and count what it costs.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::GapError;

/// One rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Rule {
    /// An effect has one size under all conditions (`confirm`).
    Constancy,
    /// An effect may have a form that is not quite the catalogue's (`widening`).
    FreeShapes,
    /// A member of a set may be replaced by another effect (`selection`).
    SwapSearch,
    /// An effect must hold on runs left out (`confirm`).
    HeldOut,
    /// A confidence is what trials have shown it to be worth (`recalibration`).
    Recalibration,
}

impl Rule {
    /// Every rule, in order.
    pub const ALL: [Self; 5] = [
        Self::Constancy,
        Self::FreeShapes,
        Self::SwapSearch,
        Self::HeldOut,
        Self::Recalibration,
    ];

    /// Its name.
    #[must_use]
    pub const fn id(self) -> &'static str {
        [
            "constancy",
            "free_shapes",
            "swap_search",
            "held_out",
            "recalibration",
        ][self as usize]
    }
}

impl fmt::Display for Rule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.id())
    }
}

impl FromStr for Rule {
    type Err = GapError;

    fn from_str(name: &str) -> Result<Self, GapError> {
        let known = Self::ALL.into_iter().find(|rule| rule.id() == name);
        known.ok_or_else(|| GapError::Rule {
            name: name.to_owned(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_rule_is_read_back_by_its_name_and_no_other_is() {
        for rule in Rule::ALL {
            assert_eq!(rule.to_string().parse::<Rule>().unwrap(), rule);
            let text = serde_json::to_string(&rule).unwrap();
            assert_eq!(text, format!("\"{rule}\""));
        }
        let error = "luck".parse::<Rule>().unwrap_err();
        assert!(error.to_string().contains("luck"), "{error}");
    }
}
