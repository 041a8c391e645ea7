//! Circles, lines and small steps on the plate of a grid encoder.

use machine::MachineFile;
use machine::file::{GridEncoderEntry, GridPlacement};
use metrology::sample::TestPlane;
use reports::evaluate::circles::plane_axes;

use super::super::instruments::Means;
use super::{Offer, SetUp, short};

/// Placements that are looked at: one of each plane first.
const MOST_PLACEMENTS: usize = 4;
/// Radii as shares of the plate's.
const RADII: [f64; 2] = [0.45, 0.75];
/// Feeds of circles, mm/min; at all but the first placement the first two.
const PLANAR_FEEDS_MM_MIN: [f64; 3] = [1500.0, 3000.0, 6000.0];
/// Feeds of lines, mm/min.
const LINE_FEEDS_MM_MIN: [f64; 2] = [1000.0, 4000.0];
/// Half of a line, as a share of the plate's radius.
const HALF_LINE: f64 = 0.7;
/// Way of the small steps, mm.
const STEPS_MM: f64 = 8.0;

pub(super) fn offers(machine: &MachineFile) -> Vec<Offer> {
    let Some(grid) = &machine.grid_encoder else {
        return vec![];
    };
    let chosen = chosen(grid).into_iter().enumerate();
    chosen
        .flat_map(|(k, placement)| at(grid, placement, k == 0))
        .collect()
}

/// One placement of each plane, then others.
fn chosen(grid: &GridEncoderEntry) -> Vec<&GridPlacement> {
    let mut first = Vec::<&GridPlacement>::new();
    let mut rest = Vec::new();
    for placement in &grid.placements {
        if first.iter().any(|known| known.plane == placement.plane) {
            rest.push(placement);
        } else {
            first.push(placement);
        }
    }
    first.extend(rest);
    first.truncate(MOST_PLACEMENTS);
    first
}

fn at(grid: &GridEncoderEntry, placement: &GridPlacement, is_first: bool) -> Vec<Offer> {
    let id = &placement.id;
    let set_up = set_up(placement);
    let n_feeds = if is_first { 3 } else { 2 };
    let mut all = Vec::new();
    for radius_mm in RADII.map(|share| (share * grid.radius_mm).round().max(1.0)) {
        for feed in PLANAR_FEEDS_MM_MIN.into_iter().take(n_feeds) {
            let title = format!(
                "circle R{} F{} both senses on the grid at {id}",
                short(radius_mm),
                short(feed)
            );
            let step = format!(
                "{{do: grid, placement: {id:?}, trajectory: circle, radius_mm: {radius_mm:.1}, \
                 feed_mm_min: {feed:.1}, sense: both, on_the_fly: true}}"
            );
            all.push(Offer::new(title, &set_up, step));
        }
    }
    let axes = plane_axes(TestPlane::from(placement.plane)).into_iter();
    for (k, axis) in axes.flatten().enumerate() {
        let half_mm = (HALF_LINE * grid.radius_mm).round().max(1.0);
        let feeds = LINE_FEEDS_MM_MIN
            .into_iter()
            .take(if is_first { 2 } else { 1 });
        for feed in feeds {
            let title = format!(
                "line {axis} F{} there and back on the grid at {id}",
                short(feed)
            );
            let step = spike(id, k, half_mm, feed, "on_the_fly: true");
            all.push(Offer::new(title, &set_up, step));
        }
        let title = format!("steps of 0.4 mm along {axis} with 1 s of rest on the grid at {id}");
        let step = spike(id, k, 0.5 * STEPS_MM, 500.0, "stations: 40, dwell_s: 1.0");
        all.push(Offer::new(title, &set_up, step));
    }
    all
}

/// There and back along the first or second axis of the plane.
fn spike(id: &str, along: usize, half_mm: f64, feed_mm_min: f64, pace: &str) -> String {
    let (angle_deg, offset_mm) = match along {
        0 => (0.0, [half_mm, 0.0]),
        _ => (90.0, [0.0, half_mm]),
    };
    format!(
        "{{do: grid, placement: {id:?}, trajectory: spike, angle_deg: {angle_deg:.1}, \
         offset_mm: [{:.1}, {:.1}], length_mm: {:.1}, feed_mm_min: {feed_mm_min:.1}, {pace}}}",
        offset_mm[0],
        offset_mm[1],
        2.0 * half_mm
    )
}

fn set_up(placement: &GridPlacement) -> SetUp {
    let [x, y, z] = placement.centre_mm;
    let [dx, dy, dz] = placement.tool_offset_mm;
    let plane = plane_axes(TestPlane::from(placement.plane))
        .map_or_else(String::new, |[u, v]| format!("{u}{v}"));
    SetUp {
        name: format!("grid {}", placement.id),
        means: Means::Grid,
        words: format!(
            "Put the grid plate up in the plane {plane}, its centre at X {x:.1}, Y {y:.1}, Z {z:.1} mm (placement `{}`), \
             the reading head at {dx:.1}, {dy:.1}, {dz:.1} mm from the axes' point. Align the plate, and set it to zero when the \
             program asks for it.",
            placement.id
        ),
    }
}
