//! What is added to the commands of the axes.

use metrology::sample::{AxisCompensation as Inner, CompensationState};

use crate::msg::AxisCompensation;
use crate::wire::{Allowed, Reader, set_letters, set_positions, time};
use crate::{Place, Wire, WireError};

pub(crate) const COMPENSATION_STATES: [CompensationState; 5] = [
    CompensationState::Off,
    CompensationState::Active,
    CompensationState::Holding,
    CompensationState::Fading,
    CompensationState::Limited,
];

pub(crate) fn state_code(state: CompensationState) -> u8 {
    match state {
        CompensationState::Off => AxisCompensation::STATE_OFF,
        CompensationState::Active => AxisCompensation::STATE_ACTIVE,
        CompensationState::Holding => AxisCompensation::STATE_HOLDING,
        CompensationState::Fading => AxisCompensation::STATE_FADING,
        CompensationState::Limited => AxisCompensation::STATE_LIMITED,
    }
}

impl Wire for AxisCompensation {
    type Inner = Inner;

    fn set_from_inner(&mut self, inner: &Inner) {
        let axes = inner.axes;
        self.header.stamp = time(inner.at);
        set_letters(&mut self.axis, axes);
        set_positions(&mut self.total, axes, &inner.total);
        set_positions(&mut self.thermal, axes, &inner.thermal);
        set_positions(&mut self.geometric, axes, &inner.geometric);
        set_positions(&mut self.positioning, axes, &inner.positioning);
        self.pulses.clear();
        self.pulses
            .extend(axes.iter().map(|axis| inner.pulses[axis]));
        set_positions(&mut self.remainder, axes, &inner.remainder);
        self.state.clear();
        self.state
            .extend(axes.iter().map(|axis| state_code(inner.state[axis])));
    }

    fn to_inner(&self) -> Result<Inner, WireError> {
        let read = Reader::of::<Self>();
        let letters = read.letters("axis", &self.axis)?;
        let finite = |field, values| read.positions(field, &letters, values, 0.0, Allowed::Finite);
        let off = CompensationState::Off;
        Ok(Inner {
            at: read.stamp("header.stamp", Place::Whole, &self.header.stamp)?,
            axes: letters.set(),
            total: finite("total", &self.total)?,
            thermal: finite("thermal", &self.thermal)?,
            geometric: finite("geometric", &self.geometric)?,
            positioning: finite("positioning", &self.positioning)?,
            pulses: read.per_axis("pulses", &letters, &self.pulses, 0, |_, n| Ok(n))?,
            remainder: finite("remainder", &self.remainder)?,
            state: read.per_axis("state", &letters, &self.state, off, |axis, value| {
                read.variant(
                    "state",
                    Place::Axis(axis),
                    value,
                    &COMPENSATION_STATES,
                    state_code,
                )
            })?,
        })
    }
}
