//! Artefacts as solids: how far a point is from their surface, and which way the surface faces.
//!
//! ```text
//!   solid of half sizes h about its middle:  s = |p - c| - h per direction                (1)
//!   distance = |max(s, 0)| + min(max s, 0),  normal = its gradient                        (2)
//! ```
//!
//! (2) is exact outside a solid, with round edges and corners as a ball feels them. A block and a
//! plane are boxes (three directions in (1)); a ring gauge and a boss are boxes in radius and
//! height; a sphere is its own case. Solids ride on the table: their places here are in the
//! workpiece frame, and the caller shifts the point instead of the solid when the table grows.

use machine::MachineFile;
use machine::file::{ArtefactEntry, BlockEntry};
use nalgebra::{Vector2, Vector3};

use super::error::{PlantError, require_finite, require_not_negative, require_positive};
use super::file::{ArtefactsEntry, FaultsEntry};
use super::noise::{Effect, Stream};

/// An artefact where it really stands.
#[derive(Clone, Debug)]
pub(super) struct Artefact {
    /// Where it stands, workpiece frame, mm: its block corner, centre or point.
    pub(super) place_mm: Vector3<f64>,
    solid: Solid,
    /// From `place_mm` to the solid's middle, mm.
    middle_mm: Vector3<f64>,
    /// When it is knocked, s since the start, and by how much, mm.
    bumps: Vec<(f64, Vector3<f64>)>,
    has_been_bumped: usize,
}

#[derive(Clone, Copy, Debug)]
enum Solid {
    Box {
        half_mm: Vector3<f64>,
    },
    Ball {
        radius_mm: f64,
    },
    /// Turned about Z: radii and heights about (middle radius, middle height).
    Turned {
        radius_mm: f64,
        half_wall_mm: f64,
        half_height_mm: f64,
    },
}

/// Distance to a surface, mm, and the unit vector away from it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Nearness {
    pub(super) distance_mm: f64,
    pub(super) away: Vector3<f64>,
}

impl Artefact {
    /// Every artefact of the machine file that is not missing.
    pub(super) fn all(
        machine: &MachineFile,
        entry: &ArtefactsEntry,
        faults: &FaultsEntry,
        seed: u64,
    ) -> Result<Vec<Self>, PlantError> {
        require_positive("artefacts.block_edge_mm", entry.block_edge_mm)?;
        require_positive("artefacts.ring_wall_mm", entry.ring_wall_mm)?;
        require_positive("artefacts.height_mm", entry.height_mm)?;
        require_positive("artefacts.plane_thickness_mm", entry.plane_thickness_mm)?;
        require_not_negative("artefacts.placement_um", entry.placement_um)?;
        let mut found = Vec::new();
        for block in &machine.blocks {
            found.push((block.id.as_str(), of_block(block, entry)));
        }
        for artefact in &machine.artefacts {
            found.push(of_artefact(artefact, entry)?);
        }
        let known = |id: &String| found.iter().any(|(known, _)| known == id);
        let bumped = faults
            .bumped_blocks
            .iter()
            .map(|bump| ("faults.bumped_blocks", &bump.id));
        let missing = faults
            .missing_blocks
            .iter()
            .map(|id| ("faults.missing_blocks", id));
        for (place, id) in bumped.chain(missing) {
            if !known(id) {
                return Err(PlantError::NameUnknown {
                    place,
                    name: id.clone(),
                });
            }
        }
        for bump in &faults.bumped_blocks {
            require_not_negative("faults.bumped_blocks.at_s", bump.at_s)?;
            for value in bump.shift_um {
                require_finite("faults.bumped_blocks.shift_um", value)?;
            }
        }
        let placed = found
            .into_iter()
            .enumerate()
            .filter_map(|(index, (id, mut artefact))| {
                let mut stream = Stream::new(seed, Effect::BlockPlacement, index as u64);
                let offset = Vector3::from_fn(|_, _| stream.normal() * entry.placement_um / 1e3);
                artefact.place_mm += offset;
                artefact.bumps = bumps_of(id, faults);
                (!faults.missing_blocks.iter().any(|missing| missing == id)).then_some(artefact)
            });
        Ok(placed.collect())
    }

    /// Lets happen what happens to the artefact up to `elapsed_s`.
    pub(super) fn age(&mut self, elapsed_s: f64) {
        while let Some((at_s, shift_mm)) = self.bumps.get(self.has_been_bumped) {
            if *at_s > elapsed_s {
                break;
            }
            self.place_mm += shift_mm;
            self.has_been_bumped += 1;
        }
    }

