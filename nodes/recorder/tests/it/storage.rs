//! Disks that fill up and directories that are there already.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use recorder::{
    Bag, ChunkCompression, Directory, MessageStamp, Order, RecorderConfig, RecorderError,
    Recording, Shelf,
};

use crate::sample::{add_channels, message, read, record, small_chunks};

/// A directory on a disk of so many bytes.
pub struct SmallDisk {
    inner: Directory,
    left: Arc<Mutex<u64>>,
}

impl SmallDisk {
    pub fn of(path: &Path, bytes: u64) -> Self {
        Self {
            inner: Directory::create(path).unwrap(),
            left: Arc::new(Mutex::new(bytes)),
        }
    }
}

pub struct SmallFile {
    file: File,
    left: Arc<Mutex<u64>>,
}

impl Write for SmallFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut left = self.left.lock().unwrap();
        let fits = (bytes.len() as u64).min(*left) as usize;
        if fits == 0 && !bytes.is_empty() {
            return Err(io::ErrorKind::StorageFull.into());
        }
        *left -= fits as u64;
        self.file.write_all(&bytes[..fits])?;
        Ok(fits)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Shelf for SmallDisk {
    type File = SmallFile;

    fn create(&mut self, name: &str) -> io::Result<SmallFile> {
        Ok(SmallFile {
            file: self.inner.create(name)?,
            left: Arc::clone(&self.left),
        })
    }

    fn replace(&mut self, name: &str, contents: &[u8]) -> io::Result<()> {
        self.inner.replace(name, contents)
    }

    fn truncate(&mut self, name: &str, length_bytes: u64) -> io::Result<()> {
        self.inner.truncate(name, length_bytes)
    }

    fn settle(&mut self, name: &str) -> io::Result<()> {
        self.inner.settle(name)
    }

    fn path(&self) -> &Path {
        self.inner.path()
    }
}

/// Writes until the disk is full; gives the error and the number of messages offered until then.
fn fill<S: Shelf>(recording: &mut Recording<S>, most: i64) -> Result<(), (RecorderError, i64)> {
    let ids = add_channels(recording);
    for n in 0..most {
        let m = message(n);
        recording
            .write(ids[m.channel], m.stamp, &m.data)
            .map_err(|error| (error, n + 1))?;
    }
    Ok(())
}

#[test]
fn a_full_disk_is_named_with_counts_and_what_is_written_stays_readable() {
    for disk_bytes in [9_000, 14_321, 20_000, 33_333, 50_001] {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("run");
        let shelf = SmallDisk {
            inner: Directory::create(&path).unwrap(),
            left: Arc::new(Mutex::new(disk_bytes)),
        };
        let config = small_chunks(ChunkCompression::None);
        let mut recording = Recording::begin(shelf, "run", config).unwrap();
        let (error, offered) = fill(&mut recording, 10_000).unwrap_err();
        let RecorderError::StorageFull {
            path: file,
            bytes_written,
            messages_written,
            messages_lost,
            ..
        } = &error
        else {
            panic!("{error}");
        };
        assert_eq!(*file, path.join("run_0.mcap"));
        assert_eq!(messages_written + messages_lost, offered as u64);
        assert!(*messages_lost > 0);
        assert_eq!(fs::metadata(file).unwrap().len(), *bytes_written);
        let (found, losses) = read(&Bag::open(&path).unwrap(), Order::File);
        assert_eq!(found.len() as u64, *messages_written);
        crate::sample::expect_first(&found, found.len() as i64);
        assert_eq!(losses.len(), 1, "the missing index is said");
        // Every message after that is counted too, and the end says so.
        let m = message(0);
        let id = recording
            .add_channel(&crate::sample::channels()[0])
            .unwrap();
        assert!(recording.write(id, m.stamp, &m.data).is_err());
        let text = recording.finish().unwrap_err().to_string();
        let lost = messages_lost + 1;
        assert!(
            text.ends_with(&format!("{lost} messages are lost")),
            "{text}"
        );
    }
}

/// A directory whose files the system itself refuses to fill.
struct DevFull {
    inner: Directory,
}

impl Shelf for DevFull {
    type File = File;

    fn create(&mut self, _: &str) -> io::Result<File> {
        fs::OpenOptions::new().write(true).open("/dev/full")
    }

    fn replace(&mut self, name: &str, contents: &[u8]) -> io::Result<()> {
        self.inner.replace(name, contents)
    }

    fn truncate(&mut self, _: &str, _: u64) -> io::Result<()> {
        Ok(())
    }

    fn settle(&mut self, _: &str) -> io::Result<()> {
        Ok(())
    }

    fn path(&self) -> &Path {
        self.inner.path()
    }
}

