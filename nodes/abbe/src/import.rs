//! `abbe import CSV --map MAP -o BAG`: somebody's measurement as a bag that `abbe diagnose` reads.
//!
//! A CSV holds what an instrument read; the map says which column is what and how the machine moved. The motion is
//! made up from it: rests at the targets of a positioning test, approached as the order of the rows says; an even feed
//! round a circle, a quarter of a turn ahead of its first row; standing axes for a log. Motors were not recorded and
//! say nothing: they are written as commanded, which a diagnosis notices and leaves out.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result};
use clap::Args;
use machine::MachineFile;

mod limits;
mod map;
mod motion;
mod table;
mod writer;

use map::Map;
use table::Table;
use writer::Writer;

use crate::tell::tell;

/// Arguments of `abbe import`.
#[derive(Args)]
pub struct Import {
    /// Table of readings.
    csv: PathBuf,
    /// Which column is what, and how the machine moved.
    #[arg(long)]
    map: PathBuf,
    /// Machine file of the machine that was measured.
    #[arg(long)]
    machine: PathBuf,
    /// Folder of the bag.
    #[arg(short, long)]
    output: PathBuf,
}

impl Import {
    /// Writes the bag.
    ///
    /// # Errors
    /// When a file cannot be read, a column is missing, a cell is no number, or the bag not written.
    pub fn execute(self) -> Result<ExitCode> {
        let map: Map = serde_saphyr::from_str(&text(&self.map)?)
            .with_context(|| format!("map {}", self.map.display()))?;
        let machine_text = text(&self.machine)?;
        let machine = MachineFile::parse(&machine_text, &self.machine.display().to_string())?;
        limits::check(&map, &machine).with_context(|| format!("map {}", self.map.display()))?;
        let ranges = limits::ranges(&map.test, &machine);
        let table = Table::read(&text(&self.csv)?, &map, &ranges)
            .with_context(|| format!("table {}", self.csv.display()))?;
        let mut writer = Writer::begin(&self.output, &machine, machine_text, map.start_s)?;
        let runs = match motion::write(&map, &table, &mut writer) {
            Ok(runs) => runs,
            Err(error) => {
                drop(writer);
                // What was begun is no bag, and would stand in the way of the next attempt.
                std::fs::remove_dir_all(&self.output)
                    .with_context(|| format!("{}", self.output.display()))?;
                return Err(error.context(format!("table {}", self.csv.display())));
            }
        };
        let messages = writer.finish()?;
        tell!(
            "{}: {runs} runs, {messages} messages",
            self.output.display()
        );
        Ok(ExitCode::SUCCESS)
    }
}

fn text(path: &Path) -> Result<String> {
    std::fs::read_to_string(path).with_context(|| format!("{}", path.display()))
}
