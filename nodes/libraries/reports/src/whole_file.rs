//! Files that are there whole or not at all: a disk that fills up leaves no half of a page behind.
#![expect(
    clippy::disallowed_methods,
    reason = "here reports and whatever else a person asked for become files"
)]

use std::fs::File;
use std::io::{ErrorKind, Write as _};
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use anyhow::{Context, Result, anyhow, bail};
use nix::sys::signal::{Signal, killpg};
use nix::unistd::Pid;
use node_runtime::interruption::Interruption;
use node_runtime::{complain, text_file};

mod output;

pub use output::{Form, Output, check_outputs};

/// Outputs that the caller has opened for this process, whatever they are.
const OWN_OUTPUTS: [&str; 3] = ["/dev/stdout", "/dev/stderr", "/dev/fd"];

/// Whether a path names an output that the caller has opened, as `>(gzip)` of a shell.
fn is_own_output(path: &Path) -> bool {
    OWN_OUTPUTS.iter().any(|own| path.starts_with(own))
}

/// Refuses a place of an output where something is that is no regular file: a pipe would wait for a reader for ever, and a
/// device take what nobody reads.
///
/// # Errors
/// With the kind of what is there.
pub fn must_be_regular(path: &Path) -> Result<()> {
    let kind = std::fs::metadata(path).map(|there| text_file::kind_of(there.file_type()));
    match kind {
        Ok(Some(kind)) => bail!(
            "{}: is {kind}, must be a regular file, or not be there: name another file",
            path.display()
        ),
        _ => Ok(()),
    }
}

/// Refuses the place of an output as [`must_be_regular`], unless the caller has opened it for this process.
///
/// # Errors
/// As [`must_be_regular`].
pub fn can_be_output(path: &Path) -> Result<()> {
    if is_own_output(path) {
        return Ok(());
    }
    must_be_regular(path)
}

/// Writes a file in the place of the old one; where that fails, the old one stays as it was.
///
/// # Errors
/// When it cannot be written, or something else than a file is there.
pub fn write(path: &Path, text: &str) -> Result<()> {
    write_bytes(path, text.as_bytes())
}

/// The same of bytes.
///
/// # Errors
/// As [`write()`].
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    if is_own_output(path) {
        return std::fs::write(path, bytes).with_context(|| path.display().to_string());
    }
    must_be_regular(path)?;
    // A link stays one.
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

/// Between two looks at the signals, where nothing else is to be done.
const LOOK: Duration = Duration::from_secs(3600);
/// How often what is being filled is removed, and the pause between two attempts.
const ATTEMPTS: u32 = 20;
const BETWEEN: Duration = Duration::from_millis(20);
/// Exit code of a process that SIGINT ended, as shells count it.
const INTERRUPTED_CODE: i32 = 130;

/// Folders that go away when a signal ends the process.
static VANISHING: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());
/// Groups of processes that are ended before.
static HELPERS: Mutex<Vec<Pid>> = Mutex::new(Vec::new());

/// A group of processes that is ended with this, and when a signal ends the process while a [`Vanishing`] is there: what
/// still writes into a folder that goes away would make it again.
#[derive(Debug)]
pub struct Helpers {
    group: Pid,
}

impl Helpers {
    /// Starts a process as the first of a group of its own. No signal comes between its start and its entry in the list.
    ///
    /// # Errors
    /// When it cannot be started.
    pub fn start(command: &mut Command) -> Result<(Child, Self)> {
        let mut all = HELPERS.lock().unwrap_or_else(PoisonError::into_inner);
        let child = command.process_group(0).spawn()?;
        let group = Pid::from_raw(i32::try_from(child.id())?);
        all.push(group);
        Ok((child, Self { group }))
    }
}

impl Drop for Helpers {
    fn drop(&mut self) {
        // A group that has ended already is no fault.
        let _ = killpg(self.group, Signal::SIGKILL);
        let mut all = HELPERS.lock().unwrap_or_else(PoisonError::into_inner);
        all.retain(|other| *other != self.group);
    }
}

/// A folder that goes away with this, and when SIGINT, SIGTERM or SIGHUP ends the process.
#[derive(Debug)]
pub struct Vanishing {
    path: PathBuf,
}

impl Vanishing {
    /// Takes charge of a folder that is there. From now on these signals end the process without its destructors, after the
    /// folder is gone.
    ///
    /// # Errors
    /// When the signals cannot be listened to.
    pub fn of(path: PathBuf) -> Result<Self> {
        // It is removed where the signals cannot be listened to, after the list is free again.
        let own = Self { path };
        own.enlist()?;
        Ok(own)
    }

