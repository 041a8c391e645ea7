//! The host clock as a program of its own.

use std::process::ExitCode;

fn main() -> ExitCode {
    node_runtime::run("host_clock", host_clock_node::node)
}
