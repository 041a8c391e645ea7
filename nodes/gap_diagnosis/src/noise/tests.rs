use super::*;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

/// A difference over the angle of a circle with two dozen modes taken out of a hundred rows.
fn difference(phi: f64, random: &mut Pcg64Mcg) -> Difference {
    let rows = 100;
    let mut last = 0.0;
    let values = DVector::from_fn(rows, |_, _| {
        let draw: f64 = StandardNormal.sample(random);
        last = phi * last + (1.0 - phi * phi).sqrt() * draw;
        last
    });
    let angle = |row: usize| std::f64::consts::TAU * row as f64 / 100.0;
    Difference {
        paced: None,
        values,
        kinds: vec![],
        modes: DMatrix::from_fn(rows, 25, |row, k| {
            let turn = if k % 2 == 0 { 0.0 } else { 0.25 };
            (angle(row) * count(k.div_ceil(2)) - std::f64::consts::TAU * turn).cos()
        }),
        open: DMatrix::zeros(rows, 0),
    }
}

/// Repeats of two circles: white noise is recognised as white, though few residuals are left to show it.
#[test]
fn eq5_few_white_rows_have_no_memory() {
    let mut random = Pcg64Mcg::seed_from_u64(11);
    let mut worst = 0.0_f64;
    for _ in 0..50 {
        let few: Vec<Difference> = (0..4).map(|_| difference(0.0, &mut random)).collect();
        let few: Vec<&Difference> = few.iter().collect();
        let (found, _) = autocovariances(&few, 3);
        let largest = found[1..].iter().map(|g| (g / found[0]).abs());
        worst = largest.fold(worst, f64::max);
    }
    assert!(worst < 0.3, "{worst}");
}

#[test]
fn eq4_modes_that_are_taken_out_do_not_colour_the_noise() {
    let mut random = Pcg64Mcg::seed_from_u64(7);
    for phi in [0.0, 0.2, 0.35] {
        let all: Vec<Difference> = (0..400).map(|_| difference(phi, &mut random)).collect();
        let all: Vec<&Difference> = all.iter().collect();
        let (found, freedom) = autocovariances(&all, 3);
        assert!((freedom - 400.0 * 75.0).abs() < 1.0, "{freedom}");
        for (lag, wanted) in [1.0, phi, phi * phi].into_iter().enumerate() {
            assert!((found[lag] - wanted).abs() < 0.08, "{phi} {lag}: {found:?}");
        }
    }
}
