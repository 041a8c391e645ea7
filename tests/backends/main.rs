//! What DDS and Zenoh give a cell of three hosts: delay, loss, a cut link, memory and CPU.
//!
//! Without arguments short runs over Zenoh, judged: links that lose, and links that are cut again and again. `cargo test --release --test backends --features abbe/zenoh -- 66`
//! runs both, each with a link that is cut for 66 s, and prints the table of nodes/node_runtime/BACKENDS.md.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]
#![expect(
    clippy::disallowed_methods,
    reason = "tests wait, look at clocks and read files"
)]
#![expect(clippy::print_stderr, reason = "figures that were seen are said")]

use std::process::ExitCode;
use std::time::Duration;

use abbe_tests::python::interpreter;
use abbe_tests::zenoh::built_in;

mod cell;
mod cuts;
mod figures;

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

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let seconds = match words.as_slice() {
        // What cargo hands to every test program: switches, or the names of tests, of which none is here.
        ["--list"] => return ExitCode::SUCCESS,
        [seconds] if seconds.parse::<u64>().is_ok() => seconds.parse().ok(),
        others if others.iter().any(|word| !word.starts_with('-')) => return ExitCode::SUCCESS,
        _ => None,
    };
    let name = "cells over Zenoh on three hosts";
    let Some(python) = interpreter(name).filter(|_| built_in(name)) else {
        return ExitCode::SUCCESS;
    };
    let Some(seconds) = seconds else {
        let Some(seen) = cell::run(Some(&python), SHORT) else {
            return ExitCode::SUCCESS;
        };
        seen.tell("Zenoh");
        let are_over = cuts::are_over_within(RECOVERY_S, &python);
        let is_well = seen.is_well(RECOVERY_S) && are_over == Some(true);
        return ExitCode::from(u8::from(!is_well));
    };
    let times = Times {
        free: Duration::from_secs(10),
        lossy: Duration::from_secs(20),
        cut: Duration::from_secs(seconds),
        after: Duration::from_secs(25),
    };
    for (name, python) in [("DDS", None), ("Zenoh", Some(&python))] {
        if let Some(seen) = cell::run(python, times) {
            seen.tell(name);
        }
    }
    ExitCode::SUCCESS
}
