//! Which kind of test a table is of.

use super::super::recognise::{Known, Recognised, Role};
use super::{dial, touched};

/// Kinds of tests.
#[derive(Clone, Copy)]
pub enum Of<'f> {
    Positioning,
    Touches([&'f Known; 3]),
    Log,
    Circle,
}

/// The kind of test of a table; none that is known.
pub fn kind(found: &Recognised) -> Option<Of<'_>> {
    let has = |role: Role| found.first(role).is_some();
    let is_read = has(Role::Deviation)
        || has(Role::Measured)
        || !found.passes().is_empty()
        || dial::column(found).is_some();
    if has(Role::Target) && is_read {
        Some(Of::Positioning)
    } else if let Some(axes) = touched::columns(found) {
        Some(Of::Touches(axes))
    } else if has(Role::Time) && (has(Role::Displacement) || has(Role::Deviation)) {
        Some(Of::Log)
    } else if has(Role::Angle) && (has(Role::Radial) || has(Role::Deviation)) {
        Some(Of::Circle)
    } else {
        None
    }
}
