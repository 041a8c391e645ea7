//! Where the figures of an entry are from: machine, time and hashes.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use machine::MachineFile;
use node_runtime::text_file;
use recorder::{Bag, MACHINE_FILE, RecordedRun};
use reports::evaluate::test_conditions::TestConditions;
use serde_json::Value;
use sha2::{Digest, Sha256};

use super::dates::{Moment, time};
use crate::diagnose::bags;

/// A time before 1971 is that of a table whose begin nobody stated, s since 1970.
const FIRST_DATED_S: i64 = 365 * 86_400;

/// Where figures are from.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Origin {
    /// Name of the machine, where it is known.
    pub machine: Option<String>,
    /// SHA-256 of the machine file.
    pub machine_sha256: Option<String>,
    /// Begin of the first test, s since 1970, where it is known.
    pub at_s: Option<i64>,
    /// SHA-256 of the bags, or of the text.
    pub sha256: String,
    /// Path as it was given.
    pub source: String,
    /// Instruments, as the report's JSON has them.
    pub instruments: String,
    /// Operator, where one is stated.
    pub operator: String,
}

impl Origin {
    /// Of one bag; `source` is its path as it was given. Machine and its hash are those of the machine file in the bag, if `has_machine`.
    ///
    /// # Errors
    /// When the bag cannot be read.
    pub fn of_bag(path: &Path, source: &Path, has_machine: bool) -> Result<Self> {
        let bag = Bag::open(path)?;
        let mut origin = Self {
            sha256: bags::hash(&bag)?,
            source: source.display().to_string(),
            at_s: begin_s(&bag),
            ..Self::default()
        };
        if let Some(attached) = bag.attachment(MACHINE_FILE)?.filter(|_| has_machine) {
            origin.machine_sha256 = Some(hash(&attached.data));
            origin.machine = std::str::from_utf8(&attached.data)
                .ok()
                .and_then(|text| MachineFile::parse(text, MACHINE_FILE).ok())
                .map(|machine| machine.name);
        }
        Ok(origin)
    }

    /// Of a table and the bag that was made of it: the table has the hash, and no machine of its own.
    ///
    /// # Errors
    /// When table or bag cannot be read.
    pub fn of_table(bag: &Path, table: &Path) -> Result<Self> {
        let bytes = text_file::bytes(table)?;
        Ok(Self {
            sha256: hash(&bytes),
            ..Self::of_bag(bag, table, false)?
        })
    }

    /// Of several bags of one machine; the time is that of the last.
    ///
    /// # Errors
    /// When a bag cannot be read.
    pub fn of_bags(paths: &[PathBuf], machine: Option<String>) -> Result<Self> {
        let mut hashes = Vec::new();
        let mut at_s = None;
        for path in paths {
            let bag = Bag::open(path)?;
            hashes.push(bags::hash(&bag)?);
            at_s = at_s.max(begin_s(&bag));
        }
        let sources: Vec<String> = paths
            .iter()
            .map(|path| path.display().to_string())
            .collect();
        Ok(Self {
            machine,
            at_s,
            sha256: joined(&hashes),
            source: shortened(sources),
            ..Self::default()
        })
    }

    /// Of a run, whose machine file is that of its scenario.
    ///
    /// # Errors
    /// When bag or machine file cannot be read.
    pub fn of_run(bag: &Path, machine: &Path) -> Result<Self> {
        let text = text_file::yaml(machine).context("machine file")?;
        let name = machine.display().to_string();
        let mut origin = Self::of_bag(bag, bag, false)?;
        origin.machine = Some(MachineFile::parse(&text, &name)?.name);
        origin.machine_sha256 = Some(hash(text.as_bytes()));
        Ok(origin)
    }

    /// Of the text of a report.
    pub fn of_text(text: impl AsRef<[u8]>, source: &Path) -> Self {
        Self {
            sha256: hash(text.as_ref()),
            source: source.display().to_string(),
            ..Self::default()
        }
    }

