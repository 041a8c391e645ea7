//! `abbe completions SHELL`: what a shell completes, from the same table as the arguments themselves.

use std::process::ExitCode;

use anyhow::Result;
use clap::{Args, CommandFactory};
use clap_complete::Shell;

use crate::tell::tell;

/// Arguments of `abbe completions`.
#[derive(Args)]
pub struct Completions {
    /// The shell.
    shell: Shell,
}

impl Completions {
    /// Prints the script.
    ///
    /// # Errors
    /// When the script is no text.
    pub fn execute(self) -> Result<ExitCode> {
        tell!("{}", script(self.shell)?.trim_end());
        Ok(ExitCode::SUCCESS)
    }
}

fn script(shell: Shell) -> Result<String> {
    let mut bytes = vec![];
    clap_complete::generate(shell, &mut crate::Arguments::command(), "abbe", &mut bytes);
    Ok(String::from_utf8(bytes)?)
}

#[cfg(test)]
mod tests {
    use clap::ValueEnum;

    use super::*;

    #[test]
    fn every_shell_completes_every_verb() {
        let program = crate::Arguments::command();
        for shell in Shell::value_variants() {
            let script = script(*shell).unwrap();
            for verb in program.get_subcommands() {
                assert!(
                    script.contains(verb.get_name()),
                    "{shell}: {}",
                    verb.get_name()
                );
            }
        }
    }
}
