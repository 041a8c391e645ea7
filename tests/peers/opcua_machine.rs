//! A machine behind PyPI `asyncua`, and what a cell with it has in common.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Stdio};
use std::time::Duration;

use abbe_msgs::builtin_interfaces::msg::Time;
use abbe_tests::program::{Process, command, root};
use abbe_tests::python::script;
use metrology::stamp::{Host, Stamp};
use serde_json::{Value, json};

/// A verb of the program that computes has ended after this time.
const END: Duration = Duration::from_secs(120);

/// The server as a process.
pub struct Server {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
    port: u16,
}

impl Server {
    /// Starts one on a free port of loopback; its nodes are the keys of `values`, in the namespace `urn:abbe:machine`.
    pub fn start(python: &PathBuf, values: &Value) -> Self {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        drop(listener);
        let plan = json!({"port": port, "namespaces": ["urn:abbe:machine"], "values": values});
        let mut server = script(python, "opcua_server.py");
        server.arg(plan.to_string()).stderr(Stdio::null());
        server.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = server.spawn().unwrap();
        let (input, output) = (child.stdin.take().unwrap(), child.stdout.take().unwrap());
        let mut server = Self {
            child,
            input,
            output: BufReader::new(output),
            port,
        };
        server.hear("ready");
        server
    }

    fn hear(&mut self, event: &str) {
        let mut line = String::new();
        self.output.read_line(&mut line).unwrap();
        let said: Value = serde_json::from_str(&line).unwrap_or_default();
        assert_eq!(said["event"], event, "{line}");
    }

    /// Writes nodes: name, value in the unit of the mapping, source stamp in ns since 1970.
    pub fn write(&mut self, rows: &[Value]) {
        writeln!(self.input, "{}", json!({"rows": rows})).unwrap();
        self.input.flush().unwrap();
        self.hear("done");
    }

    /// Writes the mapping and the parameters of a bridge to this server into a folder; the file of the parameters.
    pub fn parameters(&self, folder: &Path, map: &str, queue: u32) -> PathBuf {
        std::fs::write(folder.join("map.yaml"), map).unwrap();
        let file = folder.join("bridge.yaml");
        let parameters = format!(
            "/**:\n  ros__parameters:\n    endpoint: opc.tcp://127.0.0.1:{}/\n    map_file: map.yaml\n    \
             subscription: {{sampling_ms: 0, publishing_ms: 20, queue: {queue}}}\n",
            self.port
        );
        std::fs::write(&file, parameters).unwrap();
        file
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The line of a mapping for one node of the server.
pub fn mapped(node: &str, is: &str) -> String {
    format!("  nsu=urn:abbe:machine;s={node}: {{{is}}}\n")
}

/// Whether the program has the client: without it the test says so and ends.
pub fn is_built() -> bool {
    let asked = command(0, &["import-map", "opc.tcp://127.0.0.1:1"]);
    let said = Process::start(asked).ended_within(END).said;
    if said.contains("built without OPC UA") {
        eprintln!("NOT TESTED: a cell behind OPC UA: {said}");
        return false;
    }
    true
}

/// The diagnosis of a bag, by a machine file of the tree.
pub fn diagnosed(bag: &Path, machine: &str) -> Value {
    let mut diagnose = command(0, &["diagnose", "--json", "-"]);
    diagnose.arg(bag).arg("--machine").arg(root().join(machine));
    let ended = Process::start(diagnose).ended_within(END);
    let mut values = serde_json::Deserializer::from_str(&ended.said).into_iter();
    let report = values.next();
    let remarks = &ended.said[values.byte_offset()..];
    assert_eq!(ended.status.code(), Some(0), "{remarks}");
    report.unwrap().unwrap()
}

/// The causes that a diagnosis names.
pub fn named(report: &Value) -> Vec<Value> {
    let causes = report["causes"].as_array().unwrap();
    let named = causes.iter().filter(|one| one["status"] == "named");
    named.cloned().collect()
}

/// The parameter of the one cause that is named, or that leads a set, which must be a late probe signal; its interval must hold
/// what the plant's probe has, ms.
pub fn latency_ms(report: &Value, plant_ms: f64) -> f64 {
    let causes = report["causes"].as_array().unwrap().iter();
    let found: Vec<_> = causes
        .filter(|one| one["status"] == "named" || one["status"] == "set")
        .collect();
    assert_eq!(found[0]["effect"], "probe_latency", "{found:#?}");
    let others = found[1..].iter().filter(|one| one["status"] == "named");
    assert_eq!(others.count(), 0, "{found:#?}");
    let figures = &found[0]["parameters"][0];
    let [low, value, high] = ["low", "value", "high"].map(|key| figures[key].as_f64().unwrap());
    assert!(low < plant_ms && plant_ms < high, "{figures:#}");
    value
}

/// ns since 1970 of a message's stamp.
pub fn nanos(time: &Time) -> i64 {
    let at: Stamp<Host> = abbe_msgs::instant(time).unwrap();
    at.nanos()
}
