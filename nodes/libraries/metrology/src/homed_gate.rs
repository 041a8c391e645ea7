//! Offsets wait until every axis knows its zero.
//!
//! Homing takes a machine's zero from where its slides are when they find it. An offset that is added, or moves,
//! meanwhile shifts that zero by the drive's lag under it, for as long as the machine stays on. So a controller
//! passes offsets on only while every axis is homed: before that, and while an axis is being homed again, the
//! offsets wait and what was passed on fades.

/// What a gate has to say, once each time that it changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GateNews {
    /// Offsets come and are held back.
    HeldBack,
    /// What was held back is passed on.
    PassedOn,
}

/// The way of offsets to the drives: open only while every axis is homed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HomedGate {
    open: bool,
    holds: bool,
}

impl HomedGate {
    /// Takes whether every axis is homed (what is not known is not homed) and whether offsets come.
    pub fn step(&mut self, every_axis_homed: bool, offsets_come: bool) -> Option<GateNews> {
        self.open = every_axis_homed;
        let holds = offsets_come && !self.open;
        let before = std::mem::replace(&mut self.holds, holds);
        match (before, holds) {
            (false, true) => Some(GateNews::HeldBack),
            (true, false) if self.open => Some(GateNews::PassedOn),
            _ => None,
        }
    }

    /// Whether offsets may be passed on.
    #[must_use]
    pub const fn is_open(&self) -> bool {
        self.open
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offsets_pass_only_while_every_axis_is_homed_and_each_change_is_told_once() {
        let mut gate = HomedGate::default();
        assert!(!gate.is_open(), "nothing is known of homing yet");
        // Whether homed, whether offsets come, the expected news.
        for (homed, come, told) in [
            (false, false, None),
            (false, true, Some(GateNews::HeldBack)),
            (false, true, None),
            (true, true, Some(GateNews::PassedOn)),
            (true, true, None),
            (false, true, Some(GateNews::HeldBack)),
            (false, false, None),
            (true, false, None),
            (true, true, None),
        ] {
            assert_eq!(gate.step(homed, come), told, "{homed} {come}");
            assert_eq!(gate.is_open(), homed);
        }
    }
}
