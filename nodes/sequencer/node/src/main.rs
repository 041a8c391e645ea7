//! The sequencer as a program of its own.

use std::process::ExitCode;

fn main() -> ExitCode {
    node_runtime::run("sequencer", sequencer_node::node)
}
