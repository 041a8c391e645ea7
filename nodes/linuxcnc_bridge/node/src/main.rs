//! The bridge to LinuxCNC as a program of its own.

use std::process::ExitCode;

fn main() -> ExitCode {
    node_runtime::run("linuxcnc_bridge", linuxcnc_bridge_node::node)
}
