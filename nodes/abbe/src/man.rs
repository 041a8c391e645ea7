//! `abbe man FOLDER`: manual pages, from the same table as the arguments themselves.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result};
use clap::{Args, CommandFactory};
use reports::whole_file;

use crate::tell::tell;

/// Arguments of `abbe man`.
#[derive(Args)]
pub struct Man {
    /// Folder of the pages, such as `/usr/local/share/man/man1`; it is made.
    folder: PathBuf,
}

impl Man {
    /// Writes `abbe.1` and a page for each verb, `abbe-run.1` and so on.
    ///
    /// # Errors
    /// When a page cannot be written.
    pub fn execute(self) -> Result<ExitCode> {
        let pages = write(&self.folder)?;
        tell!("{}: {pages} manual pages", self.folder.display());
        Ok(ExitCode::SUCCESS)
    }
}

fn write(folder: &Path) -> Result<usize> {
    let context = || folder.display().to_string();
    std::fs::create_dir_all(folder).with_context(context)?;
    let mut program = crate::Arguments::command();
    program.build();
    let verbs = program.get_subcommands().filter(|verb| !verb.is_hide_set());
    let mut pages = vec![("abbe".to_owned(), program.clone())];
    pages.extend(verbs.map(|verb| (format!("abbe-{}", verb.get_name()), verb.clone())));
    for (name, command) in &pages {
        let mut page = vec![];
        clap_mangen::Man::new(command.clone())
            .render(&mut page)
            .with_context(context)?;
        whole_file::write(&folder.join(format!("{name}.1")), &String::from_utf8(page)?)?;
    }
    Ok(pages.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_verb_has_a_page_with_its_options() {
        let folder = tempfile::tempdir().unwrap();
        let pages = write(folder.path()).unwrap();
        let page = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
        assert!(page("abbe.1").contains("validate"), "{}", page("abbe.1"));
        // Without the backslashes of roff.
        let run = page("abbe-run.1").replace('\\', "");
        for words in [".TH abbe-run 1", "--list", "SCENARIO"] {
            assert!(run.contains(words), "{words}: {run}");
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), pages);
    }
}
