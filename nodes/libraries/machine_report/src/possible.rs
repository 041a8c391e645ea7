//! Credible ranges of the numbers of a machine. Beyond them a sensor is broken, a unit is wrong, or another program publishes.

use std::f64::consts::{PI, TAU};
use std::fmt;

use metrology::bound::{Range, TEMPERATURE};
use metrology::number::number;
use metrology::sample::Quantity;

use crate::mapping::Use;

/// A quantity with the range of its numbers, in units of people.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Possible {
    what: &'static str,
    range: Range,
    /// One of these units in the inner one.
    inner: f64,
}

/// Ten times the rapid of the fastest machine tools, about 120 m/min.
const FEED: Range = Range::new(-1e6, 1e6, " mm/min");
/// Above the fastest spindles, those of dentists' mills and of engraving, about 300,000 1/min.
const SPINDLE_SPEED: Range = Range::new(-1e6, 1e6, " 1/min");
/// A drive gives a few times what it can give for ever.
const LOAD: Range = Range::new(-1e4, 1e4, " %");
/// A control lets an operator go from a standstill to a few times what is programmed.
const OVERRIDE: Range = Range::new(0.0, 1e4, " %");
/// The largest travels are some tens of metres; an offset may add to them.
const LENGTH: Range = Range::new(-1e6, 1e6, " mm");
/// A rotary axis that counts its turns, or a spindle reported as an axis: a million turns.
const ANGLE: Range = Range::new(-3.6e8, 3.6e8, " deg");

impl Possible {
    /// What a value of the mapping can be; `None`: it is no number.
    #[must_use]
    pub fn of(used: &Use) -> Option<Self> {
        let of = |what, range, inner| Some(Self { what, range, inner });
        match used {
            Use::Position { axes, .. } if axes.iter().all(|axis| axis.is_linear()) => {
                of("a position", LENGTH, 1.0)
            }
            Use::Position { .. } => of("a position", ANGLE, PI / 180.0),
            Use::Number { quantity, .. } => match quantity {
                Quantity::Temperature => of("a temperature", TEMPERATURE, 1.0),
                Quantity::Feed => of("a feed", FEED, 1.0 / 60.0),
                Quantity::SpindleSpeed => of("a spindle speed", SPINDLE_SPEED, TAU / 60.0),
                Quantity::Load => of("a load", LOAD, 0.01),
                Quantity::Override => of("an override", OVERRIDE, 0.01),
                Quantity::Execution | Quantity::ControllerMode | Quantity::Text => None,
            },
            Use::Text { .. } | Use::Alarm { .. } | Use::Nothing => None,
        }
    }

    /// Whether it can be so much, in the inner unit.
    #[must_use]
    pub fn holds(&self, inner: f64) -> bool {
        self.range.holds(inner / self.inner)
    }
}

impl fmt::Display for Possible {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [least, greatest] = [self.range.least(), self.range.greatest()].map(number);
        let (what, unit) = (self.what, self.range.unit());
        write!(f, "{what} must be from {least} to {greatest}{unit}")
    }
}
