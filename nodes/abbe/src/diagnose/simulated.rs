//! A recording that another simulator made, in the place of the twin's nominal prediction.

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use gap_diagnosis::simulated;
use machine::MachineFile;
use reports::gap::simulated::Simulated;
use reports::loss;
use twin::Session;

use super::bags::Recorded;

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
    let read = Recorded::of_simulator(paths, machine).context("--simulated")?;
    if let Some(lost) = loss::lines(&read.readings).first() {
        bail!(
            "--simulated: {lost}: a simulator's bag is used whole or not at all, let the simulator write it again"
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
    let remarks = { read.omitted.iter() }
        .chain(&read.remarks)
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
