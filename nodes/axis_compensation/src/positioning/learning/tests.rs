use metrology::Stamp;
use metrology::sample::TestKind;

use super::*;

const MM: i64 = 1_000_000_000_000;
const UM: i64 = 1_000_000_000;
/// Five points, 16 mm apart.
const POINTS_MM: [f64; 5] = [-32.0, -16.0, 0.0, 16.0, 32.0];

fn segment(repeat: u32, completed: bool) -> TestSegment {
    TestSegment {
        begin: false,
        feed_mm_s: 10.0,
        repeat,
        zero_id: 1,
        setup_id: 1,
        completed,
        ..TestSegment::of_kind(TestKind::Positioning, 100 + repeat, Stamp::from_nanos(0))
    }
}

fn learning(directions: Directions) -> Learning {
    let lesson = Lesson {
        axis: Axis::X,
        directions,
        runs: 10,
        most_points: 20,
    };
    Learning::new(lesson, Dwells::new(100_000_000, 0.2, 0.5))
}

/// Stands at a place for 0.8 s, having come there in `direction`.
fn dwell(learning: &mut Learning, position_mm: f64, direction: Direction, deviation_um: f64) {
    let position_fm = (position_mm * 1e12).round() as i64;
    for _ in 0..801 {
        learning.observe(position_fm, Some(direction), deviation_um * 1e-3, 1e-3);
    }
}

/// There and back with overrun: each point from both sides.
fn run(learning: &mut Learning, points_mm: &[f64], deviation_um: impl Fn(f64, Direction) -> f64) {
    let up = points_mm.iter().map(|x_mm| (*x_mm, Direction::Up));
    let down = points_mm.iter().rev().map(|x_mm| (*x_mm, Direction::Down));
    for (x_mm, direction) in up.chain(down) {
        let before_mm = x_mm
            - if direction == Direction::Up {
                5.0
            } else {
                -5.0
            };
        learning.observe((before_mm * 1e12) as i64, Some(direction), 99.0, 1e-3);
        dwell(learning, x_mm, direction, deviation_um(x_mm, direction));
    }
    learning.observe(-40 * MM, Some(Direction::Down), 99.0, 1e-3);
}

/// 10 µm/m, and lost motion of 4 µm.
fn slide(x_mm: f64, direction: Direction) -> f64 {
    0.01 * x_mm
        + if direction == Direction::Up {
            -2.0
        } else {
            2.0
        }
}

fn runs(
    learning: &mut Learning,
    n: u32,
    points_mm: &[f64],
) -> Result<Progress, PositioningRefusal> {
    let mut last = Ok(Progress::Collected { runs: 0 });
    for repeat in 0..n {
        learning.begin(&segment(repeat, true));
        run(learning, points_mm, |x_mm, direction| {
            slide(x_mm, direction) + 0.1 * f64::from(repeat)
        });
        last = learning.end(&segment(repeat, true));
    }
    last
}

fn learned(outcome: Result<Progress, PositioningRefusal>) -> (DeviationTable, u32) {
    match outcome {
        Ok(Progress::Learned { table, runs }) => (table, runs),
        other => panic!("{other:?}"),
    }
}

fn near(found_fm: Option<i64>, expected_um: f64) {
    let found_um = found_fm.unwrap() as f64 / UM as f64;
    assert!(
        (found_um - expected_um).abs() < 1e-6,
        "{found_um} {expected_um}"
    );
}

#[test]
fn eq1_ten_runs_give_the_mean_of_each_direction() {
    let mut learning = learning(Directions::Apart);
    let (table, n) = learned(runs(&mut learning, 10, &POINTS_MM));
    assert_eq!((n, table.n_points()), (10, 5));
    // Runs rise by 0.1 µm each: their mean is 0.45 µm above the first.
    near(table.point_fm(0, Direction::Up), -0.32 - 2.0 + 0.45);
    near(table.point_fm(4, Direction::Down), 0.32 + 2.0 + 0.45);
}

#[test]
fn eq2_together_lost_motion_averages_away() {
    let mut learning = learning(Directions::Together);
    let (table, _) = learned(runs(&mut learning, 10, &POINTS_MM));
    for direction in [Direction::Up, Direction::Down] {
        near(table.point_fm(1, direction), -0.16 + 0.45);
    }
}

#[test]
fn all_runs_may_be_in_one_segment() {
    let mut learning = learning(Directions::Apart);
    learning.begin(&segment(0, true));
    for _ in 0..12 {
        run(&mut learning, &POINTS_MM, slide);
    }
    let (_, n) = learned(learning.end(&segment(0, true)));
    assert_eq!(n, 12);
}

#[test]
fn one_way_runs_without_return_make_a_table_of_both_together() {
    let mut learning = learning(Directions::Together);
    learning.begin(&segment(0, true));
    for _ in 0..10 {
        for x_mm in POINTS_MM {
            dwell(
                &mut learning,
                x_mm,
                Direction::Up,
                slide(x_mm, Direction::Up),
            );
        }
        learning.observe(-40 * MM, Some(Direction::Down), 0.0, 1e-3);
    }
    let (table, n) = learned(learning.end(&segment(0, true)));
    assert_eq!(n, 10);
    near(table.point_fm(2, Direction::Down), -2.0);
}

#[test]
fn too_few_and_too_many_runs_make_no_table() {
    let mut learning = learning(Directions::Apart);
    assert_eq!(
        runs(&mut learning, 9, &POINTS_MM),
        Ok(Progress::Collected { runs: 9 })
    );
    learning.begin(&segment(0, true));
    for _ in 0..21 {
        run(&mut learning, &POINTS_MM, slide);
    }
    assert_eq!(
        learning.end(&segment(0, true)).unwrap_err().to_string(),
        "axis X: 21 runs, must be from 10 to 20"
    );
}

