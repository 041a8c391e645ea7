//! From an order to a touching program.

use std::num::NonZeroU32;

use machine::CycleError;
use machine::MachineFile;
use machine::cycle::{self, Cycle};
use metrology::sample::{CycleKind, CycleOrder};

/// Fewest points on a bore.
const BORE_POINTS: u32 = 4;
/// Fewest points on a sphere.
const SPHERE_POINTS: u32 = 5;
/// Fewest points on the side of a plane's grid.
const PLANE_SIDE_POINTS: u32 = 2;

/// Plans the touches of `order`.
///
/// # Errors
/// When the machine file lacks a feature or a touch cannot be made; the error names it.
pub fn plan(machine: &MachineFile, order: &CycleOrder) -> Result<Cycle, CycleError> {
    let repeats = NonZeroU32::new(order.repeats).unwrap_or(NonZeroU32::MIN);
    let points = |least: u32| {
        if order.points == 0 {
            least
        } else {
            order.points
        }
    };
    let features = order.features.as_slice();
    match order.kind {
        CycleKind::Blocks => cycle::blocks(machine, features, repeats),
        CycleKind::Touch => cycle::touches(machine, features, repeats),
        CycleKind::Plane => cycle::planes(machine, features, points(PLANE_SIDE_POINTS), repeats),
        CycleKind::Bore => cycle::bores(machine, features, points(BORE_POINTS), repeats),
        CycleKind::Sphere => cycle::spheres(machine, features, points(SPHERE_POINTS), repeats),
        CycleKind::Latency => {
            let feature = features.first().map_or("", String::as_str);
            cycle::latency(machine, feature, &order.feeds_mm_min, repeats)
        }
    }
}
