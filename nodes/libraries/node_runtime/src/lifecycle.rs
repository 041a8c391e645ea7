//! The states of a managed node and the steps between them, as ROS 2 has published them.
//!
//! ```text
//!                 configure            activate
//!   unconfigured ───────────▶ inactive ─────────▶ active
//!        ▲      ◀───────────     │ ▲  ◀─────────    │
//!        │         cleanup       │ └── deactivate ──┘
//!        └── an error, put in order      any of them: shutdown ──▶ finalized
//! ```
//!
//! Each arrow passes a state of its own (configuring, deactivating, …) that lasts as long as the node needs,
//! and ends by success, failure (back to where it began) or error. Only the arrows can be asked for; how
//! one ends is the node's own answer.
//!
//! # References
//! ROS 2 design, "Managed nodes"; numbers and labels are those of `lifecycle_msgs`, their order the one in
//! which `rcl_lifecycle` names them.

use abbe_msgs::lifecycle_msgs::msg::{
    State as StateMessage, Transition as TransitionMessage, TransitionDescription, TransitionEvent,
};
use metrology::stamp::{Host, Stamp};

/// What a managed node is doing; the numbers are those of `lifecycle_msgs/msg/State`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// Nobody knows.
    Unknown = 0,
    /// Made, holds nothing.
    Unconfigured = 1,
    /// Ready, does nothing.
    Inactive = 2,
    /// At work.
    Active = 3,
    /// At its end.
    Finalized = 4,
    /// From unconfigured to inactive.
    Configuring = 10,
    /// From inactive to unconfigured.
    CleaningUp = 11,
    /// To finalized.
    ShuttingDown = 12,
    /// From inactive to active.
    Activating = 13,
    /// From active to inactive.
    Deactivating = 14,
    /// A step went wrong.
    ErrorProcessing = 15,
}

impl State {
    /// Every state.
    pub const ALL: [Self; 11] = [
        Self::Unknown,
        Self::Unconfigured,
        Self::Inactive,
        Self::Active,
        Self::Finalized,
        Self::Configuring,
        Self::CleaningUp,
        Self::ShuttingDown,
        Self::Activating,
        Self::Deactivating,
        Self::ErrorProcessing,
    ];

    /// Its name on the wire.
    #[must_use]
    pub const fn label(self) -> &'static str {
        match self {
            Self::Unknown => "unknown",
            Self::Unconfigured => "unconfigured",
            Self::Inactive => "inactive",
            Self::Active => "active",
            Self::Finalized => "finalized",
            Self::Configuring => "configuring",
            Self::CleaningUp => "cleaningup",
            Self::ShuttingDown => "shuttingdown",
            Self::Activating => "activating",
            Self::Deactivating => "deactivating",
            Self::ErrorProcessing => "errorprocessing",
        }
    }

    /// As it travels.
    #[must_use]
    pub fn message(self) -> StateMessage {
        StateMessage {
            id: self as u8,
            label: self.label().to_owned(),
        }
    }
}

/// How a step ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// As it was meant.
    Success,
    /// Back where it began.
    Failure,
    /// With something to be put in order.
    Error,
}

/// A step between two states.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Transition {
    /// Its number in `lifecycle_msgs/msg/Transition`.
    pub id: u8,
    /// Its name on the wire.
    pub label: &'static str,
    /// Where it begins.
    pub start: State,
    /// Where it ends.
    pub goal: State,
}

/// Numbers below this can be asked for.
const FIRST_PRIVATE_ID: u8 = 10;

const fn asked(id: u8, label: &'static str, start: State, goal: State) -> Transition {
    Transition {
        id,
        label,
        start,
        goal,
    }
}

/// The three ends of the state that a step passes: success, failure, error.
const fn ends(first_id: u8, passed: State, success: State, failure: State) -> [Transition; 3] {
    let error = match passed {
        State::ErrorProcessing => State::Finalized,
        _ => State::ErrorProcessing,
    };
    [
        asked(first_id, "transition_success", passed, success),
        asked(first_id + 1, "transition_failure", passed, failure),
        asked(first_id + 2, "transition_error", passed, error),
    ]
}

impl Transition {
    /// Every step.
    pub const ALL: [Self; 25] = {
        use State::{
            Activating, Active, CleaningUp, Configuring, Deactivating, ErrorProcessing, Finalized,
            Inactive, ShuttingDown, Unconfigured,
        };
        let [configured, not_configured, bad_configuration] =
            ends(10, Configuring, Inactive, Unconfigured);
        let [cleaned, not_cleaned, bad_cleaning] = ends(20, CleaningUp, Unconfigured, Inactive);
        let [activated, not_activated, bad_activation] = ends(30, Activating, Active, Inactive);
        let [deactivated, not_deactivated, bad_deactivation] =
            ends(40, Deactivating, Inactive, Active);
        let [shut_down, not_shut_down, bad_shutdown] = ends(50, ShuttingDown, Finalized, Finalized);
        let [in_order, not_in_order, bad_order] =
            ends(60, ErrorProcessing, Unconfigured, Finalized);
        [
            asked(1, "configure", Unconfigured, Configuring),
            configured,
            not_configured,
            bad_configuration,
            asked(2, "cleanup", Inactive, CleaningUp),
            cleaned,
            not_cleaned,
            bad_cleaning,
            asked(3, "activate", Inactive, Activating),
            activated,
            not_activated,
            bad_activation,
            asked(4, "deactivate", Active, Deactivating),
            deactivated,
            not_deactivated,
            bad_deactivation,
            asked(5, "shutdown", Unconfigured, ShuttingDown),
            asked(6, "shutdown", Inactive, ShuttingDown),
            asked(7, "shutdown", Active, ShuttingDown),
            shut_down,
            not_shut_down,
            bad_shutdown,
            in_order,
            not_in_order,
            bad_order,
        ]
    };

