//! A network and mounts that nobody else sees, for tests that fill disks, or whose graph must be theirs alone.

use std::path::Path;
use std::process::Command;

use nix::sched::{CloneFlags, unshare};

/// Does `work` in a thread with a network and mounts of its own: plain `lo`, without multicast. Its threads and
/// processes have the same, and all goes with the last of them.
///
/// Where that is not allowed the test's name and the reason are printed, and `None` is given. For DDS only: the threads of
/// Zenoh are the process' own and may listen in another test's network.
///
/// # Panics
/// When `work` does; when it is not allowed and `CI=true`.
pub fn alone<T: Send>(test: &str, work: impl FnOnce() -> T + Send) -> Option<T> {
    let done = std::thread::scope(|scope| {
        let thread = scope.spawn(|| {
            enter()?;
            Ok(work())
        });
        thread.join()
    });
    match done {
        Ok(Ok(outcome)) => Some(outcome),
        Ok(Err(reason)) => {
            let reason: String = reason;
            assert!(std::env::var("CI").as_deref() != Ok("true"), "{reason}");
            eprintln!("NOT TESTED: {test}: {reason}");
            None
        }
        Err(panic) => std::panic::resume_unwind(panic),
    }
}

fn enter() -> Result<(), String> {
    let both = CloneFlags::CLONE_NEWNET | CloneFlags::CLONE_NEWNS;
    unshare(both).map_err(|error| format!("a network and mounts of its own (root): {error}"))?;
    run("mount", &["--make-rprivate", "/"])?;
    run("ip", &["link", "set", "lo", "up"])
}

/// Lets `lo` carry multicast: without it only the first twelve participants of a computer find each other.
///
/// # Panics
/// When that is not allowed.
pub fn multicast_on_loopback() {
    run("ip", &["link", "set", "lo", "multicast", "on"]).unwrap();
}

/// Mounts a file system of so many KiB in memory; it goes with the namespace.
///
/// # Panics
/// When it cannot be mounted.
pub fn small_disk(at: &Path, kib: u32) {
    std::fs::create_dir_all(at).unwrap();
    let size = format!("size={kib}k");
    let at = at.display().to_string();
    run("mount", &["-t", "tmpfs", "-o", &size, "tmpfs", &at]).unwrap();
}

fn run(program: &str, arguments: &[&str]) -> Result<(), String> {
    let output = Command::new(program).args(arguments).output();
    match output {
        Ok(output) if output.status.success() => Ok(()),
        Ok(output) => Err(format!(
            "{program} {}: {}",
            arguments.join(" "),
            String::from_utf8_lossy(&output.stderr).trim()
        )),
        Err(error) => Err(format!("{program}: {error}")),
    }
}
