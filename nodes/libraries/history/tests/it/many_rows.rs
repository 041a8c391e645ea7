//! Reading one series goes by an index, however many others there are.

use history::{Options, SeriesKey, Store, Trend, Window};
use rusqlite::Connection;

use crate::example::entry;

/// Entries of a fleet.
const ENTRIES: i64 = 100_000;
/// Machines of it.
const MACHINES: i64 = 200;

#[test]
fn a_trend_of_one_machine_among_100000_entries_is_read_by_an_index() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("history.sqlite");
    let mut store = Store::open(&path, Options::default()).unwrap();
    store.add(&entry("m", 1, 0, 1.0)).unwrap();
    drop(store);
    let other = Connection::open(&path).unwrap();
    other
        .execute_batch(&format!(
            "BEGIN;
             WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < {MACHINES})
             INSERT INTO series (machine, test, name, axis, unit)
                 SELECT 'machine_' || i, 'Positioning X', 'iso230_2.accuracy', '', 'mm' FROM n;
             WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < {ENTRIES})
             INSERT INTO entry (machine, at_s, kind, sha256, source, instruments, operator, software)
                 SELECT 'machine_' || (1 + i % {MACHINES}), i * 60, 'report', 'made_' || i, 'bag_' || i, '', '', 'v' FROM n;
             INSERT INTO figure (series, at_s, entry, value, standard_uncertainty, status)
                 SELECT s.id, e.at_s, e.id, 0.01 + e.at_s * 1e-9, 0.001, ''
                 FROM entry e JOIN series s ON s.machine = e.machine WHERE e.sha256 LIKE 'made_%';
             COMMIT;"
        ))
        .unwrap();
    // The plan of the question that the store asks: a search of the key, no scan of the table.
    let plan: Vec<String> = other
        .prepare("EXPLAIN QUERY PLAN SELECT f.value, e.source FROM figure f JOIN entry e ON e.id = f.entry WHERE f.series = 5 AND f.at_s BETWEEN 0 AND 9 ORDER BY f.at_s, f.entry")
        .unwrap()
        .query_map([], |row| row.get(3))
        .unwrap()
        .map(Result::unwrap)
        .collect();
    assert!(
        plan.iter().all(|step| step.starts_with("SEARCH")),
        "{plan:?}"
    );
    drop(other);
    let store = Store::open_to_read(&path, Options::default()).unwrap();
    let key = SeriesKey {
        machine: Some("machine_7".to_owned()),
        ..SeriesKey::default()
    };
    let series = store.series(&key).unwrap();
    let kept = store.points(series[0].id, Window::ALL).unwrap();
    assert_eq!(kept.len(), usize::try_from(ENTRIES / MACHINES).unwrap());
    let points: Vec<_> = kept.iter().map(|one| one.point).collect();
    let trend = Trend::of(&points).unwrap();
    assert!((trend.slope_per_s - 1e-9).abs() < 1e-15, "{trend:?}");
    let all = store.last_values(&SeriesKey::default()).unwrap();
    assert_eq!(all.len(), usize::try_from(MACHINES + 1).unwrap());
    assert_eq!(all.iter().map(|last| last.n).sum::<i64>(), ENTRIES + 1);
}
