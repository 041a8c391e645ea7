//! What takes long: nodes killed at random times, bags cut at random bytes, days of simulated time. Without arguments a short run of each;
//! `cargo test --release --test endurance -- kills 100 [FIRST_SEED [VICTIM,…]]`, `… -- cuts 1000 [SEED]` and `… -- soak 24` run as long as they are told.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]
#![expect(
    clippy::disallowed_methods,
    reason = "tests wait, look at clocks and read files"
)]
#![expect(clippy::print_stderr, reason = "figures that were seen are said")]

use std::process::ExitCode;

mod cell;
mod cuts;
mod kills;
mod recorded;
mod soak;

/// Rounds and first seed of a short run.
const SHORT_KILLS: (u64, u64) = (2, 11);
/// Cuts of a short run, and the seed.
const SHORT_CUTS: (u64, u64) = (20, 1);
/// Simulated hours of a short run.
const SHORT_SOAK_H: f64 = 1.0;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let passed = match words.as_slice() {
        ["kills", rounds] => kills::run(rounds.parse().unwrap(), 1, &[]),
        ["kills", rounds, first] => {
            kills::run(rounds.parse().unwrap(), first.parse().unwrap(), &[])
        }
        ["kills", rounds, first, victims] => {
            let victims: Vec<&str> = victims.split(',').collect();
            kills::run(rounds.parse().unwrap(), first.parse().unwrap(), &victims)
        }
        ["cuts", cuts] => cuts::run(cuts.parse().unwrap(), 1),
        ["cuts", cuts, seed] => cuts::run(cuts.parse().unwrap(), seed.parse().unwrap()),
        ["soak", hours] => soak::run(hours.parse().unwrap()),
        // What cargo hands to every test program: switches, or the names of tests, of which none is here.
        others if others.iter().any(|word| !word.starts_with('-')) => {
            eprintln!("endurance: nothing is called {}", others.join(" "));
            true
        }
        ["--list"] => true,
        _ => {
            let (rounds, first) = SHORT_KILLS;
            let kills = kills::run(rounds, first, &[]);
            let (cuts, seed) = SHORT_CUTS;
            let cuts = cuts::run(cuts, seed);
            soak::run(SHORT_SOAK_H) && cuts && kills
        }
    };
    ExitCode::from(u8::from(!passed))
}