    /// With machine and hash of the bag or table that a report's JSON was made of, where it has them: it is recognised as that
    /// bag or table.
    pub fn with_made(mut self, made: &Value) -> Self {
        let text = |key: &str| made[key].as_str().map(str::to_owned);
        self.machine = self.machine.or_else(|| text("machine"));
        if let Some(sha256) = text("input_sha256") {
            self.sha256 = sha256;
        }
        self
    }

    /// With machine and time as they were given; `option` is the name of the time's option.
    ///
    /// # Errors
    /// When there is another time of its own: a time is stated for what has none.
    pub fn stated(self, machine: Option<String>, at: Option<Moment>, option: &str) -> Result<Self> {
        if let (Some(own_s), Some(at)) = (self.at_s, at)
            && !(at.begin_s..=at.end_s).contains(&own_s)
        {
            bail!(
                "{}: {option} {}: it has a time of its own, {}, which is not replaced: leave {option} out",
                self.source,
                time(at.begin_s as f64),
                time(own_s as f64)
            );
        }
        Ok(Self {
            machine: machine.or(self.machine),
            at_s: self.at_s.or(at.map(|at| at.begin_s)),
            ..self
        })
    }

    /// With what the conditions of a report state, where it is not known.
    pub fn with_conditions(mut self, conditions: &Value) -> Self {
        self.instruments = match &conditions["instruments"] {
            Value::Array(all) if all.is_empty() => String::new(),
            Value::Null => String::new(),
            other => other.to_string(),
        };
        if let Some(operator) = conditions["operator"].as_str() {
            operator.clone_into(&mut self.operator);
        }
        self.at_s = self.at_s.or_else(|| {
            let begin = conditions["begin"].as_str()?.strip_suffix(" UTC")?;
            let time = chrono::NaiveDateTime::parse_from_str(begin, "%Y-%m-%d %H:%M:%S").ok()?;
            dated(time.and_utc().timestamp())
        });
        self
    }
}

/// Begin of the first test of a bag, s since 1970.
fn begin_s(bag: &Bag) -> Option<i64> {
    let (first, _) = TestConditions::of(bag).between?;
    let is_run = RecordedRun::of(bag).is_some_and(|run| !run.scenario_name.is_empty());
    begun(first.nanos().div_euclid(1_000_000_000), is_run)
}

/// The begin of a test. A run has a clock from its first instant on, also one that is simulated from 1970 on.
fn begun(at_s: i64, is_run: bool) -> Option<i64> {
    if is_run { Some(at_s) } else { dated(at_s) }
}

/// A time, unless it only stands in for one that is not known.
fn dated(at_s: i64) -> Option<i64> {
    (at_s >= FIRST_DATED_S).then_some(at_s)
}

fn hash(bytes: &[u8]) -> String {
    format!("{:x}", Sha256::digest(bytes))
}

/// One hash of the hashes of a diagnosis's bags; that of a single bag stays its own.
pub fn joined(hashes: &[String]) -> String {
    match hashes {
        [one] => one.clone(),
        several => hash(several.join(",").as_bytes()),
    }
}

/// The hash of a diagnosis: of its bags, and of what it was made with.
pub fn made_with(bags_sha256: &str, made_with: &str) -> String {
    hash(format!("{bags_sha256}\n{made_with}").as_bytes())
}

/// Paths of bags in the length that a store takes.
fn shortened(sources: Vec<String>) -> String {
    const MOST: usize = 20;
    let n = sources.len();
    let mut text = sources
        .into_iter()
        .take(MOST)
        .collect::<Vec<_>>()
        .join(", ");
    if n > MOST {
        text.push_str(&format!(" and {} more", n - MOST));
    }
    text
}

