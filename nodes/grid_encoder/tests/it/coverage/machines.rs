//! Machines whose truth is known, and recordings of them: an exact product of 4×4 matrices, with bodies that carry bodies.

use std::array::from_fn;

use grid_encoder::recording::{Fixture, GridPoint, Place, Recording, in_plane};
use metrology::Axis;
use metrology::sample::TestPlane;
use nalgebra::{Matrix3, Matrix4, Vector3, Vector4};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

pub const CHAIN: &str = "[w X' Y' b Z t]";
pub const NOISE_MM: f64 = 1e-4;
pub const STATIONS: u32 = 20;
/// Edge of the working volume, mm: coefficients are drawn for it.
pub const EDGE_MM: f64 = 200.0;

/// Six error motions of one axis at one position: shifts in mm, turns in rad.
pub type Motion = [f64; 6];

/// A machine's truth.
pub trait Truth {
    fn motion(&self, axis: Axis, position_mm: f64) -> Motion;
    /// Turns of the directions of Y and Z: EC0Y, EB0Z, EA0Z, rad.
    fn squareness(&self) -> [f64; 3];
}

fn rotation(w: [f64; 3]) -> Matrix3<f64> {
    nalgebra::Rotation3::new(Vector3::from(w)).into_inner()
}

fn homogeneous(r: Matrix3<f64>, t: Vector3<f64>) -> Matrix4<f64> {
    let mut m = Matrix4::identity();
    m.fixed_view_mut::<3, 3>(0, 0).copy_from(&r);
    m.fixed_view_mut::<3, 1>(0, 3).copy_from(&t);
    m
}

fn error_matrix(motion: Motion, sign: f64) -> Matrix4<f64> {
    let [x, y, z, a, b, c] = motion.map(|e| sign * e);
    homogeneous(rotation([a, b, c]), Vector3::new(x, y, z))
}

/// Tool tip in the frame of the workpiece: bed ← Z slide ← tip against bed ← Y table ← X table.
///
/// The bodies of X and Y move against the sign of their axis, and err against the sign of the component.
fn tip_mm(truth: &dyn Truth, q: Vector3<f64>, tool_mm: Vector3<f64>) -> Vector3<f64> {
    let [c0y, b0z, a0z] = truth.squareness();
    let along = |turn: [f64; 3], axis: usize, way_mm: f64| {
        let mut unit = Vector3::zeros();
        unit[axis] = way_mm;
        homogeneous(Matrix3::identity(), rotation(turn) * unit)
    };
    let y_table = along([0.0, 0.0, c0y], 1, -q.y) * error_matrix(truth.motion(Axis::Y, q.y), -1.0);
    let x_table = along([0.0; 3], 0, -q.x) * error_matrix(truth.motion(Axis::X, q.x), -1.0);
    let z_slide = along([a0z, b0z, 0.0], 2, q.z) * error_matrix(truth.motion(Axis::Z, q.z), 1.0);
    let in_bed = z_slide * Vector4::new(tool_mm.x, tool_mm.y, tool_mm.z, 1.0);
    let in_workpiece = (y_table * x_table).try_inverse().unwrap() * in_bed;
    in_workpiece.xyz()
}

/// Cubics without constant term; straightness without linear term.
pub struct Cubic {
    /// By axis, direction and power.
    pub coefficients: [[[f64; 3]; 6]; 3],
    /// EC0Y, EB0Z, EA0Z, rad.
    pub squareness: [f64; 3],
}

impl Cubic {
    pub fn random(rng: &mut Pcg64Mcg) -> Self {
        let mut draw = |size: f64| rng.random_range(-size..size);
        let coefficients = from_fn(|axis| {
            from_fn(|direction| {
                from_fn(|k| {
                    let edge = EDGE_MM.powi(k as i32 + 1);
                    let size = if direction < 3 { 0.01 } else { 30e-6 };
                    let is_straightness = direction < 3 && direction != axis;
                    if is_straightness && k == 0 {
                        0.0
                    } else {
                        draw(size) / edge
                    }
                })
            })
        });
        Self {
            coefficients,
            squareness: [draw(50e-6), draw(50e-6), draw(50e-6)],
        }
    }
}

