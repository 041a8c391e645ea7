//! Scenarios are whole, and the plant's truth is named by the fake machine alone.

use std::collections::BTreeMap;

use axis_compensation::AxisCompensationConfig;

use crate::check;
use crate::parameters;
use crate::tree;

const FOLDER: &str = "launch_configs";

/// A launch file's nodes: executable, and its parameter files below the scenario's folder.
fn launched(xml: &str) -> Vec<(String, Vec<String>)> {
    let document = roxmltree::Document::parse(xml).unwrap();
    let nodes = document
        .descendants()
        .filter(|element| element.has_tag_name("node"));
    nodes
        .map(|node| {
            let params = node.children().filter(|child| child.has_tag_name("param"));
            let files = params.filter_map(|param| param.attribute("from"));
            let exec = node.attribute("exec").unwrap_or_default().to_owned();
            let below = |from: &str| from.trim_start_matches("$(dirname)/").to_owned();
            (exec, files.map(below).collect())
        })
        .collect()
}

/// Launch files of a scenario itself, without those of single hosts below it.
fn launch_files(scenario: &str) -> impl Iterator<Item = tree::File> {
    let folder = format!("{FOLDER}/{scenario}");
    let files = tree::files(&folder, ".launch.xml").into_iter();
    files.filter(move |file| !file.path[folder.len() + 1..].contains('/'))
}

fn incomplete(scenario: &str, xml: &[String], has: &dyn Fn(&str) -> bool) -> Vec<String> {
    let place = format!("{FOLDER}/{scenario}");
    let mut found = Vec::new();
    for file in ["scenario.yaml", "machine.yaml"] {
        if !has(&format!("{place}/{file}")) {
            found.push(format!("{place}: no {file}"));
        }
    }
    if xml.len() != 1 {
        found.push(format!("{place}: {} launch files: must be one", xml.len()));
    }
    for (exec, files) in xml.iter().flat_map(|xml| launched(xml)) {
        if !has(&format!("nodes/{exec}/node")) {
            found.push(format!("{place}: launches {exec}: no such node"));
        }
        for file in files.iter().filter(|file| !has(&format!("{place}/{file}"))) {
            found.push(format!("{place}: {exec}: no {file}"));
        }
    }
    found
}

#[test]
fn arch_every_scenario_is_whole() {
    let scenarios = tree::folders(FOLDER);
    assert!(!scenarios.is_empty());
    let mut found = Vec::new();
    for scenario in scenarios {
        let xml: Vec<String> = launch_files(&scenario).map(|file| file.text).collect();
        found.extend(incomplete(&scenario, &xml, &tree::has));
    }
    check(&found);
    let xml = "<launch><node pkg='abbe' exec='lathe'><param from='$(dirname)/lathe.yaml'/></node></launch>";
    assert_eq!(
        incomplete("bad", &[xml.to_owned()], &|path| path
            .ends_with("machine.yaml")),
        [
            "launch_configs/bad: no scenario.yaml",
            "launch_configs/bad: launches lathe: no such node",
            "launch_configs/bad: lathe: no lathe.yaml",
        ]
    );
}

/// Parameters of a ROS parameter file, dotted names; a map stays a map unless `known` has names below it.
fn set_parameters(yaml: &str) -> Vec<String> {
    let Ok(file) = serde_saphyr::from_str::<BTreeMap<String, serde_json::Value>>(yaml) else {
        return Vec::new();
    };
    let mut names = Vec::new();
    for node in file.values() {
        flatten(&node["ros__parameters"], "", &mut names);
    }
    names
}

fn flatten(value: &serde_json::Value, before: &str, names: &mut Vec<String>) {
    let Some(map) = value.as_object() else {
        names.push(before.to_owned());
        return;
    };
    for (key, value) in map {
        let name = if before.is_empty() {
            key.clone()
        } else {
            format!("{before}.{key}")
        };
        flatten(value, &name, names);
    }
}

/// Parameters that the runtime gives to every node.
const OF_EVERY_NODE: [&str; 2] = ["use_sim_time", "clock_host"];

fn unknown_parameters(path: &str, yaml: &str, known: &[String]) -> Vec<String> {
    let set = set_parameters(yaml).into_iter();
    let unknown =
        set.filter(|name| !known.contains(name) && !OF_EVERY_NODE.contains(&name.as_str()));
    unknown
        .map(|name| format!("{path}: {name}: the node has no such parameter"))
        .collect()
}

#[test]
fn arch_parameter_files_set_only_what_their_node_has() {
    let mut found = Vec::new();
    for scenario in tree::folders(FOLDER) {
        for node in tree::nodes() {
            let path = format!("{FOLDER}/{scenario}/{node}.yaml");
            if let Some(yaml) = tree::text(&path) {
                let known = parameters::names(&node);
                found.extend(unknown_parameters(&path, &yaml, &known));
            }
        }
    }
    check(&found);
    let yaml = "/**:\n  ros__parameters:\n    axes: {X: {limit_um: 1.0}}\n    rate: 3\n    use_sim_time: true\n";
    assert_eq!(
        unknown_parameters("a.yaml", yaml, &["axes.X.limit_um".to_owned()]),
        ["a.yaml: rate: the node has no such parameter"]
    );
}

