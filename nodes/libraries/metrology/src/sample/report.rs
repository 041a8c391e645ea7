//! What a machine reports of itself beside the positions of its axes.

use crate::stamp::{Host, Machine, Stamp};

/// What a reported value is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Quantity {
    /// Speed along the path or of an axis, mm/s.
    Feed,
    /// Speed of a spindle, rad/s.
    SpindleSpeed,
    /// Temperature, °C.
    Temperature,
    /// Share of what a drive can give for ever; 1.
    Load,
    /// Share of the programmed feed or speed; 1.
    Override,
    /// Whether a program runs, in MTConnect's words; no number.
    Execution,
    /// Who moves the machine, in MTConnect's words; no number.
    ControllerMode,
    /// Text of another kind: program, tool, line; no number.
    Text,
}

impl Quantity {
    /// Every quantity, in the order of the message's constants.
    pub const ALL: [Self; 8] = [
        Self::Feed,
        Self::SpindleSpeed,
        Self::Temperature,
        Self::Load,
        Self::Override,
        Self::Execution,
        Self::ControllerMode,
        Self::Text,
    ];

    /// Whether its values are numbers.
    #[must_use]
    pub const fn is_number(self) -> bool {
        !matches!(self, Self::Execution | Self::ControllerMode | Self::Text)
    }
}

/// Whether a reported value can be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Nothing speaks against it.
    Good,
    /// It differs from the values before and after it by more than the quantity can change.
    Impossible,
    /// It differs from its one neighbour by more than the quantity can change, and has no other.
    Unconfirmed,
}

/// One value as a machine reported it.
#[derive(Clone, Debug, PartialEq)]
pub struct MachineValue {
    /// When the host received it.
    pub received_at: Stamp<Host>,
    /// The machine's own stamp.
    pub machine_at: Stamp<Machine>,
    /// Which value of the machine; letters, digits and underscores.
    pub name: String,
    /// What it is about.
    pub quantity: Quantity,
    /// Whether it can be.
    pub verdict: Verdict,
    /// The number in the unit of its quantity; NaN where the quantity is no number.
    pub value: f64,
    /// The machine's own words.
    pub text: String,
}
