//! The rotary-axis calibration as a program of its own.

use std::process::ExitCode;

fn main() -> ExitCode {
    node_runtime::run("rotary_axes", rotary_axes_node::node)
}
