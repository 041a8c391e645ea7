//! Starting LinuxCNC and ending it cleanly.
//!
//! LinuxCNC refuses to run as root, only one can run on a computer, and its start script ends any
//! other one that it finds. So: an ordinary user, a lock that programs of this suite share, a look
//! at the running processes before the start, and a copy of the configuration in a working
//! directory of its own. A small guard process waits for the end of its input, which comes when it
//! is told to end *or when this process dies*, and then asks LinuxCNC over TCP to shut down.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom};
use std::net::TcpStream;
use std::os::unix::fs::OpenOptionsExt;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use super::account::Account;
use super::remains;
use crate::config::BridgeConfig;
use crate::error::BridgeError;

/// Programs that must be there, and the packages that have them.
const PROGRAMS: [(&str, &str); 5] = [
    ("linuxcnc", "linuxcnc-uspace"),
    ("halcmd", "linuxcnc-uspace"),
    ("halsampler", "linuxcnc-uspace"),
    ("stdbuf", "coreutils"),
    ("bash", "bash"),
];
/// Processes that exist while a LinuxCNC runs.
const PROCESSES: [&str; 4] = ["linuxcncrsh", "linuxcncsvr", "milltask", "rtapi_app"];
/// Arguments: INI file, host, port, connect password, enable password, file that appears when LinuxCNC has ended.
const GUARD: &str = r#"
{ linuxcnc -r "$1" </dev/null; : >"$6"; } &
read -r _
# One that is only just starting does not listen yet.
until [ -e "$6" ] || { exec 3<>"/dev/tcp/$2/$3"; } 2>/dev/null; do
  sleep 0.2
done
if [ ! -e "$6" ]; then
  printf 'hello %s abbe 1.0\r\nset enable %s\r\nshutdown\r\n' "$4" "$5" >&3
  cat <&3 >/dev/null
fi
wait
"#;
/// The file of the working directory that appears when LinuxCNC has ended.
const ENDED: &str = "abbe_linuxcnc_ended";
/// What the guard is called.
const GUARD_NAME: &str = "abbe-linuxcnc-guard";
/// LinuxCNC that starts while the last one's real-time part is still being unloaded ends at once: so often,
/// and after such a pause, it is started again.
const START_ATTEMPTS: u32 = 3;
const REALTIME_CLEANUP: Duration = Duration::from_secs(3);
/// The process whose threads are LinuxCNC's servo and base thread, and the priority they get.
const REAL_TIME: (&str, &str) = ("rtapi_app", "50");
/// A clean end takes about 3 s.
const CLEAN_END_LIMIT: Duration = Duration::from_secs(20);
/// Length of the last words in an error.
const LAST_WORDS_BYTES: u64 = 600;

/// A LinuxCNC that was started here; it ends when this is dropped.
#[derive(Debug)]
pub struct Controller {
    guard: Child,
    guard_stdin: Option<ChildStdin>,
    account: Account,
    log: File,
    _lock: File,
}

/// Checks that LinuxCNC is installed.
///
/// # Errors
/// Names the first program that is missing and the package that has it.
pub fn require_installed() -> Result<(), BridgeError> {
    let folders = ["/usr/local/bin", "/usr/bin", "/bin"];
    for (program, package) in PROGRAMS {
        if !folders
            .iter()
            .any(|folder| Path::new(folder).join(program).exists())
        {
            return Err(BridgeError::PackageMissing { program, package });
        }
    }
    Ok(())
}

fn failed<'a>(
    action: &'static str,
    path: &'a Path,
) -> impl FnOnce(std::io::Error) -> BridgeError + 'a {
    move |source| BridgeError::Io {
        action,
        path: path.to_owned(),
        source,
    }
}

/// Takes the right to run LinuxCNC on this computer, until the file is closed.
fn lock() -> Result<File, BridgeError> {
    let path = std::env::temp_dir().join("abbe-linuxcnc.lock");
    let file = OpenOptions::new()
        .create(true)
        .truncate(false)
        .write(true)
        .mode(0o666)
        .open(&path)
        .map_err(failed("opening", &path))?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(BridgeError::StartedElsewhere { path }),
        Err(TryLockError::Error(source)) => Err(failed("locking", &path)(source)),
    }
}

/// Running processes of LinuxCNC by name and id; zombies do not count.
#[expect(
    clippy::disallowed_methods,
    reason = "the system's list of processes is read here"
)]
fn running() -> Vec<(String, i32)> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir("/proc").into_iter().flatten().flatten() {
        let Ok(pid) = entry.file_name().to_string_lossy().parse::<i32>() else {
            continue;
        };
        let Ok(status) = std::fs::read_to_string(entry.path().join("stat")) else {
            continue;
        };
        // pid (name) state …
        let Some((head, tail)) = status.rsplit_once(") ") else {
            continue;
        };
        let name = head.split_once('(').map_or("", |(_, name)| name);
        if PROCESSES.contains(&name) && !tail.starts_with('Z') {
            found.push((name.to_owned(), pid));
        }
    }
    found
}

