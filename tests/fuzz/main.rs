//! What takes bytes from outside, on its corpus and on seeded changes of it: no panic, no hang, no allocation without
//! bound. `cargo test --release --test fuzz -- mcap 1000000 [SEED]` runs one target as often as told, `-- all 10000` each;
//! `cargo +nightly fuzz run mcap tests/fuzz/corpus/mcap --fuzz-dir tests/fuzz --features run` lets libFuzzer look for more.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]
#![expect(clippy::expect_used, reason = "a property that does not hold fails")]
#![expect(
    clippy::disallowed_methods,
    reason = "tests look at clocks and read files"
)]
#![expect(clippy::print_stderr, reason = "figures that were seen are said")]

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};

mod import;
mod messages;
mod mutation;
mod targets;

use mutation::Mutator;
use targets::{TARGETS, Target};

/// Each target is run for about this long, and at least so often, when nothing else is said.
const SHORT: Duration = Duration::from_millis(800);
const LEAST: u64 = 300;
/// Between two looks at the time.
const ROUND: u64 = 50;
const FIRST_SEED: u64 = 20_240_229;
/// One execution may take so long on a busy computer.
const LONGEST: Duration = Duration::from_secs(5);
/// One execution may hold so much: the largest chunk of a bag, twice, and room.
const MOST_BYTES: u64 = 640 << 20;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let (name, executions, seed) = match words.as_slice() {
        ["--list"] => return ExitCode::SUCCESS,
        [name, executions, rest @ ..] if executions.parse::<u64>().is_ok() => {
            let seed = rest
                .first()
                .map_or(FIRST_SEED, |seed| seed.parse().unwrap());
            (*name, Some(executions.parse().unwrap()), seed)
        }
        // What cargo hands to every test program: switches, or the names of tests.
        others => {
            let name = others.iter().find(|word| !word.starts_with('-'));
            (name.copied().unwrap_or("all"), None, FIRST_SEED)
        }
    };
    every_message_is_tried();
    let wanted = TARGETS
        .iter()
        .filter(|(known, _)| name == "all" || *known == name);
    let failed = wanted
        .filter(|target| !run(target, executions, seed))
        .count();
    ExitCode::from(u8::from(failed > 0))
}

/// The list of types has all that the interface files have.
fn every_message_is_tried() {
    let tried: Vec<&str> = messages::MESSAGES.iter().map(|(name, _)| *name).collect();
    // What ROS 2 derives from an action or a service is made of these.
    let derived = [
        "_Event",
        "_SendGoal_Request",
        "_SendGoal_Response",
        "_GetResult_Request",
        "_GetResult_Response",
        "_FeedbackMessage",
    ];
    for description in abbe_msgs::DESCRIPTIONS {
        let name = description.type_name;
        let is_derived = derived.iter().any(|ending| name.ends_with(ending));
        assert!(is_derived || tried.contains(&name), "{name} is not tried");
    }
}

fn corpus(name: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus");
    let mut files: Vec<_> = std::fs::read_dir(folder.join(name))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    files.sort();
    files
        .iter()
        .map(|file| std::fs::read(file).unwrap())
        .collect()
}

/// Runs a target on its corpus and on changes of it; true when nothing was found.
fn run((name, target): &Target, executions: Option<u64>, seed: u64) -> bool {
    let seeds = corpus(name);
    assert!(!seeds.is_empty(), "{name} has no corpus");
    let mut mutator = Mutator::new(seed, &seeds);
    let began = Instant::now();
    let mut found = 0;
    let mut executed = 0_u64;
    let mut most_bytes = 0;
    let mut longest = Duration::ZERO;
    let changed = std::iter::from_fn(|| Some(mutator.next()));
    for input in seeds.iter().cloned().chain(changed) {
        let enough = match executions {
            Some(executions) => executed >= executions,
            None => executed >= LEAST && executed.is_multiple_of(ROUND) && began.elapsed() > SHORT,
        };
        if enough {
            break;
        }
        let since = Instant::now();
        let mut passed = true;
        let held = allocation_counter::measure(|| {
            passed = catch_unwind(AssertUnwindSafe(|| target(&input))).is_ok();
        });
        executed += 1;
        (most_bytes, longest) = (most_bytes.max(held.bytes_max), longest.max(since.elapsed()));
        let slow = since.elapsed() > LONGEST;
        let large = held.bytes_max > MOST_BYTES;
        if !passed || slow || large {
            found += 1;
            let (s, mib) = (since.elapsed().as_secs_f64(), held.bytes_max >> 20);
            eprintln!(
                "{name}: execution {executed}: panic {}, {s:.3} s, {mib} MiB: {}",
                !passed,
                input.escape_ascii()
            );
        }
        if found > 20 {
            break;
        }
    }
    eprintln!(
        "{name}: {executed} executions in {:.1} s, {found} found; longest {:.3} s, largest {:.1} MiB",
        began.elapsed().as_secs_f64(),
        longest.as_secs_f64(),
        most_bytes as f64 / f64::from(1 << 20)
    );
    found == 0
}
