//! What the ISO 230 tests of a machine tool print, each figure with its expanded uncertainty.
//!
//! One module a part: [`positioning`] (230-2), [`thermal`] (230-3), [`circular`] (230-4),
//! [`diagonal`] (230-6) and [`probing`] (230-10); [`budget`] holds what is not known about a
//! measurement (after ISO/TR 230-9) and [`conformance`] compares a figure with a limit
//! (ISO 14253-1). [`breakdown`] finds which faults of a machine make a circle out of round.
//!
//! Deviations are measured minus nominal, mm. Expanded uncertainties have the coverage factor 2
//! where no other one stands beside them. They speak of the measurement; how well the machine
//! repeats is itself a figure and not part of them. Nothing of a budget has a default: what is left out would be an uncertainty of zero.
//!
//! The texts of the standards were not at hand. Definitions are those on which the published
//! literature and other programs agree, and uncertainties are derived here by the GUM from the
//! definitions; where a standard prints rounded factors of its own, the last digit may differ.

pub mod breakdown;
pub mod budget;
pub mod circular;
pub mod conformance;
pub mod diagonal;
mod error;
mod expanded;
mod extent;
pub mod positioning;
pub mod probing;
pub mod thermal;

pub use error::{Direction, Iso230Error};
pub use expanded::{
    COVERAGE_FACTOR, ExpandedAngle, ExpandedAngularRate, ExpandedLength, ExpandedRate,
};
