//! ROS names: expansion by namespace and node, remapping, and their forms on DDS.
//!
//! Rules: design.ros2.org, "Topic and Service name mapping to DDS" and "Remapping names".

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use metrology::bound::NAME_BYTES;

/// A name that ROS forbids.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("name `{name}`: {reason}")]
pub struct NameError {
    /// As given.
    pub name: String,
    /// Which rule it breaks.
    pub reason: &'static str,
}

/// One rule `[NODE:]FROM:=TO`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RemapRule {
    /// For one node only, by its original name.
    pub node: Option<String>,
    /// Name as the node knows it, or `__node`, `__ns`.
    pub from: String,
    /// Name on the graph.
    pub to: String,
}

impl RemapRule {
    /// Reads a rule.
    ///
    /// # Errors
    /// When `:=` is missing or a name breaks the rules of ROS.
    pub fn parse(rule: &str) -> Result<Self, NameError> {
        let error = |reason| NameError {
            name: rule.to_owned(),
            reason,
        };
        let (left, to) = rule
            .split_once(":=")
            .ok_or_else(|| error("needs FROM:=TO"))?;
        let (node, from) = match left.split_once(':') {
            Some((node, from)) => (Some(node.to_owned()), from),
            None => (None, left),
        };
        match from {
            "__node" | "__name" => check_token(to)?,
            "__ns" => check_namespace(to)?,
            _ => {
                check(from)?;
                check(to)?;
            }
        }
        let from = if from == "__name" { "__node" } else { from };
        Ok(Self {
            node,
            from: from.to_owned(),
            to: to.to_owned(),
        })
    }

    /// Whether the rule is for a node that is called `name` before remapping.
    #[must_use]
    pub fn concerns(&self, name: &str) -> bool {
        self.node.as_deref().is_none_or(|node| node == name)
    }
}

/// A rule of one node, and whether it has renamed something.
#[derive(Clone, Debug)]
struct Rule {
    rule: RemapRule,
    is_used: Arc<AtomicBool>,
}

impl PartialEq for Rule {
    fn eq(&self, other: &Self) -> bool {
        self.rule == other.rule
    }
}

fn check_token(token: &str) -> Result<(), NameError> {
    let error = |reason| {
        Err(NameError {
            name: token.to_owned(),
            reason,
        })
    };
    if token.len() > NAME_BYTES {
        return error("must have at most 255 bytes: shorten it");
    }
    if token.is_empty() {
        return error("is empty, or has two slashes together or one at its end");
    }
    if !token.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
        return error("may have letters, digits and underscores only");
    }
    if token.starts_with(|c: char| c.is_ascii_digit()) {
        return error("must not begin with a digit");
    }
    if token.contains("__") {
        return error("must not have two underscores together");
    }
    Ok(())
}

/// Checks a relative, private (`~/…`) or absolute name.
///
/// # Errors
/// Names the rule that it breaks.
pub fn check(name: &str) -> Result<(), NameError> {
    if name.len() > NAME_BYTES {
        return Err(NameError {
            name: name.to_owned(),
            reason: "must have at most 255 bytes: shorten it",
        });
    }
    let rest = match name.strip_prefix('~') {
        Some("") => return Ok(()),
        Some(rest) => rest.strip_prefix('/').ok_or_else(|| NameError {
            name: name.to_owned(),
            reason: "a tilde is followed by a slash",
        })?,
        None => name.strip_prefix('/').unwrap_or(name),
    };
    rest.split('/')
        .try_for_each(check_token)
        .map_err(|error| NameError {
            name: name.to_owned(),
            ..error
        })
}

/// Checks a namespace: `/` or absolute.
///
/// # Errors
/// Names the rule that it breaks.
pub fn check_namespace(namespace: &str) -> Result<(), NameError> {
    match namespace {
        "/" => Ok(()),
        _ if namespace.starts_with('/') => check(namespace),
        _ => Err(NameError {
            name: namespace.to_owned(),
            reason: "a namespace begins with a slash",
        }),
    }
}

/// A node's place on the graph and its rules.
#[derive(Clone, Debug, PartialEq)]
pub struct NodeNames {
    /// Base name on the graph.
    pub name: String,
    /// Namespace, `/` or `/a/b`.
    pub namespace: String,
    /// Topic and service rules that concern it.
    rules: Vec<Rule>,
}

impl NodeNames {
    /// A node that calls itself `default_name`, after its rules.
    ///
    /// # Errors
    /// When the name or the namespace breaks the rules of ROS.
    pub fn new(default_name: &str, rules: &[RemapRule]) -> Result<Self, NameError> {
        let mine = || rules.iter().filter(|rule| rule.concerns(default_name));
        let special = |key| {
            mine()
                .find(|rule| rule.from == key)
                .map(|rule| rule.to.clone())
        };
        let name = special("__node").unwrap_or_else(|| default_name.to_owned());
        check_token(&name)?;
        let namespace = special("__ns").unwrap_or_else(|| "/".to_owned());
        check_namespace(&namespace)?;
        let rules = mine()
            .filter(|rule| !rule.from.starts_with("__"))
            .map(|rule| Rule {
                rule: rule.clone(),
                is_used: Arc::default(),
            })
            .collect();
        Ok(Self {
            name,
            namespace,
            rules,
        })
    }

    /// Namespace and name in one.
    #[must_use]
    pub fn fully_qualified(&self) -> String {
        self.expand(&self.name)
    }

    /// The name of a frame of this node's machine: the namespace, without the slash that tf allows no frame to begin
    /// with, and the frame's own name; the machine's own where that is empty.
    #[must_use]
    pub fn frame(&self, name: &str) -> String {
        let machine = self.namespace.trim_matches('/');
        match (machine, name) {
            ("", name) => name.to_owned(),
            (machine, "") => machine.to_owned(),
            (machine, name) => format!("{machine}/{name}"),
        }
    }

