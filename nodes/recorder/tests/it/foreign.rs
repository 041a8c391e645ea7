//! What rosbag2 writes besides MCAP with compressed chunks is refused by name.

use std::fs;
use std::path::Path;

use recorder::{Bag, ChunkCompression};

use crate::sample::{record, small_chunks};

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
