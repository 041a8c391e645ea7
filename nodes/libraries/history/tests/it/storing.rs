//! What is added comes back, each entry once.

use history::{Added, HistoryError, Kind, Options, SeriesKey, Store, Window};

use crate::example::{entry, figure};

fn store(home: &std::path::Path) -> Store {
    Store::open(&home.join("history.sqlite"), Options::default()).unwrap()
}

#[test]
fn figures_come_back_in_order_of_time() {
    let home = tempfile::tempdir().unwrap();
    let mut store = store(home.path());
    for (number, at_s) in [(1, 300), (2, 100), (3, 200)] {
        let mut one = entry("m", number, at_s, at_s as f64);
        one.figures[0].interval = Some([1.0, 2.0]);
        assert_eq!(store.add(&one).unwrap(), Added::New);
    }
    drop(store);
    let store =
        Store::open_to_read(&home.path().join("history.sqlite"), Options::default()).unwrap();
    let series = store.series(&SeriesKey::default()).unwrap();
    assert_eq!(series.len(), 1);
    let kept = store.points(series[0].id, Window::ALL).unwrap();
    let times: Vec<f64> = kept.iter().map(|one| one.point.at_s).collect();
    assert_eq!(times, [100.0, 200.0, 300.0]);
    assert_eq!(kept[2].source, "bag_1");
    let window = Window {
        since_s: 150,
        until_s: 250,
    };
    assert_eq!(store.points(series[0].id, window).unwrap().len(), 1);
    let machines = store.machines().unwrap();
    assert_eq!(
        (machines[0].entries, machines[0].first_s, machines[0].last_s),
        (3, 100, 300)
    );
    let last = store.last_values(&SeriesKey::default()).unwrap();
    assert_eq!((last.len(), last[0].n), (1, 3));
    assert!((last[0].point.value - 300.0).abs() < 1e-12);
    let tests = store.test_times("m").unwrap();
    assert_eq!(
        tests.iter().map(|(_, at_s)| *at_s).collect::<Vec<_>>(),
        [100, 200, 300]
    );
}

#[test]
fn an_entry_is_added_once_by_kind_and_hash() {
    let home = tempfile::tempdir().unwrap();
    let mut store = store(home.path());
    let one = entry("m", 1, 100, 1.0);
    let mut diagnosis = one.clone();
    diagnosis.kind = Kind::Diagnosis;
    let again = [&one, &one, &diagnosis, &diagnosis].map(|it| store.add(it).unwrap());
    assert_eq!(again, [Added::New, Added::Known, Added::New, Added::Known]);
    assert_eq!(store.machines().unwrap()[0].entries, 2);
}

#[test]
fn an_entry_that_is_there_with_other_figures_is_reported() {
    let home = tempfile::tempdir().unwrap();
    let mut store = store(home.path());
    let one = entry("m", 1, 100, 1.0);
    assert_eq!(store.add(&one).unwrap(), Added::New);
    let (mut value, mut test, mut more) = (one.clone(), one.clone(), one.clone());
    value.figures[0].value += 1e-3;
    test.figures[0].test = "another test".to_owned();
    more.figures.push(figure("iso230_2.repeatability", 1.0));
    for other in [&value, &test, &more] {
        assert_eq!(store.add(other).unwrap(), Added::KnownOtherwise);
    }
    let mut uncertain = one.clone();
    uncertain.figures[0].standard_uncertainty = Some(0.5);
    for same in [&one, &uncertain] {
        assert_eq!(store.add(same).unwrap(), Added::Known);
    }
    assert_eq!(store.machines().unwrap()[0].entries, 1);
}

#[test]
fn an_entry_of_another_machine_or_time_is_named_and_not_added() {
    let home = tempfile::tempdir().unwrap();
    let mut store = store(home.path());
    let day_s = 20_000 * 86_400;
    let stands = Added::Otherwise {
        machine: "m1".to_owned(),
        at_s: day_s + 3_600,
    };
    let mut add = |machine, at_s| store.add(&entry(machine, 1, at_s, 1.0)).unwrap();
    assert_eq!(add("m1", day_s + 3_600), Added::New);
    for (machine, at_s, wanted) in [
        ("m1", day_s + 3_600, &Added::Known),
        // A date alone, of the same day.
        ("m1", day_s, &Added::Known),
        ("m2", day_s + 3_600, &stands),
        ("m1", day_s + 3_601, &stands),
        ("m1", day_s - 86_400, &stands),
        ("m1", day_s + 86_400, &stands),
    ] {
        assert_eq!(&add(machine, at_s), wanted, "{machine} {at_s}");
    }
    assert_eq!(store.machines().unwrap()[0].entries, 1);
}

#[test]
fn series_are_chosen_by_machine_name_axis_and_test() {
    let home = tempfile::tempdir().unwrap();
    let mut store = store(home.path());
    let mut one = entry("m", 1, 100, 1.0);
    for axis in ["X", "Y"] {
        let mut play = figure("effect.backlash.width_um", 6.0);
        axis.clone_into(&mut play.axis);
        play.test = "Diagnosis".to_owned();
        one.figures.push(play);
    }
    one.figures
        .push(figure("effect.backlash_soft.width_um", 6.0));
    store.add(&one).unwrap();
    store.add(&entry("n", 2, 100, 1.0)).unwrap();
    let n = |key: SeriesKey| store.series(&key).unwrap().len();
    let named = |name: &str| SeriesKey {
        name: Some(name.to_owned()),
        ..SeriesKey::default()
    };
    assert_eq!(n(named("effect.backlash")), 2);
    assert_eq!(n(named("effect.backlash.width_um")), 2);
    assert_eq!(n(named("effect")), 3);
    assert_eq!(n(named("iso230_2.accuracy")), 2);
    assert_eq!(n(named("iso230_2.acc%")), 0);
    let of_x = SeriesKey {
        axis: Some("X".to_owned()),
        ..named("effect.backlash")
    };
    assert_eq!(n(of_x), 1);
    let of_test = SeriesKey {
        test: Some("diagnosis".to_owned()),
        machine: Some("m".to_owned()),
        ..SeriesKey::default()
    };
    assert_eq!(n(of_test), 2);
}

#[test]
fn what_is_out_of_bounds_is_refused_and_nothing_of_it_kept() {
    let home = tempfile::tempdir().unwrap();
    let mut store = store(home.path());
    let good = entry("m", 1, 100, 1.0);
    let mut bad = vec![good.clone(); 7];
    bad[0].machine = " ".to_owned();
    bad[1].sha256 = "abc".to_owned();
    bad[2].at_s = -1;
    bad[3].figures[0].value = f64::NAN;
    bad[4].figures.clear();
    bad[5].figures[0].name = "a\nb".to_owned();
    bad[6].source = "x".repeat(5_000);
    for one in &bad {
        let error = store.add(one).unwrap_err();
        let text = error.to_string();
        assert!(!matches!(error, HistoryError::Database { .. }), "{text}");
        assert!(text.contains(": must "), "{text}");
    }
    assert!(store.machines().unwrap().is_empty());
    // A figure that stands there twice fails within the transaction: nothing of the entry stays.
    let mut twice = good;
    twice.figures.push(twice.figures[0].clone());
    assert!(store.add(&twice).is_err());
    assert!(store.machines().unwrap().is_empty());
    assert!(store.series(&SeriesKey::default()).unwrap().is_empty());
}
