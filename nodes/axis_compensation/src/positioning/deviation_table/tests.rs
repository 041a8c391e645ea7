use std::f64::consts::PI;

use super::*;
use proptest::prelude::*;

const MM: i64 = 1_000_000_000_000;
const UM: i64 = 1_000_000_000;

fn points(n: usize, spacing_mm: f64) -> Vec<f64> {
    (0..n).map(|j| -100.0 + spacing_mm * j as f64).collect()
}

fn table(up_um: &[f64], down_um: &[f64]) -> DeviationTable {
    let mm = |um: &[f64]| um.iter().map(|um| um * 1e-3).collect::<Vec<_>>();
    DeviationTable::new(
        Axis::X,
        &points(up_um.len(), 10.0),
        &mm(up_um),
        &mm(down_um),
    )
    .unwrap()
}

fn refusal(positions_mm: &[f64], up_mm: &[f64], down_mm: &[f64]) -> String {
    DeviationTable::new(Axis::Y, positions_mm, up_mm, down_mm)
        .unwrap_err()
        .to_string()
}

#[test]
fn points_that_make_no_table_are_refused_by_name() {
    let five = points(5, 10.0);
    let zero = [0.0; 5];
    assert_eq!(
        refusal(&five[..4], &zero[..4], &zero[..4]),
        "axis Y: 4 points, at least 5 are needed"
    );
    assert_eq!(
        refusal(&five, &zero, &zero[..3]),
        "axis Y: 5 points but 3 deviations"
    );
    assert_eq!(
        refusal(&[0.0, 10.0, 20.0, 20.0, 30.0], &zero, &zero),
        "axis Y: point 20 mm must lie above the one before, 20 mm"
    );
    assert_eq!(
        refusal(&[0.0, 10.0, 19.0, 30.0, 40.0], &zero, &zero),
        "axis Y: point 19 mm lies 9 mm after the one before, must be from 10 to 20 mm"
    );
    assert_eq!(
        refusal(&[0.0, 10.0, 30.5, 45.0, 60.0], &zero, &zero),
        "axis Y: point 30.5 mm lies 20.5 mm after the one before, must be from 10 to 20 mm"
    );
    assert!(refusal(&[0.0, 10.0, f64::NAN, 30.0, 40.0], &zero, &zero).contains("NaN mm"));
    assert!(
        refusal(&five, &[0.0, 0.0, f64::NAN, 0.0, 0.0], &zero)
            .contains("deviation NaN mm at -80 mm")
    );
    assert!(refusal(&five, &zero, &[0.0, 0.0, 0.0, 0.0, 6.0]).contains("deviation 6 mm at -60 mm"));
}

#[test]
fn a_border_belongs_to_the_cell_that_the_motion_enters() {
    let table = table(&[0.0, 1.0, 5.0, 6.0, 6.5], &[0.0, 1.0, 5.0, 6.0, 6.5]);
    let border_fm = -90 * MM;
    let begins = |direction| table.line(border_fm, direction).map(|line| line.x_fm / MM);
    assert_eq!(begins(Direction::Up), Some(-90));
    assert_eq!(begins(Direction::Down), Some(-100));
    assert!((table.slope(border_fm, Direction::Up) - 4e-4).abs() < 1e-18);
    assert!((table.slope(border_fm, Direction::Down) - 1e-4).abs() < 1e-18);
    // At the ends a motion that leaves the points has no slope.
    for (end_fm, out, back) in [
        (-100 * MM, Direction::Down, Direction::Up),
        (-60 * MM, Direction::Up, Direction::Down),
    ] {
        assert_eq!(
            (table.line(end_fm, out), table.slope(end_fm, out)),
            (None, 0.0)
        );
        assert!(table.line(end_fm, back).is_some());
    }
}

