//! Machines that are measured by designed programmes.
//!
//! A machine is drawn as in the other arms, and its effects are sized by the common programme: a fault is as large as it is,
//! whatever is measured. Then another program designs a programme for the machine file, and [`Trial::measured_by`] gives the
//! effects the D that they have on it. What the programme does not show has a D near 0 there.
//!
//! Trial k of the three arms is on the same machine, with effects of its own: one design serves all three. Minutes and
//! physics follow from
//!
//! ```text
//!   turn = k + floor(k / classes)                                         (1)
//! ```
//!
//! so that every class of an arm which takes them in turn meets 20 and 40 min and both physics equally often.

use std::collections::BTreeMap;

use rand_pcg::Pcg64Mcg;
use sequencer::Plan;
use serde::{Deserialize, Serialize};

use crate::arm::Arm;
use crate::compared::Compared;
use crate::effect::Class;
use crate::error::TrialError;
use crate::trial::{Trial, d_of, deviations, stream};

pub(crate) use overview::by_round;
pub use overview::{Overview, ProgrammeLine, RoundsLine, SizeLine};

mod overview;

/// Minutes of a designed programme, set-ups included.
pub const PROGRAMME_MIN: [f64; 2] = [20.0, 40.0];
/// Minutes of a second round.
pub const SECOND_ROUND_MIN: f64 = 15.0;
/// What machines are drawn with besides the seed of their series.
const MACHINE_SALT: u64 = 0x6d61_6368_696e_6573;

/// A programme that somebody designed.
#[derive(Clone, Debug, PartialEq)]
pub struct Programme {
    /// What is measured.
    pub plan: Plan,
    /// Programs that the plan runs, by name.
    pub programs: BTreeMap<String, String>,
}

/// What is true of a designed programme.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DesignedTruth {
    /// Minutes that it may take, set-ups included.
    pub minutes: f64,
    /// Minutes that it takes.
    pub used_min: f64,
    /// Whether the machine's effects have forms that are not quite the catalogue's.
    pub is_foreign: bool,
    /// Whether a small effect was drawn, where the arm draws small ones and look-alikes.
    pub is_small: bool,
}

/// (1).
const fn turn(index: u64) -> u64 {
    index + index / Class::ALL.len() as u64
}

/// Minutes of the programme of a trial.
#[must_use]
pub const fn minutes(index: u64) -> f64 {
    PROGRAMME_MIN[(turn(index) / 2 % 2) as usize]
}

/// Whether forms are not quite the catalogue's.
pub(crate) const fn is_foreign(arm: Arm, index: u64) -> bool {
    arm.is_designed() && turn(index) % 2 == 1
}

/// Whether a small effect is drawn, and not one that has a double.
pub(crate) const fn is_small(arm: Arm, index: u64) -> bool {
    matches!(arm, Arm::DesignedTwoRounds) && index % 2 == 1
}

/// Draws the machine of a number, the same for every arm; none of arms whose machines are their own.
pub(crate) fn machines(arm: Arm, seed: u64, index: u64) -> Option<Pcg64Mcg> {
    let of_all = || stream(Arm::Designed, seed ^ MACHINE_SALT, index);
    arm.is_designed().then(of_all)
}