/// What a node's last words and its farewell on the graph take at most, s.
const FAREWELL_S: f64 = 2.5;
/// How long a node that has something to wind down may take where it does not say otherwise, s.
const USUAL_WIND_DOWN_S: f64 = 5.0;

/// How long the nodes of a launch file need to end, where that is said by `of` them, against what
/// `ros2 launch` waits before it does worse than SIGINT.
fn cut_short(path: &str, xml: &str, of: &dyn Fn(&str) -> Option<f64>) -> Vec<String> {
    let document = roxmltree::Document::parse(xml).unwrap();
    let nodes = document
        .descendants()
        .filter(|element| element.has_tag_name("node"));
    let mut found = Vec::new();
    for node in nodes {
        let exec = node.attribute("exec").unwrap_or_default();
        let Some(wind_down_s) = of(exec) else {
            continue;
        };
        let least_s = wind_down_s + FAREWELL_S;
        let said = node.attribute("sigterm_timeout").map(str::parse::<f64>);
        if !matches!(said, Some(Ok(said_s)) if said_s >= least_s) {
            found.push(format!(
                "{path}: {exec}: sigterm_timeout must be at least {least_s:.1} s"
            ));
        }
        if !matches!(node.attribute("sigkill_timeout").map(str::parse::<f64>), Some(Ok(more_s)) if more_s >= FAREWELL_S)
        {
            found.push(format!(
                "{path}: {exec}: sigkill_timeout must be at least {FAREWELL_S} s"
            ));
        }
    }
    found
}

/// Time that a node of `scenario` may need to wind down by its parameters; `None`: it ends at once.
fn wind_down_s(scenario: &str, exec: &str) -> Option<f64> {
    let shell = tree::text(&format!("nodes/{exec}/node/src/lib.rs")).unwrap_or_default();
    if !shell.contains(".shutdown(") {
        return None;
    }
    if exec != "axis_compensation" {
        return Some(USUAL_WIND_DOWN_S);
    }
    let path = format!("{FOLDER}/{scenario}/{exec}.yaml");
    let yaml = tree::text(&path).unwrap();
    let mut file: BTreeMap<String, serde_json::Value> = serde_saphyr::from_str(&yaml).unwrap();
    let mut parameters = file.remove("/**").unwrap()["ros__parameters"].take();
    for own in OF_EVERY_NODE {
        parameters.as_object_mut().unwrap().remove(own);
    }
    let config: AxisCompensationConfig = serde_json::from_value(parameters).unwrap();
    // A busy computer adds to it: axis_compensation's shell counts a second.
    Some(config.wind_down_s() + 1.0)
}

#[test]
fn arch_launch_files_let_every_node_wind_down() {
    let mut found = Vec::new();
    for scenario in tree::folders(FOLDER) {
        for file in tree::files(&format!("{FOLDER}/{scenario}"), ".launch.xml") {
            let of = |exec: &str| wind_down_s(&scenario, exec);
            found.extend(cut_short(&file.path, &file.text, &of));
        }
    }
    check(&found);
    let bad = |attributes: &str| {
        let xml = format!(
            "<launch><node pkg='abbe' exec='probe'/><node pkg='abbe' exec='lathe' {attributes}/></launch>"
        );
        cut_short("a.xml", &xml, &|exec| (exec == "lathe").then_some(9.4)).len()
    };
    assert_eq!(bad(""), 2);
    assert_eq!(bad("sigterm_timeout='5' sigkill_timeout='5'"), 1);
    assert_eq!(bad("sigterm_timeout='12' sigkill_timeout='5'"), 0);
    assert!(wind_down_s("first_run", "axis_compensation").unwrap() > 9.0);
}

/// Whether a file beside the fake machine's own names a plant file.
fn tells_of_the_plant(path: &str, yaml: &str) -> Option<String> {
    let own = path.ends_with("/fake_cnc.yaml") || path.ends_with("/plant.yaml");
    let tells = yaml.contains("plant_file") || yaml.contains("plant.yaml");
    (tells && !own).then(|| format!("{path}: names the plant file: fake_cnc.yaml alone may"))
}

#[test]
fn arch_only_the_fake_machine_reads_the_plants_truth() {
    let mut files = tree::files(FOLDER, ".yaml");
    files.extend(tree::files(FOLDER, ".xml"));
    let told = files
        .iter()
        .filter_map(|file| tells_of_the_plant(&file.path, &file.text));
    check(&told.collect::<Vec<_>>());
    assert!(tells_of_the_plant("launch_configs/a/probe.yaml", "plant_file: p.yaml").is_some());
    assert!(tells_of_the_plant("launch_configs/a/fake_cnc.yaml", "plant_file: p.yaml").is_none());
}

/// Largest recorded bag that the tree carries, bytes.
const LARGEST_BAG_BYTES: usize = 1 << 20;

