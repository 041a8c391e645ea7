//! The thermal model as a program of its own.

use std::process::ExitCode;

fn main() -> ExitCode {
    node_runtime::run("thermal_model", thermal_model_node::node)
}
