//! Where a ring gauge and a sphere stand, so that the stylus gets around the sphere.
//!
//! The stylus goes straight down beside the sphere, to where a touch of its equator begins. Seen from above, whatever
//! else stands there must be farther from the sphere's centre than
//!
//! ```text
//!   R + standoff + 2 r + 2 p                                                              (1)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | R, r | radius of the sphere, of the stylus ball | mm |
//! | p | how far a surface may lie from its nominal place, as cycles have it | mm |
//!
//! The machine file has the inner radius of a ring; its wall is the plant's.

use machine::file::{ArtefactEntry, BlockEntry};
use rand::Rng;
use rand_pcg::Pcg64Mcg;

use crate::rig::Rig;

/// Radius of the sphere, mm.
const SPHERE_RADIUS_MM: f64 = 12.5;
/// p, mm.
const PLACEMENT_MM: f64 = 0.2;
/// Height of both centres, mm.
const HEIGHT_MM: f64 = 60.0;

/// A ring gauge and a sphere.
#[derive(Clone, Copy, Debug)]
pub(super) struct Places {
    ring_mm: [f64; 2],
    radius_mm: f64,
    ball_mm: [f64; 2],
}

impl Places {
    /// Draws until there is room, which one draw of twenty has not.
    pub(super) fn draw(random: &mut Pcg64Mcg, rig: &Rig) -> Self {
        loop {
            let mut near = |middle: f64| (middle + random.random_range(-20.0..20.0_f64)).round();
            let places = Self {
                ring_mm: [near(0.0), near(0.0)],
                ball_mm: [near(100.0), near(60.0)],
                radius_mm: near(50.0),
            };
            if places.room_mm(rig) > needed_mm(rig) {
                return places;
            }
        }
    }

    /// From the sphere's centre to what stands nearest, seen from above, mm.
    fn room_mm(&self, rig: &Rig) -> f64 {
        let plant = &rig.plant.artefacts;
        let [across, along] = [0, 1].map(|axis| self.ball_mm[axis] - self.ring_mm[axis]);
        let to_ring_mm = across.hypot(along) - self.radius_mm - plant.ring_wall_mm;
        let blocks = rig.machine.blocks.iter();
        let to_blocks_mm =
            blocks.map(|block| to_block_mm(block, plant.block_edge_mm, &self.ball_mm));
        to_blocks_mm.fold(to_ring_mm, f64::min)
    }

    /// As the machine file has them.
    pub(super) fn artefacts(&self) -> [ArtefactEntry; 2] {
        let [ring_mm, ball_mm] = [self.ring_mm, self.ball_mm].map(|[x, y]| [x, y, HEIGHT_MM]);
        [
            ArtefactEntry::Bore {
                id: "ring".to_owned(),
                centre_mm: ring_mm,
                radius_mm: self.radius_mm,
            },
            ArtefactEntry::Sphere {
                id: "ball".to_owned(),
                centre_mm: ball_mm,
                radius_mm: SPHERE_RADIUS_MM,
            },
        ]
    }
}

/// (1), mm.
fn needed_mm(rig: &Rig) -> f64 {
    let stylus_mm = 2.0 * rig.machine.ball_radius_mm() + rig.machine.probe.standoff_mm;
    SPHERE_RADIUS_MM + stylus_mm + 2.0 * PLACEMENT_MM
}

/// From a place to a block's body, which fills the octant behind its faces, mm.
fn to_block_mm(block: &BlockEntry, edge_mm: f64, place_mm: &[f64; 2]) -> f64 {
    let half_mm = 0.5 * edge_mm;
    let [across, along] = [0, 1].map(|axis| {
        let middle_mm = block.corner_mm[axis] + f64::from(block.approach_sign[axis]) * half_mm;
        ((place_mm[axis] - middle_mm).abs() - half_mm).max(0.0)
    });
    across.hypot(along)
}

#[cfg(test)]
mod tests {
    use machine::cycle::needed_overtravel_mm;
    use nalgebra::Vector3;
    use rand::SeedableRng;

    use super::*;

    fn rig() -> Rig {
        Rig::draw(&mut Pcg64Mcg::seed_from_u64(4), false).unwrap()
    }

    /// 6.33 mm between sphere and ring, where a stylus of 6 mm begins 2 mm before the sphere.
    #[test]
    fn eq1_a_stylus_that_is_wider_than_the_gap_has_no_room() {
        let places = Places {
            ring_mm: [10.0, 3.0],
            radius_mm: 56.0,
            ball_mm: [86.0, 45.0],
        };
        let rig = rig();
        let gap_mm = places.room_mm(&rig) - SPHERE_RADIUS_MM;
        assert!((gap_mm - 6.33).abs() < 0.01, "{gap_mm}");
        assert!((needed_mm(&rig) - SPHERE_RADIUS_MM - 8.4).abs() < 1e-9);
    }

    #[test]
    fn eq1_a_block_takes_room_behind_its_faces() {
        let mut rig = rig();
        let block = &mut rig.machine.blocks[1];
        assert_eq!(block.approach_sign, [-1, -1, -1]);
        block.corner_mm = [160.0, 140.0, 200.0];
        for (place_mm, wanted_mm) in [([117.0, 96.0], 5.0), ([140.0, 90.0], 10.0)] {
            let found_mm = to_block_mm(&rig.machine.blocks[1], 40.0, &place_mm);
            assert!((found_mm - wanted_mm).abs() < 1e-9, "{found_mm}");
        }
    }

    #[test]
    fn surfaces_may_lie_as_far_from_their_places_as_in_cycles() {
        let least_mm = needed_overtravel_mm(&rig().machine, &Vector3::x(), 0.0).unwrap();
        assert!((least_mm - PLACEMENT_MM).abs() < 1e-12, "{least_mm}");
    }

    #[test]
    fn every_drawn_place_has_room() {
        let rig = rig();
        let mut random = Pcg64Mcg::seed_from_u64(5);
        for _ in 0..10_000 {
            let places = Places::draw(&mut random, &rig);
            assert!(places.room_mm(&rig) > needed_mm(&rig), "{places:?}");
        }
    }
}
