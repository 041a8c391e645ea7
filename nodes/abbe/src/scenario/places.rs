//! Where a scenario is found by its name, and which scenarios there are.

use std::path::{Component, Path, PathBuf};

use anyhow::{Context, Result, bail};
use metrology::yaml;
use node_runtime::text_file;

use super::{SCENARIO_FILE, ScenarioFile, USUAL_HOME, scenarios_in};

/// Where packages have their scenarios, below the prefix that holds `bin/abbe` or `lib/abbe/abbe`.
const INSTALLED_HOME: &str = "share/abbe/launch_configs";
/// Similarity (Jaro) above which one name is proposed for another; clap proposes its verbs by the same.
const MIN_JARO_TO_PROPOSE: f64 = 0.7;

/// Folders in which scenarios are looked for, in this order: `launch_configs` of `current` and of its parents, then the
/// package that has installed `program`.
fn homes_of(current: &Path, program: &Path) -> Vec<PathBuf> {
    let beside = current.ancestors().map(|folder| folder.join(USUAL_HOME));
    let prefixes = program.ancestors().skip(2).take(2);
    let mut homes: Vec<PathBuf> = beside.collect();
    homes.extend(prefixes.map(|prefix| prefix.join(INSTALLED_HOME)));
    homes
}

/// The folders of [`homes_of`] for this process.
fn homes() -> Result<Vec<PathBuf>> {
    let current = std::env::current_dir().context("current folder")?;
    let program = std::env::current_exe().context("this program's own file")?;
    let program = program.canonicalize().unwrap_or(program);
    let mut homes = homes_of(&current, &program);
    // As the user would write it.
    homes[0] = PathBuf::from(USUAL_HOME);
    Ok(homes)
}

/// The folder of the scenario that is given as a path, or by its name alone.
///
/// # Errors
/// For a name that no scenario has: the nearest name, and where was looked.
pub fn find(given: &Path) -> Result<PathBuf> {
    find_in(given, &homes()?)
}

fn find_in(given: &Path, homes: &[PathBuf]) -> Result<PathBuf> {
    let mut parts = given.components();
    let (Some(Component::Normal(name)), None) = (parts.next(), parts.next()) else {
        return Ok(given.to_owned());
    };
    if given.join(SCENARIO_FILE).is_file() {
        return Ok(given.to_owned());
    }
    let mut of_name = homes.iter().map(|home| home.join(name));
    if let Some(found) = of_name.find(|folder| folder.join(SCENARIO_FILE).is_file()) {
        return Ok(found);
    }
    if given.exists() {
        return Ok(given.to_owned());
    }
    let name = name.to_string_lossy();
    let known: Vec<String> = homes.iter().flat_map(|home| scenarios_in(home)).collect();
    let proposal = match nearest(&name, &known) {
        Some(near) => format!("; did you mean {near}?"),
        None => String::new(),
    };
    let looked: Vec<String> = homes
        .iter()
        .map(|home| home.display().to_string())
        .collect();
    bail!(
        "scenario {name}: there is no scenario of this name{proposal}\n  looked in: ., {}\n  `abbe run --list` lists the scenarios; a folder's path is taken too",
        looked.join(", ")
    );
}

/// The known name that is most like `name`, if one is like it.
fn nearest<'k>(name: &str, known: &'k [String]) -> Option<&'k str> {
    let likeness = |known: &'k String| (strsim::jaro(name, known), known.as_str());
    let best = known
        .iter()
        .map(likeness)
        .max_by(|a, b| a.0.total_cmp(&b.0));
    best.filter(|(jaro, _)| *jaro > MIN_JARO_TO_PROPOSE)
        .map(|(_, near)| near)
}

/// A scenario that can be run by its name.
pub struct Listed {
    /// Its name.
    pub name: String,
    /// Its title, or why it cannot be read.
    pub title: String,
}

/// The scenarios of every folder that has some: the folder, and what it holds. A name counts where it stands first, as [`find`]
/// does.
///
/// # Errors
/// When the current folder is gone.
pub fn list() -> Result<Vec<(PathBuf, Vec<Listed>)>> {
    Ok(list_in(&homes()?))
}

