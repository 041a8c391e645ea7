//! What must not matter, and what verification says.

use machine::SphereDesign;
use machine::poses::{ReachLimits, calibration_poses, verification_poses};
use nalgebra::Vector3;
use proptest::prelude::*;
use rotary_axes::verification::verify;
use rotary_axes::{Known, estimate};

use crate::bench::{BALL_MM, Wrong, file, visits};
use crate::coverage::RULES;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn prop_the_order_of_the_poses_does_not_matter(seed in 0_u64..1000, turn in 1_usize..23) {
        let design = SphereDesign::new(&file()).unwrap();
        let poses = calibration_poses(&file(), "ball", 12, &ReachLimits::default()).unwrap();
        let seen = visits(&Wrong::drawn(seed), &BALL_MM, &poses, 2, (0.0005, seed));
        let mut other = seen.clone();
        other.rotate_left(turn);
        other.reverse();
        let spheres = [("ball".to_owned(), BALL_MM)];
        let (a, b) = (
            estimate(&design, &seen, &spheres, &RULES).unwrap(),
            estimate(&design, &other, &spheres, &RULES).unwrap(),
        );
        prop_assert_eq!(&a.unknowns, &b.unknowns);
        prop_assert!((&a.fit.values - &b.fit.values).norm() < 1e-9);
        prop_assert!((a.spatial_after_mm - b.spatial_after_mm).abs() < 1e-9);
    }

    #[test]
    fn prop_a_sphere_set_down_elsewhere_gives_the_same_errors(
        seed in 0_u64..1000, x in -0.5..0.5_f64, y in -0.5..0.5_f64, z in -0.5..0.5_f64,
    ) {
        let design = SphereDesign::new(&file()).unwrap();
        let poses = calibration_poses(&file(), "ball", 12, &ReachLimits::default()).unwrap();
        let place = BALL_MM + Vector3::new(x, y, z);
        let wrong = Wrong::drawn(seed);
        let seen = visits(&wrong, &place, &poses, 1, (0.0, 0));
        let found = estimate(&design, &seen, &[("ball".to_owned(), BALL_MM)], &RULES).unwrap();
        prop_assert!((found.spheres[0].1 - place).norm() < 1e-5);
        for (at, (name, truth)) in wrong.values().into_iter().enumerate() {
            let size = if at < 2 || at == 4 || at == 5 { 2e-5 } else { 2e-7 };
            prop_assert!((found.fit.values[at] - truth).abs() < size, "{} {}", name, found.fit.values[at]);
        }
    }
}

#[test]
fn a_verification_at_other_poses_is_as_good_as_the_uncertainties_say() {
    let file = file();
    let design = SphereDesign::new(&file).unwrap();
    let limits = ReachLimits::default();
    let poses = calibration_poses(&file, "ball", 12, &limits).unwrap();
    let others = verification_poses(&file, "ball", 10, &poses, &limits).unwrap();
    let spheres = [("ball".to_owned(), BALL_MM)];
    let (mut left, mut expected) = (0.0, 0.0);
    for seed in 0..40 {
        let wrong = Wrong::drawn(seed);
        let seen = visits(&wrong, &BALL_MM, &poses, 2, (0.0005, 2 * seed));
        let found = estimate(&design, &seen, &spheres, &RULES).unwrap();
        let checked = visits(&wrong, &BALL_MM, &others, 1, (0.0005, 2 * seed + 1));
        let same = verify(&design, &found, Known::default(), &checked, &spheres, true).unwrap();
        assert!(same.same_places && same.rms_before_mm > 5.0 * same.rms_after_mm);
        left += same.rms_after_mm.powi(2);
        expected += same.expected_mm.powi(2);
        // Set down anew 0.1 mm away, the sphere's place is fitted: its errors are as small.
        let moved = BALL_MM + Vector3::new(0.1, 0.0, -0.1);
        let checked = visits(&wrong, &moved, &others, 1, (0.0005, 2 * seed + 1));
        let anew = verify(&design, &found, Known::default(), &checked, &spheres, false).unwrap();
        assert!(!anew.same_places && anew.rms_after_mm < 1.5 * same.rms_after_mm + 2e-4);
    }
    let ratio: f64 = left / expected;
    eprintln!("verification: variance left over variance expected {ratio:.3}");
    assert!((0.85..1.15).contains(&ratio), "{ratio}");
}
