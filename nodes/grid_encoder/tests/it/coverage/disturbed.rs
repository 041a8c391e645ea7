//! Whether intervals hold the truth where the plate errs and the machine drifts from recording to recording.
//!
//! The plate's error is a sum of bumps, which is no function of those that the fit takes for it.

use grid_encoder::identify::{Disturbed, Identification, IdentifyOptions, identify};
use grid_encoder::recording::{Recording, in_plane};
use machine::{Chain, Kinematics};
use metrology::PerAxis;
use nalgebra::Vector2;
use rand::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use crate::coverage::machines::{ARMS_MM, CHAIN, Cubic, record};
use crate::coverage::{Coverage, true_coefficients};

const MACHINES: u64 = 40;
/// Standard deviations: of the plate's error at a place, of the shift and of the strain at the edge of a recording, mm.
const PLATE_MM: f64 = 4e-4;
const SHIFT_MM: f64 = 2e-4;
const STRAIN_MM: f64 = 4e-4;
/// Edge of the greatest circle, mm.
const RADIUS_MM: f64 = 70.0;
const BUMPS: usize = 60;
/// Half the width of a bump, mm.
const BUMP_MM: f64 = 18.0;

/// Error of a plate: bumps at random places.
struct Plate {
    bumps: Vec<(Vector2<f64>, [f64; 2])>,
}

impl Plate {
    fn random(rng: &mut Pcg64Mcg) -> Self {
        let half_mm = RADIUS_MM + 2.0 * BUMP_MM;
        // Bumps per mm² times the integral of a bump squared is the variance.
        let density = BUMPS as f64 / (4.0 * half_mm * half_mm);
        let height_mm = PLATE_MM / (density * std::f64::consts::PI).sqrt() / BUMP_MM;
        let bumps = (0..BUMPS).map(|_| {
            let at = [(); 2].map(|()| rng.random_range(-half_mm..half_mm));
            let height = [(); 2].map(|()| height_mm * normal(rng));
            (Vector2::from(at), height)
        });
        Self {
            bumps: bumps.collect(),
        }
    }

    fn error_mm(&self, at_mm: Vector2<f64>) -> [f64; 2] {
        let mut sum = [0.0; 2];
        for (middle, height) in &self.bumps {
            let share = (-(at_mm - middle).norm_squared() / (2.0 * BUMP_MM * BUMP_MM)).exp();
            for (sum, height) in sum.iter_mut().zip(height) {
                *sum += share * height;
            }
        }
        sum
    }
}

fn normal(rng: &mut Pcg64Mcg) -> f64 {
    StandardNormal.sample(rng)
}

/// The grid counts from the middle of the plate.
fn zeroed_in_the_middle(recordings: &mut [Recording]) {
    let mut zeros: Vec<(u32, [f64; 2])> = Vec::new();
    for recording in recordings {
        let zero_id = recording.place.fixture.zero_id;
        let known = zeros
            .iter()
            .find(|(id, _)| *id == zero_id)
            .map(|(_, zero)| *zero);
        let n = recording.points.len() as f64;
        let mean = |k: usize| {
            recording
                .points
                .iter()
                .map(|p| p.reading_mm[k])
                .sum::<f64>()
                / n
        };
        let zero = known.unwrap_or_else(|| [mean(0), mean(1)]);
        zeros.push((zero_id, zero));
        for point in &mut recording.points {
            for (reading, zero) in point.reading_mm.iter_mut().zip(zero) {
                *reading -= zero;
            }
        }
    }
}

fn disturb(recordings: &mut [Recording], rng: &mut Pcg64Mcg) {
    let plate = Plate::random(rng);
    for recording in recordings {
        let shift = [(); 2].map(|()| SHIFT_MM * normal(rng));
        let strain = [(); 2].map(|()| STRAIN_MM / RADIUS_MM * normal(rng));
        let centre = in_plane(recording.place.plane, &recording.place.centre_mm);
        for point in &mut recording.points {
            let p = in_plane(recording.place.plane, &point.positions.xyz());
            let error_mm = plate.error_mm(Vector2::from(point.reading_mm));
            for k in 0..2 {
                point.reading_mm[k] += error_mm[k] + shift[k] + strain[k] * (p[k] - centre[k]);
            }
        }
    }
}

fn identified(recordings: &[Recording], disturbed: Disturbed) -> Identification {
    let chain: Chain = CHAIN.parse().unwrap();
    let mut options = IdentifyOptions::of_chain(&chain, &PerAxis::default(), 3);
    options.disturbed = disturbed;
    let kinematics = Kinematics::of_chain(chain, PerAxis::default());
    identify(&kinematics, recordings, &options).unwrap()
}

#[test]
fn val_coverage_where_the_plate_errs_and_the_machine_drifts() {
    let (mut with, mut without) = (Coverage::default(), Coverage::default());
    let mut squares_mm2 = [0.0; 2];
    for seed in 0..MACHINES {
        let mut rng = Pcg64Mcg::seed_from_u64(900 + seed);
        let truth = Cubic::random(&mut rng);
        let mut recordings = record(&truth, &ARMS_MM, &mut rng);
        zeroed_in_the_middle(&mut recordings);
        disturb(&mut recordings, &mut rng);
        let found = identified(&recordings, Disturbed::Found { start: None });
        let plain = identified(&recordings, Disturbed::Ignored);
        let values = true_coefficients(&truth, &found);
        for (idx, value) in values.iter().enumerate() {
            for (k, (fit, coverage)) in [(&found, &mut with), (&plain, &mut without)]
                .into_iter()
                .enumerate()
            {
                let (estimate, u) = fit.estimate(idx).unwrap();
                coverage.ask(estimate - value, u);
                squares_mm2[k] += ((estimate - value) / fit.scale[idx]).powi(2);
            }
        }
        if seed == 0 {
            println!("{:?}", found.disturbances);
        }
    }
    let [with_um, without_um] = squares_mm2.map(|sum| (sum / f64::from(with.asked)).sqrt() * 1e3);
    println!(
        "rms at the edge {with_um:.3} um, {without_um:.3} um if nothing is done, whose intervals hold {} of {}",
        without.held, without.asked
    );
    assert!(with_um < 0.9 * without_um, "{with_um} {without_um}");
    with.check("coefficients of a disturbed machine");
}
