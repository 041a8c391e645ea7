//! The recorder as a program of its own.

use std::process::ExitCode;

fn main() -> ExitCode {
    node_runtime::run("recorder", recorder_node::node)
}
