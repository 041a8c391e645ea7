//! A table made of a run's own stops, loaded by LinuxCNC itself in two more runs: as it is, and with its sign turned.
//!
//! LinuxCNC reads a screw-compensation file when it starts. So each run is one of a copy of the scenario, in which this file
//! alone differs, and of a LinuxCNC of its own. Every second stop is in the table; the others show what it does in between.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use control_tables::AxisErrors;
use control_tables::linuxcnc::{FileType, compensation_file};
use node_runtime::Interruption;
use node_runtime::complain;
use recorder::Bag;
use reports::evaluate::Tests;
use reports::evaluate::stops::Stops;
use reports::section::Section;
use reports::stops;

use super::live;
use crate::scenario::{LinuxcncTable, Scenario};

const TRIAL_TITLE: &str = "The exported table on the control itself";

/// Runs of the same plan with other tables.
pub struct TableTrial<'a> {
    /// The scenario as it was run.
    pub scenario: &'a Scenario,
    /// What is tried.
    pub table: &'a LinuxcncTable,
    /// Folder of the run.
    pub folder: &'a Path,
    /// Whether every node is a process of its own.
    pub separate: bool,
    /// Ctrl-C.
    pub interruption: &'a Interruption,
}

impl TableTrial<'_> {
    /// Makes the table of the stops in `bag`, runs with it and with its sign turned, and compares.
    ///
    /// # Errors
    /// When the bag has no stops along the axis, or a run does not come to its end.
    pub fn run(&self, bag: &Path) -> Result<Section> {
        let bare = self.stops_of(bag)?;
        let with = self.with_table("with_table", &bare, 1.0)?;
        let turned = self.with_table("with_table_turned", &bare, -1.0)?;
        let runs = [
            ("without a table", &bare),
            ("with the table", &with),
            ("with its sign turned", &turned),
        ];
        stops::trial(TRIAL_TITLE, &runs)
    }

    fn stops_of(&self, bag: &Path) -> Result<Stops> {
        let tests = Tests::of(&Bag::open(bag)?);
        let axis = self.table.axis;
        let found = tests.stops.into_iter().find(|stops| stops.axis == axis);
        found.with_context(|| {
            let bag = bag.display();
            format!("{bag}: no verification stops along {axis} alone")
        })
    }

    fn with_table(&self, name: &str, bare: &Stops, sign: f64) -> Result<Stops> {
        let table = bare.table(stops::TABLE_EVERY, sign);
        let errors = AxisErrors::from_table(&table)?;
        let file = compensation_file(&errors, FileType::ActualPosition)?;
        let folder = self.folder.join(name);
        copy(&self.scenario.folder, &folder)?;
        let loaded = folder.join(&self.table.loads);
        if !loaded.is_file() {
            bail!(
                "scenario.yaml: linuxcnc_table.loads = {}: there is no such file in the scenario",
                self.table.loads.display()
            );
        }
        std::fs::write(&loaded, file.text).with_context(|| loaded.display().to_string())?;
        let copied = Scenario::read(&folder)?;
        let bag = folder.join("bag");
        complain!("Running again, {name}: {}", loaded.display());
        let outcome = live::run(&copied, &bag, self.separate, None, self.interruption)?;
        if let Some(reason) = outcome.failure {
            bail!("run {name}: {reason}");
        }
        self.stops_of(&bag)
    }
}

/// Copies a folder and what is below it.
fn copy(from: &Path, to: &Path) -> Result<()> {
    let place = |path: &PathBuf| path.display().to_string();
    std::fs::create_dir_all(to).with_context(|| to.display().to_string())?;
    for entry in std::fs::read_dir(from).with_context(|| from.display().to_string())? {
        let entry = entry?;
        let (path, target) = (entry.path(), to.join(entry.file_name()));
        if entry.file_type()?.is_dir() {
            copy(&path, &target)?;
        } else {
            std::fs::copy(&path, &target).with_context(|| place(&target))?;
        }
    }
    Ok(())
}
