//! Two programs that write at once: nothing is lost, nothing is there twice.

use std::path::PathBuf;
use std::thread;

use history::{Added, Options, SeriesKey, Store, Window};

use crate::example::entry;

const EACH: u64 = 40;

/// Adds entries of these numbers, each by a store of its own; how many were new.
fn writer(path: PathBuf, numbers: std::ops::Range<u64>) -> usize {
    let patient = Options {
        busy_ms: 120_000,
        ..Options::default()
    };
    let add = |number: u64| {
        let mut store = Store::open(&path, patient).unwrap();
        let at_s = 100 + i64::try_from(number).unwrap();
        store.add(&entry("m", number, at_s, 1.0)).unwrap() == Added::New
    };
    numbers.filter(|number| add(*number)).count()
}

#[test]
fn what_two_writers_add_is_there_once() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("history.sqlite");
    // The second half of the first writer's is the first half of the second's; both make the file.
    let first = thread::spawn({
        let path = path.clone();
        move || writer(path, 0..EACH)
    });
    let second = thread::spawn({
        let path = path.clone();
        move || writer(path, EACH / 2..EACH + EACH / 2)
    });
    let n_new = first.join().unwrap() + second.join().unwrap();
    let expected = usize::try_from(EACH + EACH / 2).unwrap();
    assert_eq!(n_new, expected);
    let store = Store::open_to_read(&path, Options::default()).unwrap();
    let series = store.series(&SeriesKey::default()).unwrap();
    assert_eq!(series.len(), 1);
    let kept = store.points(series[0].id, Window::ALL).unwrap();
    assert_eq!(kept.len(), expected);
}
