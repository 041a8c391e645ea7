//! Homing: until every axis has found its zero, no program runs and no compensation is in effect.
//!
//! A zero that is taken while an offset moves the axis has that offset in it for the rest of the day. So offsets
//! fade before a homing begins, and none rises before it is over. The axes of the fake machine find their
//! zeros where they stand; a homing takes time and moves nothing.

use super::{Control, Event};
use crate::hardware::Hardware;

/// What the control knows of its zeros.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Homing {
    /// Offsets go to zero before it begins.
    Fading,
    /// Looks for the zeros, for so many servo periods more.
    Searching(u64),
    Homed,
}

impl Homing {
    /// At the start, where no offset is in effect.
    pub(super) const fn begin(periods: u64) -> Self {
        if periods == 0 {
            Self::Homed
        } else {
            Self::Searching(periods)
        }
    }
}

impl<H: Hardware> Control<H> {
    /// Whether every axis is homed.
    pub const fn is_homed(&self) -> bool {
        matches!(self.homing, Homing::Homed)
    }

    /// Homes every axis anew, once no offset is in effect.
    ///
    /// # Errors
    /// Why not now.
    pub fn home(&mut self) -> Result<(), &'static str> {
        if self.run.is_some() {
            return Err("a program is running");
        }
        if !self.is_homed() {
            return Err("the axes are being homed already");
        }
        self.homing = Homing::Fading;
        Ok(())
    }

    /// One servo period of homing; also tells the compensation whether it may be in effect.
    pub(super) fn go_on_homing(&mut self, events: &mut Vec<Event>) {
        self.homing = match self.homing {
            Homing::Fading if self.offset_is_zero() => Homing::Searching(self.settings.homing),
            Homing::Searching(left) if left > 0 => Homing::Searching(left - 1),
            Homing::Searching(_) => Homing::Homed,
            other => other,
        };
        let changed = self.offset.hold_back(!self.is_homed());
        events.extend(changed.map(Event::Noted));
    }
}
