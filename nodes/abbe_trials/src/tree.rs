//! Whether a program is that of a commit: a final series is drawn from its hash.

use std::process::Command;

use anyhow::{Context, Result, bail};

/// Checks that the working tree around this folder is a commit, without changes.
///
/// # Errors
/// When it is another one or was changed, or when there is none.
pub fn check(commit: &str) -> Result<()> {
    let head = git(&["rev-parse", "HEAD"])?;
    if head.trim() != commit {
        bail!(
            "--final: this program is of commit {commit}, the working tree of {}: build it anew",
            head.trim()
        );
    }
    let changed = git(&["status", "--porcelain", "--untracked-files=no"])?;
    if !changed.trim().is_empty() {
        bail!(
            "--final: the working tree has changes that no commit has:\n{}",
            changed.trim_end()
        );
    }
    Ok(())
}

fn git(arguments: &[&str]) -> Result<String> {
    let output = Command::new("git")
        .args(arguments)
        .output()
        .context("--final: git, which says what is judged")?;
    if !output.status.success() {
        let told = String::from_utf8_lossy(&output.stderr);
        bail!("--final: git {}: {}", arguments.join(" "), told.trim());
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}
