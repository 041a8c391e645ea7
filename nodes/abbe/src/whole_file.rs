//! Files that are there whole or not at all: a disk that fills up leaves no half of a page behind.

use std::fs::File;
use std::io::{ErrorKind, Write as _};
use std::path::Path;

use anyhow::{Context, Result, anyhow};

/// Writes a file in the place of the old one; where that fails, the old one stays as it was.
///
/// # Errors
/// When it cannot be written.
pub fn write(path: &Path, text: &str) -> Result<()> {
    write_bytes(path, text.as_bytes())
}

/// The same of bytes.
///
/// # Errors
/// When it cannot be written.
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    // A device or a pipe takes what comes; a link stays one.
    let is_special =
        |path: &Path| std::fs::metadata(path).is_ok_and(|it| !it.is_file() && !it.is_dir());
    if is_special(path) {
        return std::fs::write(path, bytes).with_context(|| path.display().to_string());
    }
    let target = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    replace(&target, bytes).with_context(|| path.display().to_string())
}

fn replace(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let new = path.with_file_name(format!(".{name}.new"));
    let written = std::fs::write(&new, bytes).and_then(|()| std::fs::rename(&new, path));
    if written.is_err() {
        // What could not be written whole must not stay beside the old file.
        let _ = std::fs::remove_file(&new);
    }
    match written {
        // A file that may be written in a folder that may not.
        Err(error) if error.kind() == ErrorKind::PermissionDenied && path.is_file() => {
            std::fs::write(path, bytes)
        }
        written => written,
    }
}

/// Writes a file that is not there yet; where that fails, none is left. `remedy`: what to do where one is there.
///
/// # Errors
/// When it is there, or cannot be written.
pub fn create(path: &Path, text: &str, remedy: &str) -> Result<()> {
    let shown = path.display();
    let mut file = File::create_new(path).map_err(|error| match error.kind() {
        ErrorKind::AlreadyExists => {
            anyhow!("{shown}: there already, and not overwritten: {remedy}")
        }
        _ => anyhow!("{shown}: {error}"),
    })?;
    let written = file.write_all(text.as_bytes());
    if written.is_err() {
        // Half a file must not be used, nor stand in the way of the next attempt.
        let _ = std::fs::remove_file(path);
    }
    written.with_context(|| shown.to_string())
}

/// Writes files that are not there yet, all or none: where one fails, those before it are removed.
///
/// # Errors
/// As [`create`].
pub fn create_all<'a>(
    files: impl IntoIterator<Item = (&'a Path, &'a str)>,
    remedy: &str,
) -> Result<()> {
    let mut made: Vec<&Path> = Vec::new();
    for (path, text) in files {
        if let Err(error) = create(path, text, remedy) {
            for path in made {
                let _ = std::fs::remove_file(path);
            }
            return Err(error);
        }
        made.push(path);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn new_files_are_written_all_or_none_and_none_is_overwritten() {
        let home = tempfile::tempdir().unwrap();
        let [first, second] = ["a.com", "b.com"].map(|name| home.path().join(name));
        std::fs::write(&second, "mine").unwrap();
        let files = [(first.as_path(), "1"), (second.as_path(), "2")];
        let error = create_all(files, "name another folder")
            .unwrap_err()
            .to_string();
        assert!(
            error.ends_with("not overwritten: name another folder"),
            "{error}"
        );
        assert!(!first.exists());
        assert_eq!(std::fs::read_to_string(&second).unwrap(), "mine");
        std::fs::remove_file(&second).unwrap();
        create_all(files, "").unwrap();
        assert_eq!(std::fs::read_to_string(&first).unwrap(), "1");
    }

    #[test]
    fn a_file_that_cannot_be_written_leaves_the_old_one_and_nothing_beside_it() {
        let home = tempfile::tempdir().unwrap();
        let page = home.path().join("page.html");
        write(&page, "old").unwrap();
        write(&page, "new").unwrap();
        assert_eq!(std::fs::read_to_string(&page).unwrap(), "new");
        // A folder in its place.
        let taken = home.path().join("folder");
        std::fs::create_dir_all(taken.join("full")).unwrap();
        let error = write(&taken, "text").unwrap_err();
        assert!(format!("{error:#}").contains("folder"), "{error:#}");
        let missing = write(&home.path().join("no/such/page"), "text");
        assert!(format!("{:#}", missing.unwrap_err()).contains("no/such/page"));
        let mut left: Vec<_> = std::fs::read_dir(home.path())
            .unwrap()
            .map(|entry| entry.unwrap().file_name())
            .collect();
        left.sort();
        assert_eq!(left, ["folder", "page.html"]);
    }
}
