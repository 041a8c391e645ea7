//! A fleet of 200 machines with 100,000 runs: its trends, and the rate of adding.

use std::time::Instant;

use history::{Added, Options, SeriesKey, Store, Trend, Window};

use crate::example::{entry, figure};
use crate::server::Server;

/// Entries of the fleet.
const ENTRIES: i64 = 100_000;
/// Machines of it.
const MACHINES: i64 = 200;
/// Entries that are added one by one.
const ADDED: u64 = 500;

/// The fleet, made by the server.
fn fill(server: &Server) {
    let sql = format!(
        "INSERT INTO abbe.series (machine, test, name, axis, unit)
             SELECT 'machine_' || i, 'Positioning X', 'iso230_2.accuracy', '', 'mm' FROM generate_series(1, {MACHINES}) i;
         INSERT INTO abbe.entry (machine, at_s, kind, sha256, source, instruments, operator, software)
             SELECT 'machine_' || (1 + i % {MACHINES}), i * 60, 'report', 'made_' || i, 'bag_' || i, '', '', 'v' FROM generate_series(1, {ENTRIES}) i;
         INSERT INTO abbe.figure (series, at_s, entry, value, standard_uncertainty, status)
             SELECT s.id, e.at_s, e.id, 0.01 + e.at_s * 1e-9, 0.001, ''
             FROM abbe.entry e JOIN abbe.series s ON s.machine = e.machine WHERE e.sha256 LIKE 'made_%';
         ANALYZE"
    );
    server.execute("fleet", &sql);
}

#[test]
fn trends_of_a_fleet_take_half_a_second() {
    let Some(server) = Server::start("trends_of_a_fleet_take_half_a_second") else {
        return;
    };
    let path = server.database("fleet");
    let options = Options {
        busy_ms: 120_000,
        ..Options::default()
    };
    let mut store = Store::open(&path, options).unwrap();
    fill(&server);
    let began = Instant::now();
    for number in 0..ADDED {
        let mut one = entry("m", number, number as i64, 1.0);
        let more = (0..30).map(|i| figure(&format!("figure_{i}"), 1.0));
        one.figures.extend(more);
        assert_eq!(store.add(&one).unwrap(), Added::New);
    }
    let rate = ADDED as f64 / began.elapsed().as_secs_f64();
    println!("added {rate:.0} entries of 31 figures a second, at least 50 wanted");
    drop(store);
    let store = Store::open_to_read(&path, options).unwrap();
    let key = SeriesKey {
        machine: Some("machine_7".to_owned()),
        name: Some("iso230_2.accuracy".to_owned()),
        ..SeriesKey::default()
    };
    let began = Instant::now();
    let series = store.series(&key).unwrap();
    let kept = store.points(series[0].id, Window::ALL).unwrap();
    let points: Vec<_> = kept.iter().map(|one| one.point).collect();
    let trend = Trend::of(&points).unwrap();
    let took_s = began.elapsed().as_secs_f64();
    println!(
        "a trend of {ENTRIES} entries of {MACHINES} machines took {took_s:.3} s, at most 0.5 wanted"
    );
    assert_eq!(points.len(), usize::try_from(ENTRIES / MACHINES).unwrap());
    assert!((trend.slope_per_s - 1e-9).abs() < 1e-15, "{trend:?}");
    let plan = "SET search_path = abbe; EXPLAIN SELECT f.value FROM figure f LEFT JOIN entry e ON e.id = f.entry WHERE f.series = 5 AND f.at_s BETWEEN 0 AND 90000 ORDER BY f.at_s, f.entry";
    let plan = server.execute("fleet", plan);
    assert!(!plan.contains("Seq Scan on figure"), "{plan}");
}
