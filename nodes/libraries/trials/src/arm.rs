//! Kinds of trials: what is hidden, and from whom.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::TrialError;

/// One kind of trials.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Arm {
    /// 0 to 3 effects of the catalogue's classes.
    Catalogue,
    /// One effect whose class the diagnosis is told to leave out.
    LeftOut,
    /// 0 to 3 effects whose form is not quite the catalogue's.
    Foreign,
    /// No effect.
    Null,
    /// No effect, and runs that are no repeats scatter more than the repeats show.
    HeavyNull,
    /// One effect that has a double: another class that looks nearly like it.
    Confusable,
    /// One effect of a class, every class and every axis in turn, large enough to be named.
    Alone,
    /// As `Confusable`; the diagnosis is given one more run, the first that it asks for.
    TwoRounds,
    /// One effect of a class, every class and every axis in turn, as small as can just be named or smaller, whether or not
    /// a machine's physics has it as small.
    Limit,
    /// One effect of a class that has a programme of its own, every such class and every axis in turn, or none.
    Own,
    /// One effect of such a class, which the diagnosis is told to leave out.
    OwnLeftOut,
    /// One ISO 230-2 run of a shop.
    ShopPositioning,
    /// Circles of a shop's ballbar.
    ShopBallbar,
    /// Logs of a shop's displacement sensor and thermometers.
    ShopLogs,
    /// 0 to 3 effects, every second machine with forms that are not quite the catalogue's, measured by a designed programme.
    Designed,
    /// The same with one effect, whose class the diagnosis is told to leave out.
    DesignedLeftOut,
    /// One effect that has a double or is small; a designed second round follows the designed programme.
    DesignedTwoRounds,
    /// A shift of four hours with circles, blocks and production.
    ShopShift,
}

impl Arm {
    /// Every arm, in order.
    pub const ALL: [Self; 18] = [
        Self::Catalogue,
        Self::LeftOut,
        Self::Foreign,
        Self::Null,
        Self::HeavyNull,
        Self::Confusable,
        Self::Alone,
        Self::TwoRounds,
        Self::Limit,
        Self::Own,
        Self::OwnLeftOut,
        Self::ShopPositioning,
        Self::ShopBallbar,
        Self::ShopLogs,
        Self::Designed,
        Self::DesignedLeftOut,
        Self::DesignedTwoRounds,
        Self::ShopShift,
    ];

    /// Its number in the protocol; the others go by their names.
    #[must_use]
    pub const fn numeral(self) -> &'static str {
        [
            "i",
            "ii",
            "iii",
            "iv",
            "v",
            "vi",
            "alone",
            "vii",
            "limit",
            "own",
            "own-left-out",
            "s1",
            "s2",
            "s3",
            "s5",
            "s6",
            "s7",
            "s4",
        ][self as usize]
    }

    /// In words.
    #[must_use]
    pub const fn title(self) -> &'static str {
        [
            "classes of the catalogue",
            "a class left out",
            "different physics",
            "nothing hidden",
            "nothing hidden, noise worse than the repeats",
            "confusable pairs",
            "each class alone",
            "confusable pairs, with one more run of the diagnosis' choice",
            "each class alone, about as small as can be named",
            "classes with programmes of their own",
            "classes with programmes of their own, left out",
            "a shop's ISO 230-2 run",
            "a shop's ballbar",
            "a shop's logs of displacement and temperatures",
            "a designed programme",
            "a designed programme, a class left out",
            "a designed programme and a designed second round",
            "a shift of four hours",
        ][self as usize]
    }

    /// Whether the diagnosis is told to leave out the class that is hidden.
    #[must_use]
    pub const fn leaves_out(self) -> bool {
        matches!(
            self,
            Self::LeftOut | Self::OwnLeftOut | Self::DesignedLeftOut
        )
    }

    /// Whether its machines are measured by designed programmes.
    #[must_use]
    pub const fn is_designed(self) -> bool {
        matches!(
            self,
            Self::Designed | Self::DesignedLeftOut | Self::DesignedTwoRounds
        )
    }

    /// Whether its sessions are those of shops: tables, or the bag of a shift.
    #[must_use]
    pub const fn is_of_a_shop(self) -> bool {
        matches!(
            self,
            Self::ShopPositioning | Self::ShopBallbar | Self::ShopLogs | Self::ShopShift
        )
    }

    /// Whether its machines have nothing to be named.
    #[must_use]
    pub const fn is_null(self) -> bool {
        matches!(self, Self::Null | Self::HeavyNull)
    }
}

impl fmt::Display for Arm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.numeral())
    }
}

impl FromStr for Arm {
    type Err = TrialError;

    fn from_str(name: &str) -> Result<Self, TrialError> {
        let known = Self::ALL.into_iter().find(|arm| arm.numeral() == name);
        known.ok_or_else(|| TrialError::UnknownArm {
            name: name.to_owned(),
        })
    }
}
