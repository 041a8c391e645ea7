//! Which enclaves the nodes of scenarios and the players of bags need, and what each may do.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use abbe_msgs::topics;
use anyhow::{Context, Result, bail};
use node_runtime::Setup;
use node_runtime::access::Access;
use node_runtime::arguments::Arguments;
use node_runtime::names::NodeNames;
use node_runtime::node::Ports;
use replayer::PlaybackConfig;

use crate::launch::LaunchNode;
use crate::node;
use crate::play::PLAYER_NAME as PLAYER;
use crate::scenario::Scenario;

/// One enclave.
pub struct Enclave {
    /// As ROS names it.
    pub name: String,
    /// What its holder may do.
    pub access: Access,
}

/// Listeners of this program itself.
const LISTENERS: [&str; 2] = ["/abbe_run_tap", "/abbe_record"];
const VIEWER: &str = "/viewer";
const OPERATOR: &str = "/operator";
/// Begins its bag when it is built.
const RECORDER: &str = "recorder";
/// Starts its controller when it is built, unless it is told to wait.
const STARTER: &str = "linuxcnc_bridge";
const WAIT: [&str; 2] = ["-p", "autostart:=false"];

/// Enclaves of every node of some scenarios, of a player of some bags, of those who listen, and of an operator.
///
/// # Errors
/// When a scenario, a node's parameters, or a bag cannot be read.
pub fn of(folders: &[PathBuf], bags: &[PathBuf]) -> Result<Vec<Enclave>> {
    let mut all = BTreeMap::<String, Access>::new();
    let mut add = |name: String, access: Access| {
        let known = all.remove(&name);
        let access = known.map_or_else(|| access.clone(), |known| known.and(access.clone()));
        all.insert(name, access);
    };
    for folder in folders {
        let scenario = Scenario::read(folder)?;
        for launched in &scenario.nodes {
            let context = || format!("node {}", launched.name);
            let (name, access) = of_node(launched).with_context(context)?;
            if launched.exec == RECORDER {
                add(format!("/{}_tap", launched.name), Access::to_listen());
            }
            add(name, access);
        }
    }
    for bag in bags {
        for (name, access) in of_player(bag).with_context(|| bag.display().to_string())? {
            add(name, access);
        }
    }
    for name in LISTENERS {
        add(name.to_owned(), Access::to_listen());
    }
    add(VIEWER.to_owned(), Access::to_view());
    add(OPERATOR.to_owned(), Access::to_operate());
    let enclave = |(name, access)| Enclave { name, access };
    Ok(all.into_iter().map(enclave).collect())
}

fn of_node(launched: &LaunchNode) -> Result<(String, Access)> {
    let wait = (launched.exec == STARTER).then_some(WAIT).into_iter();
    let wait = wait.flatten().map(ToOwned::to_owned);
    let arguments = Arguments::parse(launched.ros_args().into_iter().chain(wait))?;
    let names = NodeNames::new(&launched.exec, &arguments.remaps)?;
    let Some(build) = node::builder(&launched.exec) else {
        bail!(
            "exec \"{}\" is unknown (known: {})",
            launched.exec,
            node::names()
        );
    };
    if launched.exec == RECORDER {
        let mut access = Access::of(&names, &Ports::default())?;
        let save = names.resolve(topics::SAVE_RECORDING.name)?;
        access.serves(&save);
        return Ok((names.fully_qualified(), access));
    }
    let built = build(&Setup::new(&launched.exec, &arguments)?)?;
    Ok((names.fully_qualified(), Access::of(&names, built.ports())?))
}

/// The participants of a player of one bag: they write the bag's topics, whoever wrote them when it was recorded.
fn of_player(bag: &Path) -> Result<[(String, Access); 2]> {
    let names = NodeNames::new(PLAYER, &[])?;
    let bag = bag.to_str().context("must be UTF-8")?;
    replayer_node::access(&names, &PlaybackConfig::whole(bag.to_owned()))
}

#[cfg(test)]
mod tests {

    use super::*;

    #[test]
    fn only_axis_compensation_and_its_machine_touch_the_compensation() {
        let home = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../launch_configs");
        let folders: Vec<PathBuf> = std::fs::read_dir(home)
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .filter(|folder| folder.join("scenario.yaml").is_file())
            .collect();
        assert!(folders.len() > 10);
        let all = of(&folders, &[]).unwrap();
        let writers = all.iter().filter(|enclave| {
            enclave
                .access
                .publish
                .iter()
                .any(|t| t == "rt/compensation")
        });
        let writers: Vec<&str> = writers.map(|enclave| enclave.name.as_str()).collect();
        assert_eq!(writers, ["/axis_compensation"]);
        for enclave in &all {
            let is_free = enclave
                .access
                .publish
                .iter()
                .any(|topic| topic == "*" || topic == "rt/*");
            assert!(!is_free, "{}", enclave.name);
        }
    }

    #[test]
    fn a_player_may_write_what_its_bag_holds_and_the_time() {
        let bag = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../bags/cold_reference");
        let all = of(&[], &[bag]).unwrap();
        let voice = all.iter().find(|enclave| enclave.name == "/replayer_voice");
        let access = &voice.unwrap().access;
        for topic in ["rt/axes/state", "rt/clock"] {
            assert!(access.publish.contains(topic), "{access:?}");
        }
        assert!(!access.publish.contains("*") && !access.publish.contains("rt/*"));
        let node = all.iter().find(|enclave| enclave.name == "/probe");
        assert!(node.is_none());
    }
}