#[test]
fn the_systems_own_full_device_is_recognised() {
    let home = tempfile::tempdir().unwrap();
    let inner = Directory::create(&home.path().join("run")).unwrap();
    let begun = Recording::begin(DevFull { inner }, "run", RecorderConfig::default());
    let Err(error) = begun else {
        panic!("a full device took a header");
    };
    assert!(
        matches!(error, RecorderError::StorageFull { .. }),
        "{error}"
    );
}

/// A file system of 256 KiB in memory, unmounted when dropped.
struct Tmpfs(PathBuf);

impl Tmpfs {
    fn mount(at: PathBuf) -> Option<Self> {
        fs::create_dir(&at).unwrap();
        let mounted = std::process::Command::new("mount")
            .args(["-t", "tmpfs", "-o", "size=256k", "tmpfs"])
            .arg(&at)
            .output();
        let mounted = mounted.is_ok_and(|output| output.status.success());
        mounted.then_some(Self(at))
    }
}

impl Drop for Tmpfs {
    fn drop(&mut self) {
        let _ = std::process::Command::new("umount").arg(&self.0).status();
    }
}

#[test]
fn a_file_system_that_fills_up_leaves_a_readable_directory() {
    let home = tempfile::tempdir().unwrap();
    // Where mounting is not allowed, the same steps run on a disk that counts.
    let tmpfs = Tmpfs::mount(home.path().join("small"));
    let root = tmpfs
        .as_ref()
        .map_or_else(|| home.path().to_owned(), |t| t.0.clone());
    let path = root.join("run");
    let left = if tmpfs.is_some() { u64::MAX } else { 1 << 18 };
    let shelf = SmallDisk {
        inner: Directory::create(&path).unwrap(),
        left: Arc::new(Mutex::new(left)),
    };
    let config = small_chunks(ChunkCompression::None);
    let mut recording = Recording::begin(shelf, "run", config).unwrap();
    let (error, offered) = fill(&mut recording, 100_000).unwrap_err();
    let RecorderError::StorageFull {
        messages_written,
        messages_lost,
        ..
    } = error
    else {
        panic!("{error}");
    };
    assert_eq!(messages_written + messages_lost, offered as u64);
    let bag = Bag::open(&path).unwrap();
    let (found, losses) = read(&bag, Order::LogTime);
    assert_eq!(found.len() as u64, messages_written);
    assert_eq!(losses.len(), 1);
    assert!(messages_written > 100, "{messages_written}");
}

#[test]
fn an_existing_directory_is_refused_by_name_and_left_alone() {
    let home = tempfile::tempdir().unwrap();
    let (path, _) = record(home.path(), 10, RecorderConfig::default());
    let before = fs::read(path.join("run_0.mcap")).unwrap();
    let refused = Directory::create(&path).unwrap_err();
    assert!(matches!(&refused, RecorderError::Exists { path: p } if *p == path));
    assert_eq!(fs::read(path.join("run_0.mcap")).unwrap(), before);
}

#[test]
fn malformed_calls_are_refused_and_harm_nothing() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("run");
    let shelf = Directory::create(&path).unwrap();
    let mut recording = Recording::begin(shelf, "run", RecorderConfig::default()).unwrap();
    let ids = add_channels(&mut recording);
    let stamp = MessageStamp {
        log_time_nanos: -1,
        ..MessageStamp::default()
    };
    let text = recording.write(ids[2], stamp, &[]).unwrap_err().to_string();
    assert_eq!(text, "topic /note: log time -1 ns is before the epoch");
    let mut other = crate::sample::channels()[2].clone();
    other.type_name = "std_msgs/msg/Empty".into();
    let text = recording.add_channel(&other).unwrap_err().to_string();
    assert!(text.contains("std_msgs/msg/String"), "{text}");
    let m = message(5);
    recording.write(ids[2], m.stamp, &m.data).unwrap();
    assert_eq!(recording.finish().unwrap().messages_written, 1);
    let missing = Bag::open(home.path().join("nothing")).unwrap_err();
    assert!(matches!(missing, RecorderError::Open { .. }));
    let empty = home.path().join("empty");
    fs::create_dir(&empty).unwrap();
    let empty = Bag::open(empty).unwrap_err();
    assert!(matches!(empty, RecorderError::NoFiles { inside: None, .. }));
    // A folder of a run, in which the bag is.
    let error = Bag::open(home.path()).unwrap_err();
    let RecorderError::NoFiles {
        inside: Some(bag), ..
    } = &error
    else {
        panic!("{error}");
    };
    assert!(Bag::open(bag).is_ok());
    assert!(
        error
            .to_string()
            .ends_with(&format!("; {} does", bag.display())),
        "{error}"
    );
}
