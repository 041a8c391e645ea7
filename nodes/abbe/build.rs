//! Tells the program which commit it is made from, for its bags.
#![expect(
    clippy::disallowed_methods,
    reason = "a build script is told its commit by the environment"
)]

use std::process::Command;

fn main() {
    let told = std::env::var("ABBE_COMMIT")
        .ok()
        .filter(|commit| !commit.is_empty());
    let commit = told.or_else(|| {
        let output = Command::new("git")
            .args(["rev-parse", "HEAD"])
            .output()
            .ok()?;
        let text = String::from_utf8(output.stdout).ok()?;
        output.status.success().then(|| text.trim().to_owned())
    });
    println!(
        "cargo::rustc-env=ABBE_COMMIT={}",
        commit.unwrap_or_else(|| "unknown".to_owned())
    );
    println!("cargo::rerun-if-env-changed=ABBE_COMMIT");
    println!("cargo::rerun-if-changed=../../.git/logs/HEAD");
}