#[test]
fn eq1_is_straight_between_points_and_level_outside() {
    let table = table(&[2.0, 4.0, 3.0, 0.0, -1.0], &[-2.0, 0.0, -1.0, -4.0, -5.0]);
    let up = |mm_tenths: i64| table.deviation_fm(mm_tenths * MM / 10, Some(Direction::Up));
    assert_eq!(up(-1000), 2 * UM);
    assert_eq!(up(-950), 3 * UM);
    assert_eq!(up(-900), 4 * UM);
    assert_eq!(up(-875), 3_750_000_000);
    assert_eq!(up(-600), -UM);
    assert_eq!((up(-5000), up(5000)), (2 * UM, -UM));
    assert_eq!(table.deviation_fm(-95 * MM, Some(Direction::Down)), -UM);
    assert_eq!(table.deviation_fm(-95 * MM, None), UM);
    assert_eq!(table.deviation_fm(i64::MIN, Some(Direction::Down)), -2 * UM);
    assert_eq!(table.deviation_fm(i64::MAX, Some(Direction::Down)), -5 * UM);
}

#[test]
fn a_point_is_passed_once_on_arrival_and_not_on_leaving() {
    let table = table(&[0.0; 6], &[0.0; 6]);
    assert_eq!(table.points_passed(-101 * MM, -100 * MM), 0..1);
    assert_eq!(table.points_passed(-100 * MM, -99 * MM), 1..1);
    assert_eq!(table.points_passed(-95 * MM, -69 * MM), 1..4);
    assert_eq!(table.points_passed(-69 * MM, -80 * MM), 2..4);
    assert_eq!(table.points_passed(-80 * MM, -85 * MM), 2..2);
    assert_eq!(table.points_passed(-80 * MM, -80 * MM), 3..3);
}

#[test]
fn a_published_table_says_its_points_in_millimetres() {
    let table = table(&[1.0; 5], &[-1.0; 5]);
    let about = Published {
        at: Stamp::from_nanos(7),
        n_runs: 10,
        weight: 0.3,
        sequence: 4,
    };
    let published = table.published(Axis::X, about);
    assert_eq!(published.position, [-100.0, -90.0, -80.0, -70.0, -60.0]);
    assert_eq!(
        (published.deviation_up[0], published.deviation_down[4]),
        (1e-3, -1e-3)
    );
    assert_eq!((published.n_runs, published.sequence), (10, 4));
}

#[test]
fn points_a_whole_number_of_leads_apart_hide_the_screws_cyclic_error() {
    let at = |spacing_mm: f64| {
        let x_mm = points(8, spacing_mm);
        DeviationTable::new(Axis::X, &x_mm, &[0.0; 8], &[0.0; 8]).unwrap()
    };
    assert!(at(10.0).hides(10 * MM) && at(20.0).hides(10 * MM) && at(10.0).hides(5 * MM));
    assert!(!at(15.0).hides(10 * MM) && !at(10.0).hides(20 * MM) && !at(10.5).hides(10 * MM));
    assert!(!at(10.0).hides(0));
}

/// The published (2), walked cell by cell in floating point; µm and mm.
fn walked_um(up_um: &[f64], spacing_mm: f64, from_mm: f64, to_mm: f64) -> f64 {
    let positions_mm = points(up_um.len(), spacing_mm);
    let (lower_mm, upper_mm) = (from_mm.min(to_mm), from_mm.max(to_mm));
    let cells = positions_mm.windows(2).zip(up_um.windows(2));
    let risen: f64 = cells
        .map(|(x_mm, d_um)| {
            let inside_mm = (upper_mm.min(x_mm[1]) - lower_mm.max(x_mm[0])).max(0.0);
            inside_mm * (d_um[1] - d_um[0]) / (x_mm[1] - x_mm[0])
        })
        .sum();
    risen * (to_mm - from_mm).signum()
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 3000,
        failure_persistence: None,
        rng_seed: proptest::test_runner::RngSeed::Fixed(4),
        ..ProptestConfig::default()
    })]

    #[test]
    fn prop_eq2_equals_the_published_increments_cell_by_cell(
        um in prop::collection::vec(-30.0..30.0_f64, 5..30),
        spacing_mm in 10.0..20.0_f64,
        from_mm in -150.0..500.0_f64,
        to_mm in -150.0..500.0_f64,
    ) {
        let mm: Vec<_> = um.iter().map(|um| um * 1e-3).collect();
        let table = DeviationTable::new(Axis::X, &points(um.len(), spacing_mm), &mm, &mm).unwrap();
        let direction = if to_mm >= from_mm { Direction::Up } else { Direction::Down };
        let at = |mm: f64| table.deviation_fm(fm_from_mm(mm).unwrap(), Some(direction));
        let risen_um = mm_from_fm(at(to_mm) - at(from_mm)) * 1e3;
        let expected_um = walked_um(&um, spacing_mm, from_mm, to_mm);
        // Two roundings to 1 fm, and those of the sum in floating point.
        prop_assert!((risen_um - expected_um).abs() < 2e-9, "{risen_um} {expected_um}");
    }

    #[test]
    fn prop_increments_add_up_whatever_the_way_between_them(
        um in prop::collection::vec(-30.0..30.0_f64, 5..20),
        way_mm in prop::collection::vec(-150.0..250.0_f64, 2..40),
    ) {
        let table = table(&um, &um);
        let at = |mm: f64, direction| table.deviation_fm(fm_from_mm(mm).unwrap(), direction);
        let mut sum_fm = at(way_mm[0], Some(Direction::Up));
        for pair in way_mm.windows(2) {
            let direction = if pair[1] >= pair[0] { Direction::Up } else { Direction::Down };
            sum_fm += at(pair[1], Some(direction)) - at(pair[0], Some(direction));
        }
        let last_mm = way_mm[way_mm.len() - 1];
        prop_assert_eq!(sum_fm, at(last_mm, None));
    }
}

