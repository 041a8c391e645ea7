//! Whether the stated uncertainties of the rotary axes' location errors hold on machines of the plant, whose
//! linear axes, error motions and probe are not perfect either and whose physics is its own.

use fake_cnc::{Plant, PlantFile};
use machine::poses::{ReachLimits, calibration_poses, verification_poses};
use machine::{MachineFile, SphereDesign};
use metrology::{Axis, PerAxis};
use nalgebra::{Matrix3, Vector3};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use rotary_axes::verification::{Verification, verify};
use rotary_axes::{
    Allowance, EstimateRules, Known, RotaryAxesConfig, RotaryEstimate, SphereVisit, estimate,
};
use serde::Deserialize;

use abbe_tests::program::root;

const MACHINES: u64 = 150;
const NOISE_MM: f64 = 0.0003;
const RULES: EstimateRules = EstimateRules {
    harmonic_orders: 2,
    doubtful_p: 0.001,
    lack_of_fit_p: 0.01,
};

fn text(name: &str) -> String {
    std::fs::read_to_string(root().join("launch_configs/five_axis").join(name)).unwrap()
}

/// The allowances that the scenario states.
fn allowance() -> Allowance {
    #[derive(Deserialize)]
    struct File {
        #[serde(rename = "/**")]
        every: Every,
    }
    #[derive(Deserialize)]
    struct Every {
        #[serde(rename = "ros__parameters")]
        parameters: RotaryAxesConfig,
    }
    let file: File = serde_saphyr::from_str(&text("rotary_axes.yaml")).unwrap();
    file.every.parameters.allowance.unwrap()
}

/// One machine: what the allowances speak of is drawn in their size, the rest is the plant's own.
struct Drawn {
    plant: Plant,
    truth: Vec<(&'static str, f64)>,
    ball_off_mm: Vector3<f64>,
    rng: Pcg64Mcg,
}

impl Drawn {
    fn new(seed: u64, machine: &MachineFile, allowance: &Allowance) -> Self {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let mut normal = |size: f64| -> f64 {
            let drawn: f64 = StandardNormal.sample(&mut rng);
            size * drawn
        };
        let mut file = PlantFile::from_yaml(&text("plant.yaml")).unwrap();
        file.seed = 7000 + seed;
        for entry in file.geometry.linear.values_mut() {
            entry.lead_um_per_m = normal(allowance.linear_scale_um_per_m);
        }
        let size = allowance.linear_squareness_urad;
        let squareness = &mut file.geometry.squareness_urad;
        (squareness.y_to_x, squareness.z_to_x) = (normal(size), normal(size));
        squareness.z_to_y = normal(size);
        for entry in file.geometry.rotary.values_mut() {
            entry.location_um = entry.location_um.map(|_| normal(25.0));
            entry.tilt_urad = entry.tilt_urad.map(|_| normal(40.0));
        }
        let (a, c) = (
            &file.geometry.rotary[&Axis::A],
            &file.geometry.rotary[&Axis::C],
        );
        let truth = vec![
            ("EY0A", a.location_um[1] / 1e3),
            ("EZ0A", a.location_um[2] / 1e3),
            ("EB0A", a.tilt_urad[1] / 1e6),
            ("EC0A", a.tilt_urad[2] / 1e6),
            ("EX0C", c.location_um[0] / 1e3),
            ("EY0C", c.location_um[1] / 1e3),
            ("EA0C", c.tilt_urad[0] / 1e6),
            ("EB0C", c.tilt_urad[1] / 1e6),
        ];
        let ball_off_mm = Vector3::from_fn(|_, _| normal(allowance.setup_um / 1e3));
        let plant = Plant::new(machine, &file).unwrap();
        Self {
            plant,
            truth,
            ball_off_mm,
            rng,
        }
    }

