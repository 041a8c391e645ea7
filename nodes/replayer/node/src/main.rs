//! The replayer as a program of its own.

use std::process::ExitCode;

fn main() -> ExitCode {
    node_runtime::run("replayer", replayer_node::node)
}
