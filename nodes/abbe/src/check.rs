//! `abbe check BAG`: a bag's results, computed again from its inputs.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, anyhow, bail};
use clap::Args;
use comfy_table::Table;
use comfy_table::presets::NOTHING;
use metrology::bound::Bound;
use metrology::epoch::utc_of_nanos;
use metrology::text::{self, Comments};
use node_runtime::arguments::Arguments;
use node_runtime::{Node, Setup};
use recorder::{Bag, RecordedRun, RunNode, verify_attachments};
use replayer::{Difference, Discrepancy, Doubtful, NotInBag, Outcome, Relay, ReplayError};
use reports::loss;
use reports::whole_file::Vanishing;
use serde_json::json;

use crate::diagnose::bags;
use crate::node;
use crate::tell::tell;
use crate::usage;

/// Nodes whose messages are what a replay puts in.
const SOURCE_NODES: [&str; 5] = [
    "fake_cnc",
    "linuxcnc_bridge",
    "mtconnect_bridge",
    "opcua_bridge",
    "sequencer",
];

/// Places at which fresh nodes take over: each is a copy of every node, made before the replay begins.
const RELAYS: Bound = Bound::at_most(100);

/// Arguments of `abbe check`.
#[derive(Args)]
pub struct Check {
    /// Folder of the bag.
    bag: PathBuf,
    /// Write the outcome as JSON to standard output.
    #[arg(long)]
    json: bool,
    /// Copy every node's state after so many messages of the bag into fresh nodes, which go on from there: the results
    /// stay the same where a state is whole. May be given up to 100 times.
    #[arg(long, value_name = "MESSAGES")]
    resume_after: Vec<u64>,
}

impl Check {
    /// Recomputes and compares. Exit code 1 when anything differs, 3 when a part of the bag was lost or left out, or its
    /// log times leap, and nothing differs before that.
    ///
    /// # Errors
    /// When the bag cannot be read, or was not recorded by a run in simulated time. With exit code 2 for more than 100
    /// values of `--resume-after`.
    pub fn execute(self) -> Result<ExitCode> {
        let place = || "--resume-after".to_owned();
        RELAYS
            .check_amount(place, "values", self.resume_after.len())
            .map_err(|error| usage::refused("check", error))?;
        let outcome = of(&self.bag, &self.resume_after)
            .with_context(|| format!("bag {}", self.bag.display()))?;
        if self.json {
            tell!("{:#}", as_json(&self.bag, &outcome));
        } else {
            tell!("{}", page(&self.bag, &outcome));
        }
        loss::complain_of(&outcome.reading);
        Ok(if outcome.is_equal() {
            loss::exit_code(outcome.reading.is_whole() && outcome.reading.leaps.is_none())
        } else {
            ExitCode::FAILURE
        })
    }
}

/// Replays the bag with the nodes, parameters and machine file that it carries, in fresh nodes after so many messages.
fn of(path: &Path, resume_after: &[u64]) -> Result<Outcome> {
    let bag = Bag::open(path)?;
    verify_attachments(&bag)?;
    // Where a file was cut, that is said with exit code 3.
    if bag.message_count() == 0 && bags::losses(&bag).is_empty() {
        bail!("holds no message: nothing can be computed again; check the whole recording");
    }
    let run = RecordedRun::of(&bag).ok_or(ReplayError::NoRun)?;
    if run.nodes.is_empty() && run.order == recorder::MessageOrder::Total {
        return Err(ReplayError::NoNodes.into());
    }
    let files = Vanishing::temporary().context("a folder for the bag's parameter files")?;
    if let Some(machine) = bag.attachment("machine.yaml")? {
        std::fs::write(files.path().join("machine.yaml"), machine.data)?;
    }
    let relay = |after_messages: &u64| {
        Ok(Relay {
            after_messages: *after_messages,
            nodes: build_all(&bag, &run, files.path())?,
        })
    };
    let relays = resume_after.iter().map(relay).collect::<Result<_>>()?;
    let nodes = build_all(&bag, &run, files.path())?;
    Ok(replayer::check(&bag, &run, nodes, relays)?)
}