    /// Where the axes stand when the ball is at the sphere's centre: found by driving there.
    fn visit(
        &mut self,
        design: &SphereDesign,
        (sphere, place): (&str, &Vector3<f64>),
        pose_rad: &PerAxis<f64>,
    ) -> SphereVisit {
        let row = design.row(place, pose_rad);
        let mut at = row.positions;
        for _ in 0..4 {
            self.plant.settle_at(&at);
            let off_mm = row.machine_from_workpiece * (self.plant.tool_in_workpiece_mm() - place);
            for axis in Axis::LINEAR {
                at[axis] -= off_mm[axis.index()];
            }
        }
        let noise = Vector3::from_fn(|_, _| -> f64 { StandardNormal.sample(&mut self.rng) });
        SphereVisit {
            sphere: sphere.to_owned(),
            pose_rad: *pose_rad,
            centre_mm: at.xyz() + self.ball_off_mm + noise * NOISE_MM,
            covariance_mm2: Matrix3::identity() * NOISE_MM.powi(2),
            known_mm: Vector3::zeros(),
        }
    }
}

/// Of each location error its deviation from the truth in standard uncertainties, with and without the allowances.
fn standardised(found: &RotaryEstimate, truth: &[(&str, f64)]) -> Vec<[f64; 2]> {
    let (whole, noise) = (found.covariance(), &found.fit.covariance);
    let of = |(name, truth): &(&str, f64)| {
        let names = found.unknowns.iter().map(ToString::to_string);
        let at = names.into_iter().position(|n| n == *name).unwrap();
        let off = found.fit.values[at] - truth;
        [off / whole[(at, at)].sqrt(), off / noise[(at, at)].sqrt()]
    };
    truth.iter().map(of).collect()
}

/// What verifications at other poses leave is what they expect: neither more nor much less, and more than the noise.
fn judge_verifications(all: &[Verification]) {
    let sum = |of: fn(&Verification) -> f64| all.iter().map(|one| of(one).powi(2)).sum::<f64>();
    let left = sum(|one| one.rms_after_mm);
    let (allowed, noise) = (sum(|one| one.allowed_mm), sum(|one| one.expected_mm));
    let beyond = |p: f64| {
        let n = all.iter().filter(|one| one.judged.p < p).count();
        n as f64 / all.len() as f64
    };
    eprintln!(
        "verifications: rms left over rms expected {:.2}, over the noise alone {:.2}; p below 0.05 in {:.3}, below 0.01 in {:.3} of them",
        (left / allowed).sqrt(),
        (left / noise).sqrt(),
        beyond(0.05),
        beyond(0.01)
    );
    assert!((0.6..=1.15).contains(&(left / allowed).sqrt()));
    assert!((left / noise).sqrt() > 1.5, "the allowances do nothing");
    assert!(beyond(0.05) <= 0.12 && beyond(0.01) <= 0.05);
}

#[test]
fn coverage_of_95_percent_intervals_over_machines_of_the_plant() {
    let machine = MachineFile::parse(&text("machine.yaml"), "machine.yaml").unwrap();
    let design = SphereDesign::new(&machine).unwrap();
    let allowance = allowance();
    let spheres = [
        ("high".to_owned(), Vector3::new(70.0, -50.0, 130.0)),
        ("low".to_owned(), Vector3::new(-120.0, 60.0, 50.0)),
    ];
    let poses = spheres
        .each_ref()
        .map(|(name, _)| calibration_poses(&machine, name, 16, &ReachLimits::default()).unwrap());
    let others =
        verification_poses(&machine, "high", 8, &poses[0], &ReachLimits::default()).unwrap();
    let mut all: Vec<Vec<[f64; 2]>> = Vec::new();
    let mut verified: Vec<Verification> = Vec::new();
    for seed in 0..MACHINES {
        let mut drawn = Drawn::new(seed, &machine, &allowance);
        let mut visits = Vec::new();
        for ((name, place), poses) in spheres.iter().zip(&poses) {
            for pose in poses.iter().chain(poses) {
                visits.push(drawn.visit(&design, (name, place), pose));
            }
        }
        let known = Known {
            allowance: Some(&allowance),
            linear: None,
        };
        let found = estimate(&design, &visits, &spheres, &RULES).unwrap();
        let found = found.with_common(&design, known);
        all.push(standardised(&found, &drawn.truth));
        let (name, place) = &spheres[0];
        let high = |pose| drawn.visit(&design, (name, place), pose);
        let visits: Vec<SphereVisit> = others.iter().map(high).collect();
        verified.push(verify(&design, &found, known, &visits, &spheres[..1], true).unwrap());
    }
    judge_verifications(&verified);
    for (at, (name, _)) in Drawn::new(0, &machine, &allowance).truth.iter().enumerate() {
        let rms = |k: usize| {
            (all.iter().map(|one| one[at][k].powi(2)).sum::<f64>() / MACHINES as f64).sqrt()
        };
        eprintln!(
            "{name}: rms of deviation over standard uncertainty {:.2}, noise alone {:.2}",
            rms(0),
            rms(1)
        );
        // Neither too small nor so great that they say nothing.
        assert!((0.5..=1.25).contains(&rms(0)), "{name}: {}", rms(0));
    }
    let share = |k: usize| {
        let inside = all.iter().flatten().filter(|one| one[k].abs() <= 1.96);
        inside.count() as f64 / (all.iter().flatten().count() as f64)
    };
    eprintln!(
        "coverage {:.3} over {MACHINES} machines, {:.3} with the noise alone",
        share(0),
        share(1)
    );
    assert!(share(0) >= 0.93, "{}", share(0));
    assert!(share(1) < 0.8, "{}: the allowances do nothing", share(1));
}
