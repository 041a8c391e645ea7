//! What DDS and Zenoh give a cell of three hosts: delay, loss, a cut link, memory and CPU.
//!
//! Without arguments short runs over Zenoh, judged: links that lose, links that are cut again and again, and computers whose
//! clocks differ, and a secured cell with a stranger; `-- cell`, `-- cuts`, `-- clocks` and `-- secured` run one of them.
//! `cargo test --release --test backends --features abbe/zenoh -- 66` runs a cell over both, each with a link that is cut for
//! 66 s, and prints the table of nodes/libraries/node_runtime/BACKENDS.md.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]
#![expect(
    clippy::disallowed_methods,
    reason = "tests wait, look at clocks and read files"
)]
#![expect(clippy::print_stderr, reason = "figures that were seen are said")]

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use abbe_tests::python::interpreter;
use abbe_tests::zenoh::built_in;

mod cell;
mod clocks;
mod cuts;
mod figures;
mod secured;

use cell::Times;

/// What every computer with two cores can do: the link is cut for longer than the routers' lease (4 s).
const SHORT: Times = Times {
    free: Duration::from_secs(4),
    lossy: Duration::from_secs(6),
    cut: Duration::from_secs(8),
    after: Duration::from_secs(12),
};

/// What is wanted from a link's return to samples that are fresh, s.
const RECOVERY_S: f64 = 3.0;

/// The short runs, each of which can be asked for alone.
const RUNS: [&str; 4] = ["cell", "cuts", "clocks", "secured"];

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let wanted = match words.as_slice() {
        // What cargo hands to every test program: switches, or the names of tests.
        ["--list"] => return ExitCode::SUCCESS,
        [seconds] if seconds.parse::<u64>().is_ok() => vec![],
        [run] if RUNS.contains(run) => vec![*run],
        others if others.iter().any(|word| !word.starts_with('-')) => return ExitCode::SUCCESS,
        _ => RUNS.to_vec(),
    };
    let name = "cells over Zenoh on three hosts";
    let Some(python) = interpreter(name).filter(|_| built_in(name)) else {
        return ExitCode::SUCCESS;
    };
    if wanted.is_empty() {
        compare(words[0].parse().unwrap(), &python);
        return ExitCode::SUCCESS;
    }
    // Each runs, whatever became of those before.
    let runs = wanted.into_iter().map(|run| is_as_wanted(run, &python));
    let seen: Vec<bool> = runs.collect();
    ExitCode::from(u8::from(seen.contains(&false)))
}

/// Whether a short run was as wanted, or cannot be had on this computer, which is said.
fn is_as_wanted(run: &str, python: &PathBuf) -> bool {
    let seen = match run {
        "cell" => cell::run(Some(python), SHORT).map(|seen| {
            seen.tell("Zenoh");
            seen.is_well(RECOVERY_S)
        }),
        "cuts" => cuts::are_over_within(RECOVERY_S, python),
        "secured" => secured::keeps_strangers_out(python),
        _ => clocks::are_no_matter(RECOVERY_S, python),
    };
    seen.unwrap_or(true)
}

/// Prints a column of the table for each middleware, with a link that is cut for so many seconds.
fn compare(seconds: u64, python: &PathBuf) {
    let times = Times {
        free: Duration::from_secs(10),
        lossy: Duration::from_secs(20),
        cut: Duration::from_secs(seconds),
        after: Duration::from_secs(25),
    };
    for (name, python) in [("DDS", None), ("Zenoh", Some(python))] {
        if let Some(seen) = cell::run(python, times) {
            seen.tell(name);
        }
    }
}
