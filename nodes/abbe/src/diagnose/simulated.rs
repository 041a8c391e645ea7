//! A recording that another simulator made, in the place of the twin's nominal prediction.

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use gap_diagnosis::report;
use gap_diagnosis::simulated::{self, Matched, Share};
use machine::MachineFile;
use serde::Serialize;
use twin::Session;

use super::bags::{Recorded, lines};

/// What a recording was compared with, as the JSON has it.
#[derive(Clone, Debug, Serialize)]
pub struct Simulated {
    /// The simulator's bags.
    pub bags: Vec<report::Bag>,
    /// What of the recording has a match in them.
    #[serde(flatten)]
    pub matched: Matched,
}

impl Simulated {
    /// What was compared and what was not, for the head of a page.
    pub fn in_words(&self) -> Vec<String> {
        let Matched {
            runs,
            readings,
            stood_in,
            unmatched,
        } = &self.matched;
        let bags: Vec<&str> = self.bags.iter().map(|bag| bag.path.as_str()).collect();
        let of = |share: &Share| format!("{} of {}", share.matched, share.of);
        let mut all = vec![format!(
            "Simulator: {} in the place of the machine file's own; {} runs and {} readings are compared with it at equal places of their paths.",
            bags.join(", "),
            of(runs),
            of(readings)
        )];
        if !unmatched.is_empty() {
            let left_out: Vec<String> = unmatched.iter().map(ToString::to_string).collect();
            all.push(format!("Not compared: {}.", left_out.join("; ")));
        }
        if *stood_in > 0 {
            all.push(format!(
                "{stood_in} of these runs have no repeat of their own in the simulator; its last run of the test stands in, and noise of that run, if any, counts as gap."
            ));
        }
        all
    }
}

/// A session to diagnose with its simulator.
pub struct Beside {
    /// The recording less the simulator.
    pub session: Session,
    /// What was matched.
    pub simulated: Simulated,
    /// What of the simulator's bags was left out, in words.
    pub remarks: Vec<String>,
}

/// Puts a simulator's bags in the place of the twin's prediction; nothing without bags.
///
/// # Errors
/// When a bag cannot be read whole, is one of the recording or another machine's, and where nothing in it can be compared.
pub fn beside(
    paths: &[PathBuf],
    machine: &MachineFile,
    recorded: &Recorded,
) -> Result<Option<Beside>> {
    if paths.is_empty() {
        return Ok(None);
    }
    let read = Recorded::read(paths, machine).context("--simulated")?;
    if let Some(loss) = lines(&read.readings).first() {
        bail!(
            "--simulated: {loss}: a simulator's bag is used whole or not at all, let the simulator write it again"
        );
    }
    for bag in &read.bags {
        if let Some(same) = recorded.bags.iter().find(|one| one.sha256 == bag.sha256) {
            bail!(
                "--simulated {}: is the same as {}, byte for byte: name the bag that the simulator made",
                bag.path,
                same.path
            );
        }
    }
    let (session, matched) =
        simulated::beside(machine, &recorded.session, &read.session).context("--simulated")?;
    let remarks = read
        .remarks
        .iter()
        .map(|line| format!("--simulated: {line}"));
    Ok(Some(Beside {
        session,
        remarks: remarks.collect(),
        simulated: Simulated {
            bags: read.bags,
            matched,
        },
    }))
}
