//! The probe's corrections as a program of its own.

use std::process::ExitCode;

fn main() -> ExitCode {
    node_runtime::run("probe", probe_node::node)
}
