//! The bags of a diagnosis. Tables among them are imported into folders that go away.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use reports::gap::diagnosed::Diagnosed;

use crate::import::Named;
use crate::report_bag::foreign_log;
use crate::report_bag::from_table::{self, FromTable};

/// Bags as they are read, and the tables that some were made of.
pub struct Opened {
    /// Each bag, in the order of the arguments.
    pub bags: Vec<PathBuf>,
    tables: Vec<FromTable>,
}

impl Opened {
    /// Takes bags as they are, and imports tables for a machine file (its name and its text) by a map, or by what is
    /// recognised in them.
    ///
    /// # Errors
    /// When a map is named without a table, a table without a machine file, or a table cannot be imported.
    pub fn of(
        paths: &[PathBuf],
        map: Option<&Path>,
        machine: Option<(&str, &str)>,
    ) -> Result<Self> {
        let (mut bags, mut tables) = (vec![], vec![]);
        for path in paths {
            let log = match from_table::is_table(path) {
                true => None,
                false => foreign_log::of(path)?,
            };
            if !from_table::is_table(path) && log.is_none() {
                bags.push(path.clone());
                continue;
            }
            let Some((name, text)) = machine else {
                bail!(
                    "{}: a table has no machine file: write one (abbe new-machine FILE) and name it with --machine",
                    path.display()
                );
            };
            let machine = Named {
                place: name.to_owned(),
                text: text.to_owned(),
            };
            let table = match log {
                Some(log) => from_table::of_log(path, &log, map, Some(machine))?,
                None => from_table::of_machine(path, map, machine)?,
            };
            bags.push(table.bag.clone());
            tables.push(table);
        }
        if tables.is_empty() && map.is_some() {
            bail!("--map does nothing: none of the bags is a table: remove it");
        }
        Ok(Self { bags, tables })
    }

    /// What was recognised in the tables and what they lack, a line each.
    pub fn lines(&self) -> Vec<String> {
        let tables = self.tables.iter();
        tables
            .flat_map(|table| table.lines.iter().cloned())
            .collect()
    }

    /// What was assumed of columns, and readings that no machine has.
    pub fn warnings(&self) -> Vec<String> {
        self.tables.iter().flat_map(FromTable::warnings).collect()
    }

    /// Whether any of them is a table.
    pub fn has_tables(&self) -> bool {
        !self.tables.is_empty()
    }

    /// Whether every cell of the tables holds a value, and no run of them is missing.
    pub fn is_whole(&self) -> bool {
        self.tables.iter().all(FromTable::is_whole)
    }

    /// Names a simulator's bags as they were given.
    pub fn name_simulated(&self, diagnosed: &mut Diagnosed, given: &[PathBuf]) {
        let inputs = diagnosed.simulated.iter_mut().flat_map(|it| &mut it.bags);
        for (input, path) in inputs.zip(given) {
            input.path = path.display().to_string();
        }
        self.name_in_remarks(diagnosed, given);
    }

    /// Names bags as they were given: the folder of a table is no more when the report is read.
    pub fn name_as_given(&self, diagnosed: &mut Diagnosed, given: &[PathBuf]) {
        let inputs = diagnosed.diagnosis.report.inputs.bags.iter_mut();
        for (input, path) in inputs.zip(given) {
            input.path = path.display().to_string();
        }
        self.name_in_remarks(diagnosed, given);
    }

    fn name_in_remarks(&self, diagnosed: &mut Diagnosed, given: &[PathBuf]) {
        for (bag, path) in self.bags.iter().zip(given) {
            let [bag, path] = [bag, path].map(|path| path.display().to_string());
            for remark in &mut diagnosed.remarks {
                *remark = remark.replace(&bag, &path);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_needs_a_machine_file_and_a_map_needs_a_table() {
        let said = |paths: &[&str], map: Option<&str>| {
            let paths: Vec<PathBuf> = paths.iter().map(PathBuf::from).collect();
            let refused = Opened::of(&paths, map.map(Path::new), None).err();
            refused.map(|error| error.to_string()).unwrap_or_default()
        };
        assert!(said(&["laser.csv"], None).contains("name it with --machine"));
        assert!(said(&["bag"], Some("map.yaml")).contains("none of the bags is a table"));
        assert_eq!(said(&["bag"], None), "");
    }
}
