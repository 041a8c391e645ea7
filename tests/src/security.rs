//! DDS Security in tests: keystores that `abbe keystore` makes, and programs that use them.

use std::path::Path;
use std::process::Command;
use std::time::Duration;

use abbe_msgs::topics;

use crate::fast_dds::FastDds;
use crate::program::{Process, command};
use crate::scenario::Scenario;

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

/// Handshakes that are tried: keys that do not fit come in one of 170.
const HANDSHAKES: usize = 3;

/// The controller of a scenario on a secured graph, and a peer on Fast DDS that listens to its axes; `None`: that cannot be
/// compiled here.
///
/// Where they do not meet, the node must have reported that the keys do not fit, as they do not in one handshake of 170
/// (`node_runtime/src/log/undecoded.rs`); both are then started again, as it asks.
///
/// # Panics
/// When they do not meet for another reason.
pub fn met_in_secret(
    (scenario, domain, keys): (&Scenario, u16, &Path),
    start: impl Fn() -> Option<FastDds>,
) -> Option<(Process, FastDds)> {
    let file = scenario.argument("fake_cnc.yaml");
    let arguments = ["node", "fake_cnc", "--ros-args", "--params-file", &file];
    for _ in 0..HANDSHAKES {
        let mut peer = start()?;
        let mut node = command(domain, &arguments);
        enforce(&mut node, keys);
        let node = Process::start(node);
        if peer.meets(&topics::AXES_STATE) {
            return Some((node, peer));
        }
        let said = node.stop();
        assert!(said.contains("could not be decrypted"), "not met: {said}");
        eprintln!("keys that do not fit were agreed; the handshake is made again");
    }
    panic!("keys did not fit in {HANDSHAKES} handshakes");
}
