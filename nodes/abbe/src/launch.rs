//! Reads a scenario's launch file: the ROS 2 XML launch format, as far as a scenario needs it.
//!
//! `<node pkg exec name namespace><param from="$(dirname)/FILE"/><param name value/></node>` below
//! `<launch>`. What `ros2 launch` would do and this reader does not is refused by name, never skipped.

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, Result, bail};
use metrology::bound::Bound;
use mtconnect_bridge::xml;
use node_runtime::Setup;
use node_runtime::arguments::Arguments;
use node_runtime::text_file::{self, Comments};

/// One node of a scenario.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LaunchNode {
    /// Executable, which is the node's folder in `nodes/`.
    pub exec: String,
    /// ROS node name.
    pub name: String,
    /// Namespace; empty: none.
    pub namespace: String,
    /// Parameter files, later ones override.
    pub parameter_files: Vec<PathBuf>,
    /// Single parameters, `name:=value` as YAML.
    pub parameters: Vec<(String, String)>,
    /// How long it may take to end before it is killed: `sigterm_timeout` and `sigkill_timeout`
    /// together, as `ros2 launch` counts them; `None`: neither is said.
    pub ends_within: Option<Duration>,
    /// Where it stands: file, line and column.
    pub place: String,
}

/// Longest launch file, bytes: one of 100 nodes with 1,000 parameters each has less.
const MOST_LAUNCH_BYTES: usize = 16 << 20;
/// Nodes of a scenario, each with threads and sockets of its own: a cell has some fifteen.
const NODE_COUNT: Bound = Bound::at_most(100);
/// Parameters and parameter files of one node, which become its command line.
const PARAMETERS: Bound = Bound::at_most(1_000);

/// What `ros2 launch` takes for a `sigterm_timeout` or `sigkill_timeout` that is not said, s.
const ROS_TIMEOUT_S: f64 = 5.0;
/// Longest of either that makes sense, s.
const LONGEST_TIMEOUT_S: f64 = 3600.0;

/// Attributes of `<node>` that are read; `output` means nothing here: every node says all.
const ATTRIBUTES: [&str; 7] = [
    "pkg",
    "exec",
    "name",
    "namespace",
    "output",
    "sigterm_timeout",
    "sigkill_timeout",
];

impl LaunchNode {
    /// The node's arguments as `ros2 launch` would give them.
    pub fn ros_args(&self) -> Vec<String> {
        let mut args = vec!["--ros-args".to_owned(), "-r".to_owned()];
        args.push(format!("__node:={}", self.name));
        if !self.namespace.is_empty() {
            args.extend(["-r".to_owned(), format!("__ns:={}", self.namespace)]);
        }
        for file in &self.parameter_files {
            args.extend(["--params-file".to_owned(), file.display().to_string()]);
        }
        for (name, value) in &self.parameters {
            args.extend(["-p".to_owned(), format!("{name}:={value}")]);
        }
        args
    }

    /// Its arguments, read.
    ///
    /// # Errors
    /// With the place of the node, when one of them cannot be read.
    pub fn arguments(&self) -> Result<Arguments> {
        Arguments::parse(self.ros_args()).with_context(|| self.described())
    }

    /// Its parameters with their files.
    ///
    /// # Errors
    /// With the place of the node, when an argument or a parameter file cannot be read.
    pub fn setup(&self) -> Result<Setup> {
        Setup::new(&self.exec, &self.arguments()?).with_context(|| self.described())
    }

    fn described(&self) -> String {
        let place = if self.place.is_empty() { "" } else { ": " };
        format!("{}{place}node {}", self.place, self.name)
    }
}

/// Finds the one `*.launch.xml` in a scenario's folder.
///
/// # Errors
/// When there is none or more than one.
pub fn find(folder: &Path) -> Result<PathBuf> {
    let entries =
        std::fs::read_dir(folder).with_context(|| format!("scenario {}", folder.display()))?;
    let mut found = Vec::new();
    for entry in entries {
        let path = entry?.path();
        if path.to_string_lossy().ends_with(".launch.xml") {
            found.push(path);
        }
    }
    match found.as_slice() {
        [one] => Ok(one.clone()),
        [] => bail!("scenario {}: it has no *.launch.xml", folder.display()),
        several => bail!(
            "scenario {}: it has {} launch files",
            folder.display(),
            several.len()
        ),
    }
}

