//! The grid encoder as a program of its own.

use std::process::ExitCode;

fn main() -> ExitCode {
    node_runtime::run("grid_encoder", grid_encoder_node::node)
}
