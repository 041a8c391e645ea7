use super::*;
use metrology::Axis;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use statrs::distribution::{ChiSquared, ContinuousCDF};

const MM: i64 = 1_000_000_000_000;
const UM: i64 = 1_000_000_000;
const PULSE_FM: i64 = UM / 10;

fn table(n: usize) -> DeviationTable {
    let x_mm: Vec<_> = (0..n).map(|j| 10.0 * j as f64).collect();
    let zero_mm = vec![0.0; n];
    DeviationTable::new(Axis::X, &x_mm, &zero_mm, &zero_mm).unwrap()
}

fn refresh(weight: f64, directions: Directions) -> Refresh {
    Refresh::new(weight, directions, 30.0, 50 * UM, PULSE_FM)
}

fn at(commanded_mm: f64, deviation_um: f64) -> ScaleReading {
    ScaleReading {
        commanded_fm: (commanded_mm * 1e12).round() as i64,
        deviation_fm: (deviation_um * 1e9).round() as i64,
    }
}

/// One pass of the point at 20 mm that measures `deviation_fm`.
fn pass(
    refresh: &mut Refresh,
    table: &mut DeviationTable,
    up: bool,
    deviation_fm: i64,
) -> Refreshed {
    refresh.forget();
    let sign = if up { 1 } else { -1 };
    let state = |by: i64| ScaleReading {
        commanded_fm: 20 * MM + sign * by * MM / 100,
        deviation_fm,
    };
    refresh.observe(table, state(-1), 1e-3);
    refresh.observe(table, state(1), 1e-3)
}

#[test]
fn eq1_takes_the_deviation_where_the_command_passes_the_point() {
    let mut table = table(5);
    let mut refresh = refresh(0.25, Directions::Apart);
    refresh.observe(&mut table, at(19.99, 2.0), 1e-3);
    let refreshed = refresh.observe(&mut table, at(20.03, 6.0), 2e-3);
    assert_eq!(refreshed.n_points, 1);
    // A quarter of the way from 2 µm to 6 µm: 3 µm, of which the table takes a quarter.
    assert_eq!(table.point_fm(2, Direction::Up), Some(750_000_000));
    assert_eq!(table.point_fm(2, Direction::Down), Some(0));
}

#[test]
fn eq5_points_beyond_those_that_are_passed_move_with_the_outermost() {
    let mut table = table(5);
    let mut refresh = refresh(0.3, Directions::Apart).with_ends_following(true);
    refresh.begin(5);
    // Work goes to and fro between 15 and 35 mm; `grown_um` is what the screw has grown.
    let mut work = |grown_um: f64| {
        for _ in 0..60 {
            for (before_mm, deviation_um) in [(19.99, 4.0), (29.99, 6.0)] {
                refresh.forget();
                for commanded_mm in [before_mm, before_mm + 0.02] {
                    let state = at(commanded_mm, deviation_um + grown_um);
                    refresh.observe(&mut table, state, 1e-3);
                }
            }
        }
        let um = |fm: i64| fm as f64 / UM as f64;
        let up_um = |point| um(table.point_fm(point, Direction::Up).unwrap());
        assert_eq!(table.point_fm(4, Direction::Down), Some(0));
        [0, 1, 2, 3, 4].map(up_um)
    };
    let (cold_um, warm_um) = (work(0.0), work(10.0));
    // What five passes leave of what is measured.
    let left = 0.7_f64.powi(5);
    assert!((cold_um[0] - 4.0 * left).abs() < 1e-6, "{cold_um:?}");
    assert!((cold_um[4] - 6.0 * left).abs() < 1e-6, "{cold_um:?}");
    for (cold_um, warm_um) in cold_um.iter().zip(warm_um) {
        assert!(
            (warm_um - cold_um - 10.0).abs() < 1e-6,
            "{cold_um} {warm_um}"
        );
    }
}

#[test]
fn every_pass_at_the_feed_limit_itself_teaches_however_commands_are_rounded() {
    // 1000 mm/min: 16.666... µm a tick, rounded to femtometres or to pulses.
    for rounding_fm in [1, PULSE_FM] {
        let mut table = table(5);
        let mut refresh = Refresh::new(0.3, Directions::Together, 1000.0 / 60.0, 50 * UM, PULSE_FM);
        let mut n_points = 0;
        for tick in 0..2500_i64 {
            let commanded_fm = (tick * MM / 60 - MM / 2) / rounding_fm * rounding_fm;
            let reading = ScaleReading {
                commanded_fm,
                deviation_fm: UM,
            };
            n_points += refresh.observe(&mut table, reading, 1e-3).n_points;
        }
        assert_eq!(n_points, 5, "rounded to {rounding_fm} fm");
    }
}