    /// The step that somebody asks for in `state`, by its label or, where that is empty, its number;
    /// `None`: it does not begin there, or is not to be asked for.
    #[must_use]
    pub fn wanted(state: State, wanted: &TransitionMessage) -> Option<Self> {
        let is_wanted = |step: &&Self| {
            if wanted.label.is_empty() {
                step.id == wanted.id
            } else {
                step.label == wanted.label
            }
        };
        Self::of(state)
            .filter(|step| step.id < FIRST_PRIVATE_ID)
            .find(is_wanted)
            .copied()
    }

    /// The steps that begin in `state`.
    pub fn of(state: State) -> impl Iterator<Item = &'static Self> {
        Self::ALL.iter().filter(move |step| step.start == state)
    }

    /// How the step that passes `passed` ends; `None`: that state has no ends.
    #[must_use]
    pub fn end(passed: State, ending: Ending) -> Option<Self> {
        let label = match ending {
            Ending::Success => "transition_success",
            Ending::Failure => "transition_failure",
            Ending::Error => "transition_error",
        };
        Self::of(passed).find(|step| step.label == label).copied()
    }

    fn message(self) -> TransitionMessage {
        TransitionMessage {
            id: self.id,
            label: self.label.to_owned(),
        }
    }

    /// As it is listed.
    #[must_use]
    pub fn description(self) -> TransitionDescription {
        TransitionDescription {
            transition: self.message(),
            start_state: self.start.message(),
            goal_state: self.goal.message(),
        }
    }

    /// The news that it was taken `at`.
    #[must_use]
    pub fn event(self, at: Stamp<Host>) -> TransitionEvent {
        TransitionEvent {
            timestamp: u64::try_from(at.nanos()).unwrap_or(0),
            transition: self.message(),
            start_state: self.start.message(),
            goal_state: self.goal.message(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_rcl_lifecycle_states_and_steps_are_equal_in_number_label_ends_and_order() {
        let jazzy: Vec<&str> = include_str!("../tests/data/jazzy_lifecycle.tsv")
            .lines()
            .filter(|line| !line.starts_with('#'))
            .collect();
        let states = State::ALL
            .iter()
            .map(|state| format!("state\t{}\t{}", *state as u8, state.label()));
        let steps = Transition::ALL.iter().map(|step| {
            let (start, goal) = (step.start as u8, step.goal as u8);
            format!("transition\t{}\t{}\t{start}\t{goal}", step.id, step.label)
        });
        assert_eq!(states.chain(steps).collect::<Vec<_>>(), jazzy);
    }

    fn wanted(state: State, id: u8, label: &str) -> Option<u8> {
        let wanted = TransitionMessage {
            id,
            label: label.to_owned(),
        };
        Transition::wanted(state, &wanted).map(|step| step.id)
    }

    #[test]
    fn a_step_is_found_by_label_before_number_and_only_where_it_begins() {
        assert_eq!(wanted(State::Inactive, 3, ""), Some(3));
        assert_eq!(wanted(State::Inactive, 3, "cleanup"), Some(2));
        assert_eq!(wanted(State::Active, 3, ""), None);
        assert_eq!(wanted(State::Active, 0, "shutdown"), Some(7));
        assert_eq!(wanted(State::Unconfigured, 0, "shutdown"), Some(5));
        assert_eq!(wanted(State::Finalized, 0, "shutdown"), None);
        assert_eq!(wanted(State::Active, 0, ""), None);
    }

    #[test]
    fn nobody_can_ask_for_the_end_of_a_step() {
        for step in Transition::ALL {
            let by_label = wanted(step.start, 0, step.label);
            let by_number = wanted(step.start, step.id, "");
            let open = (step.id < FIRST_PRIVATE_ID).then_some(step.id);
            assert_eq!((by_label, by_number), (open, open), "{step:?}");
        }
    }

    #[test]
    fn every_passing_state_has_each_end_once() {
        for step in Transition::ALL
            .iter()
            .filter(|step| step.id < FIRST_PRIVATE_ID)
        {
            for ending in [Ending::Success, Ending::Failure, Ending::Error] {
                assert!(Transition::end(step.goal, ending).is_some(), "{step:?}");
            }
        }
        assert_eq!(Transition::end(State::Active, Ending::Success), None);
    }
}
