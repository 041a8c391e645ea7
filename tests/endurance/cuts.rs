//! A bag that ends anywhere: every command that reads bags says what is lost or why it cannot go on, and none panics.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use abbe_tests::program::{command, root};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// A command may take so long on a busy computer.
const LIMIT: Duration = Duration::from_secs(60);
/// Exit codes that a damaged bag may give: refused with a reason, and done with loss.
const REFUSED: i32 = 1;
const DONE_WITH_LOSS: i32 = 3;

/// Cuts the bag of the tree at random places and has it read; true when every command answered as it should.
pub fn run(cuts: u64, seed: u64) -> bool {
    let bag = root().join("bags/cold_reference");
    let whole = std::fs::read(bag.join("bag_0.mcap")).unwrap();
    let description = std::fs::read(bag.join("metadata.yaml")).unwrap();
    let home = tempfile::tempdir().unwrap();
    let damaged = home.path().join("bag");
    std::fs::create_dir(&damaged).unwrap();
    std::fs::write(damaged.join("metadata.yaml"), description).unwrap();
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut codes: BTreeMap<String, u64> = BTreeMap::new();
    let mut failed = 0;
    for _ in 0..cuts {
        let at = rng.random_range(0..whole.len());
        std::fs::write(damaged.join("bag_0.mcap"), &whole[..at]).unwrap();
        for verb in ["check", "report", "diagnose"] {
            match answer(verb, &damaged, home.path()) {
                Ok(code) => *codes.entry(format!("{verb} {code}")).or_default() += 1,
                Err(reason) => {
                    eprintln!("cut at {at}: abbe {verb}: {reason}");
                    failed += 1;
                }
            }
        }
    }
    eprintln!(
        "cuts: {cuts} of {} bytes: {codes:?}, {failed} failed",
        whole.len()
    );
    failed == 0
}

/// The exit code of a command, when code and words go together.
fn answer(verb: &str, bag: &Path, home: &Path) -> Result<i32, String> {
    let files = ["out", "err"].map(|name| home.join(name));
    let mut reading = arguments(verb, bag, home);
    let [out, err] = files
        .each_ref()
        .map(|path| std::fs::File::create(path).unwrap());
    let began = Instant::now();
    let mut child = reading
        .stdout(Stdio::from(out))
        .stderr(Stdio::from(err))
        .spawn()
        .unwrap();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if began.elapsed() > LIMIT {
            child.kill().unwrap();
            child.wait().unwrap();
            return Err(format!("still running after {LIMIT:?}"));
        }
        std::thread::sleep(Duration::from_millis(2));
    };
    let [_, said] = files.map(|path| std::fs::read_to_string(path).unwrap());
    let code = status.code().ok_or_else(|| format!("{status}: {said}"))?;
    let is_said = match code {
        // With a word of where the file ends.
        DONE_WITH_LOSS => said.contains("bag_0.mcap") && said.contains("byte"),
        REFUSED => said.starts_with("abbe: ") && said.len() > "abbe: \n".len(),
        _ => false,
    };
    let is_calm = !said.contains("panicked") && !said.contains("differs");
    if is_said && is_calm {
        Ok(code)
    } else {
        Err(format!("exit code {code}: {}", said.trim()))
    }
}

fn arguments(verb: &str, bag: &Path, home: &Path) -> Command {
    let mut reading = command(0, &[verb]);
    reading.arg(bag);
    let json: PathBuf = home.join("answer.json");
    if verb == "diagnose" {
        reading.arg("--json").arg(json);
    }
    reading
}