#[test]
fn together_one_pass_refreshes_both_directions() {
    let mut table = table(5);
    let mut refresh = refresh(0.3, Directions::Together);
    pass(&mut refresh, &mut table, false, 10 * UM);
    assert_eq!(table.point_fm(2, Direction::Up), Some(3 * UM));
    assert_eq!(table.point_fm(2, Direction::Down), Some(3 * UM));
}

#[test]
fn a_fast_pass_a_long_step_and_a_pass_across_a_gap_teach_nothing() {
    let mut table = table(5);
    let untouched = table.clone();
    let mut refresh = refresh(0.3, Directions::Together);
    for (from_mm, to_mm, dt_s) in [(19.9, 20.1, 1e-3), (19.0, 20.5, 1.0), (20.0, 20.0, 1.0)] {
        refresh.forget();
        refresh.observe(&mut table, at(from_mm, 9.0), 1.0);
        assert_eq!(
            refresh.observe(&mut table, at(to_mm, 9.0), dt_s),
            Refreshed::default()
        );
    }
    refresh.observe(&mut table, at(19.99, 9.0), 1e-3);
    refresh.forget();
    refresh.observe(&mut table, at(20.01, 9.0), 1e-3);
    refresh.observe(&mut table, at(20.02, 9.0), 0.0);
    assert_eq!(table, untouched);
}

#[test]
fn what_is_beyond_belief_is_refused_with_place_and_change() {
    let mut table = table(5);
    let untouched = table.clone();
    let mut refresh = refresh(0.3, Directions::Together);
    let refreshed = pass(&mut refresh, &mut table, true, -51 * UM);
    assert_eq!(
        refreshed.doubted,
        Some(Doubted {
            position_fm: 20 * MM,
            change_fm: -51 * UM
        })
    );
    assert_eq!(table, untouched);
}

#[test]
fn val_ewma_remembers_2_minus_w_over_w_passes() {
    for weight in [0.05, 0.1, 0.3] {
        let mut table = table(5);
        let mut refresh = Refresh::new(weight, Directions::Together, 30.0, 5 * MM, PULSE_FM);
        let impulse_fm = 4 * MM;
        let weights: Vec<f64> = (0..2_000)
            .map(|k| {
                let deviation_fm = if k == 0 { impulse_fm } else { 0 };
                pass(&mut refresh, &mut table, true, deviation_fm);
                table.point_fm(2, Direction::Up).unwrap() as f64 / impulse_fm as f64
            })
            .collect();
        let memory = 1.0 / weights.iter().map(|w| w * w).sum::<f64>();
        eprintln!("w {weight}: memory {memory:.4} passes");
        assert!(
            (memory - (2.0 - weight) / weight).abs() < 1e-9 * memory,
            "{memory}"
        );
    }
}

#[test]
fn val_ewma_noise_gain() {
    let (n, weight, sigma_um) = (4_000_u32, 0.3, 2.0);
    let mut rng = Pcg64Mcg::seed_from_u64(17);
    let squares: f64 = (0..n)
        .map(|_| {
            let mut table = table(5);
            let mut refresh = refresh(weight, Directions::Together);
            for _ in 0..60 {
                let noise: f64 = StandardNormal.sample(&mut rng);
                pass(
                    &mut refresh,
                    &mut table,
                    true,
                    (sigma_um * noise * 1e9) as i64,
                );
            }
            let end_um = table.point_fm(2, Direction::Up).unwrap() as f64 * 1e-9;
            end_um * end_um
        })
        .sum();
    let expected = weight / (2.0 - weight);
    let gain = squares / f64::from(n) / (sigma_um * sigma_um);
    let chi_square = ChiSquared::new(f64::from(n)).unwrap();
    let statistic = f64::from(n) * gain / expected;
    eprintln!("noise gain {gain:.4}, closed form {expected:.4}");
    assert!(
        statistic > chi_square.inverse_cdf(0.0005) && statistic < chi_square.inverse_cdf(0.9995)
    );
}

#[test]
fn val_ewma_lags_a_drift_by_its_closed_form() {
    let (weight, rate_fm) = (0.3, UM / 5);
    let mut table = table(5);
    let mut refresh = refresh(weight, Directions::Together);
    for k in 1..=100_i32 {
        let slide_fm = rate_fm * i64::from(k);
        pass(&mut refresh, &mut table, true, slide_fm);
        let lag_fm = slide_fm - table.point_fm(2, Direction::Up).unwrap();
        let expected_fm = rate_fm as f64 * (1.0 - weight) / weight * (1.0 - (1.0 - weight).powi(k));
        assert!(
            (lag_fm as f64 - expected_fm).abs() < 4.0,
            "pass {k}: {lag_fm} {expected_fm}"
        );
    }
}
