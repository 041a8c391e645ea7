//! A scenario in real time.

use std::path::Path;

use anyhow::{Result, bail};

use super::Outcome;
use crate::scenario::Scenario;

/// Runs it.
pub fn run(_scenario: &Scenario, _bag: &Path, _separate: bool) -> Result<Outcome> {
    bail!("not yet");
}
