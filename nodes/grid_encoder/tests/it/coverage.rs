//! Whether a stated 95 % interval holds the truth in 95 % of machines, and what happens when the machine's
//! errors are no cubics.
//!
//! The truth is an exact product of 4×4 matrices written here, with bodies that carry bodies; it shares no
//! formula with what is fitted.

#![expect(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "a test fails by panicking and shows its figures"
)]

mod certificate;
mod disturbed;
mod machines;

use grid_encoder::identify::{Identification, IdentifyOptions, identify};
use grid_encoder::published;
use grid_encoder::recording::Recording;
use machine::{Chain, Kinematics};
use metrology::{Axis, PerAxis};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

use machines::{ARMS_MM, CHAIN, Cubic, Fourier, record};

fn fit(recordings: &[Recording]) -> Identification {
    let chain: Chain = CHAIN.parse().unwrap();
    let options = IdentifyOptions::of_chain(&chain, &PerAxis::default(), 3);
    let kinematics = Kinematics::of_chain(chain, PerAxis::default());
    identify(&kinematics, recordings, &options).unwrap()
}

/// True value of each coefficient in the order of the fit.
fn true_coefficients(truth: &Cubic, found: &Identification) -> Vec<f64> {
    let mut values = Vec::new();
    for model in &found.components {
        let component = model.component;
        if component.is_location {
            values.push(
                truth.squareness[match component.direction {
                    Axis::C => 0,
                    Axis::B => 1,
                    _ => 2,
                }],
            );
            continue;
        }
        let cubic = truth.coefficients[component.of.index()][component.direction.index()];
        values.extend(&cubic[3 - model.basis.len()..]);
    }
    values
}

/// Intervals that held the truth, of how many.
#[derive(Default)]
struct Coverage {
    held: u32,
    asked: u32,
}

impl Coverage {
    fn ask(&mut self, off: f64, standard_uncertainty: f64) {
        self.asked += 1;
        self.held += u32::from(off.abs() < 1.96 * standard_uncertainty);
    }

    fn check(&self, what: &str) {
        let share = f64::from(self.held) / f64::from(self.asked);
        println!("{what}: {share:.4} of {} intervals", self.asked);
        assert!((0.93..0.97).contains(&share), "{what}: {share}");
    }
}

#[test]
fn val_coverage_of_a_thousand_machines() {
    let mut coverage = Coverage::default();
    for seed in 0..1000 {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let truth = Cubic::random(&mut rng);
        let found = fit(&record(&truth, &ARMS_MM, &mut rng));
        let values = true_coefficients(&truth, &found);
        assert_eq!(values.len(), 51);
        for (idx, value) in values.iter().enumerate() {
            let (estimate, u) = found.estimate(idx).unwrap();
            coverage.ask(estimate - value, u);
        }
    }
    coverage.check("coefficients");
}

/// Without a tool offset neither the turns of the head nor the yaw of Y are there by themselves.
#[test]
fn val_coverage_of_combinations_where_single_errors_are_not_seen() {
    let (mut single, mut sums) = (Coverage::default(), Coverage::default());
    for seed in 0..300 {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let truth = Cubic::random(&mut rng);
        let found = fit(&record(&truth, &ARMS_MM[..1], &mut rng));
        let values = true_coefficients(&truth, &found);
        for (idx, value) in values.iter().enumerate() {
            if let Some((estimate, u)) = found.estimate(idx) {
                single.ask(estimate - value, u);
            }
        }
        for sum in &found.combinations {
            let value: f64 = sum.weights.iter().map(|(idx, w)| w * values[*idx]).sum();
            sums.ask(sum.value_mm - value, sum.standard_uncertainty_mm);
        }
        if seed == 0 {
            let names: Vec<_> = found
                .combinations
                .iter()
                .map(|c| found.name_of(c))
                .collect();
            println!("rank {} of {}: {names:?}", found.rank, found.unknowns.len());
            assert!(names.contains(&String::from("EXY2|ECY1")), "{names:?}");
        }
    }
    single.check("single errors");
    sums.check("sums");
}

