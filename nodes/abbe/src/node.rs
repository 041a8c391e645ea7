//! `abbe node NAME --ros-args …`: one node as a process of its own.

use std::process::ExitCode;

use anyhow::Result;
use clap::Args;
use clap::builder::PossibleValuesParser;
use nix::sys::signal::{Signal, raise};
use node_runtime::{Composition, Node, Setup};

use crate::tell::tell;
use crate::usage;

mod parameters;

/// What builds a node from its setup.
pub type Builder = fn(&Setup) -> Result<Box<dyn Node>>;

/// Every node that can be launched, by the name of its folder.
pub const NODES: &[(&str, Builder)] = &[
    ("axis_compensation", axis_compensation_node::node),
    ("fake_cnc", fake_cnc_node::node),
    ("gap_diagnosis", gap_diagnosis_node::node),
    ("grid_encoder", grid_encoder_node::node),
    ("host_clock", host_clock_node::node),
    ("latency_calibrator", latency_calibrator_node::node),
    ("linuxcnc_bridge", linuxcnc_bridge_node::node),
    ("live_view", live_view_node::node),
    ("machine_frames", machine_frames_node::node),
    ("mtconnect_bridge", mtconnect_bridge_node::node),
    ("opcua_bridge", opcua_bridge_node::node),
    ("probe", probe_node::node),
    ("recorder", recorder_node::node),
    ("replayer", replayer_node::node),
    ("rotary_axes", rotary_axes_node::node),
    ("sequencer", sequencer_node::node),
    ("thermal_model", thermal_model_node::node),
];

/// The builder of the node in folder `exec`.
pub fn builder(exec: &str) -> Option<Builder> {
    NODES
        .iter()
        .find(|(name, _)| *name == exec)
        .map(|(_, builder)| *builder)
}

/// Names of all nodes, for messages.
pub fn names() -> String {
    NODES
        .iter()
        .map(|(name, _)| *name)
        .collect::<Vec<_>>()
        .join(", ")
}

/// Arguments of `abbe node`.
#[derive(Args)]
#[command(disable_help_flag = true)]
pub struct NodeVerb {
    /// Stop when standard input ends: for whoever starts nodes and may be killed.
    #[arg(long)]
    while_input_is_open: bool,
    /// Print help; after the name of a node, its parameters.
    #[arg(short, long)]
    help: bool,
    /// Which node.
    #[arg(required_unless_present = "help", value_parser = PossibleValuesParser::new(NODES.iter().map(|(name, _)| *name)))]
    name: Option<String>,
    /// Arguments as of any ROS 2 node: `--ros-args -r … -p … --params-file …`; `--help` lists the node's parameters.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<String>,
}

impl NodeVerb {
    /// Runs the node until it is stopped, or prints its parameters.
    ///
    /// # Errors
    /// When its table of parameters cannot be printed.
    pub fn execute(self) -> Result<ExitCode> {
        let Some(name) = self.name else {
            tell!("{}", usage::help_of("node").trim_end());
            return Ok(ExitCode::SUCCESS);
        };
        let build = builder(&name).expect("the argument is one of NODES");
        if self.help || self.arguments.first().is_some_and(|word| is_help(word)) {
            tell!("{}", parameters::help(&name, build)?.trim_end());
            return Ok(ExitCode::SUCCESS);
        }
        if self.while_input_is_open {
            std::thread::spawn(stop_at_end_of_input);
        }
        Ok(node_runtime::run_composed(vec![Composition {
            name,
            arguments: self.arguments,
            build: Box::new(build),
        }]))
    }
}

fn is_help(word: &str) -> bool {
    matches!(word, "-h" | "--help")
}

/// Waits for the end of standard input, then asks this process to stop as a terminal would.
fn stop_at_end_of_input() {
    // What is written there, and an error, mean nothing: either way it is over.
    let _ = std::io::copy(&mut std::io::stdin().lock(), &mut std::io::sink());
    let _ = raise(Signal::SIGTERM);
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use node_runtime::arguments::Arguments;

    use super::*;
    use crate::launch;

    /// Every node of every scenario: executable and setup.
    fn launched() -> Vec<(String, Setup)> {
        let home = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../launch_configs");
        let folders = std::fs::read_dir(&home)
            .unwrap()
            .map(|entry| entry.unwrap().path());
        let scenarios = folders
            .filter(|folder| folder.is_dir())
            .map(|folder| launch::find(&folder).unwrap());
        let hosts = ["controller", "models", "archive"]
            .map(|host| home.join(format!("three_hosts/hosts/three_hosts_{host}.launch.xml")));
        let nodes = scenarios
            .chain(hosts)
            .flat_map(|file| launch::read(&file).unwrap())
            // Built, it begins its bag.
            .filter(|node| node.exec != "recorder");
        nodes
            .map(|node| {
                let arguments = Arguments::parse(node.ros_args()).unwrap();
                let setup = Setup::new(&node.exec, &arguments).unwrap();
                (node.exec, setup)
            })
            .collect()
    }

    #[test]
    fn what_a_node_resolves_is_known_without_the_node_and_has_its_defaults() {
        let all = launched();
        assert!(all.iter().any(|(exec, _)| exec == "linuxcnc_bridge"));
        for (exec, setup) in all {
            let build = builder(&exec).unwrap();
            let resolved = setup.resolved_by(build).unwrap();
            let given = setup.parameters(&[]).unwrap();
            assert!(
                resolved.len() > given.len(),
                "{exec}: no default among {resolved:?}"
            );
            if exec != "linuxcnc_bridge" {
                assert_eq!(build(&setup).unwrap().parameters(), resolved, "{exec}");
            }
        }
    }
}