impl Trial {
    /// The same machine and effects with another programme: effects get the D that they have there.
    ///
    /// # Errors
    /// When the programme cannot be measured on this machine.
    pub fn measured_by(mut self, programme: &Programme) -> Result<Self, TrialError> {
        for rig in [&mut self.rig, &mut self.bare] {
            rig.plan = programme.plan.clone();
            rig.programs = programme.programs.clone();
        }
        let (bare, program_min) = deviations(&self.bare)?;
        for (effect, hidden) in self.truth.effects.iter_mut().zip(&self.hidden) {
            effect.common_d = Some(effect.d);
            effect.d = d_of(&self.bare, &bare, hidden)?;
        }
        let (arm, index) = (self.truth.arm, self.truth.index);
        self.truth.designed = Some(DesignedTruth {
            minutes: minutes(index),
            used_min: Compared::Designed.set_up_min(&programme.plan) + program_min,
            is_foreign: is_foreign(arm, index),
            is_small: is_small(arm, index),
        });
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq1_every_class_in_turn_meets_both_minutes_and_both_physics_equally_often() {
        let classes = Class::ALL.len() as u64;
        for class in 0..classes {
            let mut seen = BTreeMap::<(u64, bool), u64>::new();
            for round in 0..4 {
                let index = class + round * classes;
                let minutes = minutes(index) as u64;
                let foreign = is_foreign(Arm::DesignedLeftOut, index);
                *seen.entry((minutes, foreign)).or_default() += 1;
            }
            assert_eq!(seen.len(), 4, "{class}: {seen:?}");
        }
    }

    /// Of (1) with 14 classes: 0, 1, 2, 3 and, behind the fourteenth, 15 and 16.
    #[test]
    fn minutes_and_physics_alternate() {
        let minutes = [0, 1, 2, 3, 4, 14, 15].map(|index| minutes(index) as u64);
        assert_eq!(minutes, [20, 20, 40, 40, 20, 40, 20]);
        let foreign = [0, 1, 2, 3, 14, 15].map(|index| is_foreign(Arm::Designed, index));
        assert_eq!(foreign, [false, true, false, true, true, false]);
        assert!(!is_foreign(Arm::Catalogue, 1) && !is_small(Arm::Designed, 1));
    }

    #[test]
    fn the_three_arms_measure_the_same_machine_with_effects_of_their_own() {
        let [s5, s6, s7] = [Arm::Designed, Arm::DesignedLeftOut, Arm::DesignedTwoRounds]
            .map(|arm| Trial::draw(arm, 6, 1).unwrap());
        assert_eq!(s5.rig.machine, s6.rig.machine);
        assert_eq!(s5.bare, s7.bare);
        assert_eq!(s6.truth.effects.len(), 1);
        assert_eq!(s6.truth.effects[0].class, Class::ScaleError);
        assert_eq!(s6.truth.left_out.as_deref(), Some("scale_error"));
        assert!(s7.truth.left_out.is_none() && s7.rig.plant.vibration.is_some());
        let other = Trial::draw(Arm::DesignedLeftOut, 6, 2).unwrap();
        assert_ne!(other.rig.machine, s6.rig.machine);
    }

    /// A play of one axis: circles in a plane without that axis show nothing of it, and one circle less than the session.
    #[test]
    fn effects_get_the_d_of_the_programme_that_measures_them() {
        let rounds = (0..12).map(|round| round * Class::ALL.len() as u64);
        let mut trials = rounds.map(|index| Trial::draw(Arm::DesignedLeftOut, 6, index).unwrap());
        let is_large = |trial: &Trial| trial.truth.effects[0].d > 30.0;
        let drawn = trials.find(is_large).unwrap();
        let common_d = drawn.truth.effects[0].d;
        let axis = drawn.truth.effects[0].axis.clone();
        let text = |placement: &str| {
            format!(
                "title: one circle\nsteps:\n  - {{do: grid, placement: {placement}, trajectory: circle, radius_mm: 50.0, \
                 feed_mm_min: 3000.0, sense: both, on_the_fly: true}}\n"
            )
        };
        let of = |placement: &str| {
            let programme = Programme {
                plan: Plan::from_yaml(&text(placement)).unwrap(),
                programs: BTreeMap::new(),
            };
            drawn.clone().measured_by(&programme).unwrap()
        };
        let (with, without) = match axis.as_str() {
            "X" => ("middle", "front"),
            "Y" => ("middle", "side"),
            _ => ("side", "middle"),
        };
        let [seen, unseen] = [with, without].map(of);
        let d = |trial: &Trial| trial.truth.effects[0].d;
        assert_eq!(seen.truth.effects[0].common_d, Some(common_d));
        assert!(d(&seen) > 2.0 * d(&unseen), "{} {}", d(&seen), d(&unseen));
        assert!(d(&seen) < common_d, "{} {common_d}", d(&seen));
        let designed = seen.truth.designed.unwrap();
        assert!(!designed.is_small);
        // A plate, and a circle of 50 mm in both senses.
        let used_min = designed.used_min;
        assert!((6.1..8.5).contains(&used_min), "{used_min}");
    }
}
