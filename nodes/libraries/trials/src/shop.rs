//! Trials on the sessions that shops have: tables of a laser, of a ballbar and of a displacement sensor.
//!
//! The generator of this folder shares no formula with the simulator, with the diagnosis or with the plant of the other
//! arms. A trial is what a user brings: tables, their maps and a minimal machine file; the product imports and
//! diagnoses them. The truth knows the size of each effect against the noise, and which other effects of
//! the catalogue make the same readings: there the only right answer is the set.
//!
//! | arm | session | file |
//! |---|---|---|
//! | s1 | one ISO 230-2 run of an axis | `positioning`, `lead`, `layout` |
//! | s2 | circles of a ballbar | `ballbar`, `machine_motion` |
//! | s3 | logs of displacement and temperatures | `logs`, `heat` |
//! | s4 | a shift of four hours | `shift` |

use rand_pcg::Pcg64Mcg;

use crate::arm::Arm;
use crate::trial::stream;

mod ballbar;
pub(crate) mod dice;
mod heat;
mod judge;
mod layout;
mod lead;
mod logs;
mod machine_motion;
mod metric;
mod positioning;
mod shape;
mod shift;
mod tally;
mod truth;

pub use judge::{Answer, Reported, answer, follows_in};
pub use shift::Samples;
pub use tally::{Line, Middle, ShopTally, Split};
pub use truth::{Change, Follow, Name, ShiftTimes, ShopEffect, ShopTruth};

/// One table of a session with its map.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Table {
    /// Name of both files, without their ends.
    pub name: String,
    /// The table.
    pub text: String,
    /// The map of `abbe import`.
    pub map: String,
}

/// A shift as a recorder has it, with what its judge needs beside it.
#[derive(Clone, Debug, PartialEq)]
pub struct Shift {
    /// The samples of its bag.
    pub samples: Samples,
    /// The same with nothing hidden: what no simulator goes below.
    pub bare: Samples,
    /// The same shift with another draw of its noise.
    pub later: Samples,
}

/// A session as its user has it, and what is true of it.
#[derive(Clone, Debug, PartialEq)]
pub struct ShopSession {
    /// Tables in the order of their measurement.
    pub tables: Vec<Table>,
    /// The machine file.
    pub machine: String,
    /// What is to be found.
    pub truth: ShopTruth,
    /// What is recorded instead of tables.
    pub shift: Option<Shift>,
}

impl ShopSession {
    /// Draws the session of a number in an arm of a series; `None`: the arm is of another kind.
    #[must_use]
    pub fn draw(arm: Arm, seed: u64, index: u64) -> Option<Self> {
        let mut random: Pcg64Mcg = stream(arm, seed, index);
        match arm {
            Arm::ShopPositioning => Some(positioning::draw(&mut random)),
            Arm::ShopBallbar => Some(ballbar::draw(&mut random)),
            Arm::ShopLogs => Some(logs::draw(&mut random)),
            Arm::ShopShift => Some(shift::draw(&mut random)),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ARMS: [Arm; 3] = [Arm::ShopPositioning, Arm::ShopBallbar, Arm::ShopLogs];

    #[test]
    fn a_number_always_draws_the_same_session_and_another_one_another() {
        for arm in ARMS {
            let draw = |index: u64| ShopSession::draw(arm, 3, index).unwrap();
            assert_eq!(draw(4), draw(4));
            assert_ne!(draw(4), draw(5));
        }
        assert!(ShopSession::draw(Arm::Null, 3, 0).is_none());
    }

    #[test]
    fn sessions_hide_up_to_three_effects_of_which_some_cannot_be_told_from_others() {
        for arm in ARMS {
            let truths = (0..40).filter_map(|index| Some(ShopSession::draw(arm, 8, index)?.truth));
            let truths: Vec<ShopTruth> = truths.collect();
            let effects = || truths.iter().flat_map(|truth| &truth.effects);
            assert!(truths.iter().any(|truth| truth.effects.is_empty()), "{arm}");
            assert!(truths.iter().all(|truth| truth.effects.len() < 4), "{arm}");
            assert!(effects().any(ShopEffect::is_resolvable), "{arm}");
            assert!(
                effects().any(|effect| !effect.same_readings.is_empty()),
                "{arm}"
            );
            assert!(
                effects().all(|effect| effect.d > 0.0 && effect.d_alone <= 1.001 * effect.d),
                "{arm}"
            );
        }
    }
}