/// Reads a launch file.
///
/// # Errors
/// With line and column, when the file is not a launch file or uses what this reader does not know; two nodes of one name.
pub fn read(path: &Path) -> Result<Vec<LaunchNode>> {
    let text = text_file::read(path, Comments::Xml).context("launch file")?;
    let folder = path.parent().unwrap_or_else(|| Path::new("."));
    let nodes = parse(&text, folder).and_then(of_own_names);
    let mut nodes = nodes.with_context(|| format!("launch file {}", path.display()))?;
    for node in &mut nodes {
        node.place = format!("{}:{}", path.display(), node.place);
        // An unknown node is refused by name where the nodes are built.
        if crate::node::builder(&node.exec).is_some() {
            node.arguments()?;
        }
    }
    Ok(nodes)
}

/// The nodes, where each has a name of its own in its namespace.
fn of_own_names(nodes: Vec<LaunchNode>) -> Result<Vec<LaunchNode>> {
    let name = |node: &LaunchNode| {
        (
            node.namespace.trim_matches('/').to_owned(),
            node.name.clone(),
        )
    };
    for (at, node) in nodes.iter().enumerate() {
        if nodes[..at].iter().any(|other| name(other) == name(node)) {
            bail!(
                "name=\"{}\": two nodes have it: give one of them another",
                node.name
            );
        }
    }
    Ok(nodes)
}

fn parse(text: &str, folder: &Path) -> Result<Vec<LaunchNode>> {
    let document = xml::parse(text, MOST_LAUNCH_BYTES)?;
    let root = document.root_element();
    if root.tag_name().name() != "launch" {
        bail!(
            "the root element is <{}>: must be <launch>",
            root.tag_name().name()
        );
    }
    let elements = || root.children().filter(roxmltree::Node::is_element);
    NODE_COUNT.check_amount(|| "<launch>".to_owned(), "nodes", elements().count())?;
    let mut nodes = Vec::new();
    for child in elements() {
        let place = document.text_pos_at(child.range().start);
        match child.tag_name().name() {
            "node" => {
                let mut read = node(child, folder).with_context(|| format!("at {place}"))?;
                read.place = place.to_string();
                nodes.push(read);
            }
            other => bail!("{place}: <{other}> is not supported in a scenario (supported: <node>)"),
        }
    }
    if nodes.is_empty() {
        bail!("it launches no <node>");
    }
    Ok(nodes)
}

fn node(element: roxmltree::Node<'_, '_>, folder: &Path) -> Result<LaunchNode> {
    for attribute in element.attributes() {
        if !ATTRIBUTES.contains(&attribute.name()) {
            bail!(
                "attribute \"{}\" of <node> is not supported in a scenario",
                attribute.name()
            );
        }
    }
    let n_parameters = element
        .children()
        .filter(roxmltree::Node::is_element)
        .count();
    PARAMETERS.check_amount(|| "<node>".to_owned(), "parameters", n_parameters)?;
    let exec = element
        .attribute("exec")
        .context("<node> lacks \"exec\"")?
        .to_owned();
    let mut launched = LaunchNode {
        name: element.attribute("name").unwrap_or(&exec).to_owned(),
        namespace: element
            .attribute("namespace")
            .unwrap_or_default()
            .to_owned(),
        exec,
        parameter_files: Vec::new(),
        parameters: Vec::new(),
        ends_within: ends_within(element)?,
        place: String::new(),
    };
    for child in element.children().filter(roxmltree::Node::is_element) {
        let tag = child.tag_name().name();
        let (from, name, value) = (
            child.attribute("from"),
            child.attribute("name"),
            child.attribute("value"),
        );
        match (tag, from, name, value) {
            ("param", Some(from), None, None) => {
                launched
                    .parameter_files
                    .push(substitute(from, folder)?.into());
            }
            ("param", None, Some(name), Some(_))
                if launched.parameters.iter().any(|(other, _)| other == name) =>
            {
                bail!("<param name=\"{name}\"> stands there twice: keep one of them");
            }
            ("param", None, Some(name), Some(value)) => {
                launched
                    .parameters
                    .push((name.to_owned(), substitute(value, folder)?));
            }
            ("param", ..) => bail!("<param> needs either \"from\" or \"name\" and \"value\""),
            (other, ..) => bail!("<{other}> in <node> is not supported in a scenario"),
        }
    }
    Ok(launched)
}