#[test]
fn distances_and_numbers_of_points_outside_their_limits_are_refused() {
    for (points_mm, told) in [
        (
            &[0.0, 9.0, 18.0, 27.0, 36.0][..],
            "9 mm after the one before",
        ),
        (
            &[0.0, 21.0, 42.0, 63.0, 84.0][..],
            "21 mm after the one before",
        ),
        (&[0.0, 10.0, 20.0, 30.0][..], "4 points, at least 5"),
    ] {
        let refused = runs(&mut learning(Directions::Apart), 10, points_mm).unwrap_err();
        assert!(refused.to_string().contains(told), "{refused}");
    }
    let many: Vec<_> = (0..25).map(|j| 10.0 * f64::from(j)).collect();
    let refused = runs(&mut learning(Directions::Apart), 1, &many).unwrap_err();
    assert_eq!(
        refused,
        PositioningRefusal::TooManyPoints {
            axis: Axis::X,
            most: 20
        }
    );
}

#[test]
fn a_run_that_misses_a_point_or_was_broken_off_is_left_out() {
    let mut learning = learning(Directions::Apart);
    runs(&mut learning, 9, &POINTS_MM).unwrap();
    learning.begin(&segment(9, true));
    run(&mut learning, &POINTS_MM, slide);
    assert_eq!(
        learning.end(&segment(9, false)),
        Err(PositioningRefusal::RunBrokenOff {
            axis: Axis::X,
            run: 109
        })
    );
    learning.begin(&segment(9, true));
    run(&mut learning, &POINTS_MM, slide);
    dwell(&mut learning, 16.0, Direction::Up, 0.0);
    let refused = learning.end(&segment(9, true)).unwrap_err();
    assert_eq!(
        refused.to_string(),
        "axis X: 1 dwells at -32 mm going up, 2 elsewhere in the run"
    );
    learning.begin(&segment(9, true));
    run(&mut learning, &[-32.0, -16.0, 1.0, 16.0, 32.0], slide);
    let refused = learning.end(&segment(9, true)).unwrap_err();
    assert!(
        refused.to_string().contains("1 mm is a point of one run"),
        "{refused}"
    );
    // The nine before are still there.
    learning.begin(&segment(9, true));
    run(&mut learning, &POINTS_MM, slide);
    learned(learning.end(&segment(9, true)));
}

#[test]
fn a_scale_that_says_nothing_and_a_direction_that_misses_are_refused_by_name() {
    let mut learning = learning(Directions::Apart);
    learning.begin(&segment(0, true));
    run(&mut learning, &POINTS_MM, |x_mm, _| {
        if x_mm > 10.0 { f64::NAN } else { 0.0 }
    });
    assert_eq!(
        learning.end(&segment(0, true)).unwrap_err().to_string(),
        "axis X: no scale reading at 16 mm"
    );
    learning.begin(&segment(0, true));
    for _ in 0..10 {
        for x_mm in POINTS_MM {
            dwell(&mut learning, x_mm, Direction::Up, 0.0);
        }
    }
    assert_eq!(
        learning.end(&segment(0, true)).unwrap_err().to_string(),
        "axis X: no run goes down, which tables apart need"
    );
}

#[test]
fn another_setup_begins_anew() {
    let mut learning = learning(Directions::Apart);
    runs(&mut learning, 9, &POINTS_MM).unwrap();
    let other = TestSegment {
        setup_id: 2,
        ..segment(9, true)
    };
    learning.begin(&other);
    run(&mut learning, &POINTS_MM, slide);
    assert_eq!(learning.end(&other), Ok(Progress::Collected { runs: 1 }));
}

#[test]
fn learning_states_allocates_nothing() {
    let mut learning = learning(Directions::Apart);
    learning.begin(&segment(0, true));
    let measured = allocation_counter::measure(|| run(&mut learning, &POINTS_MM, slide));
    assert_eq!(measured.count_total, 0);
    assert_eq!(learning.n_points(), 5);
}

#[test]
fn where_the_axis_stood_before_a_test_is_no_point_of_it() {
    let mut learning = learning(Directions::Together);
    let mut last = Ok(Progress::Collected { runs: 0 });
    for repeat in 0..10 {
        learning.begin(&segment(repeat, true));
        // It still stands where the last program left it, with the direction of its last motion.
        dwell(&mut learning, -47.0, Direction::Down, 77.0);
        run(&mut learning, &POINTS_MM, slide);
        last = learning.end(&segment(repeat, true));
    }
    let (table, runs) = learned(last);
    assert_eq!(runs, 10);
    assert_eq!(table.n_points(), POINTS_MM.len());
}

#[test]
fn an_overrun_where_the_axis_stood_before_and_after_a_test_is_no_point_of_it() {
    for directions in [Directions::Together, Directions::Apart] {
        let mut learning = learning(directions);
        let mut last = Ok(Progress::Collected { runs: 0 });
        for repeat in 0..10 {
            learning.begin(&segment(repeat, true));
            // The last program left it among the points; then it rests at the overrun, and again at the end.
            if repeat == 0 {
                dwell(&mut learning, -21.0, Direction::Down, 55.0);
            }
            dwell(&mut learning, -37.0, Direction::Down, 77.0);
            run(&mut learning, &POINTS_MM, slide);
            dwell(&mut learning, -37.0, Direction::Down, 77.0);
            last = learning.end(&segment(repeat, true));
        }
        let (table, runs) = learned(last);
        assert_eq!((runs, table.n_points()), (10, POINTS_MM.len()));
    }
}
