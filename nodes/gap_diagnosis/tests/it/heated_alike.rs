//! Logs of rooms that swing, of two mornings, and of bodies that are heated alike. What they hold is in closed form: exponentials as
//! in `logs`, and of a swing what follows it with the lag tau,
//!
//! ```text
//!   k(t) = A sin(w t),   y(t) = A (sin(w t) - w tau cos(w t)) / (1 + w^2 tau^2)
//! ```

use std::f64::consts::TAU;

use gap_diagnosis::Diagnosis;
use gap_diagnosis::report::Cause;

use super::logs::{FRONT, Log, lagged_k, machine, named, warm_k};

const COLUMN: &str = "\n  - {id: column, place: column, period_s: 10.0}";
const NUT: &str = "\n  - {id: nut_z, place: nut_z, period_s: 10.0}";

fn swing_k(size_k: f64, period_s: f64, lag_s: f64, time_s: f64) -> f64 {
    let along = TAU / period_s * time_s;
    let slow = TAU / period_s * lag_s;
    size_k * (along.sin() - slow * along.cos()) / (1.0 + slow * slow)
}

fn names(diagnosis: &Diagnosis) -> Vec<(&str, &str)> {
    let all = named(diagnosis).into_iter();
    all.map(|cause| (cause.effect.as_str(), cause.axis.as_str()))
        .collect()
}

fn lists(cause: &Cause, effect: &str, axis: &str) -> bool {
    let mut rivals = cause.confusable_with.iter();
    rivals.any(|rival| rival.effect == effect && rival.axis == axis)
}

/// A day beside an air conditioner that goes on and off: its swings are no noise where the air is read.
#[test]
fn swings_of_a_room_are_no_noise_of_a_day_at_rest() {
    let machine = machine("");
    let mut log = Log::new(&machine, 91);
    log.segment(1, true, 0.0);
    for row in 0..=240 {
        let at_s = 360.0 * f64::from(row);
        let air_k =
            |lag_s| swing_k(0.35, 2700.0, lag_s, at_s) + swing_k(0.6, 86_400.0, lag_s, at_s);
        let um = -6.0 * air_k(240.0) + log.normal(0.08);
        let degc = 21.0 + air_k(0.0) + log.normal(0.02);
        log.row(at_s, um, &[("ambient", degc)]);
    }
    log.segment(1, false, 86_400.0);
    let diagnosis = log.diagnosed(&machine);
    let floor = &diagnosis.report.noise_floor[0];
    assert!(floor.sigma_um < 0.3, "{floor:?}");
    let names = names(&diagnosis);
    let is_of_air = |(effect, axis): &(&str, &str)| match *effect {
        "thermal_shift" => *axis == "ambient",
        other => other == "column_bend" || other == "ambient_drift",
    };
    assert!(
        !names.is_empty() && names.iter().all(is_of_air),
        "{names:?}"
    );
}

/// A Z that goes with its nut by 0.5 µm/K, logged on two mornings of other heats.
#[test]
fn two_mornings_show_which_thermometer_a_log_goes_with() {
    let machine = machine(NUT);
    let mut log = Log::new(&machine, 92);
    for (run, rise_k) in [(1, 9.0), (2, 5.0)] {
        let begin_s = 86_400.0 * f64::from(run - 1);
        log.segment(run, true, begin_s);
        for minute in 0..150 {
            let since_s = 60.0 * f64::from(minute);
            let um = 0.5 * lagged_k(rise_k, 2400.0, 900.0, since_s) + log.normal(0.08);
            let nut = 20.0 + warm_k(rise_k, 2400.0, since_s) + log.normal(0.02);
            let air = 20.0 + swing_k(0.2, 5000.0, 0.0, since_s) + log.normal(0.02);
            log.row(begin_s + since_s, um, &[("nut_z", nut), ("ambient", air)]);
        }
        log.segment(run, false, begin_s + 8940.0);
    }
    let diagnosis = log.diagnosed(&machine);
    assert_eq!(names(&diagnosis), [("thermal_shift", "nut_z")]);
}

/// A nut that is heated by the spindle beside it, behind which it lags by 5 min: a growth goes with either.
#[test]
fn a_thermometer_that_is_heated_alike_is_listed_with_the_one_that_is_named() {
    let machine = machine(&[FRONT, NUT].concat());
    let mut log = Log::new(&machine, 93);
    for (run, rise_k) in [(1, 8.0), (2, 5.0), (3, 11.0), (4, 6.5)] {
        let begin_s = 86_400.0 * f64::from(run - 1);
        log.segment(run, true, begin_s);
        for minute in 0..120 {
            let since_s = 60.0 * f64::from(minute);
            let um = -0.8 * lagged_k(rise_k, 1800.0, 1500.0, since_s) + log.normal(0.15);
            let front = 20.0 + warm_k(rise_k, 1800.0, since_s) + log.normal(0.02);
            let nut = 20.0 + 0.6 * lagged_k(rise_k, 1800.0, 300.0, since_s) + log.normal(0.02);
            log.row(
                begin_s + since_s,
                um,
                &[("spindle_front", front), ("nut_z", nut)],
            );
        }
        log.segment(run, false, begin_s + 7140.0);
    }
    let diagnosis = log.diagnosed(&machine);
    let all = named(&diagnosis);
    let [cause] = all[..] else {
        panic!("{:#?}", diagnosis.report.causes);
    };
    let is_of_spindle = cause.effect == "spindle_growth";
    let other = if is_of_spindle {
        ("thermal_shift", "nut_z")
    } else {
        ("spindle_growth", "")
    };
    assert!(lists(cause, other.0, other.1), "{cause:#?}");
}

