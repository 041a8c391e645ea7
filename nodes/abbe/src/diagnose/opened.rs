//! The bags of a diagnosis. Tables among them are imported into folders that go away.

use std::path::{Path, PathBuf};

use anyhow::{Result, anyhow, bail};
use reports::gap::diagnosed::Diagnosed;

use recorder::Bag;

use super::bags;
use super::no_machine::{Assumed, Shown};
use crate::import::Named;
use crate::import::begin::Before;
use crate::report_bag::folder;
use crate::report_bag::foreign_log::{self, Log};
use crate::report_bag::from_table::{self, FromTable};

/// Bags as they are read, and the tables that some were made of.
pub struct Opened {
    /// Each bag, in the order of the arguments.
    pub bags: Vec<PathBuf>,
    tables: Vec<FromTable>,
    /// What was assumed of a machine that nobody stated, and of tables without dates.
    assumed: Vec<String>,
}

impl Opened {
    /// Takes bags as they are, and imports tables for a machine file by a map, or by what is recognised in them.
    ///
    /// # Errors
    /// When a map is named without a table, or a table cannot be imported.
    pub fn of(paths: &[PathBuf], map: Option<&Path>, machine: &Named) -> Result<Self> {
        refuse_copies(paths)?;
        let (mut bags, mut tables) = (vec![], vec![]);
        let mut put_behind = vec![];
        let mut last = Last::default();
        for path in paths {
            let Some(source) = Source::of(path)? else {
                last.add(path, false);
                bags.push(path.clone());
                continue;
            };
            let machine = Named {
                place: machine.place.clone(),
                text: machine.text.clone(),
            };
            let table = match source {
                Source::Log(log) => {
                    from_table::of_log(path, &log, map, (Some(machine), last.before(map)?))?
                }
                Source::Table => from_table::of_machine(path, map, (machine, last.before(map)?))?,
            };
            last.add(&table.bag, true);
            put_behind.extend(table.is_put_behind.then(|| path.clone()));
            bags.push(table.bag.clone());
            tables.push(table);
        }
        if tables.is_empty() && map.is_some() {
            bail!("--map does nothing: none of the bags is a table: remove it");
        }
        Ok(Self {
            bags,
            tables,
            assumed: apart(&put_behind).into_iter().collect(),
        })
    }

    /// The same where no machine file is named: that of the first bag, and of tables alone the plain machine that they show.
    ///
    /// # Errors
    /// As [`Self::of`], and when the first bag has no machine file.
    pub fn without_machine(paths: &[PathBuf], map: Option<&Path>) -> Result<(Self, Named)> {
        let mut shown = Shown::default();
        for path in paths {
            let table = match Source::of(path)? {
                None => {
                    let (place, text) = bags::machine_text(path)?;
                    let machine = Named { place, text };
                    return Ok((Self::of(paths, map, &machine)?, machine));
                }
                Some(Source::Log(log)) => from_table::of_log(path, &log, map, (None, None))?,
                Some(Source::Table) => from_table::of_any(path, map, None)?,
            };
            shown.add(&table.bag)?;
        }
        let Assumed { machine, lines } = shown.machine();
        let mut opened = Self::of(paths, map, &machine)?;
        opened.assumed.splice(0..0, lines);
        Ok((opened, machine))
    }

    /// What was recognised in the tables and what they lack, a line each.
    pub fn lines(&self) -> Vec<String> {
        let lines = self.tables.iter().flat_map(|table| &table.lines);
        self.assumed.iter().chain(lines).cloned().collect()
    }

    /// What was assumed of columns, and readings that no machine has.
    pub fn warnings(&self) -> Vec<String> {
        let of_tables = self.tables.iter().flat_map(FromTable::warnings);
        self.assumed.iter().cloned().chain(of_tables).collect()
    }

    /// Takes from a diagnosis what rests on the time between files, where nobody stated it.
    pub fn forget_time_between(&self, diagnosed: &mut Diagnosed) {
        if self.tables.iter().any(|table| table.is_put_behind) {
            let unknown = &mut diagnosed.diagnosis.report.unknown;
            unknown.description.time_constant_s = None;
        }
    }

