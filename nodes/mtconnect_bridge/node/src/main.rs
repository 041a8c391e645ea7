//! The bridge to a machine that speaks MTConnect as a program of its own.

use std::process::ExitCode;

fn main() -> ExitCode {
    node_runtime::run("mtconnect_bridge", mtconnect_bridge_node::node)
}