fn list_in(homes: &[PathBuf]) -> Vec<(PathBuf, Vec<Listed>)> {
    let mut names = Vec::<String>::new();
    let mut all = vec![];
    for home in homes {
        let mut listed = vec![];
        for name in scenarios_in(home) {
            if names.contains(&name) {
                continue;
            }
            let title = title_of(&home.join(&name).join(SCENARIO_FILE));
            let title = title.unwrap_or_else(|error| format!("cannot be read: {error:#}"));
            names.push(name.clone());
            listed.push(Listed { name, title });
        }
        if !listed.is_empty() {
            all.push((home.clone(), listed));
        }
    }
    all
}

fn title_of(path: &Path) -> Result<String> {
    let text = text_file::yaml(path)?;
    let file: ScenarioFile = yaml::read_letters(&text)?;
    Ok(file.title)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `launch_configs` below a folder, with scenarios of these names.
    fn home_with(folder: &Path, names: &[&str]) -> PathBuf {
        let home = folder.join(USUAL_HOME);
        for name in names {
            std::fs::create_dir_all(home.join(name)).unwrap();
            let text = format!("title: All of {name}\nreport: blocks\nlimit_min: 1.0\n");
            std::fs::write(home.join(name).join(SCENARIO_FILE), text).unwrap();
        }
        home
    }

    #[test]
    fn scenarios_are_looked_for_upwards_and_where_packages_have_them() {
        let of = |program| homes_of(Path::new("/shop/cells/mill"), Path::new(program));
        let upwards = [
            "/shop/cells/mill/launch_configs",
            "/shop/cells/launch_configs",
            "/shop/launch_configs",
            "/launch_configs",
        ];
        let paths = |homes: Vec<PathBuf>| -> Vec<String> {
            let shown = homes.iter().map(|home| home.display().to_string());
            shown.collect()
        };
        // What the Debian package lists among its assets.
        let debian = paths(of("/usr/bin/abbe"));
        assert_eq!(debian[..4], upwards);
        assert_eq!(debian[4], "/usr/share/abbe/launch_configs");
        // `abbe install-ros /opt/abbe` and colcon.
        let ros = paths(of("/opt/abbe/lib/abbe/abbe"));
        assert!(
            ros.contains(&"/opt/abbe/share/abbe/launch_configs".to_owned()),
            "{ros:?}"
        );
    }

    #[test]
    fn a_name_is_found_in_the_first_folder_that_has_it_and_a_path_is_left_alone() {
        let (near, far) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let homes = [
            home_with(near.path(), &["mill_3"]),
            home_with(far.path(), &["mill_3", "first_run"]),
        ];
        let found = |given: &str| find_in(Path::new(given), &homes).unwrap();
        assert_eq!(found("mill_3"), homes[0].join("mill_3"));
        assert_eq!(found("first_run"), homes[1].join("first_run"));
        for path in ["elsewhere/first_run", "./first_run", "/first_run", ".."] {
            assert_eq!(found(path), Path::new(path));
        }
        let listed: Vec<Vec<(String, String)>> = list_in(&homes)
            .into_iter()
            .map(|(_, all)| all.into_iter().map(|one| (one.name, one.title)).collect())
            .collect();
        let pair = |name: &str| (name.to_owned(), format!("All of {name}"));
        assert_eq!(listed, [vec![pair("mill_3")], vec![pair("first_run")]]);
    }

    #[test]
    fn an_unknown_name_proposes_the_nearest_and_says_where_was_looked() {
        let folder = tempfile::tempdir().unwrap();
        let homes = [home_with(folder.path(), &["first_run", "gap_first"])];
        for (given, near) in [
            ("frist_run", Some("first_run")),
            ("first", Some("first_run")),
            ("gap", Some("gap_first")),
            ("qqq", None),
        ] {
            let said = find_in(Path::new(given), &homes).unwrap_err().to_string();
            assert!(said.contains(&homes[0].display().to_string()), "{said}");
            match near {
                Some(near) => {
                    let words = format!("did you mean {near}?");
                    assert!(said.contains(&words), "{said}");
                }
                None => assert!(!said.contains("did you mean"), "{said}"),
            }
        }
    }
}