#[test]
fn a_machine_whose_errors_are_waves_is_told_to_lack_fit() {
    let mut flagged = [0, 0];
    for seed in 0..50 {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let cubic = Cubic::random(&mut rng);
        let of_cubic = fit(&record(&cubic, &ARMS_MM, &mut rng));
        let of_waves = fit(&record(&Fourier(cubic), &ARMS_MM, &mut rng));
        flagged[0] += usize::from(of_cubic.judgement.lacks_something(0.001));
        flagged[1] += usize::from(of_waves.judgement.lacks_something(0.001));
        assert!(of_waves.noise_ratio > 3.0, "{}", of_waves.noise_ratio);
        assert!(
            of_waves.variance_inflation > 1.2,
            "{}",
            of_waves.variance_inflation
        );
        assert!((of_cubic.variance_inflation - 1.0).abs() < 1e-12);
        if seed == 0 {
            println!(
                "cubic {:?}\nwaves {:?}, noise ratio {}",
                of_cubic.judgement, of_waves.judgement, of_waves.noise_ratio
            );
        }
    }
    println!("flagged {flagged:?} of 50");
    assert_eq!(flagged, [0, 50]);
}

#[test]
fn a_bumped_station_is_weighed_down_and_counted() {
    let mut rng = Pcg64Mcg::seed_from_u64(77);
    let truth = Cubic::random(&mut rng);
    let clean = record(&truth, &ARMS_MM, &mut rng);
    let mut bumped = clean.clone();
    for (recording, point) in [(0, 3), (4, 11), (9, 15)] {
        bumped[recording].points[point].reading_mm[0] += 0.02;
    }
    let (of_clean, of_bumped) = (fit(&clean), fit(&bumped));
    assert_eq!(of_bumped.n_outliers, 3);
    for idx in 0..of_clean.n_coefficients {
        if let (Some((a, u)), Some((b, _))) = (of_clean.estimate(idx), of_bumped.estimate(idx)) {
            assert!((a - b).abs() < u, "{}", of_clean.unknowns[idx]);
        }
    }
}

/// The published solution and the fit on the same first circle, whose truth is known.
#[test]
fn the_published_solution_prints_single_errors_that_the_fit_refuses() {
    let mut rng = Pcg64Mcg::seed_from_u64(4);
    let mut truth = Cubic::random(&mut rng);
    // A machine that is perfect but for the scale of X.
    truth.coefficients = [[[0.0; 3]; 6]; 3];
    truth.squareness = [0.0; 3];
    truth.coefficients[0][0][0] = 100e-6;
    let circle = record(&truth, &ARMS_MM[..1], &mut rng).swap_remove(0);
    let kinematics = Kinematics::of_chain(CHAIN.parse().unwrap(), PerAxis::default());
    let (system, radial_mm) = published::of_recording(&kinematics, &circle).unwrap();
    let printed = published::solve(&system, &radial_mm, &[]);
    let names = ["EXX1", "EXX2", "EXX3", "EYY1", "EYY2", "EYY3"];
    for (name, beta_mm) in names.iter().zip(printed.beta_mm.iter()) {
        println!("published {name}: {:.2} µm at the radius", beta_mm * 1e3);
    }
    // 7 µm at the radius are in EXX1 and nowhere else; the published one spreads them.
    assert!((printed.beta_mm[0] - 0.007).abs() > 1e-3);
    assert!(printed.beta_mm[2].abs() > 1e-3 || printed.beta_mm[3].abs() > 1e-3);
    let found = fit(&[circle]);
    let (exx1, u) = found.estimate(found.find("EXX1").unwrap()).unwrap();
    assert!((exx1 - 100e-6).abs() < 4.0 * u, "{exx1} {u}");
    for name in ["EXY2", "EYX2", "EXX2", "EYY2", "ECY1", "EC0Y", "EXY3"] {
        let idx = found.find(name).unwrap();
        assert!(found.estimate(idx).is_none(), "{name}");
    }
}