/// The text of a JSON file.
///
/// # Errors
/// When it cannot be read, or is no JSON.
pub fn json(path: &Path) -> Result<(String, Value)> {
    let text = text_file::read(path, text_file::Comments::None)?;
    match serde_json::from_str(&text) {
        Ok(value) => Ok((text, value)),
        Err(error) => {
            let (line, column) = (error.line(), error.column());
            let said = error.to_string();
            let reason = said
                .rsplit_once(" at line ")
                .map_or("", |(reason, _)| reason);
            bail!(
                "{}: line {line}, column {column}: is no JSON ({reason}): write it anew with abbe report --json",
                path.display()
            )
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::history::dates::moment;

    #[test]
    fn conditions_state_time_instruments_and_operator() {
        let conditions = json!({
            "begin": "2026-03-01 12:00:00 UTC", "operator": "A. B.",
            "instruments": [{"kind": "length_reference", "serial_number": "12-3"}],
        });
        let origin = Origin::of_text("{}", Path::new("report.json")).with_conditions(&conditions);
        assert_eq!(origin.at_s, Some(1_772_366_400));
        assert_eq!(origin.operator, "A. B.");
        assert!(
            origin.instruments.contains("12-3"),
            "{}",
            origin.instruments
        );
        assert_eq!(origin.sha256.len(), 64);
        let undated = json!({"begin": "1970-01-01 00:00:05 UTC"});
        assert_eq!(Origin::default().with_conditions(&undated).at_s, None);
        let nothing = Origin::default().with_conditions(&Value::Null);
        assert_eq!(nothing, Origin::default());
    }

    #[test]
    fn a_report_is_recognised_by_what_it_was_made_of() {
        let path = Path::new("report.json");
        let bag = "ab".repeat(32);
        for (made, machine, sha256) in [
            (
                json!({"machine": "vmc_3x", "input_sha256": bag}),
                Some("vmc_3x"),
                Some(&bag),
            ),
            (
                json!({"machine": null, "input_sha256": bag}),
                None,
                Some(&bag),
            ),
            (json!({"machine": "vmc_3x"}), Some("vmc_3x"), None),
            (Value::Null, None, None),
        ] {
            let plain = Origin::of_text("{}", path);
            let origin = plain.clone().with_made(&made);
            assert_eq!(origin.machine.as_deref(), machine, "{made}");
            assert_eq!(&origin.sha256, sha256.unwrap_or(&plain.sha256), "{made}");
        }
    }

    #[test]
    fn the_first_second_of_1970_is_a_time_of_a_run_and_none_of_a_table() {
        for (at_s, is_run, wanted) in [
            (0, true, Some(0)),
            (5, true, Some(5)),
            (0, false, None),
            (FIRST_DATED_S - 1, false, None),
            (FIRST_DATED_S, false, Some(FIRST_DATED_S)),
        ] {
            assert_eq!(begun(at_s, is_run), wanted, "{at_s} {is_run}");
        }
    }

    #[test]
    fn a_time_is_stated_for_what_has_none_and_replaces_none() {
        let at = |text: &str| moment(text).ok();
        let own = || Origin {
            at_s: Some(1_772_366_400),
            machine: Some("own".to_owned()),
            source: "a bag".to_owned(),
            ..Origin::default()
        };
        for given in [None, at("2026-03-01"), at("2026-03-01T12:00:00Z")] {
            let stated = own().stated(None, given, "--at").unwrap();
            assert_eq!(stated, own());
        }
        for given in ["2020-01-01", "2026-03-01T12:00:01Z", "2026-03-02"] {
            let refused = own().stated(None, at(given), "--at").unwrap_err();
            let words = refused.to_string();
            assert!(words.starts_with("a bag: --at 20"), "{words}");
            assert!(
                words.contains("of its own, 2026-03-01T12:00:00Z"),
                "{words}"
            );
        }
        let machine = Some("given".to_owned());
        let stated = Origin::default()
            .stated(machine.clone(), at("2026-03-01"), "--at")
            .unwrap();
        assert_eq!(
            (stated.machine, stated.at_s),
            (machine, Some(1_772_323_200))
        );
    }

    #[test]
    fn a_single_bag_keeps_its_hash_and_several_have_one_of_all() {
        let [a, b] = ["a", "b"].map(|text| hash(text.as_bytes()));
        assert_eq!(joined(std::slice::from_ref(&a)), a);
        let both = joined(&[a.clone(), b.clone()]);
        assert_ne!(both, joined(&[b, a]));
        assert_eq!(both.len(), 64);
    }
}
