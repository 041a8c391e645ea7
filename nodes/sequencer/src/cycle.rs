//! From an order to a touching program.

use std::num::NonZeroU32;

use machine::MachineFile;
use machine::cycle::{self, Cycle};
use machine::file::ArtefactEntry;
use metrology::sample::{CycleKind, CycleOrder};

use crate::bounds;
use crate::error::OrderError;

/// Fewest points on a bore.
const BORE_POINTS: u32 = 4;
/// Fewest points on a sphere.
const SPHERE_POINTS: u32 = 5;
/// Fewest points on the side of a plane's grid.
const PLANE_SIDE_POINTS: u32 = 2;

/// Plans the touches of `order`.
///
/// # Errors
/// When a number of the order is out of its bound or is of no use to its cycle, the machine file lacks a feature, or a
/// touch cannot be made; the error names it.
pub fn plan(machine: &MachineFile, order: &CycleOrder) -> Result<Cycle, OrderError> {
    let points = points_of(order);
    bounds::of_order(order, n_known(machine, order.kind), points)?;
    refuse_unused(order)?;
    let repeats = NonZeroU32::new(order.repeats).unwrap_or(NonZeroU32::MIN);
    let features = order.features.as_slice();
    let planned = match order.kind {
        CycleKind::Blocks => cycle::blocks(machine, features, repeats),
        CycleKind::Touch => cycle::touches(machine, features, repeats),
        CycleKind::Plane => cycle::planes(machine, features, points, repeats),
        CycleKind::Bore => cycle::bores(machine, features, points, repeats),
        CycleKind::Sphere => cycle::spheres(machine, features, points, repeats),
        CycleKind::Latency => {
            let [feature] = features else {
                return Err(OrderError::OneFeature {
                    n: features.len(),
                    names: features.join(", "),
                });
            };
            cycle::latency(machine, feature, &order.feeds_mm_min, repeats)
        }
    };
    Ok(planned?)
}

/// Points of each feature: as ordered, or the least that its shape needs.
const fn points_of(order: &CycleOrder) -> u32 {
    match (order.points, order.kind) {
        (0, CycleKind::Plane) => PLANE_SIDE_POINTS,
        (0, CycleKind::Bore) => BORE_POINTS,
        (0, CycleKind::Sphere) => SPHERE_POINTS,
        (points, _) => points,
    }
}

/// How many features a cycle without names touches.
fn n_known(machine: &MachineFile, kind: CycleKind) -> usize {
    let artefacts = |is_wanted: fn(&ArtefactEntry) -> bool| {
        machine
            .artefacts
            .iter()
            .filter(|entry| is_wanted(entry))
            .count()
    };
    match kind {
        CycleKind::Blocks => machine.blocks.len(),
        CycleKind::Plane => artefacts(|entry| matches!(entry, ArtefactEntry::Plane { .. })),
        CycleKind::Bore => artefacts(|entry| {
            matches!(
                entry,
                ArtefactEntry::Bore { .. } | ArtefactEntry::Boss { .. }
            )
        }),
        CycleKind::Sphere => artefacts(|entry| matches!(entry, ArtefactEntry::Sphere { .. })),
        CycleKind::Latency | CycleKind::Touch => 0,
    }
}

/// Refuses what the cycle would pass over.
fn refuse_unused(order: &CycleOrder) -> Result<(), OrderError> {
    let cycle = in_words(order.kind);
    let unused = |key, value, reason| OrderError::Unused {
        key,
        value,
        cycle,
        reason,
    };
    if order.kind != CycleKind::Latency && !order.feeds_mm_min.is_empty() {
        let feeds: Vec<String> = order
            .feeds_mm_min
            .iter()
            .map(|feed_mm_min| format!("{feed_mm_min} mm/min"))
            .collect();
        let reason = "it touches at the machine file's probe.feed_mm_min";
        return Err(unused("feeds", feeds.join(", "), reason));
    }
    let has_points = matches!(
        order.kind,
        CycleKind::Plane | CycleKind::Bore | CycleKind::Sphere
    );
    if !has_points && order.points > 0 {
        let reason = "only a plane, bore or sphere has points; give repeats";
        return Err(unused("points", order.points.to_string(), reason));
    }
    if order.kind != CycleKind::Blocks && order.cold {
        let reason = "only blocks become the cold reference";
        return Err(unused("cold", "true".to_owned(), reason));
    }
    Ok(())
}

const fn in_words(kind: CycleKind) -> &'static str {
    match kind {
        CycleKind::Blocks => "block",
        CycleKind::Latency => "latency",
        CycleKind::Touch => "touch",
        CycleKind::Plane => "plane",
        CycleKind::Bore => "bore",
        CycleKind::Sphere => "sphere",
    }
}
