//! The machine's frames as a program of their own.

use std::process::ExitCode;

fn main() -> ExitCode {
    node_runtime::run("machine_frames", machine_frames_node::node)
}
