//! Who may depend on whom.

use crate::check;
use crate::packages::{self, Package};
use crate::tree::{self, PURE};

/// What speaks ROS.
const ROS: [&str; 4] = ["ros2-client", "rustdds", "zenoh", "zenoh-ext"];

/// What a pure crate never reaches: ROS, its middlewares and wire, runtimes, logs and clocks.
const IMPURE: [&str; 12] = [
    "ros2-client",
    "rustdds",
    "zenoh",
    "abbe_msgs",
    "node_runtime",
    "tokio",
    "tracing",
    "tracing-subscriber",
    "log",
    "nix",
    "chrono",
    "mcap",
];

/// What nodes share.
const VOCABULARY: [&str; 6] = [
    "metrology",
    "iso230",
    "machine",
    "machine_report",
    "twin",
    "control_tables",
];

/// Libraries that are not for every node, with the only crates that may depend on each.
const USERS: [(&str, &[&str]); 5] = [
    ("iso230", &["reports", "abbe", "abbe_fuzz"]),
    (
        "machine_report",
        &["mtconnect_bridge", "opcua_bridge", "opcua_bridge_node"],
    ),
    ("twin", &["gap_diagnosis", "reports", "abbe", "abbe_trials"]),
    ("reports", &["abbe", "abbe_trials"]),
    ("control_tables", &["abbe"]),
];

/// Who composes nodes.
const COMPOSERS: [&str; 2] = ["abbe", "abbe_tests"];

fn speaks_ros(members: &[Package]) -> Vec<String> {
    let mut found = Vec::new();
    for member in members
        .iter()
        .filter(|member| member.name != "node_runtime")
    {
        for dependency in &member.dependencies {
            if ROS.contains(&dependency.name.as_str()) {
                found.push(format!(
                    "{}: depends on {}: only node_runtime may",
                    member.folder(),
                    dependency.name
                ));
            }
        }
    }
    found
}

#[test]
fn arch_node_runtime_alone_depends_on_ros() {
    let members = packages::members();
    check(&speaks_ros(&members));
    let bad = [packages::example("nodes/probe/node", &["ros2-client"])];
    assert_eq!(
        speaks_ros(&bad),
        ["nodes/probe/node: depends on ros2-client: only node_runtime may"]
    );
}

fn impure(members: &[Package]) -> Vec<String> {
    let locked = packages::locked();
    let mut found = Vec::new();
    for member in members
        .iter()
        .filter(|member| PURE.contains(&member.name.as_str()))
    {
        let reached = packages::reach(member, members, &locked);
        for name in IMPURE.iter().filter(|name| reached.contains(**name)) {
            found.push(format!("{}: reaches {name}", member.folder()));
        }
        let product = member
            .dependencies
            .iter()
            .filter(|need| need.kind.is_none());
        for need in product.filter(|need| need.name == "rand") {
            let is_entropy = |feature: &String| feature == "os_rng" || feature == "thread_rng";
            if need.uses_default_features || need.features.iter().any(is_entropy) {
                found.push(format!("{}: rand with entropy", member.folder()));
            }
        }
    }
    found
}

#[test]
fn arch_pure_crates_reach_no_ros_runtime_log_or_entropy() {
    let members = packages::members();
    for name in PURE {
        assert!(members.iter().any(|member| member.name == name), "{name}");
    }
    check(&impure(&members));
    let bad = [packages::example(
        "nodes/probe",
        &["rand", "serde", "tracing"],
    )];
    // The client of opcua_bridge builds `tracing` with its `log`.
    assert_eq!(
        impure(&bad),
        [
            "nodes/probe: reaches tracing",
            "nodes/probe: reaches log",
            "nodes/probe: rand with entropy"
        ]
    );
}

/// The form of a bag is the recorder's library: whoever replays reads it there.
fn may_read(own: Option<&str>, need: &str) -> bool {
    own == Some("replayer") && need == "recorder"
}

/// The node whose library or shell a package is.
fn node_of(name: &str, nodes: &[String]) -> Option<String> {
    let node = name.strip_suffix("_node").unwrap_or(name);
    nodes.iter().find(|known| *known == node).cloned()
}

fn between_nodes(members: &[Package], nodes: &[String]) -> Vec<String> {
    let mut found = Vec::new();
    for member in members {
        let own = node_of(&member.name, nodes);
        let composes = COMPOSERS.contains(&member.name.as_str());
        for need in member.needs() {
            let is_shell = members
                .iter()
                .any(|other| other.name == need && other.is_shell());
            let other = node_of(need, nodes);
            let shares = VOCABULARY.contains(&member.name.as_str());
            if is_shell && !composes {
                found.push(format!(
                    "{}: depends on shell {need}: only nodes/abbe composes nodes",
                    member.folder()
                ));
            } else if other.is_some()
                && own != other
                && (own.is_some() || shares)
                && !may_read(own.as_deref(), need)
            {
                found.push(format!("{}: depends on node {need}", member.folder()));
            }
        }
    }
    found
}

#[test]
fn arch_no_node_depends_on_another_and_only_abbe_on_shells() {
    check(&between_nodes(&packages::members(), &tree::nodes()));
    let nodes = ["probe".to_owned(), "recorder".to_owned()];
    let bad = [
        packages::example("nodes/probe", &["recorder", "machine"]),
        packages::example("nodes/probe/node", &["probe"]),
        packages::example("nodes/libraries/machine", &["probe"]),
        packages::example("nodes/libraries/node_runtime", &["probe_node"]),
        packages::example("nodes/abbe", &["probe_node"]),
    ];
    assert_eq!(
        between_nodes(&bad, &nodes),
        [
            "nodes/probe: depends on node recorder",
            "nodes/libraries/machine: depends on node probe",
            "nodes/libraries/node_runtime: depends on shell probe_node: only nodes/abbe composes nodes",
        ]
    );
}

fn not_for(members: &[Package]) -> Vec<String> {
    let mut found = Vec::new();
    for member in members {
        for (library, users) in USERS {
            let is_needed = member.needs().any(|need| need == library);
            if is_needed && !users.contains(&member.name.as_str()) {
                found.push(format!(
                    "{}: depends on {library}: only {} may",
                    member.folder(),
                    users.join(", ")
                ));
            }
        }
    }
    found
}

#[test]
fn arch_libraries_are_used_by_those_they_are_for() {
    let members = packages::members();
    for (library, users) in USERS {
        for user in users {
            let has = |member: &Package| member.needs().any(|need| need == library);
            let is_user = |member: &&Package| member.name == *user;
            assert!(members.iter().find(is_user).is_some_and(has), "{user}");
        }
    }
    check(&not_for(&members));
    let bad = [
        packages::example("nodes/libraries/machine", &["twin"]),
        packages::example("nodes/gap_diagnosis", &["twin"]),
    ];
    assert_eq!(
        not_for(&bad),
        [
            "nodes/libraries/machine: depends on twin: only gap_diagnosis, reports, abbe, abbe_trials may"
        ]
    );
}