fn unlisted(readme: &str, files: &[(String, usize)]) -> Vec<String> {
    let mut found = Vec::new();
    for (path, bytes) in files {
        let name = path.trim_start_matches("bags/");
        if name != "README.md" && !readme.contains(name) {
            found.push(format!("{path}: bags/README.md does not list it"));
        }
        if *bytes > LARGEST_BAG_BYTES {
            found.push(format!(
                "{path}: {bytes} bytes: at most {LARGEST_BAG_BYTES}"
            ));
        }
    }
    found
}

#[test]
fn arch_every_bag_is_listed_with_its_making() {
    let readme = tree::text("bags/README.md");
    assert!(readme.is_some(), "bags/README.md: is missing");
    let size = |path: String| {
        let bytes = std::fs::read(tree::root().join(&path)).unwrap().len();
        (path, bytes)
    };
    let files: Vec<_> = tree::paths("bags").into_iter().map(size).collect();
    check(&unlisted(&readme.unwrap_or_default(), &files));
    let bad = [("bags/a/a_0.mcap".to_owned(), 2 << 20)];
    assert_eq!(unlisted("", &bad).len(), 2);
    assert_eq!(unlisted("`a/a_0.mcap`", &bad).len(), 1);
}

/// What the launch file of a host has: executables with their parameter file, and whatever names another host.
fn of_host(host: &str, text: &dyn Fn(&str) -> Option<String>) -> (Vec<String>, Vec<String>) {
    let path = format!("{FOLDER}/three_hosts/hosts/three_hosts_{host}.launch.xml");
    let (mut nodes, mut found) = (Vec::new(), Vec::new());
    for (exec, files) in launched(&text(&path).unwrap_or_default()) {
        for file in files.iter().map(|file| file.trim_start_matches("../")) {
            nodes.push(format!("{exec} {file}"));
            let yaml = text(&format!("{FOLDER}/three_hosts/{file}"));
            let yaml = yaml.unwrap_or_default();
            let mut said = yaml.lines().filter_map(|line| {
                let (key, value) = line.trim().split_once(": ")?;
                ["host", "clock_host"].contains(&key).then_some(value)
            });
            match said.next() {
                Some(named) if named == host => {}
                None if host == "controller" => {}
                named => found.push(format!("{path}: {file}: host {named:?}")),
            }
        }
    }
    (nodes, found)
}

#[test]
fn arch_the_hosts_of_a_cell_launch_together_what_the_cell_launches_and_an_archive() {
    let (mut nodes, mut found) = (Vec::new(), Vec::new());
    for host in ["controller", "models", "archive"] {
        let (of_host, wrong) = of_host(host, &tree::text);
        nodes.extend(of_host);
        found.extend(wrong);
    }
    check(&found);
    let cell = launch_files("three_hosts").next().unwrap().text;
    let whole = launched(&cell).into_iter();
    let mut expected: Vec<String> = whole
        .flat_map(|(exec, files)| files.into_iter().map(move |file| format!("{exec} {file}")))
        .chain(["host_clock clock_of_archive.yaml", "recorder recorder.yaml"].map(str::to_owned))
        .collect();
    nodes.sort();
    expected.sort();
    assert_eq!(nodes, expected);
    let wrong = of_host("models", &|path| {
        Some(if path.ends_with(".xml") {
            "<launch><node exec='probe'><param from='$(dirname)/../probe.yaml'/></node></launch>"
                .to_owned()
        } else {
            "    clock_host: archive\n".to_owned()
        })
    });
    assert_eq!(wrong.1.len(), 1);
}

/// Files of one name that have one text, which a `base` would share.
fn copies(files: &[tree::File]) -> Vec<String> {
    let mut known: BTreeMap<(&str, &str), &str> = BTreeMap::new();
    let mut found = Vec::new();
    for file in files {
        let name = file.path.rsplit('/').next().unwrap();
        match known.insert((name, file.text.as_str()), &file.path) {
            Some(other) if !file.text.contains("base: ") => found.push(format!(
                "{}: is {other} again: base: PATH shares it",
                file.path
            )),
            _ => {}
        }
    }
    found
}

#[test]
fn arch_scenarios_share_machines_and_plants() {
    let mut files = tree::files(FOLDER, "/machine.yaml");
    files.extend(tree::files(FOLDER, "/plant.yaml"));
    assert!(files.len() > 30, "{}", files.len());
    check(&copies(&files));
    let file = |path: &str, text: &str| tree::File {
        path: path.to_owned(),
        text: text.to_owned(),
    };
    let bad = [
        file("a/plant.yaml", "seed: 1\n"),
        file("b/plant.yaml", "seed: 1\n"),
        file("c/machine.yaml", "seed: 1\n"),
        file("d/machine.yaml", "base: ../c/machine.yaml\n"),
        file("e/machine.yaml", "base: ../c/machine.yaml\n"),
    ];
    assert_eq!(
        copies(&bad),
        ["b/plant.yaml: is a/plant.yaml again: base: PATH shares it"]
    );
}