/// The nodes of a run but its sources, as they were at its start.
fn build_all(bag: &Bag, run: &RecordedRun, files: &Path) -> Result<Vec<Box<dyn Node>>> {
    run.nodes
        .iter()
        .filter(|node| !SOURCE_NODES.contains(&node.executable.as_str()))
        .map(|node| build(bag, node, files).with_context(|| format!("node {}", node.name)))
        .collect()
}

/// A node as it ran, with the parameters in the bag.
fn build(bag: &Bag, ran: &RunNode, files: &Path) -> Result<Box<dyn Node>> {
    let name = format!("params/{}.yaml", ran.name);
    let Some(parameters) = bag.attachment(&name)? else {
        bail!("the bag has no attachment {name}");
    };
    let text = text::decode(&parameters.data, Comments::Yaml)
        .map_err(|wrong| anyhow!("attachment {name}:{wrong}"))?;
    let file = files.join(format!("{}.yaml", ran.name));
    std::fs::write(&file, parameter_file(&text))?;
    let words = [
        "--ros-args".to_owned(),
        "-r".to_owned(),
        format!("__node:={}", ran.name),
        "--params-file".to_owned(),
        file.display().to_string(),
    ];
    let setup = Setup::new(&ran.executable, &Arguments::parse(words)?)?;
    match node::builder(&ran.executable) {
        Some(build) => build(&setup),
        None => bail!(
            "executable \"{}\" is unknown (known: {})",
            ran.executable,
            node::names()
        ),
    }
}

/// Names and values as a ROS parameter file has them.
fn parameter_file(flat: &str) -> String {
    let mut file = "/**:\n  ros__parameters:\n".to_owned();
    for line in flat.lines() {
        file.push_str(&format!("    {line}\n"));
    }
    file
}

fn page(path: &Path, outcome: &Outcome) -> String {
    let mut table = Table::new();
    table.load_style(NOTHING);
    table.set_header(["topic", "compared", "differing"]);
    for (topic, compared) in &outcome.compared {
        table.add_row([
            topic.clone(),
            compared.messages.to_string(),
            compared.differing.to_string(),
        ]);
    }
    let compared: u64 = outcome.compared.values().map(|c| c.messages).sum();
    let verdict = match (&outcome.first, &outcome.doubtful) {
        (None, _) if outcome.compared_nothing() && !outcome.not_in_bag.is_empty() => format!(
            "nothing to compare: the bag has none of the topics that were computed ({})",
            listed(&outcome.not_in_bag)
        ),
        (None, None) if compared == 0 => "nothing to compare: no node of this run computes anything from what was recorded (controllers, \
             sequencer and recorder are not computed again, and topics are found by the names that they had in the run)"
            .to_owned(),
        (None, Some(Doubtful { messages, first })) => format!(
            "equal up to the first input that was lost or left out, or the first leap of the log times; {messages} messages behind it differ, which may come of that; first {}",
            in_words(first)
        ),
        (None, None) => format!(
            "equal: {compared} messages were computed again byte for byte from {} inputs",
            outcome.inputs
        ),
        (Some(first), _) => format!("differs; first {}", in_words(first)),
    };
    let skipped = match outcome.reading.leaps.line() {
        Some(line) => format!("\n{line}: no timer ran through a leap"),
        None => String::new(),
    };
    let absent = if outcome.compared_nothing() {
        String::new()
    } else {
        absent(&outcome.not_in_bag)
    };
    format!(
        "{}\n\n{table}\n\n{verdict}{skipped}{absent}",
        path.display()
    )
}

/// The computed topics that the bag lacks, each with the number of its messages; empty: it lacks none.
fn absent(not_in_bag: &BTreeMap<String, NotInBag>) -> String {
    if not_in_bag.is_empty() {
        return String::new();
    }
    let topics = not_in_bag.iter().map(|(topic, sum)| {
        let plural = if sum.messages == 1 { "" } else { "s" };
        format!("{topic} ({} message{plural})", sum.messages)
    });
    let topics: Vec<String> = topics.collect();
    format!(
        "\ncomputed, and absent from the bag: {}; where they were recorded, the bag is not whole",
        topics.join(", ")
    )
}

fn listed(not_in_bag: &BTreeMap<String, NotInBag>) -> String {
    let topics: Vec<&str> = not_in_bag.keys().map(String::as_str).collect();
    topics.join(", ")
}