/// A column that warms on four mornings beside air that stays as it is: the air explains nothing, and the column is found all the same.
#[test]
fn a_column_beside_steady_air_is_found_by_its_thermometer() {
    let machine = machine(COLUMN);
    let mut log = Log::new(&machine, 94);
    for (run, rise_k) in [(1, 4.0), (2, 2.5), (3, 6.0), (4, 3.0)] {
        let begin_s = 86_400.0 * f64::from(run - 1);
        log.segment(run, true, begin_s);
        for minute in 0..120 {
            let since_s = 60.0 * f64::from(minute);
            let um = -3.0 * lagged_k(rise_k, 2400.0, 900.0, since_s) + log.normal(0.15);
            let column = 20.0 + warm_k(rise_k, 2400.0, since_s) + log.normal(0.02);
            let air = 20.0 + log.normal(0.02);
            log.row(
                begin_s + since_s,
                um,
                &[("column", column), ("ambient", air)],
            );
        }
        log.segment(run, false, begin_s + 7140.0);
    }
    let diagnosis = log.diagnosed(&machine);
    let names = names(&diagnosis);
    let is_of_column = |(effect, axis): &(&str, &str)| {
        *effect == "column_bend" || (*effect, *axis) == ("thermal_shift", "column")
    };
    assert!(names.iter().any(is_of_column), "{names:?}");
}

/// A spindle that warms unread beside air that is read: by its course in time alone it may be a drift.
#[test]
fn a_growth_without_a_thermometer_at_the_spindle_is_listed_with_the_drift() {
    let machine = machine("");
    let mut log = Log::new(&machine, 95);
    log.segment(1, true, 0.0);
    for minute in 0..=180 {
        let at_s = 60.0 * f64::from(minute);
        let um = -2.0 * lagged_k(8.0, 2400.0, 1200.0, at_s) + log.normal(0.1);
        let air = 20.0 + swing_k(0.2, 5000.0, 0.0, at_s) + log.normal(0.02);
        log.row(at_s, um, &[("ambient", air)]);
    }
    log.segment(1, false, 10_800.0);
    let diagnosis = log.diagnosed(&machine);
    for cause in named(&diagnosis) {
        let is_growth = cause.effect == "spindle_growth";
        assert!(
            !is_growth || lists(cause, "ambient_drift", "Z"),
            "{cause:#?}"
        );
    }
}

/// A Z that goes with its nut, warmed once, of which nobody reads the spindle: readings of the nut are rounded to `step_k`.
fn warmed_once(minutes: u32, lag_s: f64, (step_k, noise_um): (f64, f64)) -> Diagnosis {
    let machine = machine(NUT);
    let mut log = Log::new(&machine, 96);
    log.segment(1, true, 0.0);
    for minute in 0..minutes {
        let at_s = 60.0 * f64::from(minute);
        let um = 2.0 * lagged_k(8.0, 1800.0, lag_s, at_s) + log.normal(noise_um);
        let nut = 20.0 + warm_k(8.0, 1800.0, at_s) + log.normal(0.02);
        log.row(at_s, um, &[("nut_z", (nut / step_k).round() * step_k)]);
    }
    log.segment(1, false, 60.0 * f64::from(minutes - 1));
    log.diagnosed(&machine)
}

/// A growth by time alone fits a warm-up as well, and is no reason to keep silent about the thermometer that explains it.
#[test]
fn a_log_that_goes_with_its_nut_has_the_nut_among_its_causes() {
    for (minutes, lag_s, read) in [
        (40, 1.0, (0.01, 0.1)),
        (60, 1.0, (0.01, 0.1)),
        (66, 1.0, (0.01, 0.1)),
        (79, 600.0, (0.01, 0.1)),
        (180, 1.0, (0.5, 0.2)),
        (180, 1200.0, (0.5, 0.2)),
    ] {
        let diagnosis = warmed_once(minutes, lag_s, read);
        let causes = named(&diagnosis);
        let is_of_nut = |cause: &&Cause| {
            (cause.effect.as_str(), cause.axis.as_str()) == ("thermal_shift", "nut_z")
                || lists(cause, "thermal_shift", "nut_z")
        };
        let causes_of_nut = causes.iter().filter(|cause| is_of_nut(cause)).count();
        assert_eq!(
            (causes_of_nut, causes.len()),
            (1, 1),
            "{minutes} {lag_s} {read:?}: {:#?}",
            diagnosis.report.causes
        );
    }
    // Steps of the readings are too much of what is left here to name anything: what is shown is of the nut all the same.
    let diagnosis = warmed_once(480, 1.0, (0.5, 0.2));
    let shown: Vec<&str> = { diagnosis.report.causes.iter() }
        .map(|cause| cause.effect.as_str())
        .collect();
    assert!(shown.contains(&"thermal_shift"), "{shown:?}");
}
