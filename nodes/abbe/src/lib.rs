//! The command line of Abbe: one verb a file.
//!
//! A library, so that the program of the blind trials reads bags and writes pages in the same way.
#![cfg_attr(not(test), warn(clippy::print_stderr))]
#![expect(
    clippy::disallowed_methods,
    reason = "the command line reads files, clocks and the environment for everybody else"
)]

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use node_runtime::complain;
use node_runtime::complaint;
use reports::screen::Software;

mod alarm;
mod check;
mod completions;
pub mod diagnose;
mod export;
mod history;
pub mod import;
mod import_map;
mod import_shift;
mod install_ros;
mod keystore;
mod launch;
mod man;
mod new_machine;
mod node;
mod pdf;
mod play;
pub mod preflight;
mod progress;
mod record;
mod report_bag;
mod run;
mod scenario;
mod schema;
mod serve;
pub mod tell;
mod truth;
mod usage;
mod validate;
#[cfg(test)]
mod wrong_files;

/// Commit that this program was built from; `unknown` outside a clone.
pub const COMMIT: &str = env!("ABBE_COMMIT");
/// This program, for its reports.
const SOFTWARE: Software = Software {
    version: env!("CARGO_PKG_VERSION"),
    commit: COMMIT,
};

/// Measures a CNC machine, models its errors, compensates its axes and records every run.
#[derive(Parser)]
#[command(version, arg_required_else_help = true)]
struct Arguments {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    /// Run a scenario: its nodes, its plan, a bag and a page at the end.
    Run(run::Run),
    /// Evaluate the tests that a bag holds.
    Report(report_bag::ReportBag),
    /// Compute a bag's results again from its inputs and compare them byte for byte.
    Check(check::Check),
    /// Say where simulator and machine differ, which effect causes it, and how far it shrinks.
    Diagnose(diagnose::Diagnose),
    /// Tell what a plan's recordings will determine, before they are made, and what to add.
    Preflight(preflight::Preflight),
    /// Check scenarios and single files, and print every mistake with its place; nothing is run.
    Validate(validate::Validate),
    /// Print the JSON Schema of a file that people write, for editors.
    Schema(schema::Schema),
    /// Write a commented machine file to begin with.
    NewMachine(new_machine::NewMachine),
    /// Record topics of the ROS graph into a bag.
    Record(record::Record),
    /// Publish a bag's messages again, with `/clock`, at any rate.
    Play(play::Play),
    /// Make a bag of a table that a laser, a ballbar or a logger wrote.
    Import(import::Import),
    /// Propose a mapping for mtconnect_bridge from an agent's `probe`, or for opcua_bridge from a server.
    ImportMap(import_map::ImportMap),
    /// Make part programs that load a machine as a logged shift loaded another.
    ImportShift(import_shift::ImportShift),
    /// Keep figures of reports and diagnoses, and show trends, change points and limits of each machine.
    History(history::History),
    /// Make compensation tables for a control from what a bag knows.
    Export(export::Export),
    /// Run one node on the ROS graph, with the arguments of any ROS 2 node.
    Node(node::NodeVerb),
    /// Serve a live view of a cell to browsers, from its topics; it moves nothing.
    Serve(serve::Serve),
    /// Install the nodes and scenarios as a ROS 2 package, for `ros2 run` and `ros2 launch`.
    InstallRos(install_ros::InstallRos),
    /// Make credentials of DDS Security for the nodes of scenarios.
    Keystore(keystore::Keystore),
    /// Print what a shell completes.
    Completions(completions::Completions),
    /// Write the manual pages.
    Man(man::Man),
}

/// Runs the verb that the process's arguments name.
#[must_use]
pub fn execute() -> ExitCode {
    let outcome = match Arguments::parse().verb {
        Verb::Run(run) => run.execute(),
        Verb::Report(report) => report.execute(),
        Verb::Check(check) => check.execute(),
        Verb::Diagnose(diagnose) => diagnose.execute(),
        Verb::Preflight(preflight) => preflight.execute(),
        Verb::Record(record) => record.execute(),
        Verb::Play(play) => play.execute(),
        Verb::Import(import) => import.execute(),
        Verb::ImportMap(import) => import.execute(),
        Verb::ImportShift(import) => import.execute(),
        Verb::History(history) => history.execute(),
        Verb::Export(export) => export.execute(),
        Verb::Node(node) => node.execute(),
        Verb::Serve(serve) => serve.execute(),
        Verb::InstallRos(install) => install.execute(),
        Verb::Keystore(keystore) => keystore.execute(),
        Verb::Validate(validate) => validate.execute(),
        Verb::NewMachine(new) => new.execute(),
        Verb::Schema(schema) => schema.execute(),
        Verb::Completions(completions) => completions.execute(),
        Verb::Man(man) => man.execute(),
    };
    outcome.unwrap_or_else(|error| report_failure("abbe", &error))
}

/// Prints why a program failed; its exit code is 2 when the arguments are wrong, else 1.
#[must_use]
pub fn report_failure(program: &str, error: &anyhow::Error) -> ExitCode {
    if let Some(refusal) = error.downcast_ref::<clap::Error>() {
        // Where nobody reads standard error, the exit code alone tells it.
        let _ = refusal.print();
        return ExitCode::from(usage::USAGE);
    }
    complain!("{program}: {}", complaint::in_words(error));
    ExitCode::FAILURE
}
