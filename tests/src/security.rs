//! DDS Security in tests: keystores that `abbe keystore` makes, and programs that use them.

use std::path::Path;
use std::process::Command;
use std::time::Duration;

use crate::program::{Process, command};

/// Makes a keystore for the nodes of a scenario; `false`: the program was built without DDS Security, the test's name is
/// printed with the reason.
///
/// # Panics
/// When it cannot be made; when the program was built without and `CI=true`.
#[must_use]
pub fn keystore(test: &str, keystore: &Path, scenario: &Path) -> bool {
    let mut make = command(0, &["keystore"]);
    make.arg(keystore).arg("--scenario").arg(scenario);
    let ended = Process::start(make).ended_within(Duration::from_secs(60));
    if ended.said.contains("without DDS Security") {
        let reason = "abbe was built without the feature security (tests/run turns it on)";
        assert!(std::env::var("CI").as_deref() != Ok("true"), "{reason}");
        eprintln!("NOT TESTED: {test}: {reason}");
        return false;
    }
    assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
    true
}

/// Lets a program use a keystore, and start only with its credentials.
pub fn enforce(command: &mut Command, keystore: &Path) {
    command
        .env("ROS_SECURITY_ENABLE", "true")
        .env("ROS_SECURITY_STRATEGY", "Enforce")
        .env("ROS_SECURITY_KEYSTORE", keystore);
}
