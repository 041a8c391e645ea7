//! The Grafana board over a history on PostgreSQL: its questions on what `abbe history add` kept, and its form by Grafana's
//! own models. Grafana itself is not run.

use std::path::{Path, PathBuf};
use std::time::Duration;

use abbe_tests::program::{Process, command, root};
use abbe_tests::python::{interpreter, script, succeeded};
use serde_json::{Value, json};

use crate::postgres::Server;

/// First and last second that the board shows, s since 1970: as `now-1y` on 2026-06-01.
const SHOWN_S: [i64; 2] = [1_748_736_000, 1_780_272_000];
/// The time of the table that is kept, s since 1970.
const KEPT_S: &str = "1767600002";

fn board_file() -> PathBuf {
    root().join("launch_configs/history.grafana.json")
}

fn board() -> Value {
    serde_json::from_str(&std::fs::read_to_string(board_file()).unwrap()).unwrap()
}

fn abbe(arguments: &[&str]) -> String {
    let mut program = command(0, arguments);
    program.current_dir(root());
    let ended = Process::start(program).ended_within(Duration::from_secs(120));
    assert_eq!(
        ended.status.code(),
        Some(0),
        "{arguments:?}: {}",
        ended.said
    );
    ended.said
}

/// Keeps a report and a diagnosis of a table.
fn fill(home: &Path, store: &str) {
    let bag = home.join("bag").display().to_string();
    let map = "tests/import/positioning.yaml";
    let machine = "launch_configs/gap_first/machine.yaml";
    abbe(&[
        "import",
        "tests/import/positioning.csv",
        "--map",
        map,
        "--machine",
        machine,
        "-o",
        &bag,
    ]);
    let said = abbe(&["history", "add", &bag, "--diagnose", "--store", store]);
    assert!(said.contains("figures of a diagnosis of vmc_3x"), "{said}");
}

/// A question as Grafana fills it in: its macro, and variables as SQL strings in quotes
/// (grafana.com/docs, "PostgreSQL query editor", "Macros"; "Variable syntax", `sqlstring`).
fn filled(question: &str) -> String {
    let [from, to] = SHOWN_S;
    let mut sql = question
        .replace("${machine:sqlstring}", "'vmc_3x','o''hara'")
        .replace("${figure:sqlstring}", "'iso230_2.accuracy','gap.rms'");
    while let Some((before, rest)) = sql.split_once("$__unixEpochFilter(") {
        let (column, after) = rest.split_once(')').unwrap();
        sql = format!("{before}{column} >= {from} AND {column} <= {to}{after}");
    }
    assert!(!sql.contains('$'), "{sql}");
    sql
}

/// What a question of a time series needs: Grafana takes the time from its column `time`, ascending, and names of lines from
/// `metric`.
fn series_of_rows(server: &Server, sql: &str) {
    let names = format!(
        "SELECT pg_typeof(q.time), pg_typeof(q.metric), pg_typeof(q.value) FROM ({sql}) q LIMIT 1"
    );
    let types = server.execute("fleet", &names);
    assert_eq!(types.trim(), "bigint|text|double precision", "{sql}");
    let times = server.execute("fleet", &format!("SELECT DISTINCT q.time FROM ({sql}) q"));
    assert_eq!(times.trim(), KEPT_S, "{sql}");
    assert!(sql.contains("ORDER BY f.at_s"), "{sql}");
}

#[test]
fn scenario_each_question_of_the_board_has_rows_of_what_was_kept() {
    let name = "scenario_each_question_of_the_board_has_rows_of_what_was_kept";
    let Some(server) = Server::start(name) else {
        return;
    };
    let home = tempfile::tempdir().unwrap();
    let store = server.database("fleet").display().to_string();
    fill(home.path(), &store);
    let board = board();
    let mut n_questions = 0;
    for panel in board["panels"].as_array().unwrap() {
        for target in panel["targets"].as_array().unwrap() {
            let sql = filled(target["rawSql"].as_str().unwrap());
            let rows = server.execute("fleet", &sql);
            assert!(rows.contains("vmc_3x"), "{}: {rows}", panel["title"]);
            if target["format"] == "time_series" {
                series_of_rows(&server, &sql);
            }
            n_questions += 1;
        }
    }
    for (variable, value) in [("machine", "vmc_3x"), ("figure", "iso230_2.accuracy")] {
        let all = board["templating"]["list"].as_array().unwrap();
        let found = all.iter().find(|it| it["name"] == variable).unwrap();
        let rows = server.execute("fleet", &filled(found["query"].as_str().unwrap()));
        assert!(rows.lines().any(|row| row == value), "{variable}: {rows}");
        n_questions += 1;
    }
    assert_eq!(n_questions, 7);
}

#[test]
fn scenario_grafanas_own_models_know_every_key_of_the_board() {
    let name = "scenario_grafanas_own_models_know_every_key_of_the_board";
    let Some(python) = interpreter(name) else {
        return;
    };
    let read = |file: &Path| {
        let output = script(&python, "grafana_board.py").arg(file).output();
        succeeded(&output.unwrap())
    };
    assert_eq!(read(&board_file()), "");
    // A key that nobody knows is found.
    let home = tempfile::tempdir().unwrap();
    let mut wrong = board();
    wrong["panels"][0]["fieldConfig"]["defaults"]["custom"]["drawStil"] = json!("line");
    let file = home.path().join("wrong.json");
    std::fs::write(&file, wrong.to_string()).unwrap();
    let told = read(&file);
    assert_eq!(
        told,
        "/panels[0]/fieldConfig/defaults/custom/drawStil: unknown\n"
    );
}
