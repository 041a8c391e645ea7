//! What rosbag2 writes besides MCAP with compressed chunks is refused by name.

use std::fs;
use std::path::Path;

use recorder::{Bag, ChunkCompression, MessageOrder, Order, RecorderConfig};

use crate::sample::{expect_first, read, record, record_run, small_chunks};

/// A small recording whose `metadata.yaml` says that rosbag2 has compressed it.
fn compressed(home: &Path, mode: &str) -> std::path::PathBuf {
    let (path, _) = record(home, 12, small_chunks(ChunkCompression::None));
    let metadata = path.join("metadata.yaml");
    let text = fs::read_to_string(&metadata).unwrap();
    let plain = "compression_mode: \"\"";
    assert!(text.contains(plain), "{text}");
    let said = text.replace(plain, &format!("compression_mode: {mode}"));
    fs::write(&metadata, said).unwrap();
    path
}

fn refusal(path: &Path) -> String {
    Bag::open(path).unwrap_err().to_string()
}

#[test]
fn messages_that_rosbag2_compressed_one_by_one_are_refused_as_a_directory_and_as_a_file() {
    let home = tempfile::tempdir().unwrap();
    let path = compressed(home.path(), "MESSAGE");
    for path in [path.clone(), path.join("run_0.mcap")] {
        let said = refusal(&path);
        assert!(said.contains("compressed one by one"), "{said}");
        assert!(said.contains("ros2 bag convert"), "{said}");
        assert!(said.contains(&*path.to_string_lossy()), "{said}");
    }
}

#[test]
fn a_bag_whose_description_names_no_compression_of_its_own_is_read() {
    let home = tempfile::tempdir().unwrap();
    let path = compressed(home.path(), "NONE");
    assert_eq!(Bag::open(path).unwrap().message_count(), 12);
}

#[test]
fn files_that_are_compressed_as_a_whole_and_databases_are_refused() {
    let home = tempfile::tempdir().unwrap();
    let cases: [(&str, &[u8], &str); 2] = [
        (
            "run_0.mcap.zstd",
            b"\x28\xb5\x2f\xfd\x04\x58 and more",
            "compressed as a whole",
        ),
        ("run_0.db3", b"SQLite format 3\0 and more", "SQLite"),
    ];
    for (name, bytes, what) in cases {
        let file = home.path().join(name);
        fs::write(&file, bytes).unwrap();
        let said = refusal(&file);
        assert!(said.contains(what) && said.contains(name), "{said}");
        assert!(said.contains("ros2 bag convert"), "{said}");
        let folder = home.path().join(format!("{name}_bag"));
        fs::create_dir(&folder).unwrap();
        fs::rename(&file, folder.join(name)).unwrap();
        let listed = format!(
            "rosbag2_bagfile_information:\n  version: 9\n  compression_mode: FILE\n  relative_file_paths:\n  - {name}\n"
        );
        fs::write(folder.join("metadata.yaml"), listed).unwrap();
        let said = refusal(&folder);
        assert!(said.contains(what) && said.contains(name), "{said}");
    }
}

/// Puts something of the name into a bag's folder.
type Stray = fn(&Path);

const STRAYS: [(&str, Stray, &str); 6] = [
    (
        "dead.mcap",
        |path| std::os::unix::fs::symlink("nowhere", path).unwrap(),
        "is a link that leads nowhere",
    ),
    (
        "folder.mcap",
        |path| fs::create_dir(path).unwrap(),
        "is a folder",
    ),
    (
        "pipe.mcap",
        |path| {
            let made = std::process::Command::new("mkfifo").arg(path).status();
            assert!(made.unwrap().success());
        },
        "is a pipe (FIFO)",
    ),
    (
        "device.mcap",
        |path| std::os::unix::fs::symlink("/dev/zero", path).unwrap(),
        "is a device",
    ),
    (
        "database.mcap",
        |path| fs::write(path, b"SQLite format 3\0 and more").unwrap(),
        "is an SQLite database",
    ),
    (
        "junk.mcap",
        |path| fs::write(path, [0x5a; 64]).unwrap(),
        "not an MCAP file",
    ),
];

#[test]
fn what_is_no_part_of_a_bag_is_a_loss_with_its_name_and_the_parts_are_read() {
    for order in [Order::File, Order::LogTime] {
        for (name, put, reason) in STRAYS {
            let home = tempfile::tempdir().unwrap();
            let (path, _) = record(home.path(), 60, small_chunks(ChunkCompression::None));
            put(&path.join(name));
            let (found, losses) = read(&Bag::open(&path).unwrap(), order);
            expect_first(&found, 60);
            assert_eq!(losses.len(), 1, "{losses:?}");
            let words = losses[0].to_string();
            assert!(words.contains(name) && words.contains(reason), "{words}");
        }
    }
}

#[test]
fn a_part_that_the_description_names_and_that_is_no_file_is_one_loss() {
    for (_, put, reason) in STRAYS {
        let home = tempfile::tempdir().unwrap();
        let config = RecorderConfig {
            max_file_s: 0.2,
            flush_period_s: 0.05,
            ..RecorderConfig::default()
        };
        let (path, summary) = record(home.path(), 600, config);
        assert!(summary.files.len() > 1, "{:?}", summary.files);
        let part = path.join(&summary.files[0]);
        fs::remove_file(&part).unwrap();
        put(&part);
        let bag = Bag::open(&path).unwrap();
        assert_eq!(bag.description_losses(), []);
        let (found, losses) = read(&bag, Order::LogTime);
        assert!(!found.is_empty() && found.len() < 600);
        assert_eq!(losses.len(), 1, "{losses:?}");
        let words = losses[0].to_string();
        assert!(words.contains(reason), "{words}");
    }
}

