//! ISO 230 evaluations against outside truth, algebra, chance and bad input.

#![expect(clippy::unwrap_used, reason = "a test may panic")]
#![expect(clippy::print_stderr, reason = "figures that module headers quote")]

mod coverage;
mod drift;
mod exact;
mod laws;
pub mod machines;
mod published;
mod reference_temperature;
mod refusals;
mod scipy;

use iso230::budget::{DeviceUncertainty, Expansion};
use iso230::positioning::budget::PositioningBudget;
use iso230::positioning::{self, PositioningResult, PositioningRuns};

/// A device of which everything is known.
pub const EXACT_DEVICE: DeviceUncertainty = DeviceUncertainty {
    expanded_uncertainty_mm: 0.0,
    expanded_uncertainty_per_length: 0.0,
    coverage_factor: 2.0,
};

/// Something that does not expand.
pub const RIGID: Expansion = Expansion {
    temperature_deviation_k: 0.0,
    temperature_half_width_k: 0.0,
    expansion_per_k: 0.0,
    expansion_half_width_per_k: 0.0,
};

/// A positioning test of which everything is known.
pub const EXACT: PositioningBudget = PositioningBudget {
    device: EXACT_DEVICE,
    misalignment_mm: 0.0,
    machine: RIGID,
    device_expansion: RIGID,
    environmental_drift_mm: 0.0,
    environmental_unrest_mm: None,
};

/// The one place where a positioning test is evaluated.
pub fn evaluated(runs: &PositioningRuns) -> PositioningResult {
    positioning::evaluate(runs, &EXACT).unwrap()
}

/// Compares with the words of what is compared.
pub fn near(what: &str, found: f64, expected: f64, within: f64) {
    eprintln!("{what}: apart {:e}", found - expected);
    assert!(
        (found - expected).abs() <= within,
        "{what}: found {found}, expected {expected}, apart {:e}",
        found - expected
    );
}
