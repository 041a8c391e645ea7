//! What is written comes back.

use std::fs;

use recorder::{
    Bag, BagMetadata, ChunkCompression, Directory, LossReason, MessageStamp, Order, RecorderConfig,
    RecorderError, Recording, RunContext, dump_json, verify_attachments,
};

use crate::sample::{
    self, BEGIN_NANOS, add_channels, expect_first, message, read, record, small_chunks,
};

const COMPRESSIONS: [ChunkCompression; 3] = [
    ChunkCompression::None,
    ChunkCompression::Lz4,
    ChunkCompression::Zstd,
];

#[test]
fn every_message_comes_back_in_both_orders_and_every_compression() {
    for compression in COMPRESSIONS {
        let home = tempfile::tempdir().unwrap();
        let (path, summary) = record(home.path(), 500, small_chunks(compression));
        assert_eq!(summary.messages_written, 500);
        assert_eq!(summary.messages_lost, 0);
        let file_bytes = fs::metadata(path.join("run_0.mcap")).unwrap().len();
        assert_eq!(summary.bytes_written, file_bytes);
        let bag = Bag::open(&path).unwrap();
        for order in [Order::File, Order::LogTime] {
            let (found, losses) = read(&bag, order);
            assert_eq!(losses, []);
            expect_first(&found, 500);
        }
        assert_eq!(bag.message_count(), 500);
        let first = BEGIN_NANOS as u64;
        assert_eq!(bag.log_times_nanos(), Some((first, first + 499_000_000)));
    }
}

#[test]
fn topics_bring_all_that_a_reader_needs() {
    let home = tempfile::tempdir().unwrap();
    let (path, _) = record(home.path(), 100, RecorderConfig::default());
    let bag = Bag::open(path.join("run_0.mcap")).unwrap();
    let expected = [60, 10, 10, 10, 10];
    for ((topic, channel), count) in bag.topics().iter().zip(sample::channels()).zip(expected) {
        assert_eq!(topic.topic, channel.topic);
        assert_eq!(topic.type_name, channel.type_name);
        assert_eq!(topic.type_hash, channel.type_hash);
        assert_eq!(topic.definition, channel.definition);
        assert_eq!(topic.definition_encoding, "ros2msg");
        assert_eq!(topic.message_encoding, "cdr");
        assert_eq!(topic.qos_yaml, channel.qos_yaml);
        assert_eq!(topic.message_count, count);
    }
}

#[test]
fn recording_twice_gives_equal_bytes() {
    let bytes = |()| {
        let home = tempfile::tempdir().unwrap();
        let (path, _) = record(home.path(), 300, small_chunks(ChunkCompression::Zstd));
        (
            fs::read(path.join("run_0.mcap")).unwrap(),
            fs::read_to_string(path.join("metadata.yaml")).unwrap(),
        )
    };
    assert_eq!(bytes(()), bytes(()));
}

#[test]
fn splits_are_read_in_order_and_listed_in_the_description() {
    let home = tempfile::tempdir().unwrap();
    let config = RecorderConfig {
        max_file_bytes: 8_192,
        ..small_chunks(ChunkCompression::None)
    };
    let (path, summary) = record(home.path(), 700, config);
    assert!(summary.files.len() > 11, "{:?}", summary.files);
    let text = fs::read_to_string(path.join("metadata.yaml")).unwrap();
    let metadata = BagMetadata::from_yaml(&text).unwrap();
    assert_eq!(metadata.relative_file_paths, summary.files);
    assert_eq!(metadata.message_count, 700);
    assert_eq!(metadata.duration.nanoseconds, 699_000_000);
    let topics = &metadata.topics_with_message_count;
    assert_eq!(topics.iter().map(|t| t.message_count).sum::<u64>(), 700);
    let (found, losses) = read(&Bag::open(&path).unwrap(), Order::File);
    assert_eq!(losses, []);
    expect_first(&found, 700);
    // Without its description a bag is still a bag, file 10 behind file 9.
    fs::remove_file(path.join("metadata.yaml")).unwrap();
    let (found, losses) = read(&Bag::open(&path).unwrap(), Order::File);
    assert_eq!(losses, []);
    expect_first(&found, 700);
    // A file that is gone is said, the others are read.
    fs::write(path.join("metadata.yaml"), text).unwrap();
    fs::remove_file(path.join("run_3.mcap")).unwrap();
    let (found, losses) = read(&Bag::open(&path).unwrap(), Order::LogTime);
    assert!(found.len() < 700);
    assert_eq!(losses.len(), 1);
    assert_eq!(losses[0].reason, LossReason::Absent);
}

