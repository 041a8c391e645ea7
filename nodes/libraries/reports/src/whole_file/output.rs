//! Where an output may go: never over an input, nor over what is no output of its kind, nor twice to one place.

use std::fs::File;
use std::io::Read as _;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};

use super::{is_own_output, must_be_regular};

/// Largest JSON that is looked into, bytes; a report has some megabytes.
const LARGEST_JSON: u64 = 256 << 20;
/// Bytes at the begin of a page that show its kind.
const HEAD: u64 = 1024;

/// What describes a bag in its folder.
const DESCRIPTION: &str = "metadata.yaml";

/// What stands for standard output where an option can print; those that reach [`check_outputs`] cannot.
const STANDARD_OUTPUT: &str = "-";

/// Kind of an output; where a file is, it must be of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// A page for a browser.
    Html,
    /// A page for a printer.
    Pdf,
    /// Figures of a report or a diagnosis.
    Json,
    /// Whatever is there is refused elsewhere.
    Any,
}

/// A file that will be written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Output {
    option: &'static str,
    path: PathBuf,
    form: Form,
}

impl Output {
    /// What an option names.
    #[must_use]
    pub fn new(option: &'static str, path: PathBuf, form: Form) -> Self {
        Self { option, path, form }
    }

    fn shown(&self) -> String {
        format!("{} {}", self.option, self.path.display())
    }
}

/// Refuses an output that is an input, would replace a file of another kind, or has the path of another output. An empty file
/// may be replaced.
///
/// # Errors
/// The option, the file and what to do instead.
pub fn check_outputs<'p>(
    outputs: &[Output],
    inputs: impl IntoIterator<Item = &'p Path>,
) -> Result<()> {
    let inputs: Vec<PathBuf> = inputs.into_iter().map(place).collect();
    let to_files = outputs.iter().filter(|output| !is_own_output(&output.path));
    let mut places: Vec<(PathBuf, &Output)> = Vec::new();
    for output in to_files {
        if output.path == Path::new(STANDARD_OUTPUT) {
            bail!(
                "{}: is no name of a file, and would write one named `-`: name a file, or /dev/stdout for standard output",
                output.shown()
            );
        }
        must_be_regular(&output.path)?;
        let at = place(&output.path);
        if inputs.iter().any(|input| is_same(input, &at)) {
            bail!("{}: is read as an input: name another file", output.shown());
        }
        if is_part_of_bag(&at, &inputs) {
            bail!(
                "{}: a bag's own folder is read with every *.mcap in it: name a file elsewhere",
                output.shown()
            );
        }
        if let Some((_, other)) = places.iter().find(|(other, _)| is_same(other, &at)) {
            bail!(
                "{}: {} writes there too: name two files",
                output.shown(),
                other.option
            );
        }
        check_form(output)?;
        places.push((at, output));
    }
    Ok(())
}

/// Whether a new file would be read as a part of a bag.
fn is_part_of_bag(at: &Path, inputs: &[PathBuf]) -> bool {
    let is_mcap = at.extension().is_some_and(|it| it == "mcap");
    let of_bag = |folder: &Path| {
        inputs.iter().any(|input| input == folder) || folder.join(DESCRIPTION).is_file()
    };
    is_mcap && at.parent().is_some_and(of_bag)
}

/// A path without links, also of a file that is not there yet.
fn place(path: &Path) -> PathBuf {
    if let Ok(place) = path.canonicalize() {
        return place;
    }
    let parent = path.parent().unwrap_or(Path::new(""));
    let parent = if parent.as_os_str().is_empty() {
        Path::new(".")
    } else {
        parent
    };
    match (parent.canonicalize(), path.file_name()) {
        (Ok(parent), Some(name)) => parent.join(name),
        _ => path.to_owned(),
    }
}

/// Whether two places are one file, by one name or by two.
fn is_same(a: &Path, b: &Path) -> bool {
    let id = |path: &Path| std::fs::metadata(path).map(|it| (it.dev(), it.ino()));
    a == b || id(a).is_ok_and(|a| id(b).is_ok_and(|b| a == b))
}

fn check_form(output: &Output) -> Result<()> {
    let size = std::fs::metadata(&output.path).map_or(0, |file| file.len());
    if size == 0 || output.form == Form::Any {
        return Ok(());
    }
    let (is_of_form, kind) = match output.form {
        Form::Html => (is_html(&read(output, HEAD)?), "HTML page"),
        Form::Pdf => (read(output, HEAD)?.starts_with(b"%PDF"), "PDF"),
        _ => (
            size <= LARGEST_JSON && is_ours(&read(output, LARGEST_JSON)?),
            "JSON of Abbe",
        ),
    };
    if is_of_form {
        return Ok(());
    }
    bail!(
        "{}: is there already, is no {kind}, and is not overwritten: name another file",
        output.shown()
    )
}

fn read(output: &Output, most: u64) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let file = File::open(&output.path).with_context(|| output.shown())?;
    let read = file.take(most).read_to_end(&mut bytes);
    read.with_context(|| output.shown())?;
    Ok(bytes)
}

fn is_html(head: &[u8]) -> bool {
    let head = String::from_utf8_lossy(head).to_ascii_lowercase();
    head.trim_start_matches('\u{feff}')
        .trim_start()
        .starts_with("<!doctype html")
}

