//! `abbe import-map SOURCE`: what an MTConnect agent has, as a mapping for `mtconnect_bridge` to go over by hand.

use node_runtime::complain;

use std::path::Path;
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use clap::Args;
use mtconnect_bridge::document::{self, Answer};
use mtconnect_bridge::{io, proposal};

use crate::tell::tell;

/// Arguments of `abbe import-map`.
#[derive(Args)]
pub struct ImportMap {
    /// The agent's answer to `probe`: `http://host:port/probe`, or a file that holds it.
    source: String,
}

impl ImportMap {
    /// Prints the mapping.
    ///
    /// # Errors
    /// When nobody answers, the file cannot be read, or the answer is none to `probe`.
    pub fn execute(self) -> Result<ExitCode> {
        let text = if self.source.starts_with("http://") {
            io::http::fetch(&self.source)?
        } else {
            let path = Path::new(&self.source);
            std::fs::read(path).with_context(|| format!("probe {}", path.display()))?
        };
        let answer = document::read(&text).with_context(|| format!("probe {}", self.source))?;
        let Answer::Devices { items, .. } = answer else {
            bail!("{}: no answer to `probe`", self.source);
        };
        let map = proposal::propose(&items);
        let text = proposal::text_of(&map).context("mapping")?;
        tell!("{}", text.trim_end_matches('\n'));
        complain!(
            "{}: {} of {} data items have a meaning here; names and units are to be gone over",
            self.source,
            map.values.len(),
            items.len()
        );
        Ok(ExitCode::SUCCESS)
    }
}
