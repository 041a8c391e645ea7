//! The fake machine as a program of its own.

use std::process::ExitCode;

fn main() -> ExitCode {
    node_runtime::run("fake_cnc", fake_cnc_node::node)
}
