//! The simulator that a machine was compared with, where it is not the machine file's own.

use gap_diagnosis::report;
use gap_diagnosis::simulated::{Matched, Share};
use serde::Serialize;

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
