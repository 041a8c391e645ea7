//! What is kept in memory: nothing of the window is lost, and no more than the limit is held.

use std::path::{Path, PathBuf};

use recorder::{
    Bag, ChunkCompression, Directory, Order, RecorderConfig, Ring, RingConfig, RunContext,
    verify_attachments,
};

use crate::sample::{self, BEGIN_NANOS, Message, message, read};

/// Topic of the sample that is latched, depth 1.
const LATCHED: usize = 4;
const MACHINE: &str = "name: a_machine\n";

pub fn ring(window_s: f64, limit_bytes: u64) -> Ring {
    let config = RingConfig {
        window_s,
        limit_bytes,
        save_on_error: false,
    };
    let mut ring = Ring::new(&config).unwrap();
    for (place, channel) in sample::channels().iter().enumerate() {
        let id = ring.add_channel(channel).unwrap();
        assert_eq!(ring.add_channel(channel).unwrap(), id, "{place}");
    }
    ring
}

pub fn fill(ring: &mut Ring, numbers: std::ops::Range<i64>) {
    let ids: Vec<_> = sample::channels()
        .iter()
        .map(|channel| ring.add_channel(channel).unwrap())
        .collect();
    for n in numbers {
        let message = message(n);
        ring.push(ids[message.channel], message.stamp, &message.data);
    }
}

pub fn save(ring: &Ring, home: &Path) -> PathBuf {
    let path = home.join("run");
    let shelf = Directory::create(&path).unwrap();
    let context = RunContext {
        machine_file: Some(MACHINE.to_owned()),
        ..RunContext::default()
    };
    let config = RecorderConfig {
        max_file_s: 0.5,
        flush_period_s: 0.1,
        compression: ChunkCompression::Lz4,
        ..RecorderConfig::default()
    };
    let summary = ring
        .snapshot()
        .write(shelf, "run", &config, &context)
        .unwrap();
    assert_eq!(summary.messages_lost, 0);
    assert_eq!(
        summary.messages_back_in_time, 0,
        "latched ones stand at the begin"
    );
    path
}

#[test]
fn all_of_the_window_is_saved_and_before_it_what_held_when_it_began() {
    let mut ring = ring(2.0, 64 << 20);
    fill(&mut ring, 0..10_000);
    let home = tempfile::tempdir().unwrap();
    let bag = Bag::open(save(&ring, home.path())).unwrap();
    let (found, losses) = read(&bag, Order::File);
    assert_eq!(losses, []);
    // The window reaches from message 7,999 to 9,999; the last latched one before it is 7,989.
    let (before, within) = found.split_at(1);
    let latched = message(7_989);
    assert_eq!(
        (before[0].channel, &before[0].data),
        (LATCHED, &latched.data)
    );
    let stamp = before[0].stamp;
    assert_eq!(stamp.log_time_nanos, BEGIN_NANOS + 7_999 * 1_000_000);
    assert_eq!(stamp.publish_time_nanos, latched.stamp.publish_time_nanos);
    let expected: Vec<Message> = (7_999..10_000).map(message).collect();
    assert_eq!(within.len(), expected.len());
    assert!(within == expected);
    assert_eq!(verify_attachments(&bag).unwrap(), ["machine.yaml"]);
    let stats = ring.stats();
    assert_eq!(stats.messages_crowded_out, 0);
    assert!((stats.reach_s - 2.0).abs() < 1e-9, "{}", stats.reach_s);
    // It goes on: what was saved may be saved again, with what came since.
    fill(&mut ring, 10_000..10_500);
    assert_eq!(ring.stats().messages_received, 10_500);
    assert_eq!(ring.snapshot().len(), 2_002);
}

#[test]
fn where_the_clock_is_set_back_the_window_goes_on() {
    const BACK_NANOS: i64 = 3_600_000_000_000;
    let mut ring = ring(2.0, 64 << 20);
    fill(&mut ring, 0..5_000);
    let ids: Vec<_> = sample::channels()
        .iter()
        .map(|channel| ring.add_channel(channel).unwrap())
        .collect();
    for n in 5_000..10_000 {
        let mut message = message(n);
        message.stamp.log_time_nanos -= BACK_NANOS;
        ring.push(ids[message.channel], message.stamp, &message.data);
        let stats = ring.stats();
        assert!((1.9..=2.0).contains(&stats.reach_s), "{stats:?}");
        assert_eq!(stats.messages_crowded_out, 0);
        assert!((1_990..=2_010).contains(&stats.messages_kept), "{stats:?}");
    }
}

#[test]
fn the_limit_holds_whatever_comes_and_says_how_far_back_it_reaches() {
    const LIMIT_BYTES: u64 = 256 << 10;
    let mut ring = ring(3_600.0, LIMIT_BYTES);
    for part in 0..50 {
        fill(&mut ring, part * 1_000..(part + 1) * 1_000);
        assert!(ring.stats().bytes_kept <= LIMIT_BYTES);
    }
    let stats = ring.stats();
    eprintln!("{stats:?}");
    // One message more than the limit, until the oldest has left.
    assert!(stats.high_water_bytes <= LIMIT_BYTES);
    assert!(stats.messages_crowded_out > 40_000);
    assert!(stats.reach_s > 0.1 && stats.reach_s < 10.0);
    // What is kept is the newest, without a gap.
    let home = tempfile::tempdir().unwrap();
    let (found, _) = read(&Bag::open(save(&ring, home.path())).unwrap(), Order::File);
    let kept = found.len() as i64 - 1;
    let expected: Vec<Message> = (50_000 - kept..50_000).map(message).collect();
    assert!(found[1..] == expected);
    assert_eq!(found[0].channel, LATCHED);
}

#[test]
fn a_ring_of_nothing_is_an_empty_bag_and_senseless_numbers_are_refused_by_name() {
    let home = tempfile::tempdir().unwrap();
    let empty = ring(1.0, 4096);
    assert!(empty.snapshot().is_empty());
    let bag = Bag::open(save(&empty, home.path())).unwrap();
    assert_eq!(bag.message_count(), 0);
    for (window_s, limit_bytes, name) in [
        (0.0, 4096, "ring.window_s"),
        (f64::NAN, 4096, "ring.window_s"),
        (1e9, 4096, "ring.window_s"),
        (1.0, 10, "ring.limit_bytes"),
        (1.0, u64::MAX, "ring.limit_bytes"),
    ] {
        let config = RingConfig {
            window_s,
            limit_bytes,
            save_on_error: true,
        };
        let refusal = Ring::new(&config).unwrap_err().to_string();
        assert!(refusal.starts_with(name), "{refusal}");
    }
}

#[test]
fn a_topic_with_a_second_type_is_refused() {
    let mut ring = ring(1.0, 4096);
    let mut channel = sample::channels().swap_remove(2);
    channel.type_name = "std_msgs/msg/Empty".to_owned();
    let refusal = ring.add_channel(&channel).unwrap_err().to_string();
    assert!(refusal.contains("/note"), "{refusal}");
}
