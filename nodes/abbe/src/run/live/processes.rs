//! Every node of a launch file as a process of its own.

use std::os::unix::process::CommandExt;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use node_runtime::Interruption;
use node_runtime::complain;

use crate::launch::LaunchNode;

/// A process that was told to stop is killed after this time where its launch file says nothing; a
/// node has a limit of its own below it.
const STOP_TIMEOUT: Duration = Duration::from_secs(30);
/// A node takes a second signal within this for the same Ctrl-C.
const SIGNAL_WINDOW: Duration = Duration::from_millis(600);
/// A process that was forced to end is killed after this time.
const LAST_PATIENCE: Duration = Duration::from_secs(3);
/// Between two looks at processes that stop.
const STOP_PERIOD: Duration = Duration::from_millis(20);
/// They stop last, so that compensation fades through them.
const CONTROLLERS: [&str; 2] = ["fake_cnc", "linuxcnc_bridge"];
/// With the controllers, the node without which no plan goes on.
const CONDUCTOR: &str = "sequencer";

struct Process {
    name: String,
    exec: String,
    child: Child,
    patience: Duration,
    ended: bool,
}

/// Processes that were started here; they end when this is dropped.
pub struct Processes(Vec<Process>);

impl Processes {
    /// Starts this program once for each node.
    ///
    /// # Errors
    /// When a process cannot be started; those that were are stopped.
    pub fn start(nodes: &[LaunchNode]) -> Result<Self> {
        let program = std::env::current_exe().context("path of this program")?;
        let mut processes = Self(Vec::with_capacity(nodes.len()));
        for node in nodes {
            let child = Command::new(&program)
                .args(["node", "--while-input-is-open", &node.exec])
                .args(node.ros_args())
                // A Ctrl-C at the terminal reaches this program alone, which then stops them in order.
                .process_group(0)
                // It closes with this program, however that ends.
                .stdin(Stdio::piped())
                .spawn()
                .with_context(|| format!("process of node {}", node.name))?;
            processes.0.push(Process {
                name: node.name.clone(),
                exec: node.exec.clone(),
                child,
                patience: node.ends_within.unwrap_or(STOP_TIMEOUT),
                ended: false,
            });
        }
        Ok(processes)
    }

    /// Says which processes have ended since the last look; the reason when the plan cannot go on.
    pub fn look(&mut self) -> Option<String> {
        let mut reason = None;
        for process in self.0.iter_mut().filter(|process| !process.ended) {
            if let Ok(Some(status)) = process.child.try_wait() {
                process.ended = true;
                let word = format!("node {} ended: {}", process.name, in_words(status));
                complain!("abbe: {word}");
                if process.is_needed() && reason.is_none() {
                    reason = Some(word);
                }
            }
        }
        reason
    }

    /// Tells all to stop, waits, and kills what does not.
    pub fn stop(mut self, interruption: &Interruption) {
        self.end(interruption);
    }

    fn end(&mut self, interruption: &Interruption) {
        let others = |process: &Process| !CONTROLLERS.contains(&process.exec.as_str());
        self.end_those(others, interruption);
        self.end_those(|_| true, interruption);
    }

    /// Tells `which` to stop; once the end is forced, at once, and kills what does not even so.
    fn end_those(&mut self, which: fn(&Process) -> bool, interruption: &Interruption) {
        let open = |process: &Process| !process.ended && which(process);
        let tell = |processes: &[Process], signal: Signal| {
            for process in processes.iter().filter(|process| open(process)) {
                // It is a child that nobody has waited for: its number is still its own.
                if let Ok(number) = i32::try_from(process.child.id()) {
                    let _ = kill(Pid::from_raw(number), signal);
                }
            }
        };
        tell(&self.0, Signal::SIGTERM);
        let asked = Instant::now();
        let mut forced = None;
        while self.0.iter().any(open) {
            if forced.is_none() && asked.elapsed() >= SIGNAL_WINDOW && interruption.is_forced() {
                // For a node that was told to stop it is the second signal.
                tell(&self.0, Signal::SIGINT);
                forced = Some(Instant::now());
            }
            let forced_for = forced.map_or(Duration::ZERO, |at| at.elapsed());
            for process in self.0.iter_mut().filter(|process| open(process)) {
                let late = asked.elapsed() >= process.patience || forced_for >= LAST_PATIENCE;
                process.settle(late);
            }
            std::thread::sleep(STOP_PERIOD);
        }
    }
}

impl Process {
    fn is_needed(&self) -> bool {
        let exec = self.exec.as_str();
        exec == CONDUCTOR || CONTROLLERS.contains(&exec)
    }

    fn settle(&mut self, late: bool) {
        match self.child.try_wait() {
            Ok(Some(status)) => {
                self.ended = true;
                if !status.success() {
                    complain!("abbe: node {} stopped: {}", self.name, in_words(status));
                }
            }
            _ if late => {
                complain!("abbe: node {} did not stop in time: killed", self.name);
                // It may have ended in this moment.
                let _ = self.child.kill();
                let _ = self.child.wait();
                self.ended = true;
            }
            _ => {}
        }
    }
}

impl Drop for Processes {
    fn drop(&mut self) {
        self.end(&Interruption::never());
    }
}

fn in_words(status: ExitStatus) -> String {
    match status.code() {
        Some(code) => format!("exit code {code}"),
        None => status.to_string(),
    }
}