    /// (2): from the surface to `point_mm`.
    pub(super) fn nearness(&self, point_mm: &Vector3<f64>) -> Nearness {
        let from_middle = point_mm - self.place_mm - self.middle_mm;
        match self.solid {
            Solid::Box { half_mm } => in_box(&from_middle, &half_mm),
            Solid::Ball { radius_mm } => {
                let distance_mm = from_middle.norm();
                let away = from_middle.try_normalize(0.0).unwrap_or_else(Vector3::z);
                Nearness {
                    distance_mm: distance_mm - radius_mm,
                    away,
                }
            }
            Solid::Turned {
                radius_mm,
                half_wall_mm,
                half_height_mm,
            } => {
                let axial = Vector2::new(from_middle.x, from_middle.y);
                let outward = axial.try_normalize(0.0).unwrap_or_else(Vector2::x);
                let section = Vector3::new(axial.norm() - radius_mm, 0.0, from_middle.z);
                let half_mm = Vector3::new(half_wall_mm, f64::INFINITY, half_height_mm);
                let flat = in_box(&section, &half_mm);
                let away = Vector3::new(
                    outward.x * flat.away.x,
                    outward.y * flat.away.x,
                    flat.away.z,
                );
                Nearness {
                    distance_mm: flat.distance_mm,
                    away,
                }
            }
        }
    }
}

fn bumps_of(id: &str, faults: &FaultsEntry) -> Vec<(f64, Vector3<f64>)> {
    let mut bumps: Vec<_> = faults
        .bumped_blocks
        .iter()
        .filter(|bump| bump.id == id)
        .map(|bump| (bump.at_s, Vector3::from(bump.shift_um) / 1e3))
        .collect();
    bumps.sort_by(|a, b| a.0.total_cmp(&b.0));
    bumps
}

fn in_box(from_middle: &Vector3<f64>, half_mm: &Vector3<f64>) -> Nearness {
    let beyond = from_middle.abs() - half_mm; // (1)
    let sign = from_middle.map(|value| if value < 0.0 { -1.0 } else { 1.0 });
    let outside = beyond.map(|value| value.max(0.0));
    let distance_mm = outside.norm();
    if distance_mm > 0.0 {
        return Nearness {
            distance_mm,
            away: outside.component_mul(&sign) / distance_mm,
        };
    }
    let face = beyond.imax();
    let mut away = Vector3::zeros();
    away[face] = sign[face];
    Nearness {
        distance_mm: beyond[face],
        away,
    }
}

fn of_block(block: &BlockEntry, entry: &ArtefactsEntry) -> Artefact {
    let half = 0.5 * entry.block_edge_mm;
    let sign = block.approach_sign.map(f64::from);
    Artefact {
        place_mm: Vector3::from(block.corner_mm),
        solid: Solid::Box {
            half_mm: Vector3::repeat(half),
        },
        middle_mm: Vector3::from(sign) * half,
        bumps: Vec::new(),
        has_been_bumped: 0,
    }
}

fn of_artefact<'a>(
    artefact: &'a ArtefactEntry,
    entry: &ArtefactsEntry,
) -> Result<(&'a str, Artefact), PlantError> {
    let half_height_mm = 0.5 * entry.height_mm;
    let half_wall_mm = 0.5 * entry.ring_wall_mm;
    let turned = |radius_mm, half_wall_mm| Solid::Turned {
        radius_mm,
        half_wall_mm,
        half_height_mm,
    };
    let (id, place, solid, middle_mm) = match artefact {
        ArtefactEntry::Sphere {
            id,
            centre_mm,
            radius_mm,
        } => (
            id,
            centre_mm,
            Solid::Ball {
                radius_mm: *radius_mm,
            },
            Vector3::zeros(),
        ),
        ArtefactEntry::Bore {
            id,
            centre_mm,
            radius_mm,
        } => (
            id,
            centre_mm,
            turned(radius_mm + half_wall_mm, half_wall_mm),
            Vector3::zeros(),
        ),
        ArtefactEntry::Boss {
            id,
            centre_mm,
            radius_mm,
        } => (id, centre_mm, turned(0.0, *radius_mm), Vector3::zeros()),
        ArtefactEntry::Plane {
            id,
            point_mm,
            normal,
            half_side_mm,
        } => {
            let (solid, middle_mm) = slab(id, normal, *half_side_mm, entry.plane_thickness_mm)?;
            (id, point_mm, solid, middle_mm)
        }
    };
    let artefact = Artefact {
        place_mm: Vector3::from(*place),
        solid,
        middle_mm,
        bumps: Vec::new(),
        has_been_bumped: 0,
    };
    Ok((id, artefact))
}