/// Whether a guard is there; without one who holds the lock it is that of a process that was killed.
#[expect(
    clippy::disallowed_methods,
    reason = "the system's list of processes is read here"
)]
fn is_guarded() -> bool {
    let mut processes = std::fs::read_dir("/proc").into_iter().flatten().flatten();
    processes.any(|entry| {
        // What is no process has no command line.
        let command = std::fs::read(entry.path().join("cmdline")).unwrap_or_default();
        let mut words = command.split(|byte| *byte == 0);
        words.any(|word| word == GUARD_NAME.as_bytes())
    })
}

/// Waits while the LinuxCNC of a process that was killed is being ended by its guard.
#[expect(clippy::disallowed_methods, reason = "a process outside is waited for")]
fn wait_for_orphan() {
    let deadline = Instant::now() + CLEAN_END_LIMIT;
    while is_guarded() && Instant::now() < deadline {
        std::thread::sleep(Duration::from_millis(100));
    }
}

/// Gives LinuxCNC's real-time part the priority that it has only under a real-time kernel by itself.
///
/// Without it any process may stop the servo thread between taking a command and telling of it, and
/// LinuxCNC's task, which then believes that a probing move has ended, gives the program up ("Queue is not
/// empty after probing").
fn prefer_real_time() {
    for (_, pid) in running()
        .into_iter()
        .filter(|(name, _)| name == REAL_TIME.0)
    {
        let outcome = Command::new("chrt")
            .args(["--all-tasks", "--fifo", "--pid", REAL_TIME.1])
            .arg(pid.to_string())
            .output();
        match outcome {
            Ok(output) if output.status.success() => {}
            Ok(output) => tracing::info!(
                "LinuxCNC runs without real-time priority: {}",
                String::from_utf8_lossy(&output.stderr).trim()
            ),
            Err(error) => tracing::info!("LinuxCNC runs without real-time priority: chrt: {error}"),
        }
    }
}

