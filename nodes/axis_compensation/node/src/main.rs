//! The axis compensation as a program of its own.

use std::process::ExitCode;

fn main() -> ExitCode {
    node_runtime::run("axis_compensation", axis_compensation_node::node)
}
