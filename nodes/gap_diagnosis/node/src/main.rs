//! The gap diagnosis as a program of its own.

use std::process::ExitCode;

fn main() -> ExitCode {
    node_runtime::run("gap_diagnosis", gap_diagnosis_node::node)
}
