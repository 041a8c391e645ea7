//! `--keep` of `run`, `report` and `diagnose`: their figures into the history.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail};
use clap::Args;
use history::{Added, Entry, Figure, Kind, LeftOut, Store, gap_figures, left_out, report_figures};
use metrology::stamp::NANOS_PER_S;
use node_runtime::complain;
use reports::evaluate::limits::Limits;
use serde_json::Value;

use super::alarms::{Alarms, Measured};
use super::dates::{Moment, moment, time};
use super::origin::{Origin, made_with};
use super::{open_to_write, unmake};

/// Arguments of verbs that can keep their figures.
#[derive(Args, Clone, Debug, Default)]
pub struct Keep {
    /// Keep the figures in the history of the machine, for `abbe history`.
    #[arg(long)]
    keep: bool,
    /// Name of the machine in the history; without it that of its machine file.
    #[arg(long, value_name = "MACHINE", requires = "keep")]
    kept_as: Option<String>,
    /// Time of the measurement, for a table without one: 2026-03-01 or 2026-03-01T12:00:00Z.
    #[arg(long, value_name = "DATE", requires = "keep", value_parser = moment)]
    kept_at: Option<Moment>,
    /// The history: a file, or `postgres://USER@HOST/DATABASE`; without it `~/.local/share/abbe/history.sqlite`.
    #[arg(long, value_name = "STORE", requires = "keep")]
    store: Option<PathBuf>,
}

impl Keep {
    /// Whether figures are kept.
    pub const fn is_wanted(&self) -> bool {
        self.keep
    }

    /// The file of the history, where one is named.
    pub fn store(&self) -> Option<&Path> {
        self.store.as_deref()
    }

    /// Holds the figures of a report against limits, before they are kept; `machine` and `between` (ns since 1970) are its own.
    ///
    /// # Errors
    /// When it is no report, or a limit is of another unit than its figure.
    pub fn judge_report(
        &self,
        limits: Limits,
        figures: &Value,
        (machine, between, source): (Option<&str>, Option<(i64, i64)>, &Path),
    ) -> Result<Alarms> {
        self.judge(
            limits,
            &report_figures(figures)?,
            (machine, between, source),
        )
    }

    /// Holds the figures of a diagnosis against limits, as [`Self::judge_report`].
    ///
    /// # Errors
    /// As [`Self::judge_report`].
    pub fn judge_diagnosis(
        &self,
        limits: Limits,
        gap: &Value,
        (machine, between, source): (Option<&str>, Option<(i64, i64)>, &Path),
    ) -> Result<Alarms> {
        self.judge(
            limits,
            &gap_figures(gap)?.figures,
            (machine, between, source),
        )
    }

    fn judge(
        &self,
        limits: Limits,
        figures: &[Figure],
        (machine, between, source): (Option<&str>, Option<(i64, i64)>, &Path),
    ) -> Result<Alarms> {
        let own_s = between.map(|(begin, _)| begin.div_euclid(NANOS_PER_S));
        let stated_s = self.kept_at.map(|at| at.begin_s);
        let at_s = own_s
            .or(stated_s)
            .unwrap_or_else(|| chrono::Utc::now().timestamp());
        let measured = Measured {
            machine: self.kept_as.as_deref().or(machine).unwrap_or_default(),
            at_s: at_s as f64,
            source: &source.display().to_string(),
            figures,
        };
        Alarms::of_figures(limits, &measured).context("--limits")
    }

    /// Name of the machine in the history, where one is stated.
    pub fn kept_as(&self) -> Option<&str> {
        self.kept_as.as_deref()
    }

    /// Keeps the figures of a report.
    ///
    /// # Errors
    /// When machine or time are not known, or the store cannot be written.
    pub fn report(&self, figures: &Value, origin: Origin) -> Result<()> {
        let origin = origin.with_conditions(&figures["conditions"]);
        complain_of_left_out(figures, &origin.source);
        let entry = entry(Kind::Report, report_figures(figures)?, self.named(origin)?)?;
        self.add(&entry)
    }

    /// Keeps the figures of a diagnosis.
    ///
    /// # Errors
    /// As [`Self::report`].
    pub fn diagnosis(&self, gap: &Value, origin: Origin) -> Result<()> {
        complain_of_left_out(gap, &origin.source);
        let gap = gap_figures(gap)?;
        let mut origin = self.named(origin)?;
        origin.machine_sha256 = origin.machine_sha256.or(gap.machine_sha256);
        origin.sha256 = made_with(&origin.sha256, &gap.made_with);
        let entry = entry(Kind::Diagnosis, gap.figures, origin)?;
        self.add(&entry)
    }

    fn named(&self, origin: Origin) -> Result<Origin> {
        origin.stated(self.kept_as.clone(), self.kept_at, "--kept-at")
    }

    fn add(&self, entry: &Entry) -> Result<()> {
        let (mut store, path, is_new) = open_to_write(self.store.as_deref()).context("--keep")?;
        let added = add(&mut store, entry).context("--keep");
        drop(store);
        if added.is_err() && is_new {
            unmake(&path);
        }
        let line = added?;
        complain!("abbe: {}: {line}", path.display());
        Ok(())
    }
}

/// Figures that are named one by one; more are counted.
const LEFT_OUT_NAMED: usize = 5;

