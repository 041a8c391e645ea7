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

/// One pass upwards of the point at `mm` that measures `deviation_um`.
fn pass_up(refresh: &mut Refresh, table: &mut DeviationTable, mm: f64, deviation_um: f64) {
    refresh.forget();
    for commanded_mm in [mm - 0.01, mm + 0.01] {
        refresh.observe(table, at(commanded_mm, deviation_um), 1e-3);
    }
}

fn up_um(table: &DeviationTable) -> Vec<f64> {
    let points = 0..table.n_points();
    let up = points.map(|point| table.point_fm(point, Direction::Up).unwrap());
    up.map(|fm| fm as f64 / UM as f64).collect()
}

/// A learned table with a shape of its own at its ends.
fn shaped() -> DeviationTable {
    let learned_mm = [-2e-3, 1e-3, 4e-3, 6e-3, 5e-3];
    let x_mm: Vec<_> = (0..5).map(|j| 10.0 * f64::from(j)).collect();
    DeviationTable::new(Axis::X, &x_mm, &learned_mm, &[0.0; 5]).unwrap()
}

/// One pass upwards of each point, after `pause_s` without one.
fn cycle(refresh: &mut Refresh, table: &mut DeviationTable, points: &[(f64, f64)], pause_s: f64) {
    refresh.observe(table, at(-50.0, 0.0), pause_s);
    for (mm, deviation_um) in points {
        pass_up(refresh, table, *mm, *deviation_um);
    }
}

/// Points of [`shaped`] from the second to the fourth, all grown.
fn inner(grown_um: f64) -> [(f64, f64); 3] {
    [(10.0, 1.0), (20.0, 4.0), (30.0, 6.0)].map(|(mm, um)| (mm, um + grown_um))
}

fn following(table: &DeviationTable) -> Refresh {
    let mut refresh = refresh(0.3, Directions::Apart).with_unpassed(Unpassed::Follow);
    refresh.begin(table);
    refresh
}

/// Warming up from the first pass on: all that the outermost point takes is the ends' as well.
#[test]
fn eq5_ends_keep_their_shape_while_the_screw_grows() {
    let mut table = shaped();
    let mut refresh = following(&table);
    for n in 1..=60_i32 {
        // Grows by 2 µm from one cycle to the next, to 24 µm; work goes to and fro between 5 and 35 mm.
        let grown_um = 2.0 * f64::from(n.min(12));
        cycle(&mut refresh, &mut table, &inner(grown_um), 60.0);
        let all_um = up_um(&table);
        let ends_um = [all_um[0] - all_um[1], all_um[4] - all_um[3]];
        assert!((ends_um[0] + 3.0).abs() < 1e-6, "cycle {n}: {all_um:?}");
        assert!((ends_um[1] + 1.0).abs() < 1e-6, "cycle {n}: {all_um:?}");
    }
    for (um, learned_um) in up_um(&table).into_iter().zip([-2.0, 1.0, 4.0, 6.0, 5.0]) {
        assert!((um - learned_um - 24.0).abs() < 1e-3, "{um} {learned_um}");
    }
    // No pass has measured downwards, so the lost motion is as it was learned.
    let down_um = table.point_fm(4, Direction::Down).unwrap() as f64 / UM as f64;
    assert!((down_um - 24.0).abs() < 1e-3, "{down_um}");
}

/// Holes at 10 and 40 mm with fast ways between them: each keeps what is measured there, and the gap is bridged.
#[test]
fn eq6_a_gap_is_bridged_between_the_points_that_are_passed() {
    let mut table = shaped();
    let mut refresh = following(&table);
    for n in 0..200_i32 {
        // The screw grows more towards 40 mm, by 4 and 16 µm in the end; many strokes at 10 mm for each hole at 40 mm.
        let share = f64::from(n.min(100)) / 100.0;
        for _ in 0..20 {
            cycle(&mut refresh, &mut table, &[(10.0, 1.0 + 4.0 * share)], 3.0);
        }
        cycle(&mut refresh, &mut table, &[(40.0, 5.0 + 16.0 * share)], 3.0);
    }
    let all_um = up_um(&table);
    for (um, wanted_um) in all_um.iter().zip([2.0, 5.0, 12.0, 18.0, 21.0]) {
        assert!((um - wanted_um).abs() < 0.1, "{all_um:?}");
    }
}

/// What was passed once, long ago, is no end of the work; what is measured is never left out.
#[test]
fn eq5_a_point_that_was_passed_half_an_hour_ago_follows() {
    let mut table = shaped();
    let mut refresh = following(&table);
    cycle(&mut refresh, &mut table, &inner(0.0), 1.0);
    pass_up(&mut refresh, &mut table, 40.0, 5.0);
    for n in 0..100 {
        cycle(&mut refresh, &mut table, &inner(0.2 * f64::from(n)), 60.0);
    }
    let (behind_um, all_um) = (4.0, up_um(&table));
    let end_um = all_um[4] - all_um[3];
    // Behind by what grew in half an hour, at most.
    assert!(
        (-1.0 - 6.2..=-1.0).contains(&end_um) && end_um < -behind_um,
        "{end_um}"
    );
    pass_up(&mut refresh, &mut table, 40.0, 60.0);
    let own_um = up_um(&table)[4];
    cycle(&mut refresh, &mut table, &inner(19.8), 60.0);
    assert!((up_um(&table)[4] - own_um).abs() < 1e-9);
}

/// 650 kg on 165 N/µm lag by 12 µm while they slow down at 3 m/s² into the point where the axis turns.
#[test]
fn where_the_speed_changes_nothing_is_learned_and_at_one_speed_it_is() {
    let learned = |braked: bool| {
        let mut table = table(5);
        let mut refresh = refresh(0.3, Directions::Apart).with_steadiness(0.05);
        refresh.begin(&table);
        let brake_ticks = if braked { 8 } else { 0 };
        let n_points: u32 = (-200..=4_i32)
            .map(|tick| {
                // 24 mm/s, and to rest at 20 mm within 8 ms.
                let left = f64::from((-tick).max(0));
                let slow = left.min(f64::from(brake_ticks));
                let way_mm = 0.5 * 3e-3 * slow * slow + 24e-3 * (left - slow);
                let beyond_mm = if braked {
                    0.0
                } else {
                    24e-3 * f64::from(tick.max(0))
                };
                let state = at(20.0 - way_mm + beyond_mm, -12.0);
                refresh.observe(&mut table, state, 1e-3).n_points
            })
            .sum();
        (n_points, table.point_fm(2, Direction::Up) != Some(0))
    };
    assert_eq!(learned(true), (0, false));
    assert_eq!(learned(false), (1, true));
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