impl Controller {
    /// Starts the INI file `ini` and waits until LinuxCNC listens.
    ///
    /// # Errors
    /// LinuxCNC is not installed, runs already, ends at once, or does not listen in time; memory that a
    /// killed one left cannot be removed.
    #[expect(
        clippy::disallowed_methods,
        reason = "this is the part that waits for processes"
    )]
    pub fn start(config: &BridgeConfig, ini: &Path) -> Result<Self, BridgeError> {
        require_installed()?;
        let mut attempt = 1;
        loop {
            match Self::start_once(config, ini) {
                Err(BridgeError::EndedAtStart { .. }) if attempt < START_ATTEMPTS => {
                    attempt += 1;
                    std::thread::sleep(REALTIME_CLEANUP);
                }
                outcome => return outcome,
            }
        }
    }

    fn start_once(config: &BridgeConfig, ini: &Path) -> Result<Self, BridgeError> {
        let lock = lock()?;
        wait_for_orphan();
        if let Some((process, pid)) = running().into_iter().next() {
            return Err(BridgeError::AlreadyRunning { process, pid });
        }
        remains::clear()?;
        let account = Account::ordinary(&config.user)?;
        let ini_copy = copy_configuration(ini, &account)?;
        let (guard, guard_stdin, log) = spawn_guard(config, &account, &ini_copy)?;
        let mut controller = Self {
            guard,
            guard_stdin: Some(guard_stdin),
            account,
            log,
            _lock: lock,
        };
        controller.wait_ready(config, ini)?;
        prefer_real_time();
        Ok(controller)
    }

    /// The user who owns it.
    #[must_use]
    pub fn account(&self) -> &Account {
        &self.account
    }

    /// Its working directory; programs can be put there.
    #[must_use]
    pub fn folder(&self) -> &Path {
        self.account.home()
    }

    /// Runs one command of LinuxCNC's, such as `halcmd`, and gives what it printed.
    ///
    /// # Errors
    /// When it could not be started.
    pub fn command(&self, program: &str, arguments: &[&str]) -> Result<String, BridgeError> {
        let mut command = Command::new(program);
        self.account.apply(&mut command);
        let output = command
            .args(arguments)
            .output()
            .map_err(failed("running", Path::new(program)))?;
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    }

    #[expect(clippy::disallowed_methods, reason = "a process outside is waited for")]
    fn wait_ready(&mut self, config: &BridgeConfig, ini: &Path) -> Result<(), BridgeError> {
        let limit_s = config.connection.start_timeout_s;
        let deadline = Instant::now() + Duration::from_secs_f64(limit_s.max(0.0));
        let port = config.connection.port;
        let ended = self.account.home().join(ENDED);
        while Instant::now() < deadline {
            // Looked for before the processes: what runs after it is no part of a start.
            let has_ended = ended.exists();
            let alive = running();
            if has_ended && alive.is_empty() {
                let last_words = self.last_words();
                return Err(BridgeError::EndedAtStart {
                    ini: ini.to_owned(),
                    last_words,
                });
            }
            let listens = alive.iter().any(|(name, _)| name == "linuxcncrsh");
            if listens && TcpStream::connect((config.connection.host.as_str(), port)).is_ok() {
                return Ok(());
            }
            std::thread::sleep(Duration::from_millis(100));
        }
        let last_words = self.last_words();
        Err(BridgeError::NotReady {
            ini: ini.to_owned(),
            port,
            limit_s,
            last_words,
        })
    }

    fn last_words(&mut self) -> String {
        let mut words = Vec::new();
        let length = self.log.seek(SeekFrom::End(0)).unwrap_or(0);
        let from = SeekFrom::Start(length.saturating_sub(LAST_WORDS_BYTES));
        if self.log.seek(from).is_ok() {
            // What cannot be read is not there to be quoted.
            let _ = self.log.read_to_end(&mut words);
        }
        String::from_utf8_lossy(&words).trim().replace('\n', " | ")
    }

    #[expect(clippy::disallowed_methods, reason = "a process outside is waited for")]
    fn wait_end(&mut self, limit: Duration) -> bool {
        let deadline = Instant::now() + limit;
        while Instant::now() < deadline {
            if matches!(self.guard.try_wait(), Ok(Some(_))) && running().is_empty() {
                return true;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        false
    }

    fn signal_all(&self, signal: Signal) {
        // Nothing ran before the start and the lock is held: every one of these is ours.
        for (_, pid) in running() {
            // It may have ended in this moment.
            let _ = kill(Pid::from_raw(pid), signal);
        }
    }
}

impl Drop for Controller {
    fn drop(&mut self) {
        self.guard_stdin = None;
        if self.wait_end(CLEAN_END_LIMIT) {
            return;
        }
        self.signal_all(Signal::SIGTERM);
        if !self.wait_end(CLEAN_END_LIMIT) {
            self.signal_all(Signal::SIGKILL);
            // The last resort: nothing is left to try after it.
            let _ = self.guard.kill();
            let _ = self.guard.wait();
            let _ = self.command("halrun", &["-U"]);
        }
    }
}

/// Copies the folder of the INI file and gives it to the user.
fn copy_configuration(ini: &Path, account: &Account) -> Result<PathBuf, BridgeError> {
    let folder = account.home();
    let source = ini.parent().unwrap_or(Path::new("."));
    let entries = std::fs::read_dir(source).map_err(failed("reading", source))?;
    for entry in entries {
        let entry = entry.map_err(failed("reading", source))?;
        let copy = folder.join(entry.file_name());
        if entry.path().is_file() {
            std::fs::copy(entry.path(), &copy).map_err(failed("copying", &entry.path()))?;
            account.own(&copy)?;
        }
    }
    let name = ini.file_name().unwrap_or_default();
    let copy = folder.join(name);
    if copy.is_file() {
        Ok(copy)
    } else {
        Err(failed("reading", ini)(std::io::ErrorKind::NotFound.into()))
    }
}

#[expect(clippy::disallowed_methods, reason = "the log of a process outside")]
fn spawn_guard(
    config: &BridgeConfig,
    account: &Account,
    ini: &Path,
) -> Result<(Child, ChildStdin, File), BridgeError> {
    let log_path = account.home().join("linuxcnc.log");
    let log = File::create(&log_path).map_err(failed("creating", &log_path))?;
    let connection = &config.connection;
    let mut command = Command::new("bash");
    account.apply(&mut command);
    command
        .args(["-c", GUARD, GUARD_NAME])
        .arg(ini)
        .args([&connection.host, &connection.port.to_string()])
        .args([&connection.connect_password, &connection.enable_password])
        .arg(account.home().join(ENDED))
        // A Ctrl-C at the terminal reaches this process; the guard then ends LinuxCNC in order.
        .process_group(0)
        .stdin(Stdio::piped())
        .stdout(log.try_clone().map_err(failed("opening", &log_path))?)
        .stderr(log.try_clone().map_err(failed("opening", &log_path))?);
    let mut guard = command
        .spawn()
        .map_err(failed("starting", Path::new("bash")))?;
    let stdin = guard.stdin.take().expect("a piped input was asked for");
    let log = File::open(&log_path).map_err(failed("opening", &log_path))?;
    Ok((guard, stdin, log))
}