    fn enlist(&self) -> Result<()> {
        let mut all = VANISHING.lock().unwrap_or_else(PoisonError::into_inner);
        if all.is_empty() {
            listen()?;
        }
        all.push(self.path.clone());
        Ok(())
    }

    /// A folder among the system's temporary ones.
    ///
    /// # Errors
    /// When it cannot be made.
    pub fn temporary() -> Result<Self> {
        let home = tempfile::Builder::new().prefix("abbe_").tempdir();
        Self::of(home.context("a temporary folder")?.keep())
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for Vanishing {
    fn drop(&mut self) {
        if let Err(error) = std::fs::remove_dir_all(&self.path)
            && error.kind() != ErrorKind::NotFound
        {
            complain!("abbe: {}: not removed: {error}", self.path.display());
        }
        let mut all = VANISHING.lock().unwrap_or_else(PoisonError::into_inner);
        all.retain(|other| *other != self.path);
        // The listener stays: an entry that is not there keeps a second one from being started.
        if all.is_empty() {
            all.push(PathBuf::new());
        }
    }
}

/// Waits for a signal in a thread of its own.
fn listen() -> Result<()> {
    let interruption = Interruption::listen("nothing is kept")?;
    let wait = move || {
        while !interruption.wait(LOOK) {}
        // From here on whoever waits for a helper does not come past the end of its folder, and no helper is started.
        let all = VANISHING.lock().unwrap_or_else(PoisonError::into_inner);
        let helpers = HELPERS.lock().unwrap_or_else(PoisonError::into_inner);
        for group in helpers.iter() {
            let _ = killpg(*group, Signal::SIGKILL);
        }
        for path in all.iter().filter(|path| !path.as_os_str().is_empty()) {
            // The other thread may write one more file meanwhile.
            for _ in 0..ATTEMPTS {
                match std::fs::remove_dir_all(path) {
                    Err(error) if error.kind() != ErrorKind::NotFound => {
                        std::thread::sleep(BETWEEN);
                    }
                    _ => break,
                }
            }
        }
        complain!("abbe: interrupted; what was begun is removed");
        std::process::exit(INTERRUPTED_CODE);
    };
    let thread = std::thread::Builder::new().name("vanishing".to_owned());
    thread.spawn(wait).context("thread of the signals")?;
    Ok(())
}

/// A folder that is made beside its place, and put there when it is whole.
#[derive(Debug)]
pub struct WholeFolder {
    /// Goes away at the end.
    _home: Vanishing,
    /// In it, with the name of its place.
    path: PathBuf,
    place: PathBuf,
}

impl WholeFolder {
    /// Makes room beside `place`, which must not be there, or be an empty folder.
    ///
    /// # Errors
    /// When something is there, or nothing can be made beside it.
    pub fn begin(place: &Path) -> Result<Self> {
        let shown = place.display();
        let name = place
            .file_name()
            .with_context(|| format!("{shown}: no name of a folder"))?;
        if place.exists() {
            let mut entries = std::fs::read_dir(place).with_context(|| shown.to_string())?;
            if entries.next().is_some() {
                bail!("{shown}: there already, and not overwritten: name another folder");
            }
        }
        let parent = place.parent().unwrap_or(Path::new(""));
        if !parent.as_os_str().is_empty() {
            std::fs::create_dir_all(parent).with_context(|| parent.display().to_string())?;
        }
        let new = format!(".{}.{}.new", name.to_string_lossy(), std::process::id());
        let new = place.with_file_name(new);
        std::fs::create_dir(&new).with_context(|| new.display().to_string())?;
        Ok(Self {
            path: new.join(name),
            _home: Vanishing::of(new)?,
            place: place.to_owned(),
        })
    }

    /// Where it is to be made and filled.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Puts it in its place.
    ///
    /// # Errors
    /// When it cannot be put there; then it is removed.
    pub fn finish(self) -> Result<()> {
        let shown = self.place.display();
        std::fs::rename(&self.path, &self.place).map_err(|error| match error.kind() {
            ErrorKind::DirectoryNotEmpty | ErrorKind::AlreadyExists | ErrorKind::NotADirectory => {
                anyhow!(
                    "{shown}: was made by another process meanwhile, and not overwritten: name another folder"
                )
            }
            _ => anyhow!("{shown}: {error}"),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_helper_starts_while_the_helpers_are_being_ended() {
        let home = tempfile::tempdir().unwrap();
        let began = home.path().join("began");
        let ending = HELPERS.lock().unwrap();
        let mut shell = Command::new("sh");
        shell.arg("-c").arg(format!(": > {}", began.display()));
        let starts = std::thread::spawn(move || Helpers::start(&mut shell).unwrap().0.wait());
        std::thread::sleep(Duration::from_millis(300));
        assert!(!began.exists(), "started, and in no list");
        drop(ending);
        assert!(starts.join().unwrap().unwrap().success());
        assert!(began.exists());
    }

    #[test]
    fn a_place_that_another_process_filled_meanwhile_stays_as_it_is() {
        let home = tempfile::tempdir().unwrap();
        for (name, is_folder) in [("folder", true), ("file", false)] {
            let place = home.path().join(name);
            let whole = WholeFolder::begin(&place).unwrap();
            std::fs::create_dir(whole.path()).unwrap();
            let other = if is_folder {
                std::fs::create_dir(&place).unwrap();
                place.join("a")
            } else {
                place.clone()
            };
            std::fs::write(&other, "theirs").unwrap();
            let refused = whole.finish().unwrap_err().to_string();
            let words =
                format!("{name}: was made by another process meanwhile, and not overwritten");
            assert!(refused.contains(&words), "{refused}");
            assert_eq!(std::fs::read_to_string(&other).unwrap(), "theirs");
            assert_eq!(std::fs::read_dir(home.path()).unwrap().count(), 1);
            if is_folder {
                std::fs::remove_dir_all(&place).unwrap();
            }
        }
    }

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
        assert!(
            format!("{error:#}").contains("is a folder, must be"),
            "{error:#}"
        );
        let missing = write(&home.path().join("no/such/page"), "text");
        assert!(format!("{:#}", missing.unwrap_err()).contains("no/such/page"));
        let mut left: Vec<_> = std::fs::read_dir(home.path())
            .unwrap()
            .map(|entry| entry.unwrap().file_name())
            .collect();
        left.sort();
        assert_eq!(left, ["folder", "page.html"]);
    }

    #[test]
    fn no_output_goes_into_what_is_no_regular_file() {
        let home = tempfile::tempdir().unwrap();
        let (pipe, link) = (home.path().join("pipe"), home.path().join("link"));
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        assert!(made.unwrap().success());
        std::os::unix::fs::symlink(&pipe, &link).unwrap();
        for (path, kind) in [
            (pipe.as_path(), "is a pipe (FIFO)"),
            (link.as_path(), "is a pipe (FIFO)"),
            (Path::new("/dev/zero"), "is a device"),
            (home.path(), "is a folder"),
        ] {
            let error = write(path, "text").unwrap_err().to_string();
            assert!(error.contains(kind), "{error}");
        }
        must_be_regular(&home.path().join("new")).unwrap();
        for own in ["/dev/stdout", "/dev/stderr", "/dev/fd/1"] {
            can_be_output(Path::new(own)).unwrap();
        }
        assert!(can_be_output(Path::new("/dev/zero")).is_err());
    }

    #[test]
    fn a_folder_is_there_whole_or_not_at_all() {
        let home = tempfile::tempdir().unwrap();
        let left = || -> Vec<String> {
            let entries = std::fs::read_dir(home.path()).unwrap();
            entries
                .map(|one| one.unwrap().file_name().into_string().unwrap())
                .collect()
        };
        for is_there in [false, true] {
            let place = home.path().join(if is_there { "empty" } else { "new" });
            if is_there {
                std::fs::create_dir(&place).unwrap();
            }
            let begun = WholeFolder::begin(&place).unwrap();
            std::fs::create_dir(begun.path()).unwrap();
            std::fs::write(begun.path().join("half"), "h").unwrap();
            assert!(!place.join("half").exists());
            drop(begun);
            assert_eq!(
                left().iter().filter(|name| name.ends_with(".new")).count(),
                0
            );
            let begun = WholeFolder::begin(&place).unwrap();
            std::fs::create_dir(begun.path()).unwrap();
            std::fs::write(begun.path().join("whole"), "w").unwrap();
            begun.finish().unwrap();
            assert!(place.join("whole").exists());
            let refused = WholeFolder::begin(&place).unwrap_err().to_string();
            assert!(refused.contains("there already"), "{refused}");
        }
        let mut names = left();
        names.sort();
        assert_eq!(names, ["empty", "new"]);
        let temporary = Vanishing::temporary().unwrap();
        let path = temporary.path().to_owned();
        assert!(path.is_dir());
        drop(temporary);
        assert!(!path.exists());
    }
}