impl Truth for Cubic {
    fn motion(&self, axis: Axis, q: f64) -> Motion {
        self.coefficients[axis.index()].map(|[a, b, c]| q * (a + q * (b + q * c)))
    }

    fn squareness(&self) -> [f64; 3] {
        self.squareness
    }
}

/// Waves of three lengths in every component.
pub struct Fourier(pub Cubic);

impl Truth for Fourier {
    fn motion(&self, axis: Axis, q: f64) -> Motion {
        let cubic = self.0.motion(axis, q);
        let wave = |k: usize| (q * (3.0 + k as f64) / 60.0 + k as f64).sin() - (k as f64).sin();
        from_fn(|k| cubic[k] + if k < 3 { 2e-3 } else { 4e-6 } * wave(k + axis.index()))
    }

    fn squareness(&self) -> [f64; 3] {
        self.0.squareness
    }
}

/// Tool offsets that show the turns of the head: not on one line.
pub const ARMS_MM: [[f64; 3]; 3] = [[0.0, 0.0, 0.0], [60.0, 0.0, -80.0], [0.0, 60.0, -150.0]];
const PLANES: [(TestPlane, [usize; 3]); 3] = [
    (TestPlane::Xy, [0, 1, 2]),
    (TestPlane::Yz, [1, 2, 0]),
    (TestPlane::Zx, [2, 0, 1]),
];
/// Places in a plane and along its normal, mm.
const PLACES_MM: [[f64; 3]; 5] = [
    [0.0, 0.0, 0.0],
    [120.0, 0.0, 100.0],
    [-120.0, 0.0, -100.0],
    [0.0, 120.0, 100.0],
    [0.0, -120.0, -100.0],
];

/// Circles in three planes: five places each, two radii under one zero, tool offsets in turn.
pub fn programme(arms_mm: &[[f64; 3]]) -> Vec<Place> {
    let mut places = Vec::new();
    let mut id = 0;
    for (plane, axes) in PLANES {
        for (k, place_mm) in PLACES_MM.into_iter().enumerate() {
            id += 1;
            let mut centre = Vector3::zeros();
            for (axis, at_mm) in axes.into_iter().zip(place_mm) {
                centre[axis] = at_mm;
            }
            for radius in [70.0, 35.0] {
                let mut place = Place::circle(plane, centre, radius, STATIONS);
                place.tool_offset_mm = Vector3::from(arms_mm[k % arms_mm.len()]);
                place.fixture = Fixture {
                    zero_id: id,
                    setup_id: id,
                };
                places.push(place);
            }
        }
    }
    places
}

pub fn record(truth: &dyn Truth, arms_mm: &[[f64; 3]], rng: &mut Pcg64Mcg) -> Vec<Recording> {
    let programme = programme(arms_mm);
    let mut offsets = Vec::new();
    for _ in 0..=programme.len() {
        let turn = rng.random_range(-2e-4..2e-4_f64);
        offsets.push((
            [rng.random_range(-5.0..5.0), rng.random_range(-5.0..5.0)],
            turn,
        ));
    }
    let mut recording = |(run, place): (usize, &Place)| {
        let ([ou, ov], turn) = offsets[place.fixture.zero_id as usize];
        let points = (0..STATIONS)
            .map(|k| {
                let angle_rad = f64::from(k) * std::f64::consts::TAU / f64::from(STATIONS);
                let positions = place.on_circle_mm(angle_rad);
                let tip = tip_mm(truth, positions.xyz(), place.tool_offset_mm);
                let [u, v] = in_plane(place.plane, &tip);
                let (s, c) = turn.sin_cos();
                let mut noise =
                    || -> f64 { NOISE_MM * Distribution::<f64>::sample(&StandardNormal, rng) };
                GridPoint {
                    positions,
                    sense: Vector3::zeros(),
                    velocity_mm_s: Vector3::zeros(),
                    reading_mm: [c * u - s * v + ou + noise(), s * u + c * v + ov + noise()],
                    standard_uncertainty_mm: [NOISE_MM; 2],
                    n_readings: 55,
                }
            })
            .collect();
        Recording {
            run: u32::try_from(run).unwrap(),
            place: *place,
            points,
        }
    };
    let mut made = Vec::new();
    for numbered in programme.iter().enumerate() {
        made.push(recording(numbered));
    }
    made
}
