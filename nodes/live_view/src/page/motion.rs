//! Positions of the axes, and their offsets.

use metrology::sample::CompensationState;
use metrology::stamp::Host;
use metrology::{Axis, Stamp};
use serde_json::{Value, json};

use super::{Page, ms};

/// Unit of positions of an axis in the JSON.
pub(super) const fn unit(axis: Axis) -> &'static str {
    if axis.is_linear() { "mm" } else { "rad" }
}

const fn word(state: CompensationState) -> &'static str {
    match state {
        CompensationState::Off => "off",
        CompensationState::Active => "active",
        CompensationState::Holding => "holding",
        CompensationState::Fading => "fading",
        CompensationState::Limited => "limited",
    }
}

impl Page {
    pub(super) fn axes_part(&self, now: Stamp<Host>) -> Option<Value> {
        let latest = self.axes.as_ref()?;
        let state = &latest.value;
        let one = |axis: Axis| {
            json!({
                "axis": axis.letter(),
                "unit": unit(axis),
                "commanded": state.commanded[axis],
                "motor": state.motor[axis],
                "scale": state.scale[axis],
                "velocity": state.velocity[axis],
            })
        };
        Some(json!({
            "at_ms": ms(state.received_at),
            "stale_since_ms": self.stale_since(now, latest.at),
            "axes": state.axes.iter().map(one).collect::<Vec<_>>(),
        }))
    }

    pub(super) fn offsets_part(&self, now: Stamp<Host>) -> Option<Value> {
        let latest = self.offsets.as_ref()?;
        let offsets = &latest.value;
        let one = |axis: Axis| {
            json!({
                "axis": axis.letter(),
                "unit": unit(axis),
                "total": offsets.total[axis],
                "thermal": offsets.thermal[axis],
                "geometric": offsets.geometric[axis],
                "positioning": offsets.positioning[axis],
                "limit_um": self.limits_um.get(&axis),
                "state": word(offsets.state[axis]),
            })
        };
        Some(json!({
            "at_ms": ms(offsets.at),
            "stale_since_ms": self.stale_since(now, latest.at),
            "axes": offsets.axes.iter().map(one).collect::<Vec<_>>(),
        }))
    }
}
