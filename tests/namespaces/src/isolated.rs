//! A test in a process of its own that sees neither processes, shared memory, network nor `/tmp` of anybody else.
//!
//! LinuxCNC has one name for each of these on a computer. So several run at once, a namespace of each kind around every one.

use std::any::type_name;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::LazyLock;
use std::time::Duration;

use nix::unistd::getuid;

/// How many such tests run at once, of all programs of this user: each waits far more than it computes.
const SEATS: usize = 4;
/// Set where a test runs inside.
const INSIDE: &str = "ABBE_TEST_IS_ISOLATED";
/// What makes the namespaces; all that is inside ends with it.
const UNSHARE: [&str; 7] = [
    "--fork",
    "--kill-child",
    "--pid",
    "--mount-proc",
    "--mount",
    "--net",
    "--ipc",
];
/// Arguments: the folder that becomes `/tmp`, two folders that stay visible, the program and its arguments. The shell stays,
/// as the first process inside: it waits for those that nobody else waits for.
const INSIDE_FIRST: &str = r#"
set -e
ip link set lo up
export TMPDIR=/tmp
for kept in "$2" "$3"; do
  case "$kept" in
    "$TMPDIR"/*)
      below="$1${kept#"$TMPDIR"}"
      mkdir -p "$below"
      mount --rbind "$kept" "$below"
      ;;
  esac
done
chmod 1777 "$1"
mount --rbind "$1" "$TMPDIR"
shift 3
"$@"
exit 0
"#;

/// Why namespaces cannot be made here.
static REFUSED: LazyLock<Option<String>> = LazyLock::new(|| {
    let outcome = unshare().arg("true").output();
    match outcome {
        Ok(output) if output.status.success() => None,
        Ok(output) => Some(String::from_utf8_lossy(&output.stderr).trim().to_owned()),
        Err(error) => Some(format!("unshare: {error}")),
    }
});

fn unshare() -> Command {
    let mut command = Command::new("unshare");
    command.args(UNSHARE).stdin(Stdio::null());
    command
}

/// Does `work`, the whole body of a test, in a process and namespaces of its own, a few at a time. Where they cannot be
/// made (they need root) it is done here, with no other such test beside it.
///
/// # Panics
/// When `work` does, or is not the closure of a test's own function: the process inside runs the test of its name.
pub fn isolated<F: FnOnce()>(work: F) {
    if std::env::var_os(INSIDE).is_some() {
        return work();
    }
    if let Some(reason) = &*REFUSED {
        eprintln!("one test at a time: no namespaces here: {reason}");
        let _all: Vec<File> = (0..SEATS).map(|seat| take(seat..=seat)).collect();
        return work();
    }
    let _seat = take(0..=SEATS - 1);
    let name = test_of::<F>();
    let output = run_inside(&name);
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    let complained = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}\n{complained}");
    assert!(said.contains(" 1 passed;"), "no test {name}: {said}");
    print!("{said}");
    eprint!("{complained}");
}

fn run_inside(test: &str) -> Output {
    let tmp = tempfile::tempdir().unwrap();
    let program = std::env::current_exe().unwrap();
    // <target>/release/deps/<program>
    let target = program.ancestors().nth(3).unwrap();
    unshare()
        .args(["bash", "-c", INSIDE_FIRST, "bash"])
        .args([tmp.path(), workspace(), target])
        .arg(&program)
        .args(["--exact", test, "--nocapture"])
        .env(INSIDE, "1")
        .output()
        .unwrap()
}

fn workspace() -> &'static Path {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.ancestors().nth(2).unwrap()
}

/// The test that a closure is the body of, as its program calls it.
fn test_of<F>() -> String {
    let path = type_name::<F>().trim_end_matches("::{{closure}}");
    let (_program, test) = path.split_once("::").unwrap_or(("", path));
    test.to_owned()
}

/// Waits for one of some seats; it is free again when the file is closed.
fn take(seats: std::ops::RangeInclusive<usize>) -> File {
    let folder = seats_folder();
    std::fs::create_dir_all(&folder).unwrap();
    loop {
        for seat in seats.clone() {
            let lock = File::create(folder.join(seat.to_string())).unwrap();
            if lock.try_lock().is_ok() {
                return lock;
            }
        }
        std::thread::sleep(Duration::from_millis(100));
    }
}

fn seats_folder() -> PathBuf {
    std::env::temp_dir().join(format!("abbe_test_seats_{}", getuid()))
}
