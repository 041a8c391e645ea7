//! The machine as a process, and a wire to it that can be cut.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use metrology::stamp::{Host, Stamp};
use serde_json::{Value, json};

/// The tree.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The host's clock.
pub fn host_now() -> Stamp<Host> {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
    Stamp::from_nanos(i64::try_from(since.as_nanos()).unwrap())
}

/// A port that nobody listens on.
pub fn free_port() -> u16 {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    listener.local_addr().unwrap().port()
}

/// The interpreter that has `asyncua`: `ABBE_PYTHON`, else `.venv/bin/python`. Without it the test reports that and ends,
/// which with `CI=true` is a failure.
pub fn interpreter(test: &str) -> Option<PathBuf> {
    let python = std::env::var("ABBE_PYTHON")
        .map_or_else(|_| root().join(".venv/bin/python"), PathBuf::from);
    let tried = Command::new(&python)
        .args(["-c", "import asyncua"])
        .output();
    if tried.is_ok_and(|output| output.status.success()) {
        return Some(python);
    }
    let reason = format!("{}: no asyncua (tests/run installs it)", python.display());
    assert!(std::env::var("CI").as_deref() != Ok("true"), "{reason}");
    eprintln!("NOT TESTED: {test}: {reason}");
    None
}

/// A server that ends with its test.
pub struct Machine {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
}

impl Machine {
    /// Starts it with what the head of the program has beside port and namespaces, and waits until it listens.
    pub fn start(python: &Path, port: u16, namespaces: &[&str], more: &Value) -> Self {
        let mut values = json!({"X": 0.0, "T": 20.0});
        for n in 0..10 {
            values[format!("V{n}")] = json!(-1.0 - f64::from(n));
        }
        let mut plan = json!({"port": port, "namespaces": namespaces, "values": values});
        for (key, value) in more.as_object().unwrap() {
            plan[key] = value.clone();
        }
        let mut child = Command::new(python)
            .arg(root().join("tests/peers/opcua_server.py"))
            .arg(plan.to_string())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let (input, output) = (child.stdin.take().unwrap(), child.stdout.take().unwrap());
        let mut machine = Self {
            child,
            input,
            output: BufReader::new(output),
        };
        machine.hear("ready");
        machine
    }

    /// Waits for an event.
    pub fn hear(&mut self, event: &str) -> Value {
        let mut line = String::new();
        self.output.read_line(&mut line).unwrap();
        let said: Value = serde_json::from_str(&line).unwrap_or_default();
        assert_eq!(said["event"], event, "{line}");
        said
    }

    /// Has it do something, and does not wait for it.
    pub fn ask(&mut self, command: &Value) {
        writeln!(self.input, "{command}").unwrap();
        self.input.flush().unwrap();
    }

    /// Has it do something.
    pub fn tell(&mut self, command: &Value) {
        self.ask(command);
        self.hear("done");
    }
}

impl Drop for Machine {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Passes bytes between the bridge and the machine, until it is cut.
pub struct Proxy {
    port: u16,
    is_cut: Arc<AtomicBool>,
    is_silent: Arc<AtomicBool>,
    wires: Arc<Mutex<Vec<TcpStream>>>,
}

impl Proxy {
    /// Listens on a port of its own.
    pub fn start(machine: u16) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let proxy = Self {
            port: listener.local_addr().unwrap().port(),
            is_cut: Arc::new(AtomicBool::new(false)),
            is_silent: Arc::new(AtomicBool::new(false)),
            wires: Arc::new(Mutex::new(Vec::new())),
        };
        let (is_cut, wires) = (Arc::clone(&proxy.is_cut), Arc::clone(&proxy.wires));
        let is_silent = Arc::clone(&proxy.is_silent);
        std::thread::spawn(move || {
            for near in listener.incoming().flatten() {
                if is_cut.load(Ordering::SeqCst) {
                    continue;
                }
                let Ok(far) = TcpStream::connect(("127.0.0.1", machine)) else {
                    continue;
                };
                let ends = [near, far];
                let clones = ends.each_ref().map(|end| end.try_clone().unwrap());
                wires.lock().unwrap().extend(clones);
                let [near, far] = ends;
                let clones = (near.try_clone().unwrap(), far.try_clone().unwrap());
                pass(clones.0, clones.1, Arc::clone(&is_silent));
                pass(far, near, Arc::clone(&is_silent));
            }
        });
        proxy
    }

    /// Where it listens.
    pub const fn port(&self) -> u16 {
        self.port
    }

    /// Cuts every wire, and refuses new ones.
    pub fn cut(&self) {
        self.is_cut.store(true, Ordering::SeqCst);
        for wire in self.wires.lock().unwrap().drain(..) {
            let _ = wire.shutdown(Shutdown::Both);
        }
        std::thread::sleep(Duration::from_millis(300));
    }

    /// Keeps every wire and passes nothing on, as a plug that was pulled does.
    pub fn fall_silent(&self) {
        self.is_silent.store(true, Ordering::SeqCst);
    }

    /// Takes new wires again; those that were silent are cut.
    pub fn mend(&self) {
        if self.is_silent.swap(false, Ordering::SeqCst) {
            self.cut();
        }
        self.is_cut.store(false, Ordering::SeqCst);
    }
}

fn pass(mut from: TcpStream, mut to: TcpStream, is_silent: Arc<AtomicBool>) {
    std::thread::spawn(move || {
        let mut bytes = [0; 16384];
        while let Ok(length @ 1..) = from.read(&mut bytes) {
            let is_passed = !is_silent.load(Ordering::SeqCst);
            if is_passed && to.write_all(&bytes[..length]).is_err() {
                break;
            }
        }
        let _ = to.shutdown(Shutdown::Both);
    });
}
