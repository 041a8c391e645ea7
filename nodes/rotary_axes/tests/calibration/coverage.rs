//! Whether the stated uncertainties are right, and what harmonics and doubtful visits do to them.

use machine::SphereDesign;
use machine::poses::{ReachLimits, calibration_poses};
use rotary_axes::{EstimateRules, Unknown, estimate};

use crate::bench::{BALL_MM, Wrong, file, visits};

pub const RULES: EstimateRules = EstimateRules {
    harmonic_orders: 2,
    doubtful_p: 0.001,
    lack_of_fit_p: 0.01,
};
const NOISE_MM: f64 = 0.0005;

#[test]
fn coverage_of_95_percent_intervals_over_a_thousand_machines() {
    let file = file();
    let design = SphereDesign::new(&file).unwrap();
    let poses = calibration_poses(&file, "ball", 12, &ReachLimits::default()).unwrap();
    let spheres = [("ball".to_owned(), BALL_MM)];
    let (mut inside, mut asked) = (0_u32, 0_u32);
    let mut with_harmonics = 0;
    for seed in 0..1000 {
        let wrong = Wrong::drawn(seed);
        let placed = BALL_MM + nalgebra::Vector3::new(0.05, -0.08, 0.03);
        let seen = visits(&wrong, &placed, &poses, 2, (NOISE_MM, 10_000 + seed));
        let found = estimate(&design, &seen, &spheres, &RULES).unwrap();
        with_harmonics += u32::from(found.unknowns.len() > 8);
        for (name, truth) in wrong.values() {
            let at = found
                .unknowns
                .iter()
                .position(|u| u.to_string() == name)
                .unwrap();
            assert!(found.fit.estimable[at], "{name}");
            let u = found.fit.covariance[(at, at)].sqrt();
            inside += u32::from((found.fit.values[at] - truth).abs() <= 1.96 * u);
            asked += 1;
        }
    }
    let share = f64::from(inside) / f64::from(asked);
    eprintln!(
        "coverage {share:.4} of {asked} intervals; harmonics taken in {with_harmonics} of 1000"
    );
    assert!((0.93..=0.97).contains(&share), "{share}");
    assert!(
        with_harmonics <= 30,
        "{with_harmonics}: the machines have none"
    );
}

#[test]
fn the_predicted_uncertainty_is_the_one_that_is_stated() {
    let file = file();
    let design = SphereDesign::new(&file).unwrap();
    let poses = calibration_poses(&file, "ball", 12, &ReachLimits::default()).unwrap();
    let seen = visits(&Wrong::drawn(5), &BALL_MM, &poses, 1, (NOISE_MM, 6));
    let spheres = [("ball".to_owned(), BALL_MM)];
    let found = estimate(&design, &seen, &spheres, &RULES).unwrap();
    let told = machine::poses::merit(&design, &[(BALL_MM, poses)]);
    for (at, (_, predicted)) in told.standard_uncertainty.iter().enumerate() {
        let stated = found.fit.covariance[(at, at)].sqrt() / found.enlargement;
        let ratio = stated / (predicted.unwrap() * NOISE_MM);
        assert!(
            (ratio - 1.0).abs() < 1e-3,
            "{}: {ratio}",
            found.unknowns[at]
        );
    }
}

#[test]
fn a_run_out_twice_per_turn_is_found_and_the_location_errors_stay_right() {
    let file = file();
    let design = SphereDesign::new(&file).unwrap();
    let poses = calibration_poses(&file, "ball", 20, &ReachLimits::default()).unwrap();
    let spheres = [("ball".to_owned(), BALL_MM)];
    let wrong = Wrong {
        run_out_c: 0.004,
        ..Wrong::drawn(77)
    };
    let seen = visits(&wrong, &BALL_MM, &poses, 2, (NOISE_MM, 3));
    let plain = EstimateRules {
        harmonic_orders: 0,
        ..RULES
    };
    let without = estimate(&design, &seen, &spheres, &plain).unwrap();
    assert!(without.lack_of_fit_p < 1e-6 && without.enlargement > 1.5);
    let found = estimate(&design, &seen, &spheres, &RULES).unwrap();
    let harmonics: Vec<String> = found
        .unknowns
        .iter()
        .skip(8)
        .map(Unknown::to_string)
        .collect();
    eprintln!(
        "{harmonics:?}, p {:.3}, {:.2} um to {:.2} um",
        found.lack_of_fit_p,
        without.spatial_after_mm * 1e3,
        found.spatial_after_mm * 1e3
    );
    let at = found
        .unknowns
        .iter()
        .position(|u| u.to_string() == "EXC cos 2C");
    assert!(
        (found.fit.values[at.unwrap()] - 0.004).abs() < 0.0015,
        "{:?}",
        found.fit.values
    );
    assert!(found.spatial_after_mm < 0.5 * without.spatial_after_mm);
    for (at, (name, truth)) in wrong.values().into_iter().enumerate() {
        let u = found.fit.covariance[(at, at)].sqrt();
        assert!((found.fit.values[at] - truth).abs() < 4.0 * u, "{name}");
    }
}

#[test]
fn two_spheres_tell_tilts_better_than_one() {
    let file = file();
    let design = SphereDesign::new(&file).unwrap();
    let limits = ReachLimits::default();
    let poses = calibration_poses(&file, "ball", 12, &limits).unwrap();
    let low = calibration_poses(&file, "low", 12, &limits).unwrap();
    let low_mm = nalgebra::Vector3::new(-110.0, 70.0, 40.0);
    let wrong = Wrong::drawn(8);
    let mut seen = visits(&wrong, &BALL_MM, &poses, 1, (NOISE_MM, 1));
    let one = estimate(&design, &seen, &[("ball".to_owned(), BALL_MM)], &RULES).unwrap();
    let mut second = visits(&wrong, &low_mm, &low, 1, (NOISE_MM, 2));
    second
        .iter_mut()
        .for_each(|visit| visit.sphere = "low".to_owned());
    seen.extend(second);
    let spheres = [("ball".to_owned(), BALL_MM), ("low".to_owned(), low_mm)];
    let two = estimate(&design, &seen, &spheres, &RULES).unwrap();
    for (at, unknown) in one
        .unknowns
        .iter()
        .enumerate()
        .filter(|(_, u)| u.is_angular())
    {
        let (u, v) = (
            one.fit.covariance[(at, at)].sqrt(),
            two.fit.covariance[(at, at)].sqrt(),
        );
        assert!(v < 0.75 * u, "{unknown}: {u} {v}");
    }
}

#[test]
fn a_scatter_of_repeats_beyond_the_stated_one_enlarges_the_uncertainties() {
    let file = file();
    let design = SphereDesign::new(&file).unwrap();
    let poses = calibration_poses(&file, "ball", 12, &ReachLimits::default()).unwrap();
    let mut seen = visits(&Wrong::drawn(5), &BALL_MM, &poses, 2, (3.0 * NOISE_MM, 6));
    for visit in &mut seen {
        visit.covariance_mm2 /= 9.0;
    }
    let spheres = [("ball".to_owned(), BALL_MM)];
    let found = estimate(&design, &seen, &spheres, &RULES).unwrap();
    assert!(
        (found.enlargement - 3.0).abs() < 0.6,
        "{}",
        found.enlargement
    );
}
