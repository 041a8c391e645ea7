//! `--keep` of `run`, `report` and `diagnose`: their figures into the history.

use std::path::PathBuf;

use anyhow::{Context, Result, anyhow};
use clap::Args;
use history::{Added, Entry, Figure, Kind, Store, gap_figures, report_figures};
use node_runtime::complain;
use serde_json::Value;

use super::dates::{Moment, moment};
use super::open_to_write;
use super::origin::Origin;

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
    /// File of the history; without it `~/.local/share/abbe/history.sqlite`.
    #[arg(long, value_name = "FILE", requires = "keep")]
    store: Option<PathBuf>,
}

impl Keep {
    /// Whether figures are kept.
    pub const fn is_wanted(&self) -> bool {
        self.keep
    }

    /// Keeps the figures of a report.
    ///
    /// # Errors
    /// When machine or time are not known, or the store cannot be written.
    pub fn report(&self, figures: &Value, origin: Origin) -> Result<()> {
        let origin = origin.with_conditions(&figures["conditions"]);
        let entry = entry(Kind::Report, report_figures(figures)?, self.named(origin))?;
        self.add(&entry)
    }

    /// Keeps the figures of a diagnosis.
    ///
    /// # Errors
    /// As [`Self::report`].
    pub fn diagnosis(&self, gap: &Value, origin: Origin) -> Result<()> {
        let gap = gap_figures(gap)?;
        let mut origin = self.named(origin);
        origin.machine_sha256 = origin.machine_sha256.or(gap.machine_sha256);
        let entry = entry(Kind::Diagnosis, gap.figures, origin)?;
        self.add(&entry)
    }

    fn named(&self, origin: Origin) -> Origin {
        Origin {
            machine: self.kept_as.clone().or(origin.machine),
            at_s: self.kept_at.map(|at| at.begin_s).or(origin.at_s),
            ..origin
        }
    }

    fn add(&self, entry: &Entry) -> Result<()> {
        let (mut store, path) = open_to_write(self.store.as_deref()).context("--keep")?;
        let line = add(&mut store, entry).context("--keep")?;
        complain!("abbe: {}: {line}", path.display());
        Ok(())
    }
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
/// When the store cannot be written.
pub fn add(store: &mut Store, entry: &Entry) -> Result<String> {
    let (n, kind, machine) = (entry.figures.len(), entry.kind.name(), &entry.machine);
    Ok(match store.add(entry)? {
        Added::New => format!("kept {n} figures of a {kind} of {machine}"),
        Added::Known => format!("has this {kind} of {machine} already, nothing was added"),
    })
}