#[test]
fn a_folder_that_lacks_a_file_of_its_recording_says_how_many_messages_and_a_lone_part_does_not() {
    let home = tempfile::tempdir().unwrap();
    let config = RecorderConfig {
        max_file_bytes: 8_192,
        ..small_chunks(ChunkCompression::None)
    };
    let (path, summary) = record(home.path(), 700, config);
    assert_eq!(Bag::open(&path).unwrap().description_losses(), []);
    let last = summary.files.last().unwrap();
    let part = Bag::open(path.join(last)).unwrap();
    assert!(part.message_count() < 700);
    assert_eq!(part.description_losses(), []);
    fs::remove_file(path.join("metadata.yaml")).unwrap();
    assert_eq!(Bag::open(&path).unwrap().description_losses(), []);
    fs::remove_file(path.join("run_3.mcap")).unwrap();
    let bag = Bag::open(&path).unwrap();
    let [loss] = bag.description_losses() else {
        panic!("{:?}", bag.description_losses());
    };
    let n = bag.message_count();
    let words = format!("700 messages were recorded, and the files hold {n} (");
    let said = loss.to_string();
    assert!(n < 700 && said.contains(&words), "{said}");
    assert!(!loss.reason.is_beside_messages());
}

#[test]
fn files_split_by_time_span_no_more_than_they_may_and_a_chunk() {
    let home = tempfile::tempdir().unwrap();
    let config = RecorderConfig {
        max_file_s: 0.5,
        flush_period_s: 0.05,
        ..RecorderConfig::default()
    };
    let (path, summary) = record(home.path(), 3_000, config);
    assert!(
        (5..=6).contains(&summary.files.len()),
        "{:?}",
        summary.files
    );
    for file in &summary.files {
        let file = Bag::open(path.join(file)).unwrap();
        let (first, last) = file.log_times_nanos().unwrap();
        assert!(last - first <= 560_000_000, "{}", last - first);
    }
    let (found, losses) = read(&Bag::open(&path).unwrap(), Order::LogTime);
    assert_eq!(losses, []);
    expect_first(&found, 3_000);
    let wrong = RecorderConfig {
        max_file_s: -1.0,
        ..RecorderConfig::default()
    };
    let refusal = wrong.checked().unwrap_err().to_string();
    assert!(refusal.starts_with("max_file_s = -1"), "{refusal}");
}

#[test]
fn a_killed_recording_loses_the_open_chunk_and_no_more() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("run");
    let config = RecorderConfig {
        flush_period_s: 0.05,
        ..RecorderConfig::default()
    };
    let mut recording = Recording::begin(Directory::create(&path).unwrap(), "run", config).unwrap();
    assert_eq!(Bag::open(&path).unwrap().message_count(), 0);
    let ids = add_channels(&mut recording);
    for n in 0..375 {
        let m = message(n);
        recording.write(ids[m.channel], m.stamp, &m.data).unwrap();
    }
    // As SIGKILL would: neither `finish` nor `drop` runs.
    std::mem::forget(recording);
    let bag = Bag::open(&path).unwrap();
    let (found, losses) = read(&bag, Order::File);
    // 50 ms at 1 kHz: a chunk is 50 messages, 7 are whole.
    expect_first(&found, 350);
    assert_eq!(losses.len(), 1);
    assert_eq!(losses[0].reason, LossReason::NoEnd);
    let text = fs::read_to_string(path.join("metadata.yaml")).unwrap();
    let metadata = BagMetadata::from_yaml(&text).unwrap();
    assert_eq!(metadata.topics_with_message_count.len(), 5);
}

