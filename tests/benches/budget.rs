//! The budget of the suite, each figure beside its peer in the same run; see README.md here.
//!
//! ```text
//! cargo bench -p abbe_tests --bench budget [-- [identification|round_trip|pose|recorder|control|hour|cell]... [--seconds N] [--program ABBE]]
//! ```
#![expect(
    clippy::disallowed_methods,
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "a bench reads clocks, starts programs, prints its figures and fails by panicking"
)]

use std::path::PathBuf;
use std::process::Command;

mod hour;
mod identification;
mod pose;
mod python;
mod round_trip;

const PARTS: [&str; 7] = [
    "identification",
    "round_trip",
    "pose",
    "recorder",
    "control",
    "hour",
    "cell",
];
const USAGE: &str = "budget [identification|round_trip|pose|recorder|control|hour|cell]... [--seconds N] [--program ABBE]";

struct Wanted {
    parts: Vec<String>,
    seconds: u32,
    program: Option<PathBuf>,
}

fn wanted() -> Wanted {
    let (mut parts, mut seconds, mut program) = (Vec::new(), 60, None);
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            // What cargo itself adds.
            "--bench" => {}
            "--seconds" => {
                let value = arguments.next().and_then(|text| text.parse().ok());
                seconds = value.filter(|seconds| *seconds > 0).expect(USAGE);
            }
            "--program" => program = Some(arguments.next().expect(USAGE).into()),
            part if PARTS.contains(&part) => parts.push(argument),
            other => panic!("{other}: {USAGE}"),
        }
    }
    if parts.is_empty() {
        parts = PARTS.map(str::to_owned).to_vec();
    }
    Wanted {
        parts,
        seconds,
        program,
    }
}

/// Runs another crate's bench, whose figures go straight to the console.
fn bench_of(package: &str, bench: &str) {
    let status = Command::new(env!("CARGO"))
        .args(["bench", "--quiet", "-p", package, "--bench", bench])
        .status()
        .unwrap();
    assert!(status.success(), "cargo bench -p {package}: {status}");
}

fn main() {
    let wanted = wanted();
    for part in &wanted.parts {
        println!("\n== {part}");
        match part.as_str() {
            "round_trip" => round_trip::run(wanted.seconds, wanted.program.clone()),
            "identification" => identification::run(),
            "pose" => pose::run(),
            "hour" | "cell" => {
                let program = wanted.program.clone();
                let measure = if part == "cell" {
                    hour::cell
                } else {
                    hour::check
                };
                measure(&program.unwrap_or_else(round_trip::built_program));
            }
            "recorder" => bench_of("recorder", "bag"),
            _ => bench_of("fake_cnc", "servo_period"),
        }
    }
}
