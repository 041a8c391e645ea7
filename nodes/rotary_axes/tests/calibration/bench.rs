//! A five-axis machine whose readings come from its own product of matrices, with errors put in.
//!
//! Independent of the crate's model: homogeneous matrices about displaced and tilted lines, written out
//! here, exact to every order, and the reading solved from them.

use machine::MachineFile;
use metrology::{Axis, PerAxis};
use nalgebra::{Matrix3, Matrix4, Vector3, Vector4};
use rand::{Rng, SeedableRng};
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64Mcg;
use rotary_axes::SphereVisit;

pub const BENCH: &str = include_str!("../../../libraries/machine/tests/data/bench.yaml");
/// Bench's sphere.
pub const BALL_MM: Vector3<f64> = Vector3::new(60.0, -40.0, 90.0);

pub fn file() -> MachineFile {
    let second =
        "artefacts:\n  - {kind: sphere, id: low, centre_mm: [-110.0, 70.0, 40.0], radius_mm: 12.5}";
    MachineFile::parse(&BENCH.replace("artefacts:", second), "bench.yaml").unwrap()
}

pub fn pose(a_rad: f64, c_rad: f64) -> PerAxis<f64> {
    let mut pose = PerAxis::default();
    (pose[Axis::A], pose[Axis::C]) = (a_rad, c_rad);
    pose
}

pub fn degrees(a: f64, c: f64) -> PerAxis<f64> {
    pose(a.to_radians(), c.to_radians())
}

/// What is wrong with the rotary axes: EY0A EZ0A EB0A EC0A EX0C EY0C EA0C EB0C, mm and rad.
#[derive(Clone, Copy, Debug, Default)]
pub struct Wrong {
    pub ey0a: f64,
    pub ez0a: f64,
    pub eb0a: f64,
    pub ec0a: f64,
    pub ex0c: f64,
    pub ey0c: f64,
    pub ea0c: f64,
    pub eb0c: f64,
    /// Run-out of C along its X: amplitude of cos 2C - 1, mm.
    pub run_out_c: f64,
}

impl Wrong {
    pub fn values(&self) -> [(&'static str, f64); 8] {
        [
            ("EY0A", self.ey0a),
            ("EZ0A", self.ez0a),
            ("EB0A", self.eb0a),
            ("EC0A", self.ec0a),
            ("EX0C", self.ex0c),
            ("EY0C", self.ey0c),
            ("EA0C", self.ea0c),
            ("EB0C", self.eb0c),
        ]
    }

    /// Displacements of some 20 µm, tilts of some 40 µrad.
    pub fn drawn(seed: u64) -> Self {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let mut draw = |size: f64| size * rng.random_range(-1.0..1.0);
        Self {
            ey0a: draw(0.03),
            ez0a: draw(0.03),
            eb0a: draw(8e-5),
            ec0a: draw(8e-5),
            ex0c: draw(0.03),
            ey0c: draw(0.03),
            ea0c: draw(8e-5),
            eb0c: draw(8e-5),
            run_out_c: 0.0,
        }
    }
}

/// exp of a rotation vector, by its series: small or not, no library's convention in it.
fn turn(vector: Vector3<f64>) -> Matrix3<f64> {
    let cross = Matrix3::new(
        0.0, -vector.z, vector.y, vector.z, 0.0, -vector.x, -vector.y, vector.x, 0.0,
    );
    let mut term = Matrix3::identity();
    let mut sum = Matrix3::identity();
    for k in 1..40 {
        term = term * cross / f64::from(k);
        sum += term;
    }
    sum
}

fn rigid(turned: Matrix3<f64>, shift: Vector3<f64>) -> Matrix4<f64> {
    let mut pose = Matrix4::identity();
    pose.fixed_view_mut::<3, 3>(0, 0).copy_from(&turned);
    pose.fixed_view_mut::<3, 1>(0, 3).copy_from(&shift);
    pose
}

/// A turn by `angle` about the line through `point` along `direction`.
fn about(point: Vector3<f64>, direction: Vector3<f64>, angle: f64) -> Matrix4<f64> {
    let turned = turn(direction * angle);
    rigid(turned, point - turned * point)
}

/// Where the sphere really is, machine directions, and so where the axes read it.
pub fn reading_mm(wrong: &Wrong, place: &Vector3<f64>, pose: &PerAxis<f64>) -> Vector3<f64> {
    let line_a = Vector3::new(0.0, wrong.ey0a, 50.0 + wrong.ez0a);
    let line_c = Vector3::new(wrong.ex0c, wrong.ey0c, 0.0);
    let along_a = turn(Vector3::new(0.0, wrong.eb0a, wrong.ec0a)) * Vector3::x();
    let along_c = turn(Vector3::new(wrong.ea0c, wrong.eb0c, 0.0)) * Vector3::z();
    let c = pose[Axis::C];
    let run_out = Vector3::new(wrong.run_out_c * ((2.0 * c).cos() - 1.0), 0.0, 0.0);
    // The body of C shifts against the way the tool seems to go.
    let carried = about(line_a, along_a, pose[Axis::A])
        * rigid(Matrix3::identity(), -run_out)
        * about(line_c, along_c, c);
    let at: Vector4<f64> = carried * place.push(1.0);
    at.xyz()
}

/// A visit with normal noise of `noise_mm` in each direction.
pub fn visit(
    sphere: &str,
    place: &Vector3<f64>,
    wrong: &Wrong,
    pose: &PerAxis<f64>,
    noise: (f64, &mut Pcg64Mcg),
) -> SphereVisit {
    let (noise_mm, rng) = noise;
    let normal = Normal::new(0.0, 1.0).unwrap();
    let off = Vector3::from_fn(|_, _| noise_mm * normal.sample(rng));
    SphereVisit {
        sphere: sphere.to_owned(),
        pose_rad: *pose,
        centre_mm: reading_mm(wrong, place, pose) + off,
        covariance_mm2: Matrix3::identity() * noise_mm.max(1e-6).powi(2),
        known_mm: Vector3::zeros(),
    }
}

pub fn visits(
    wrong: &Wrong,
    place: &Vector3<f64>,
    poses: &[PerAxis<f64>],
    repeats: usize,
    (noise_mm, seed): (f64, u64),
) -> Vec<SphereVisit> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    (0..repeats)
        .flat_map(|_| poses.iter())
        .map(|pose| visit("ball", place, wrong, pose, (noise_mm, &mut rng)))
        .collect()
}
