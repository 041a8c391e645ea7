//! Circles that a machine's travel and a plate allow.
//!
//! The plate lies with its middle at the middle of the travel and at both ends along each of its own axes, at
//! the heights and with the tool offsets given. Every placement is a set-up of its own; its circles share one
//! zero, or are zeroed each by itself.

use metrology::sample::TestPlane;
use metrology::{Axis, PerAxis};
use nalgebra::Vector3;

use crate::recording::{Fixture, Place, plane_axes};

/// What is tried.
#[derive(Clone, Debug, PartialEq)]
pub struct PlateRules {
    /// Planes in which the plate can be mounted.
    pub planes: Vec<TestPlane>,
    /// Radii of the circles, mm.
    pub radii_mm: Vec<f64>,
    /// Radius of the plate's field, mm: larger circles are left out.
    pub plate_radius_mm: f64,
    /// Places along the plane's normal, as shares of the travel from −1 to 1.
    pub heights: Vec<f64>,
    /// Tool offsets, mm.
    pub tool_offsets_mm: Vec<Vector3<f64>>,
    /// Whether the grid is zeroed anew for every circle.
    pub rezeroed: bool,
}

/// All circles of `rules` within the travel of the linear axes, mm.
#[must_use]
pub fn candidates(travel_mm: &PerAxis<(f64, f64)>, rules: &PlateRules) -> Vec<Place> {
    let mut found = Vec::new();
    let mut setup_id = 0;
    let mut zero_id = 0;
    for &plane in &rules.planes {
        let Some([u, v]) = plane_axes(plane) else {
            continue;
        };
        let largest_mm = rules
            .radii_mm
            .iter()
            .copied()
            .fold(0.0, f64::max)
            .min(rules.plate_radius_mm);
        for offset_mm in &rules.tool_offsets_mm {
            for middle_mm in middles_mm(travel_mm, [u, v], &rules.heights, largest_mm) {
                setup_id += 1;
                zero_id += 1;
                for (idx, radius_mm) in rules.radii_mm.iter().enumerate() {
                    if *radius_mm > rules.plate_radius_mm
                        || !fits(travel_mm, [u, v], &middle_mm, *radius_mm)
                    {
                        continue;
                    }
                    zero_id += u32::from(rules.rezeroed && idx > 0);
                    let mut place = Place::circle(plane, middle_mm, *radius_mm, 360);
                    place.tool_offset_mm = *offset_mm;
                    place.fixture = Fixture { zero_id, setup_id };
                    found.push(place);
                }
            }
        }
    }
    found
}

/// Middle, both ends along u, both along v, at each height.
fn middles_mm(
    travel_mm: &PerAxis<(f64, f64)>,
    [u, v]: [Axis; 2],
    heights: &[f64],
    radius_mm: f64,
) -> Vec<Vector3<f64>> {
    let middle = Vector3::from_fn(|i, _| {
        let (least, greatest) = travel_mm[Axis::LINEAR[i]];
        f64::midpoint(least, greatest)
    });
    let half = Vector3::from_fn(|i, _| {
        let (least, greatest) = travel_mm[Axis::LINEAR[i]];
        (greatest - least) / 2.0
    });
    let normal = Axis::LINEAR
        .into_iter()
        .find(|axis| *axis != u && *axis != v);
    let mut found = Vec::new();
    for height in heights {
        let mut at = middle;
        if let Some(normal) = normal {
            at[normal.index()] += height * half[normal.index()];
        }
        found.push(at);
        for axis in [u, v] {
            let way = (half[axis.index()] - radius_mm).max(0.0);
            for sign in [-1.0, 1.0] {
                let mut end = at;
                end[axis.index()] += sign * way;
                if way > 0.0 {
                    found.push(end);
                }
            }
        }
    }
    found
}

fn fits(
    travel_mm: &PerAxis<(f64, f64)>,
    axes: [Axis; 2],
    middle_mm: &Vector3<f64>,
    radius_mm: f64,
) -> bool {
    axes.iter().all(|axis| {
        let (least, greatest) = travel_mm[*axis];
        let at = middle_mm[axis.index()];
        at - radius_mm >= least - 1e-9 && at + radius_mm <= greatest + 1e-9
    })
}