/// A square plate whose face looks along `normal`, and the way from the face to its middle.
fn slab(
    id: &str,
    normal: &[f64; 3],
    half_side_mm: f64,
    thickness_mm: f64,
) -> Result<(Solid, Vector3<f64>), PlantError> {
    let outward = Vector3::from(*normal);
    let along = outward.iamax();
    if !((outward.amax() - 1.0).abs() < 1e-12 && (outward.norm() - 1.0).abs() < 1e-12) {
        return Err(PlantError::Normal {
            id: id.to_owned(),
            normal: *normal,
        });
    }
    let mut half_mm = Vector3::repeat(half_side_mm);
    half_mm[along] = 0.5 * thickness_mm;
    Ok((Solid::Box { half_mm }, -outward * (0.5 * thickness_mm)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn solid(solid: Solid) -> Artefact {
        Artefact {
            place_mm: Vector3::new(1.0, 2.0, 3.0),
            solid,
            middle_mm: Vector3::zeros(),
            bumps: vec![(5.0, Vector3::new(0.01, 0.0, 0.0))],
            has_been_bumped: 0,
        }
    }

    fn at(artefact: &Artefact, x: f64, y: f64, z: f64) -> Nearness {
        artefact.nearness(&Vector3::new(1.0 + x, 2.0 + y, 3.0 + z))
    }

    #[test]
    fn eq2_a_box_has_faces_edges_and_corners() {
        let block = solid(Solid::Box {
            half_mm: Vector3::new(10.0, 10.0, 10.0),
        });
        let face = at(&block, -12.0, 3.0, 4.0);
        assert_eq!((face.distance_mm, face.away), (2.0, -Vector3::x()));
        let edge = at(&block, 13.0, 14.0, 0.0);
        assert!((edge.distance_mm - 5.0).abs() < 1e-12);
        let corner = at(&block, 11.0, 12.0, -12.0);
        assert!((corner.distance_mm - 3.0).abs() < 1e-12);
        let inside = at(&block, 9.5, 0.0, 0.0);
        assert_eq!((inside.distance_mm, inside.away), (-0.5, Vector3::x()));
    }

    #[test]
    fn eq2_a_bore_faces_inwards_and_a_boss_outwards() {
        let bore = solid(Solid::Turned {
            radius_mm: 30.0,
            half_wall_mm: 5.0,
            half_height_mm: 10.0,
        });
        let wall = at(&bore, 0.0, 22.0, 0.0);
        assert!((wall.distance_mm - 3.0).abs() < 1e-12);
        assert!((wall.away + Vector3::y()).norm() < 1e-12);
        let boss = solid(Solid::Turned {
            radius_mm: 0.0,
            half_wall_mm: 20.0,
            half_height_mm: 10.0,
        });
        let wall = at(&boss, -24.0, 0.0, 0.0);
        assert!((wall.distance_mm - 4.0).abs() < 1e-12);
        assert!((wall.away + Vector3::x()).norm() < 1e-12);
        assert!((at(&boss, 3.0, 0.0, 12.0).away - Vector3::z()).norm() < 1e-12);
    }

    #[test]
    fn eq2_normals_are_the_gradient_of_the_distance() {
        let shapes = [
            Solid::Box {
                half_mm: Vector3::new(4.0, 5.0, 6.0),
            },
            Solid::Ball { radius_mm: 5.0 },
            Solid::Turned {
                radius_mm: 20.0,
                half_wall_mm: 5.0,
                half_height_mm: 6.0,
            },
        ];
        for shape in shapes {
            let artefact = solid(shape);
            let point = Vector3::new(7.3, -5.9, 8.1);
            let near = artefact.nearness(&point);
            for direction in 0..3 {
                let mut step = Vector3::zeros();
                step[direction] = 1e-6;
                let ahead = artefact.nearness(&(point + step)).distance_mm;
                let behind = artefact.nearness(&(point - step)).distance_mm;
                assert!(((ahead - behind) / 2e-6 - near.away[direction]).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn a_bump_moves_the_artefact_once_and_not_before_its_time() {
        let mut ball = solid(Solid::Ball { radius_mm: 5.0 });
        ball.age(4.9);
        assert!((ball.place_mm.x - 1.0).abs() < 1e-12);
        ball.age(5.0);
        ball.age(6.0);
        assert!((ball.place_mm.x - 1.01).abs() < 1e-12);
    }
}