#[test]
fn time_going_back_is_kept_and_counted() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("run");
    let shelf = Directory::create(&path).unwrap();
    let config = small_chunks(ChunkCompression::Lz4);
    let mut recording = Recording::begin(shelf, "run", config).unwrap();
    let ids = add_channels(&mut recording);
    let times_ms = [0, 10, 20, 15, 30, 5, 40];
    for (sequence, ms) in times_ms.iter().enumerate() {
        let stamp = MessageStamp {
            log_time_nanos: ms * 1_000_000,
            publish_time_nanos: 0,
            sequence: sequence as u32,
        };
        recording.write(ids[3], stamp, &[0, 1, 0, 0, 0]).unwrap();
    }
    let summary = recording.finish().unwrap();
    assert_eq!(summary.messages_back_in_time, 2);
    assert_eq!(summary.largest_step_back_nanos, 25_000_000);
    let bag = Bag::open(&path).unwrap();
    let closing = bag.metadata("abbe.recording").unwrap();
    assert_eq!(closing["messages_back_in_time"], "2");
    assert_eq!(closing["largest_step_back_ns"], "25000000");
    let sequences = |order| {
        let (found, _) = read(&bag, order);
        found.iter().map(|m| m.stamp.sequence).collect::<Vec<_>>()
    };
    assert_eq!(sequences(Order::File), [0, 1, 2, 3, 4, 5, 6]);
    assert_eq!(sequences(Order::LogTime), [0, 5, 1, 3, 2, 4, 6]);
}

#[test]
fn log_time_order_holds_across_chunks_and_keeps_ties_in_order_of_recording() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("run");
    let shelf = Directory::create(&path).unwrap();
    let config = small_chunks(ChunkCompression::Zstd);
    let mut recording = Recording::begin(shelf, "run", config).unwrap();
    let ids = add_channels(&mut recording);
    let mut expected = Vec::new();
    for n in 0..3000_i64 {
        // Steps back over many chunks, and many ties.
        let at_nanos = (n % 700) / 3 * 1000;
        let stamp = MessageStamp {
            log_time_nanos: at_nanos,
            publish_time_nanos: n,
            sequence: n as u32,
        };
        recording.write(ids[2], stamp, &message(5).data).unwrap();
        expected.push((at_nanos, n));
    }
    recording.finish().unwrap();
    expected.sort();
    let (found, losses) = read(&Bag::open(&path).unwrap(), Order::LogTime);
    let found: Vec<_> = found
        .iter()
        .map(|m| (m.stamp.log_time_nanos, i64::from(m.stamp.sequence)))
        .collect();
    assert_eq!((found, losses.len()), (expected, 0));
}