    /// Whether any of them is a table.
    pub fn has_tables(&self) -> bool {
        !self.tables.is_empty()
    }

    /// Whether every cell of the tables holds a value, and no run of them is missing.
    pub fn is_whole(&self) -> bool {
        self.tables.iter().all(FromTable::is_whole)
    }

    /// An error with the bags named as they were given.
    pub fn named(&self, error: &anyhow::Error, given: &[PathBuf]) -> anyhow::Error {
        let mut text = format!("{error:#}");
        for (bag, path) in self.bags.iter().zip(given) {
            let [bag, path] = [bag, path].map(|path| path.display().to_string());
            text = text.replace(&bag, &path);
        }
        anyhow!("{text}")
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

/// Refuses a table that is named twice, or copied: put behind itself it would count as a repeat.
fn refuse_copies(paths: &[PathBuf]) -> Result<()> {
    let tables: Vec<&PathBuf> = { paths.iter() }
        .filter(|path| from_table::is_table(path))
        .collect();
    for (at, path) in tables.iter().enumerate() {
        if let Some(other) = tables[..at].iter().find(|other| is_same(path, other)) {
            bail!(
                "table {}: is the same as {}, byte for byte: a copy repeats nothing, name each recording once",
                path.display(),
                other.display()
            );
        }
    }
    Ok(())
}

/// Whether two files hold the same; what cannot be read is another matter.
fn is_same(one: &Path, other: &Path) -> bool {
    let length = |path: &Path| std::fs::metadata(path).ok().map(|it| it.len());
    let bytes = |path: &Path| std::fs::read(path).ok();
    length(one).is_some_and(|it| Some(it) == length(other))
        && bytes(one).is_some_and(|it| Some(it) == bytes(other))
}

/// The end of what was read last.
#[derive(Default)]
struct Last {
    bag: Option<PathBuf>,
    is_table: bool,
}

impl Last {
    fn add(&mut self, bag: &Path, is_table: bool) {
        self.bag = Some(bag.to_owned());
        self.is_table |= is_table;
    }

    /// What a table comes after; the bag is opened here, as nothing else asks when it ends.
    fn before(&self, map: Option<&Path>) -> Result<Option<Before>> {
        let Some(bag) = &self.bag else {
            return Ok(None);
        };
        let times = Bag::open(bag)?.log_times_nanos();
        let end_s = times.and_then(|(_, end)| i64::try_from(end.div_ceil(1_000_000_000)).ok());
        let has_same_map = self.is_table && map.is_some();
        Ok(end_s.map(|end_s| Before {
            end_s,
            has_same_map,
        }))
    }
}

/// What was assumed of tables without dates.
fn apart(put_behind: &[PathBuf]) -> Option<String> {
    let tables = put_behind.iter().map(|path| path.display().to_string());
    let tables = tables.collect::<Vec<_>>().join(", ");
    (!tables.is_empty()).then(|| {
        format!(
            "warning, begin not stated: {tables}: taken to follow the file before in the order given, a day later or at the next such time \
             of the day; nothing is judged by the time between these files; write `Date: 2026-01-05 08:00` above the names of the columns"
        )
    })
}

/// What a table is made of.
enum Source {
    Table,
    /// A bag of another program that holds a log.
    Log(Log),
}

impl Source {
    /// `None`: a bag.
    fn of(path: &Path) -> Result<Option<Self>> {
        if from_table::is_table(path) {
            return Ok(Some(Self::Table));
        }
        folder::check(path, "diagnose")?;
        Ok(foreign_log::of(path)?.map(Self::Log))
    }
}

#[cfg(test)]
mod tests {
    use machine::MachineFile;

    use super::*;

    #[test]
    fn a_map_needs_a_table() {
        let machine = Named {
            place: "machine.yaml".to_owned(),
            text: String::new(),
        };
        let refused = |map: Option<&Path>| Opened::of(&["bag".into()], map, &machine).err();
        let why = refused(Some(Path::new("map.yaml"))).unwrap().to_string();
        assert!(why.contains("none of the bags is a table"), "{why}");
        assert!(refused(None).is_none());
    }

    /// Opens tables with these texts as one session; gives their machine and their recording too.
    fn read(texts: &[String]) -> (Opened, Named, bags::Recorded) {
        let home = tempfile::tempdir().unwrap();
        let path = |k: usize| home.path().join(format!("table_{k}.csv"));
        for (k, text) in texts.iter().enumerate() {
            std::fs::write(path(k), text).unwrap();
        }
        let paths: Vec<PathBuf> = (0..texts.len()).map(path).collect();
        let (opened, named) = Opened::without_machine(&paths, None).unwrap();
        let machine = MachineFile::parse(&named.text, &named.place).unwrap();
        let recorded = bags::Recorded::read(&opened.bags, &machine).unwrap();
        (opened, named, recorded)
    }

    /// A log of ten minutes that begins with `first`, minutes of it as they are written by `time`.
    fn log(first: &str, time: fn(u32) -> String, from_um: f64) -> String {
        let row = |minute: u32| format!("{},{}\n", time(minute), from_um + f64::from(minute) * 0.5);
        format!("{first}time,z_um\n") + &(0..10).map(row).collect::<String>()
    }

    #[test]
    fn tables_without_dates_follow_one_another_in_the_order_given_and_lose_nothing() {
        let seconds: fn(u32) -> String = |minute| (60 * minute).to_string();
        let of_day: fn(u32) -> String = |minute| format!("08:{minute:02}:00");
        let dated = "Date: 2026-01-05 08:00\n";
        for firsts in [
            [("", seconds), ("", seconds), ("", seconds)],
            [("", of_day), ("", of_day), ("", of_day)],
            [(dated, seconds), ("", seconds), ("", of_day)],
        ] {
            // Equal files are copies.
            let of = |k: usize| log(firsts[k].0, firsts[k].1, 0.1 * k as f64);
            let logs = [of(0), of(1), of(2)];
            let (opened, _, recorded) = read(&logs);
            let runs = recorded.bags.iter().map(|bag| (bag.runs, bag.samples));
            assert_eq!(runs.collect::<Vec<_>>(), [(1, 10); 3]);
            let said = [recorded.omitted, recorded.remarks].concat();
            assert!(said.is_empty(), "{said:?}");
            let lines = opened.warnings();
            let line = lines.iter().find(|line| line.contains("begin not stated"));
            let line = line.expect("an assumption");
            assert_eq!(line.matches("table_").count(), 2, "{line}");
        }
        let later = "Date: 2026-01-06 08:00\n";
        let (opened, ..) = read(&[log(dated, seconds, 0.0), log(later, seconds, 0.1)]);
        let lines = opened.warnings().join("\n");
        assert!(!lines.contains("begin not stated"), "{lines}");
    }

    /// A ballbar's table with rows at 0 and 180 deg, read behind the play of 4 µm of X that is run through there.
    #[test]
    fn rows_on_a_reversal_are_no_drift() {
        let mut text = "run,angle_deg,radial_um\n".to_owned();
        for run in 1..=5 {
            for deg in 0..=360 {
                let (sin, cos) = f64::from(deg).to_radians().sin_cos();
                let is_back = deg % 360 < 180;
                let play_um = if is_back { 2.0 } else { -2.0 } * cos;
                let noise_um = 0.04 * f64::sin(f64::from(7919 * (361 * run + deg)));
                let um = play_um + 2.0 * sin * cos + noise_um;
                text.push_str(&format!("{run},{deg},{um:.3}\n"));
            }
        }
        let (opened, machine, recorded) = read(&[text]);
        let on_reversal = "25 readings lie on the point where an axis turns round";
        let said = recorded.remarks.join("\n");
        assert!(said.contains(on_reversal), "{said}");
        let config = gap_diagnosis::GapConfig::default();
        let found = super::super::of(&opened.bags, &machine.place, &machine.text, &config).unwrap();
        let causes = found.diagnosis.report.causes.iter();
        let named = causes.filter(|cause| cause.status != gap_diagnosis::report::Status::Surrogate);
        let named: Vec<&str> = named.map(|cause| cause.effect.as_str()).collect();
        assert!(!named.contains(&"ambient_drift"), "{named:?}");
        assert!(named.contains(&"backlash"), "{named:?}");
    }
}
