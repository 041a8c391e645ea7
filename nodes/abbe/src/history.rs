//! `abbe history`: keeps the figures of reports and diagnoses, and shows how each machine's change over time.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, anyhow};
use clap::{Args, Subcommand};
use reports::whole_file;

mod add;
pub mod alarms;
mod dates;
mod export;
pub mod keep;
mod machines;
mod numbers;
pub mod origin;
mod overview;
mod single;
mod view;
mod webhook;

/// Arguments of `abbe history`.
#[derive(Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct History {
    #[command(subcommand)]
    action: Option<Action>,
    #[command(flatten)]
    view: view::View,
}

#[derive(Subcommand)]
enum Action {
    /// Keep the figures of bags, folders of runs, and JSON of reports and diagnoses; each once, however often it is added.
    Add(add::Add),
    /// Write the values as a Parquet file, for data platforms; needs the feature `parquet`.
    Export(export::Export),
}

impl History {
    /// Adds or shows; exit code 3 when a part of an added bag was lost or left out.
    ///
    /// # Errors
    /// When the store or an input cannot be read or written, or nothing matches.
    pub fn execute(self) -> Result<ExitCode> {
        match self.action {
            Some(Action::Add(add)) => add.execute(),
            Some(Action::Export(export)) => export.execute(),
            None => self.view.execute(),
        }
    }
}

/// The store at a path, or the usual one: `abbe/history.sqlite` in `$XDG_DATA_HOME` or `~/.local/share`.
///
/// # Errors
/// Where neither is known, or something is there that is no regular file.
fn store_path(given: Option<&Path>) -> Result<PathBuf> {
    let path = path_of_store(given)?;
    if history::is_server(&path) {
        return Ok(path);
    }
    whole_file::must_be_regular(&path).context("history")?;
    Ok(path)
}

fn path_of_store(given: Option<&Path>) -> Result<PathBuf> {
    if let Some(path) = given {
        return Ok(path.to_owned());
    }
    let absolute = |name: &str| {
        let folder = std::env::var_os(name).map(PathBuf::from);
        folder.filter(|folder| folder.is_absolute())
    };
    let data = absolute("XDG_DATA_HOME").or_else(|| Some(absolute("HOME")?.join(".local/share")));
    let data = data.ok_or_else(|| {
        anyhow!("neither XDG_DATA_HOME nor HOME is an absolute path: name the history with --store")
    })?;
    Ok(data.join("abbe/history.sqlite"))
}

/// Opens a store for writing; its folder is made. The last value: whether the store is new.
///
/// # Errors
/// When folder or store cannot be made or opened.
fn open_to_write(given: Option<&Path>) -> Result<(history::Store, PathBuf, bool)> {
    let path = store_path(given)?;
    if history::is_server(&path) {
        let store = history::Store::open(&path, history::Options::default())?;
        return Ok((store, history::shown(&path), false));
    }
    if let Some(folder) = path.parent().filter(|it| !it.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder)
            .with_context(|| format!("folder of the history {}", folder.display()))?;
    }
    let is_new = !path.exists();
    match history::Store::open(&path, history::Options::default()) {
        Ok(store) => Ok((store, path, is_new)),
        Err(error) => {
            if is_new {
                unmake(&path);
            }
            Err(error.into())
        }
    }
}

/// Removes a new store that holds nothing, with what the database keeps beside it.
fn unmake(path: &Path) {
    for end in ["", "-wal", "-shm", "-journal"] {
        let mut name = path.as_os_str().to_owned();
        name.push(end);
        // What cannot be removed was told by the error that led here.
        let _ = std::fs::remove_file(name);
    }
}
