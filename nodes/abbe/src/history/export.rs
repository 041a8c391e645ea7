//! `abbe history export FILE.parquet`: the values of a history as one Parquet file.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Result, bail};
use clap::Args;
use history::{Options, SeriesKey, Store, Window};
use reports::whole_file::{Form, Output, check_outputs};

use super::dates::{Moment, moment};
use super::store_path;

#[cfg(feature = "parquet")]
mod parquet_file;

/// Arguments of `abbe history export`.
#[derive(Args)]
pub struct Export {
    /// The file, whose name ends with `.parquet`.
    file: PathBuf,
    /// Only values of this machine.
    #[arg(long)]
    machine: Option<String>,
    /// Only values from this date on: 2026-03-01 or 2026-03-01T12:00:00Z.
    #[arg(long, value_parser = moment)]
    since: Option<Moment>,
    /// Only values up to this date.
    #[arg(long, value_parser = moment)]
    until: Option<Moment>,
    /// The history: a file, or `postgres://USER@HOST/DATABASE`; without it `~/.local/share/abbe/history.sqlite`.
    #[arg(long, value_name = "STORE")]
    store: Option<PathBuf>,
}

impl Export {
    /// Writes the file.
    ///
    /// # Errors
    /// When the store cannot be read, has no value or too many, or the file not written.
    pub fn execute(self) -> Result<ExitCode> {
        let ending = self.file.extension().and_then(|ending| ending.to_str());
        if ending != Some("parquet") {
            bail!(
                "{}: must end with .parquet; --csv of `abbe history` prints a table",
                self.file.display()
            );
        }
        let path = store_path(self.store.as_deref())?;
        let output = Output::new("FILE", self.file.clone(), Form::Any);
        check_outputs(&[output], [path.as_path()])?;
        let store = Store::open_to_read(&path, Options::default())?;
        let key = SeriesKey {
            machine: self.machine.clone(),
            ..SeriesKey::default()
        };
        let window = Window {
            since_s: self.since.map_or(i64::MIN, |moment| moment.begin_s),
            until_s: self.until.map_or(i64::MAX, |moment| moment.end_s),
        };
        self.write(&store, &key, window)
    }

    #[cfg(feature = "parquet")]
    fn write(&self, store: &Store, key: &SeriesKey, window: Window) -> Result<ExitCode> {
        let file = parquet_file::of(store, key, window)?;
        reports::whole_file::write_bytes(&self.file, &file.bytes)?;
        let (path, rows) = (self.file.display(), file.rows);
        crate::tell::tell!("{path}: {rows} values");
        Ok(ExitCode::SUCCESS)
    }

    #[cfg(not(feature = "parquet"))]
    fn write(&self, _store: &Store, _key: &SeriesKey, _window: Window) -> Result<ExitCode> {
        bail!(
            "{}: this program was built without the feature `parquet`: build it with `cargo build --release --features parquet`, or use --csv of `abbe history`",
            self.file.display()
        )
    }
}
