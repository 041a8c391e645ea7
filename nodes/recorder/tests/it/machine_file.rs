//! A machine file that is not the one that was recorded, or that nobody can read, is named when a bag is opened.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use mcap::records::Metadata;
use recorder::{Bag, verify_attachments};
use sha2::{Digest, Sha256};

const RIGHT: &[u8] = b"name: mill_1\n";

fn hash(bytes: &[u8]) -> String {
    let digits = Sha256::digest(bytes);
    digits.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// A bag with a machine file of these bytes, and with the hash of `recorded` beside it.
fn bag(home: &Path, machine: Option<&[u8]>, recorded: Option<&[u8]>) -> Bag {
    let path = home.join("bag.mcap");
    let file = fs::File::create(&path).unwrap();
    let options = mcap::WriteOptions::new().profile("ros2");
    let mut writer = options.create(file).unwrap();
    if let Some(machine) = machine {
        let attachment = mcap::Attachment {
            log_time: 1,
            create_time: 1,
            name: "machine.yaml".to_owned(),
            media_type: "application/yaml".to_owned(),
            data: Cow::Owned(machine.to_vec()),
        };
        writer.attach(&attachment).unwrap();
    }
    if let Some(recorded) = recorded {
        let metadata = BTreeMap::from([("machine.yaml".to_owned(), hash(recorded))]);
        let record = Metadata {
            name: "abbe.attachments".to_owned(),
            metadata,
        };
        writer.write_metadata(&record).unwrap();
    }
    writer.finish().unwrap();
    Bag::open(&path).unwrap()
}

#[test]
fn a_machine_file_that_is_right_or_that_nobody_recorded_is_no_loss() {
    for (machine, recorded) in [
        (None, None),
        (Some(RIGHT), None),
        (Some(RIGHT), Some(RIGHT)),
        (Some(&b"name: m # \xb5m\n"[..]), None),
    ] {
        let home = tempfile::tempdir().unwrap();
        let bag = bag(home.path(), machine, recorded);
        assert!(bag.description_losses().is_empty(), "{machine:?}");
        let found = bag.attachment("machine.yaml").unwrap();
        assert_eq!(found.map(|it| it.data).as_deref(), machine);
    }
}

#[test]
fn a_machine_file_that_is_absent_empty_no_text_or_another_one_is_named() {
    let (right, other) = (hash(RIGHT), hash(b"name: mill_2\n"));
    let absent = format!("machine.yaml: is absent, the bag says that its sha256 is {right}");
    let another = format!("machine.yaml: sha256 is {other}, the bag says {right}");
    type Bytes<'a> = Option<&'a [u8]>;
    let cases: [(Bytes<'_>, Bytes<'_>, &str); 6] = [
        (None, Some(RIGHT), absent.as_str()),
        (Some(b"name: mill_2\n"), Some(RIGHT), another.as_str()),
        (Some(b""), Some(RIGHT), "the bag says"),
        (Some(b""), None, "machine.yaml: is empty"),
        (
            Some(b"name: \xff\n"),
            None,
            "machine.yaml:1:7: byte 0xFF is not UTF-8",
        ),
        (
            Some(b"\xff\xfen\0"),
            None,
            "machine.yaml:1:1: the file is UTF-16",
        ),
    ];
    for (machine, recorded, words) in cases {
        let home = tempfile::tempdir().unwrap();
        let bag = bag(home.path(), machine, recorded);
        let losses = bag.description_losses();
        let [loss] = losses else {
            panic!("{words}: {losses:?}")
        };
        assert!(loss.reason.is_beside_messages(), "{loss:?}");
        let said = loss.to_string();
        assert!(said.contains(words), "{said}");
        assert!(said.contains("bag.mcap"), "{said}");
        let is_recorded = recorded.is_some();
        assert_eq!(bag.attachment("machine.yaml").is_err(), is_recorded);
        assert_eq!(verify_attachments(&bag).is_err(), is_recorded);
    }
}