#[test]
fn val_a_pure_lead_error_is_met_everywhere_between_the_points() {
    let lead_error = 35e-6;
    let x_mm = points(31, 16.0);
    let mm: Vec<_> = x_mm.iter().map(|x_mm| lead_error * x_mm).collect();
    let table = DeviationTable::new(Axis::X, &x_mm, &mm, &mm).unwrap();
    for k in 0..10_000 {
        let x_mm = -100.0 + 0.048 * f64::from(k);
        let found_fm = table.deviation_fm(fm_from_mm(x_mm).unwrap(), Some(Direction::Up));
        assert!(
            (mm_from_fm(found_fm) - lead_error * x_mm).abs() < 2e-12,
            "{x_mm}"
        );
    }
}

/// Linear interpolation of samples h apart is a convolution with a triangle of half-width h, whose Fourier
/// transform is sinc²: a wave of length L keeps sinc²(h/L) of its amplitude.
#[test]
fn val_sampled_cosine_keeps_sinc_squared_of_its_amplitude() {
    for (spacing_mm, wave_mm) in [(16.0_f64, 64.0), (12.0, 60.0), (20.0, 50.0), (10.0, 200.0)] {
        let amplitude_mm = 4e-3;
        // A whole number of both waves and cells for each pair.
        let length_mm = 960.0
            * if spacing_mm > 15.0 && spacing_mm < 17.0 {
                1.0
            } else {
                1.25
            };
        let n = (length_mm / spacing_mm).round() as usize + 1;
        let x_mm: Vec<_> = (0..n).map(|j| spacing_mm * j as f64).collect();
        let wave = |x_mm: f64| amplitude_mm * (2.0 * PI * x_mm / wave_mm).cos();
        let mm: Vec<_> = x_mm.iter().map(|&x_mm| wave(x_mm)).collect();
        let table = DeviationTable::new(Axis::X, &x_mm, &mm, &mm).unwrap();
        let steps = 60_000;
        let coefficient: f64 = (0..steps)
            .map(|k| {
                let x_mm = length_mm * (f64::from(k) + 0.5) / f64::from(steps);
                let found_fm = table.deviation_fm(fm_from_mm(x_mm).unwrap(), Some(Direction::Up));
                2.0 / f64::from(steps) * mm_from_fm(found_fm) * (2.0 * PI * x_mm / wave_mm).cos()
            })
            .sum();
        let ratio = PI * spacing_mm / wave_mm;
        let expected = amplitude_mm * (ratio.sin() / ratio).powi(2);
        eprintln!(
            "h {spacing_mm} L {wave_mm}: {} of {}",
            coefficient / amplitude_mm,
            expected / amplitude_mm
        );
        assert!((coefficient - expected).abs() < 1e-6 * amplitude_mm);
    }
}
