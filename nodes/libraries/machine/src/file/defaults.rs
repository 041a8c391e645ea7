//! What a machine file that leaves a key out stands for: a common vertical machining centre with ball screws and rotary motor
//! encoders. A template of a machine file states each of these values beside its key.

use std::collections::BTreeMap;

use super::{ControlEntry, Latch, ProbeEntry, StylusEntry};

/// Name of the stylus of [`ProbeEntry::default`].
const STYLUS: &str = "ruby_6";

pub(super) const fn feed_limit_mm_min() -> f64 {
    20_000.0
}

pub(super) const fn acceleration_limit_mm_s2() -> f64 {
    3000.0
}

pub(super) const fn lead_mm() -> f64 {
    10.0
}

/// Kv 3.6 m/min/mm.
pub(super) const fn position_gain_per_s() -> f64 {
    60.0
}

pub(super) const fn velocity_feedforward() -> f64 {
    0.98
}

pub(super) const fn encoder_resolution_um() -> f64 {
    0.05
}

impl Default for ControlEntry {
    fn default() -> Self {
        Self {
            servo_period_ms: 1.0,
            pulse_equivalent_um: 0.1,
            latch: Latch::Polled,
        }
    }
}

impl Default for ProbeEntry {
    fn default() -> Self {
        let stylus = StylusEntry {
            radius_mm: 3.0,
            length_mm: 150.0,
            stem_length_mm: None,
        };
        Self {
            styli: BTreeMap::from([(STYLUS.to_owned(), stylus)]),
            mounted: STYLUS.to_owned(),
            standoff_mm: 2.0,
            overtravel_mm: 3.0,
            feed_mm_min: 120.0,
            repeatability_um: 0.3,
            latency_ms: None,
        }
    }
}