/// Prints the number and names of figures without a finite number; returns whether all have one.
pub fn complain_of_left_out(figures: &Value, source: &str) -> bool {
    let left_out = left_out(figures);
    if let Some(line) = in_words(&left_out) {
        complain!("abbe: {source}: {line}");
    }
    left_out.is_empty()
}

fn in_words(left_out: &[LeftOut]) -> Option<String> {
    let first = left_out.iter().take(LEFT_OUT_NAMED).map(|it| {
        let test = if it.test.is_empty() {
            String::new()
        } else {
            format!("{}: ", it.test)
        };
        format!("{test}{} = {}", it.name, it.value)
    });
    let first: Vec<String> = first.collect();
    let more = match left_out.len().saturating_sub(LEFT_OUT_NAMED) {
        0 => String::new(),
        n => format!("; {n} more"),
    };
    let figures = match left_out.len() {
        0 => return None,
        1 => "1 figure".to_owned(),
        n => format!("{n} figures"),
    };
    Some(format!(
        "{figures} left out, no finite number: {}{more}; measure again, or mend the file",
        first.join("; ")
    ))
}

/// An entry of figures.
///
/// # Errors
/// When machine or time are not known.
pub fn entry(kind: Kind, figures: Vec<Figure>, origin: Origin) -> Result<Entry> {
    let source = &origin.source;
    let machine = origin.machine.ok_or_else(|| {
        anyhow!(
            "{source}: names no machine: state it with --kept-as (`abbe history add`: --machine)"
        )
    })?;
    let at_s = origin.at_s.ok_or_else(|| {
        anyhow!(
            "{source}: has no time of a test: state it with --kept-at DATE (`abbe history add`: --at)"
        )
    })?;
    Ok(Entry {
        machine,
        at_s,
        kind,
        sha256: origin.sha256,
        machine_sha256: origin.machine_sha256,
        source: origin.source,
        instruments: origin.instruments,
        operator: origin.operator,
        software: format!("abbe {}", env!("CARGO_PKG_VERSION")),
        figures,
    })
}

/// Adds an entry; what became of it, in words.
///
/// # Errors
/// When the store cannot be written, or has it under another machine or time.
pub fn add(store: &mut Store, entry: &Entry) -> Result<String> {
    let (n, kind, machine) = (entry.figures.len(), entry.kind.name(), &entry.machine);
    Ok(match store.add(entry)? {
        Added::New => format!("kept {n} figures of a {kind} of {machine}"),
        Added::Known => format!("has this {kind} of {machine} already, nothing was added"),
        Added::KnownOtherwise => format!(
            "has this {kind} of {machine} already, with other figures (as of another budget, map or version): nothing was added; keep these in another file with --store"
        ),
        Added::Otherwise {
            machine: other,
            at_s,
        } => bail!(
            "{}: the history has this {kind} already, of {other} at {}, and not of {machine} at {}: nothing was added; state what it has, or keep it in another file with --store",
            entry.source,
            time(at_s as f64),
            time(entry.at_s as f64)
        ),
    })
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn figures_of_another_machine_or_date_are_refused_with_those_that_they_stand_under() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("s.sqlite");
        let mut store = Store::open(&path, history::Options::default()).unwrap();
        let figure = Figure {
            test: "X".to_owned(),
            name: "iso230_2.accuracy".to_owned(),
            axis: String::new(),
            value: 0.01,
            unit: "mm".to_owned(),
            standard_uncertainty: None,
            interval: None,
            status: String::new(),
        };
        let mut kept = |machine: &str, date: &str| {
            let origin = Origin {
                sha256: "0".repeat(64),
                source: "table.csv".to_owned(),
                ..Origin::default()
            };
            let origin = origin.stated(Some(machine.to_owned()), moment(date).ok(), "--kept-at")?;
            let one = entry(Kind::Report, vec![figure.clone()], origin)?;
            add(&mut store, &one)
        };
        assert!(kept("m1", "2026-06-30").unwrap().starts_with("kept 1"));
        let again = kept("m1", "2026-06-30T12:00:00Z").unwrap();
        assert!(again.contains("already, nothing was added"), "{again}");
        for (machine, date) in [
            ("m2", "2026-06-30"),
            ("m1", "2026-01-01"),
            ("m2", "2026-01-01"),
        ] {
            let refused = format!("{:#}", kept(machine, date).unwrap_err());
            for words in [
                "table.csv: ",
                "of m1 at 2026-06-30T00:00:00Z",
                format!("not of {machine} at {date}").as_str(),
                "--store",
            ] {
                assert!(refused.contains(words), "{refused}");
            }
        }
    }

    #[test]
    fn figures_that_are_left_out_are_counted_and_the_first_are_named() {
        let quantity = json!({"value_mm": null, "expanded_uncertainty_mm": null});
        let report = |n: usize| {
            let test = json!({"test": "X", "iso230_2": {"accuracy": quantity}});
            json!({"tests": vec![test; n]})
        };
        assert_eq!(in_words(&left_out(&report(0))), None);
        assert!(complain_of_left_out(&report(0), "report.json"));
        assert!(!complain_of_left_out(&report(1), "report.json"));
        let one = in_words(&left_out(&report(1))).unwrap();
        let begin = "1 figure left out, no finite number: X: iso230_2.accuracy.value_mm = null;";
        assert!(one.starts_with(begin), "{one}");
        let many = in_words(&left_out(&report(12))).unwrap();
        assert!(many.starts_with("12 figures left out"), "{many}");
        assert!(many.contains("; 7 more; measure again"), "{many}");
    }
}