#[test]
fn a_description_that_contradicts_the_files_or_is_no_file_is_a_loss() {
    let changes: [(&str, &str); 4] = [
        ("storage_identifier: mcap", "storage_identifier: sqlite3"),
        ("compression_mode: \"\"", "compression_mode: file"),
        ("compression_mode: \"\"", "compression_mode: SOME"),
        ("compression_format: \"\"", "compression_format: zstd"),
    ];
    for (from, to) in changes {
        let home = tempfile::tempdir().unwrap();
        let (path, _) = record(home.path(), 12, small_chunks(ChunkCompression::None));
        let metadata = path.join("metadata.yaml");
        let text = fs::read_to_string(&metadata).unwrap();
        assert!(text.contains(from), "{text}");
        fs::write(&metadata, text.replace(from, to)).unwrap();
        let bag = Bag::open(&path).unwrap();
        assert_eq!(bag.message_count(), 12);
        let losses = bag.description_losses();
        assert_eq!(losses.len(), 1, "{losses:?}");
        let words = losses[0].to_string();
        let (key, value) = to.split_once(": ").unwrap();
        assert!(words.contains(&format!("{key} = {value}: ")), "{words}");
    }
    for (name, put, reason) in &STRAYS[..4] {
        let home = tempfile::tempdir().unwrap();
        let (path, _) = record(home.path(), 12, small_chunks(ChunkCompression::None));
        let metadata = path.join("metadata.yaml");
        fs::remove_file(&metadata).unwrap();
        put(&metadata);
        let losses = Bag::open(&path).unwrap().description_losses().to_vec();
        assert_eq!(losses.len(), 1, "{name}: {losses:?}");
        assert!(losses[0].to_string().contains(reason), "{losses:?}");
    }
}

#[test]
fn parts_whose_names_are_exchanged_are_read_in_the_order_of_a_composed_run_alone() {
    for (order, is_composed) in [
        (Some(MessageOrder::Total), true),
        (Some(MessageOrder::Arrival), false),
        (None, false),
    ] {
        let home = tempfile::tempdir().unwrap();
        let config = RecorderConfig {
            max_file_s: 0.2,
            flush_period_s: 0.05,
            ..RecorderConfig::default()
        };
        let (path, summary) = record_run(home.path(), 600, config, order);
        let parts: Vec<_> = summary.files.iter().map(|name| path.join(name)).collect();
        assert!(parts.len() > 2, "{parts:?}");
        let aside = path.join("aside");
        fs::rename(&parts[0], &aside).unwrap();
        fs::rename(&parts[1], &parts[0]).unwrap();
        fs::rename(&aside, &parts[1]).unwrap();
        let bag = Bag::open(&path).unwrap();
        assert_eq!(bag.has_overlapping_files(), !is_composed);
        assert!(!bag.has_doubled_file());
        let times: Vec<i64> = read(&bag, Order::File)
            .0
            .iter()
            .map(|it| it.stamp.log_time_nanos)
            .collect();
        assert_eq!(times.len(), 600);
        assert_eq!(times.is_sorted(), is_composed);
        fs::copy(&parts[0], path.join("run_99.mcap")).unwrap();
        assert!(Bag::open(&path).unwrap().has_doubled_file());
    }
}

/// Names the files as rosbag2 of Lyrical does, one each ten seconds: `0_run_2026_11_30-17_24_50`.
fn renamed_as_by_lyrical(path: &Path, files: &[String]) {
    let metadata = path.join("metadata.yaml");
    let mut text = fs::read_to_string(&metadata).unwrap();
    for (place, file) in files.iter().enumerate() {
        let second = 50 + 10 * place;
        let (minute, second) = (24 + second / 60, second % 60);
        let name = format!("{place}_run_2026_11_30-17_{minute}_{second:02}.mcap");
        fs::rename(path.join(file), path.join(&name)).unwrap();
        text = text.replace(&format!(" {file}\n"), &format!(" {name}\n"));
    }
    assert!(text.contains("ros_distro: jazzy"), "{text}");
    fs::write(metadata, text.replace("jazzy", "lyrical")).unwrap();
}

#[test]
fn a_bag_of_lyrical_is_read_in_order_with_and_without_its_description() {
    let home = tempfile::tempdir().unwrap();
    let config = RecorderConfig {
        max_file_bytes: 8_192,
        ..small_chunks(ChunkCompression::None)
    };
    let (path, summary) = record(home.path(), 700, config);
    assert!(summary.files.len() > 11, "{:?}", summary.files);
    renamed_as_by_lyrical(&path, &summary.files);
    // A recorder that was killed has written no description.
    for is_described in [true, false] {
        if !is_described {
            fs::remove_file(path.join("metadata.yaml")).unwrap();
        }
        let bag = Bag::open(&path).unwrap();
        assert_eq!(bag.description_losses(), [], "{is_described}");
        assert!(!bag.has_overlapping_files(), "{is_described}");
        let (found, losses) = read(&bag, Order::File);
        assert_eq!(losses, [], "{is_described}");
        expect_first(&found, 700);
    }
}