fn in_words(difference: &Difference) -> String {
    let at = utc_of_nanos(difference.at_nanos, 9);
    let place = format!(
        "on {}, message {}, at {at}",
        difference.topic, difference.message
    );
    match &difference.discrepancy {
        Discrepancy::Field {
            field,
            recorded,
            computed,
            ulps,
        } => {
            let distance = ulps.map_or_else(String::new, |ulps| format!(" ({ulps} ulp apart)"));
            format!("{place}: {field}: recorded {recorded}, computed {computed}{distance}")
        }
        Discrepancy::Bytes => format!("{place}: equal values in other bytes"),
        Discrepancy::NotComputed => format!("{place}: recorded, and not computed again"),
        Discrepancy::NotRecorded => format!("{place}: computed, and not in the bag"),
        Discrepancy::Order => format!("{place}: recorded in another order than it was computed"),
        Discrepancy::Unreadable { reason } => format!("{place}: {reason}"),
    }
}

fn as_json(path: &Path, outcome: &Outcome) -> serde_json::Value {
    let losses = outcome.reading.losses.iter();
    let losses: Vec<String> = losses.map(ToString::to_string).collect();
    json!({
        "schema": "abbe.check/1",
        "bag": path.display().to_string(),
        "equal": outcome.is_equal() && outcome.doubtful.is_none(),
        "inputs": outcome.inputs,
        "compared": outcome.compared,
        "not_in_bag": outcome.not_in_bag,
        "first_difference": outcome.first,
        "doubtful": outcome.doubtful,
        "losses": losses,
        "loss": loss::as_json(&outcome.reading),
        "leaps": loss::leaps_as_json(&outcome.reading.leaps),
        "account": loss::account_as_json(&outcome.reading.account),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_copies_of_the_nodes_than_a_hundred_are_refused_before_the_bag_is_opened() {
        let check = Check {
            bag: PathBuf::from("no such bag"),
            json: false,
            resume_after: vec![1; 101],
        };
        let refused = check.execute().unwrap_err();
        assert!(
            refused.downcast_ref::<clap::Error>().is_some(),
            "{refused:#}"
        );
        let words = refused.to_string();
        assert!(
            words.contains("--resume-after: 101 values: at most 100"),
            "{words}"
        );
    }

    #[test]
    fn a_bag_without_a_computed_topic_is_not_equal_and_why_is_said() {
        let nothing = Outcome::default();
        assert!(!nothing.is_equal());
        let words = page(Path::new("bag"), &nothing);
        assert!(words.contains("nothing to compare: no node"), "{words}");
        assert_eq!(as_json(Path::new("bag"), &nothing)["equal"], false);
        let sum = NotInBag {
            messages: 3,
            sha256: String::new(),
        };
        let not_in_bag = Outcome {
            not_in_bag: BTreeMap::from([("/latency".to_owned(), sum)]),
            ..Outcome::default()
        };
        assert!(!not_in_bag.is_equal());
        let words = page(Path::new("bag"), &not_in_bag);
        assert!(words.contains("were computed (/latency)"), "{words}");
    }

    #[test]
    fn computed_topics_that_the_bag_lacks_are_named_beside_equal_ones() {
        let sum = |messages| NotInBag {
            messages,
            sha256: String::new(),
        };
        let mut outcome = Outcome::default();
        outcome
            .compared
            .entry("/tf".to_owned())
            .or_default()
            .messages = 7;
        let path = Path::new("bag");
        assert!(!page(path, &outcome).contains("absent"));
        outcome.not_in_bag = BTreeMap::from([
            ("/latency".to_owned(), sum(1)),
            ("/thermal/model".to_owned(), sum(3)),
        ]);
        let words = page(path, &outcome);
        let wanted = "computed, and absent from the bag: /latency (1 message), /thermal/model (3 messages); ";
        assert!(words.contains(wanted), "{words}");
    }

    #[test]
    fn recorded_parameters_become_a_parameter_file() {
        let file = parameter_file("a: 1.0\nb:\n- c: 2\n");
        assert_eq!(
            file,
            "/**:\n  ros__parameters:\n    a: 1.0\n    b:\n    - c: 2\n"
        );
    }
}