fn ends_within(element: roxmltree::Node<'_, '_>) -> Result<Option<Duration>> {
    let timeout_s = |name: &str| -> Result<Option<f64>> {
        let Some(text) = element.attribute(name) else {
            return Ok(None);
        };
        match text.parse::<f64>() {
            Ok(seconds) if (0.0..=LONGEST_TIMEOUT_S).contains(&seconds) => Ok(Some(seconds)),
            _ => bail!("{name}=\"{text}\": must be 0 to {LONGEST_TIMEOUT_S} s"),
        }
    };
    let (term_s, kill_s) = (timeout_s("sigterm_timeout")?, timeout_s("sigkill_timeout")?);
    Ok((term_s.is_some() || kill_s.is_some()).then(|| {
        let whole_s = term_s.unwrap_or(ROS_TIMEOUT_S) + kill_s.unwrap_or(ROS_TIMEOUT_S);
        Duration::from_secs_f64(whole_s)
    }))
}

fn substitute(text: &str, folder: &Path) -> Result<String> {
    let text = text.replace("$(dirname)", &folder.display().to_string());
    match text.find("$(") {
        Some(at) => bail!(
            "\"{}\": only $(dirname) is supported in a scenario",
            &text[at..]
        ),
        None => Ok(text),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_launch_file_that_the_parser_takes_long_over_is_refused_with_place_and_limit() {
        let attributes: String = (0..60_000).map(|k| format!(" a{k}='1'")).collect();
        for (text, words) in [
            (
                format!("<launch>\n<node{attributes}/></launch>"),
                "2:1: more than 256 attributes",
            ),
            (
                "<a>".repeat(200_000),
                "more than 128 elements within each other",
            ),
            (
                format!("<launch>{}</launch>", "<![CDATA[&]]>".repeat(101)),
                "100 sections of raw text",
            ),
        ] {
            let refused = format!("{:#}", parse(&text, Path::new(".")).unwrap_err());
            assert!(refused.contains(words), "{words}: {refused}");
        }
    }

    #[test]
    fn a_text_that_is_no_xml_is_refused_in_own_words_with_its_place() {
        let long = format!("<launch>&{};</launch>", "x".repeat(300));
        for (text, words) in [
            (
                "<!DOCTYPE launch><launch/>",
                "a document type (`<!DOCTYPE`) is not read: remove it",
            ),
            ("", "no element stands there"),
            (
                "<launch>\n<node>",
                "2:7: the text ends inside of an element",
            ),
            (
                "<launch>\n  <node></launch>",
                "2:9: </launch> closes <node>",
            ),
            (
                "<launch a='1' a='2'/>",
                "the attribute a stands there twice",
            ),
            (
                "<launch>&abbe;</launch>",
                "&abbe; is not defined: write &amp; for an ampersand",
            ),
            (
                "<launch>a & b</launch>",
                "an ampersand begins no reference, or one to a letter that may not stand in XML: write &amp;",
            ),
            ("<x:launch/>", "the prefix x is not declared"),
            ("<launch <", "check tags, quotes and brackets"),
            (long.as_str(), "…; is not defined"),
        ] {
            let shown = format!("{:#}", parse(text, Path::new(".")).unwrap_err());
            assert!(shown.contains(words), "{text}: {shown}");
            assert!(shown.len() < 160, "{shown}");
        }
    }

    #[test]
    fn a_node_with_files_and_parameters_becomes_ros_arguments() {
        let text = r#"<launch><node pkg="abbe" exec="probe" namespace="/m1">
            <param from="$(dirname)/probe.yaml"/><param name="queue_s" value="2.0"/>
        </node></launch>"#;
        let nodes = parse(text, Path::new("lc")).unwrap();
        assert_eq!(
            nodes[0].ros_args().join(" "),
            "--ros-args -r __node:=probe -r __ns:=/m1 --params-file lc/probe.yaml -p queue_s:=2.0"
        );
    }

    #[test]
    fn a_wrong_parameter_or_name_in_a_launch_file_is_told_with_its_place() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cell.launch.xml");
        for (node, words) in [
            (
                "<node pkg='abbe' exec='probe' namespace='a b'/>",
                "2:1: node probe: remap rule",
            ),
            (
                "<node pkg='abbe' exec='probe'><param name='a' value='['/></node>",
                "2:1: node probe: parameter `a:=[`",
            ),
            (
                "<node pkg='abbe' exec='probe'><param name='a' value='1'/><param name='a' value='2'/></node>",
                "at 2:1: <param name=\"a\"> stands there twice: keep one of them",
            ),
        ] {
            std::fs::write(&path, format!("<launch>\n{node}\n</launch>")).unwrap();
            let shown = format!("{:#}", read(&path).unwrap_err());
            assert!(shown.contains(words), "{shown}");
            assert!(shown.contains("cell.launch.xml"), "{shown}");
        }
        let node =
            "<node pkg='abbe' exec='fake_cnc'><param name='servo_rate_hz' value='fast'/></node>";
        std::fs::write(&path, format!("<launch>\n{node}\n</launch>")).unwrap();
        let nodes = read(&path).unwrap();
        assert!(nodes[0].place.ends_with("cell.launch.xml:2:1"));
    }

    #[test]
    fn more_nodes_or_parameters_than_a_computer_takes_are_refused_before_any_is_made() {
        let node = |inside: &str| format!("<node pkg='abbe' exec='probe'>{inside}</node>");
        let launch = |nodes: &str| parse(&format!("<launch>{nodes}</launch>"), Path::new("lc"));
        assert_eq!(launch(&node("").repeat(100)).unwrap().len(), 100);
        let refused = launch(&node("").repeat(101)).unwrap_err();
        assert_eq!(refused.to_string(), "<launch>: 101 nodes: at most 100");
        let parameters = "<param name='a' value='1'/>".repeat(1_001);
        let refused = format!("{:#}", launch(&node(&parameters)).unwrap_err());
        assert!(
            refused.contains("<node>: 1001 parameters: at most 1000"),
            "{refused}"
        );
    }

    #[test]
    fn two_nodes_of_one_name_are_refused_wherever_a_launch_file_is_read() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("cell.launch.xml");
        let read = |nodes: &str| {
            std::fs::write(&path, format!("<launch>{nodes}</launch>")).unwrap();
            read(&path)
        };
        let node = |words: &str| format!("<node pkg='abbe' {words}/>");
        let probe = node("exec='probe'");
        for twice in [
            node("exec='probe'"),
            node("exec='fake_cnc' name='probe'"),
            node("exec='probe' namespace='/'"),
        ] {
            let error = format!("{:#}", read(&format!("{probe}{twice}")).unwrap_err());
            for word in ["cell.launch.xml", "name=\"probe\": two nodes have it"] {
                assert!(error.contains(word), "{twice}: {error}");
            }
        }
        for other in [
            node("exec='fake_cnc'"),
            node("exec='probe' name='probe_2'"),
            node("exec='probe' namespace='/m2'"),
        ] {
            assert_eq!(
                read(&format!("{probe}{other}")).unwrap().len(),
                2,
                "{other}"
            );
        }
    }

    #[test]
    fn the_time_to_end_is_what_ros_launch_would_give() {
        let of = |attributes: &str| {
            let text = format!("<launch><node pkg='abbe' exec='probe' {attributes}/></launch>");
            parse(&text, Path::new("lc")).map(|nodes| nodes[0].ends_within)
        };
        let seconds = |seconds| Some(Duration::from_secs(seconds));
        assert_eq!(of("").unwrap(), None);
        assert_eq!(of("sigterm_timeout='12'").unwrap(), seconds(17));
        assert_eq!(
            of("sigterm_timeout='12' sigkill_timeout='3'").unwrap(),
            seconds(15)
        );
        for wrong in ["-1", "NaN", "3601", "soon"] {
            let error = of(&format!("sigkill_timeout='{wrong}'")).unwrap_err();
            let limit = format!("sigkill_timeout=\"{wrong}\": must be 0 to 3600 s");
            assert!(format!("{error:#}").contains(&limit), "{error:#}");
        }
    }

    #[test]
    fn what_the_reader_does_not_know_is_refused_with_its_place() {
        let text = "<launch>\n  <include file=\"x\"/>\n</launch>";
        let error = format!("{:#}", parse(text, Path::new(".")).unwrap_err());
        assert!(
            error.contains("2:3") && error.contains("<include>"),
            "{error}"
        );
        let text = r#"<launch><node exec="a"><param from="$(env HOME)/x"/></node></launch>"#;
        let error = format!("{:#}", parse(text, Path::new(".")).unwrap_err());
        assert!(error.contains("$(env HOME)"), "{error}");
    }
}
