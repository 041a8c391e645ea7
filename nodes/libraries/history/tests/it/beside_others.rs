//! Machines of a fleet, changes between dates, tests that are due; by hand.

use history::{Verdict, difference, due, fleet, latest_until};

use crate::example::{DAY_S, points};

fn named(values: &[f64]) -> Vec<(String, f64)> {
    let all = values.iter().enumerate();
    all.map(|(i, value)| (format!("m{i}"), *value)).collect()
}

#[test]
fn eq1_of_a_fleet_by_hand() {
    // Median 10, absolute deviations 2, 1, 0, 1, 40: their median is 1.
    let found = fleet(&named(&[8.0, 9.0, 10.0, 11.0, 50.0]));
    assert_eq!(found.median, Some(10.0));
    let scores: Vec<f64> = found
        .machines
        .iter()
        .map(|one| one.score.unwrap())
        .collect();
    for (score, expected) in scores.iter().zip([-1.349, -0.6745, 0.0, 0.6745, 26.98]) {
        assert!((score - expected).abs() < 1e-9, "{scores:?}");
    }
    let outliers: Vec<&str> = found
        .machines
        .iter()
        .filter(|one| one.is_outlier)
        .map(|one| one.machine.as_str())
        .collect();
    assert_eq!(outliers, ["m4"]);
}

#[test]
fn few_machines_or_equal_ones_have_no_outlier() {
    for values in [vec![1.0, 1.0, 1.0, 90.0], vec![2.0; 7], vec![]] {
        let found = fleet(&named(&values));
        assert!(
            found
                .machines
                .iter()
                .all(|one| !one.is_outlier && one.score.is_none()),
            "{values:?}"
        );
    }
}

#[test]
fn one_machine_beside_equal_ones_is_an_outlier() {
    let found = fleet(&named(&[1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 5.0]));
    // Mean absolute deviation 0.5.
    let score = found.machines[7].score.unwrap();
    assert!((score - 4.0 / (0.5 * 1.253_314)).abs() < 1e-9, "{score}");
    assert!(found.machines[7].is_outlier && !found.machines[0].is_outlier);
}

#[test]
fn a_difference_is_a_change_beyond_its_expanded_uncertainty() {
    let all = points(&[0.0, 100.0], &[4.0, 5.1], &[0.3, 0.4]);
    // U = 2 √(0.09 + 0.16) = 1.
    let found = difference(all[0], all[1]);
    assert!((found.expanded_uncertainty.unwrap() - 1.0).abs() < 1e-12);
    assert_eq!(found.verdict, Verdict::Changed);
    let mut nearer = all[1];
    nearer.value = 4.9;
    assert_eq!(
        difference(all[0], nearer).verdict,
        Verdict::WithinUncertainty
    );
    nearer.standard_uncertainty = None;
    assert_eq!(difference(all[0], nearer).verdict, Verdict::NotDecided);
}

#[test]
fn the_value_of_a_date_is_the_last_one_up_to_it() {
    let all = points(&[10.0, 20.0, 30.0], &[1.0, 2.0, 3.0], &[]);
    let at = |day: f64| latest_until(&all, day * DAY_S).map(|point| point.value);
    assert_eq!(
        [at(9.0), at(10.0), at(29.0), at(99.0)],
        [None, Some(1.0), Some(2.0), Some(3.0)]
    );
}

#[test]
fn a_test_is_due_after_the_given_or_its_own_usual_interval() {
    let times = [0.0, 90.0, 190.0, 280.0].map(|day| day * DAY_S);
    // Intervals of 90, 100 and 90 days.
    let own = due(&times, None).unwrap();
    assert_eq!(own.due_s, Some(370.0 * DAY_S));
    let given = due(&times, Some(30.0 * DAY_S)).unwrap();
    assert_eq!(given.due_s, Some(310.0 * DAY_S));
    let once = due(&times[..2], None).unwrap();
    assert_eq!((once.last_s, once.due_s), (90.0 * DAY_S, None));
    assert!(due(&[], None).is_none());
}