#[test]
fn a_bag_brings_its_context_with_hashes() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("run");
    let shelf = Directory::create(&path).unwrap();
    let mut recording = Recording::begin(shelf, "run", RecorderConfig::default()).unwrap();
    let machine = include_str!("../../../../launch_configs/first_run/machine.yaml");
    let probe = "/**:\n  ros__parameters:\n    stylus_radius_mm: 3.0\n    feeds: [1.0, 2.5]\n";
    let mut context = RunContext {
        start_time_nanos: 42,
        scenario_name: "first_run".into(),
        seed: Some(7),
        commit: "0123abcd".into(),
        machine_file: Some(machine.into()),
        scenario_file: Some("name: first_run\n".into()),
        ..RunContext::default()
    };
    context
        .programs
        .insert("touch.ngc".into(), "G38.2 X1 F10\nM2\n".into());
    context.parameters.insert("probe".into(), probe.into());
    recording.add_context(&context).unwrap();
    add_channels(&mut recording);
    recording.finish().unwrap();

    let bag = Bag::open(&path).unwrap();
    // All that is ever attached; the plant's file has no place among it.
    let names = [
        "machine.yaml",
        "scenario.yaml",
        "params/probe.yaml",
        "touch.ngc",
    ];
    assert_eq!(bag.attachment_names().collect::<Vec<_>>(), names);
    assert_eq!(verify_attachments(&bag).unwrap().len(), 4);
    let found = bag.attachment("machine.yaml").unwrap().unwrap();
    assert_eq!(found.data, machine.as_bytes());
    assert_eq!(bag.metadata("abbe.run").unwrap()["seed"], "7");
    assert_eq!(bag.metadata("abbe.run").unwrap()["commit"], "0123abcd");
    let flat = bag.metadata("abbe.parameters.probe").unwrap();
    assert_eq!(flat["/**.ros__parameters.stylus_radius_mm"], "3.0");
    assert_eq!(flat["/**.ros__parameters.feeds.1"], "2.5");

    // One changed byte of an attachment is noticed.
    let file = path.join("run_0.mcap");
    let mut bytes = fs::read(&file).unwrap();
    let at = bytes.windows(5).position(|w| w == b"G38.2").unwrap();
    bytes[at] ^= 1;
    fs::write(&file, bytes).unwrap();
    let refused = verify_attachments(&Bag::open(&path).unwrap());
    assert!(
        matches!(refused, Err(RecorderError::Damaged { .. })),
        "{refused:?}"
    );
}

#[test]
fn files_of_other_writers_without_chunks_or_index_are_read() {
    for with_summary in [true, false] {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("other.mcap");
        let file = fs::File::create(&path).unwrap();
        let mut writer = mcap::WriteOptions::new()
            .profile("ros2")
            .use_chunks(false)
            .emit_summary_records(with_summary)
            .emit_summary_offsets(with_summary)
            .create(file)
            .unwrap();
        let mut ids = Vec::new();
        for channel in sample::channels() {
            let schema = writer
                .add_schema(&channel.type_name, "ros2msg", channel.definition.as_bytes())
                .unwrap();
            let id = writer.add_channel(schema, &channel.topic, "cdr", &Default::default());
            ids.push(id.unwrap());
        }
        for m in (0..200).map(message) {
            let header = mcap::records::MessageHeader {
                channel_id: ids[m.channel],
                sequence: m.stamp.sequence,
                log_time: m.stamp.log_time_nanos as u64,
                publish_time: m.stamp.publish_time_nanos as u64,
            };
            writer.write_to_known_channel(&header, &m.data).unwrap();
        }
        writer.finish().unwrap();
        drop(writer);
        let bag = Bag::open(&path).unwrap();
        assert_eq!(bag.message_count(), 200);
        for order in [Order::File, Order::LogTime] {
            let (found, losses) = read(&bag, order);
            assert_eq!(losses, []);
            expect_first(&found, 200);
        }
    }
}

#[test]
fn a_dump_holds_every_message_and_what_json_cannot_say_as_text() {
    let home = tempfile::tempdir().unwrap();
    let (path, _) = record(home.path(), 20, RecorderConfig::default());
    let mut out = Vec::new();
    let losses = dump_json(&Bag::open(&path).unwrap(), &mut out).unwrap();
    assert_eq!(losses, []);
    let text = String::from_utf8(out).unwrap();
    let lines: Vec<serde_json::Value> = text
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(lines.len(), 20);
    let axes = &lines[0]["message"];
    assert_eq!(axes["axis"], serde_json::json!(["X", "Y", "Z", "A", "C"]));
    assert_eq!(axes["scale"][1], "NaN");
    assert_eq!(axes["scale"][4], "-Infinity");
    let all = &lines[9]["message"];
    assert_eq!(all["i64"], i64::MIN + 9);
    assert_eq!(all["u64"], u64::MAX - 9);
    assert_eq!(all["f32"], f64::from(0.1_f32));
    assert_eq!(all["text"], "Längenfehler 9 µm: 直线度");
    assert_eq!(all["ends"][1]["y"], -3.0);
    assert_eq!(all["last"], 7);
    assert_eq!(lines[7]["message"], serde_json::json!({}));
}
