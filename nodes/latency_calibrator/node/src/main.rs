//! The latency calibrator as a program of its own.

use std::process::ExitCode;

fn main() -> ExitCode {
    node_runtime::run("latency_calibrator", latency_calibrator_node::node)
}
