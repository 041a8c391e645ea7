//! A fleet of 200 machines with 100,000 runs: its trends, the rate of adding, and the questions of the Grafana board.

use std::path::Path;
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
fn trends_of_a_fleet_and_the_questions_of_the_board() {
    let Some(server) = Server::start("trends_of_a_fleet_and_the_questions_of_the_board") else {
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
    let mut diagnosis = entry("machine_7", ADDED, 8_000_000, 1.0);
    let names = ["gap.rms_before", "effect.backlash.width_um"];
    diagnosis.figures = names.map(|name| figure(name, 1.0)).to_vec();
    store.add(&diagnosis).unwrap();
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
    board(&server);
}

/// Each question of the board gives rows.
fn board(server: &Server) {
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../launch_configs/history.grafana.json");
    let text = std::fs::read_to_string(path).unwrap();
    let board: serde_json::Value = serde_json::from_str(&text).unwrap();
    let mut questions = Vec::new();
    for panel in board["panels"].as_array().unwrap() {
        for target in panel["targets"].as_array().unwrap() {
            questions.push(target["rawSql"].as_str().unwrap());
        }
    }
    for variable in board["templating"]["list"].as_array().unwrap() {
        if variable["type"] == "query" {
            questions.push(variable["query"].as_str().unwrap());
        }
    }
    assert!(questions.len() >= 7, "{questions:?}");
    for question in questions {
        // As Grafana fills them in.
        let sql = question
            .replace("$__unixEpochFilter(f.at_s)", "f.at_s BETWEEN 0 AND 9000000")
            .replace("$__unixEpochFilter(e.at_s)", "e.at_s BETWEEN 0 AND 9000000")
            .replace("${machine:sqlstring}", "'machine_7'")
            .replace("${figure:sqlstring}", "'iso230_2.accuracy'");
        assert!(!sql.contains('$'), "{sql}");
        let rows = server.execute("fleet", &sql);
        assert!(!rows.trim().is_empty(), "{sql}");
    }
}
