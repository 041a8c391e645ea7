//! What the packages say of themselves: `cargo metadata` of the members, Cargo.lock of the others.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use serde::Deserialize;

use crate::tree;

/// A member of the workspace.
#[derive(Debug, Deserialize)]
pub struct Package {
    /// Its name.
    pub name: String,
    /// Path of its Cargo.toml.
    manifest_path: String,
    /// What it depends on, of every kind.
    pub dependencies: Vec<Dependency>,
    /// What it builds.
    pub targets: Vec<Target>,
}

/// One line of a `[dependencies]` table.
#[derive(Debug, Deserialize)]
pub struct Dependency {
    /// Its name.
    pub name: String,
    /// `None`: in the product; else `dev` or `build`.
    pub kind: Option<String>,
    /// Whether its default features are on.
    pub uses_default_features: bool,
    /// Further features.
    pub features: Vec<String>,
}

/// A library, program, test or bench.
#[derive(Debug, Deserialize)]
pub struct Target {
    /// Its name.
    pub name: String,
    /// What it is.
    pub kind: Vec<String>,
}

#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Package>,
}

#[derive(Deserialize)]
struct Lock {
    package: Vec<Locked>,
}

#[derive(Deserialize)]
struct Locked {
    name: String,
    #[serde(default)]
    dependencies: Vec<String>,
}

impl Package {
    /// Its folder below the root.
    pub fn folder(&self) -> String {
        let root = tree::root().to_string_lossy().replace('\\', "/");
        let path = self.manifest_path.replace('\\', "/");
        let below = path.strip_prefix(&root).unwrap().trim_start_matches('/');
        below.trim_end_matches("/Cargo.toml").to_owned()
    }

    /// Names of what its product depends on, without tests and benches.
    pub fn needs(&self) -> impl Iterator<Item = &str> {
        let of_product = |dependency: &&Dependency| dependency.kind.as_deref() != Some("dev");
        let product = self.dependencies.iter().filter(of_product);
        product.map(|dependency| dependency.name.as_str())
    }

    /// Whether it is a ROS shell.
    pub fn is_shell(&self) -> bool {
        self.folder().ends_with("/node")
    }
}

/// All members of the workspace.
pub fn members() -> Vec<Package> {
    let cargo = env!("CARGO");
    let output = Command::new(cargo)
        .args([
            "metadata",
            "--no-deps",
            "--offline",
            "--format-version",
            "1",
        ])
        .current_dir(tree::root())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "cargo metadata: {said}");
    serde_json::from_slice::<Metadata>(&output.stdout)
        .unwrap()
        .packages
}

/// Every package of Cargo.lock with what it needs, names only; versions of one name are taken together.
pub fn locked() -> BTreeMap<String, BTreeSet<String>> {
    let lock: Lock = toml::from_str(&tree::text("Cargo.lock").unwrap()).unwrap();
    let mut all: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for package in lock.package {
        let name = |entry: String| entry.split(' ').next().unwrap_or_default().to_owned();
        let needs = package.dependencies.into_iter().map(name);
        all.entry(package.name).or_default().extend(needs);
    }
    all
}

/// Everything that `package` needs in its product, directly or not.
pub fn reach(
    package: &Package,
    members: &[Package],
    locked: &BTreeMap<String, BTreeSet<String>>,
) -> BTreeSet<String> {
    let mut reached = BTreeSet::new();
    let mut open: Vec<String> = package.needs().map(str::to_owned).collect();
    while let Some(name) = open.pop() {
        if !reached.insert(name.clone()) {
            continue;
        }
        match members.iter().find(|member| member.name == name) {
            Some(member) => open.extend(member.needs().map(str::to_owned)),
            None => open.extend(locked.get(&name).into_iter().flatten().cloned()),
        }
    }
    reached
}

/// A member that needs `needs`, for bad examples.
pub fn example(folder: &str, needs: &[&str]) -> Package {
    let dependency = |name: &&str| Dependency {
        name: (*name).to_owned(),
        kind: None,
        uses_default_features: true,
        features: Vec::new(),
    };
    let name = match folder.strip_suffix("/node") {
        Some(node) => format!("{}_node", node.rsplit('/').next().unwrap()),
        None => folder.rsplit('/').next().unwrap().to_owned(),
    };
    Package {
        name,
        manifest_path: format!("{}/{folder}/Cargo.toml", tree::root().display()),
        dependencies: needs.iter().map(dependency).collect(),
        targets: Vec::new(),
    }
}

#[test]
fn what_is_needed_through_others_is_reached() {
    let made = [
        example("nodes/a", &["b", "serde"]),
        example("nodes/b", &["tokio"]),
    ];
    let locked = BTreeMap::from([("tokio".to_owned(), BTreeSet::from(["mio".to_owned()]))]);
    let reached = reach(&made[0], &made, &locked);
    assert_eq!(
        reached.into_iter().collect::<Vec<_>>(),
        ["b", "mio", "serde", "tokio"]
    );
    assert!(
        members()
            .iter()
            .any(|member| member.folder() == "nodes/probe/node")
    );
}