    fn expand(&self, name: &str) -> String {
        let root = self.namespace.trim_end_matches('/');
        match (name.strip_prefix('~'), name.starts_with('/')) {
            (Some(rest), _) => format!("{root}/{}{rest}", self.name),
            (None, true) => name.to_owned(),
            (None, false) => format!("{root}/{name}"),
        }
    }

    /// The absolute name of a topic, service or action after remapping.
    ///
    /// # Errors
    /// When `name` breaks the rules of ROS.
    pub fn resolve(&self, name: &str) -> Result<String, NameError> {
        check(name)?;
        let expanded = self.expand(name);
        let mut rules = self.rules.iter();
        Ok(
            match rules.find(|rule| self.expand(&rule.rule.from) == expanded) {
                Some(rule) => {
                    rule.is_used.store(true, Ordering::Relaxed);
                    self.expand(&rule.rule.to)
                }
                None => expanded,
            },
        )
    }

    /// Rules for this node that have renamed nothing so far, as they were given.
    #[must_use]
    pub fn unused_rules(&self) -> Vec<String> {
        let unused = self.rules.iter();
        let unused = unused.filter(|rule| !rule.is_used.load(Ordering::Relaxed));
        unused
            .map(|rule| format!("{}:={}", rule.rule.from, rule.rule.to))
            .collect()
    }
}

/// `/a/b` as the DDS topic of a message.
#[must_use]
pub fn dds_topic(name: &str) -> String {
    format!("rt{name}")
}

/// `/a/b` as the DDS topic of a service's requests.
#[must_use]
pub fn dds_request_topic(service: &str) -> String {
    format!("rq{service}Request")
}

/// `/a/b` as the DDS topic of a service's replies.
#[must_use]
pub fn dds_reply_topic(service: &str) -> String {
    format!("rr{service}Reply")
}

/// `pkg/msg/Name` as DDS writes it: `pkg::msg::dds_::Name_`.
#[must_use]
pub fn dds_type(type_name: &str) -> String {
    match type_name.rsplit_once('/') {
        Some((package, name)) => format!("{}::dds_::{name}_", package.replace('/', "::")),
        None => type_name.to_owned(),
    }
}

/// `pkg::msg::dds_::Name_` as ROS writes it: `pkg/msg/Name`.
#[must_use]
pub fn ros_type(dds_type: &str) -> Option<String> {
    let (package, name) = dds_type.split_once("::dds_::")?;
    Some(format!(
        "{}/{}",
        package.replace("::", "/"),
        name.strip_suffix('_')?
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(rules: &[&str]) -> NodeNames {
        let rules: Vec<_> = rules.iter().map(|r| RemapRule::parse(r).unwrap()).collect();
        NodeNames::new("probe", &rules).unwrap()
    }

    #[test]
    fn relative_private_and_absolute_names_expand() {
        let node = names(&["__ns:=/cell", "__node:=bed"]);
        assert_eq!(node.fully_qualified(), "/cell/bed");
        assert_eq!(node.resolve("axes/state").unwrap(), "/cell/axes/state");
        assert_eq!(node.resolve("~/state").unwrap(), "/cell/bed/state");
        assert_eq!(node.resolve("/tf").unwrap(), "/tf");
        assert_eq!(names(&[]).resolve("axes/state").unwrap(), "/axes/state");
    }

    #[test]
    fn frames_have_their_machines_namespace_in_front() {
        let node = names(&["__ns:=/shop/mill_3"]);
        assert_eq!(node.frame("base_link"), "shop/mill_3/base_link");
        assert_eq!(node.frame(""), "shop/mill_3");
        assert_eq!(names(&[]).frame("base_link"), "base_link");
        assert_eq!(names(&[]).frame(""), "");
    }

    #[test]
    fn the_first_fitting_rule_renames() {
        let node = names(&["__ns:=/cell", "other:a:=b", "a:=/x/c", "a:=d", "/tf:=tf"]);
        assert_eq!(node.resolve("a").unwrap(), "/x/c");
        assert_eq!(node.resolve("/cell/a").unwrap(), "/x/c");
        assert_eq!(node.unused_rules(), ["a:=d", "/tf:=tf"]);
        assert_eq!(node.resolve("/tf").unwrap(), "/cell/tf");
        assert_eq!(node.unused_rules(), ["a:=d"]);
    }

    #[test]
    fn forbidden_names_are_refused() {
        for bad in ["", "a//b", "a/", "1a", "a__b", "a-b", "~a", "ü"] {
            assert!(check(bad).is_err(), "{bad} passed");
        }
        for long in [
            "b".repeat(256),
            format!("/{}/b", "b".repeat(253)),
            "b/".repeat(200),
        ] {
            let refused = check(&long).unwrap_err().to_string();
            assert!(
                refused.ends_with("at most 255 bytes: shorten it"),
                "{refused}"
            );
        }
        assert!(check(&"b".repeat(255)).is_ok());
        let long = [RemapRule::parse(&format!("__node:={}", "b".repeat(255))).unwrap()];
        assert!(NodeNames::new("a", &long).is_ok());
        assert!(RemapRule::parse("__ns:=cell").is_err());
        assert!(RemapRule::parse("__node:=a/b").is_err());
    }

    #[test]
    fn type_names_go_to_dds_and_back() {
        let dds = "abbe_msgs::msg::dds_::AxisState_";
        assert_eq!(dds_type("abbe_msgs/msg/AxisState"), dds);
        assert_eq!(ros_type(dds).unwrap(), "abbe_msgs/msg/AxisState");
    }
}