/// A diagnosis has its schema, a report its title.
fn is_ours(text: &[u8]) -> bool {
    let Ok(value) = serde_json::from_slice::<serde_json::Value>(text) else {
        return false;
    };
    let schema = value["schema"].as_str();
    schema.is_some_and(|schema| schema.starts_with("abbe.")) || value["title"].is_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(outputs: &[Output], inputs: &[&Path]) -> Option<String> {
        let checked = check_outputs(outputs, inputs.iter().copied());
        checked.err().map(|error| format!("{error:#}"))
    }

    #[test]
    fn an_output_replaces_an_output_of_its_kind_alone() {
        let home = tempfile::tempdir().unwrap();
        let at = |name: &str, text: &str| {
            let path = home.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        let html = at("a", "\u{feff}\n<!doctype HTML><html>");
        let pdf = at("b", "%PDF-1.7 ...");
        let gap = at("c", r#"{"inputs": {}, "schema": "abbe.gap/1"}"#);
        let report = at("d", r#"{"title": "Tests in bag"}"#);
        let empty = at("e", "");
        let new = home.path().join("new");
        let foreign = [
            at("bag.mcap", "\u{89}MCAP0\r\n"),
            at("machine.yaml", "name: m\n"),
            at("store.sqlite", "SQLite format 3\0"),
            at("table.csv", "target,deviation\n"),
            at("package.json", r#"{"name": "x"}"#),
            at("half.json", r#"{"title": "#),
        ];
        for (form, own) in [
            (Form::Html, vec![&html]),
            (Form::Pdf, vec![&pdf]),
            (Form::Json, vec![&gap, &report]),
        ] {
            for good in own.iter().copied().chain([&empty, &new]) {
                let output = Output::new("--x", good.clone(), form);
                assert_eq!(refusal(&[output], &[]), None, "{form:?} {good:?}");
            }
            let pages = [&html, &pdf, &gap, &report];
            let others = pages.into_iter().filter(|page| !own.contains(page));
            for bad in others.chain(&foreign) {
                let output = Output::new("--x", bad.clone(), form);
                let said = refusal(&[output], &[]).unwrap();
                assert!(said.contains("is not overwritten"), "{said}");
                assert!(
                    said.starts_with("--x ") && said.contains("is no "),
                    "{said}"
                );
            }
        }
    }

    #[test]
    fn a_file_that_would_be_a_part_of_a_bag_is_refused() {
        let home = tempfile::tempdir().unwrap();
        let [bag, other] = ["bag", "other"].map(|name| home.path().join(name));
        for folder in [&bag, &other] {
            std::fs::create_dir(folder).unwrap();
        }
        std::fs::write(other.join("metadata.yaml"), "").unwrap();
        let said = |path: PathBuf| {
            let output = Output::new("--json", path, Form::Json);
            refusal(&[output], &[&bag])
        };
        for folder in [&bag, &other] {
            let refused = said(folder.join("x.mcap")).unwrap();
            assert!(
                refused.contains("is read with every *.mcap in it"),
                "{refused}"
            );
            assert_eq!(said(folder.join("x.json")), None);
        }
        assert_eq!(said(home.path().join("x.mcap")), None);
    }

    #[test]
    fn a_dash_is_no_file() {
        for (option, form) in [
            ("--html", Form::Html),
            ("--pdf", Form::Pdf),
            ("--json", Form::Json),
            ("--write-machine", Form::Any),
        ] {
            let said = refusal(&[Output::new(option, "-".into(), form)], &[]).unwrap();
            assert!(said.starts_with(&format!("{option} -: ")), "{said}");
            assert!(said.contains("name a file, or /dev/stdout"), "{said}");
            for good in ["./-", "a-", "-.html"] {
                assert_eq!(
                    refusal(&[Output::new(option, good.into(), form)], &[]),
                    None
                );
            }
        }
    }

    #[test]
    fn no_output_is_an_input_or_another_output_by_any_of_their_names() {
        let home = tempfile::tempdir().unwrap();
        let page = home.path().join("page.html");
        std::fs::write(&page, "<!DOCTYPE html>").unwrap();
        let [link, hard, dots] =
            ["link", "hard", "folder/../page.html"].map(|n| home.path().join(n));
        std::os::unix::fs::symlink(&page, &link).unwrap();
        std::fs::hard_link(&page, &hard).unwrap();
        std::fs::create_dir(home.path().join("folder")).unwrap();
        for name in [&page, &link, &hard, &dots] {
            let one = Output::new("--html", name.clone(), Form::Html);
            let said = refusal(std::slice::from_ref(&one), &[&page]).unwrap();
            assert!(said.contains("is read as an input"), "{said}");
            let two = Output::new("--json", page.clone(), Form::Json);
            let said = refusal(&[one, two], &[]).unwrap();
            assert!(said.contains("--html writes there too"), "{said}");
        }
        // Not there yet.
        let new = home.path().join("folder/new");
        let same = home.path().join("folder/../folder/new");
        let two = [
            Output::new("--html", new, Form::Html),
            Output::new("--pdf", same, Form::Pdf),
        ];
        let said = refusal(&two, &[]).unwrap();
        assert!(said.contains("name two files"), "{said}");
        let own = ["--html", "--json"].map(|o| Output::new(o, "/dev/stdout".into(), Form::Html));
        assert_eq!(refusal(&own, &[]), None);
    }
}
