//! Damaged bags: no panic, no wrong message, and every loss is said.

use std::fs;
use std::path::{Path, PathBuf};

use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use recorder::{Bag, ChunkCompression, LossReason, Order, RecorderConfig, RecorderError, recover};

use crate::sample::{Message, message, read, record, small_chunks};

const MESSAGES: i64 = 120;

fn runner(cases: u32) -> TestRunner {
    let config = Config {
        cases,
        failure_persistence: None,
        ..Config::default()
    };
    TestRunner::new_with_rng(config, TestRng::deterministic_rng(RngAlgorithm::ChaCha))
}

/// The bytes of a small bag, and a path to put damaged copies at.
fn whole(home: &Path, compression: ChunkCompression) -> (Vec<u8>, PathBuf) {
    let (path, _) = record(home, MESSAGES, small_chunks(compression));
    let bytes = fs::read(path.join("run_0.mcap")).unwrap();
    (bytes, home.join("damaged.mcap"))
}

fn originals() -> Vec<Message> {
    (0..MESSAGES).map(message).collect()
}

/// True when `found` is `all` with some left out.
fn is_part_of(found: &[Message], all: &[Message]) -> bool {
    let mut rest = all.iter();
    found.iter().all(|m| rest.any(|other| other == m))
}

#[test]
fn prop_a_cut_anywhere_gives_all_before_it_and_says_where() {
    for compression in [
        ChunkCompression::None,
        ChunkCompression::Lz4,
        ChunkCompression::Zstd,
    ] {
        let home = tempfile::tempdir().unwrap();
        let (bytes, path) = whole(home.path(), compression);
        let all = originals();
        let mut partial = 0;
        let cuts = runner(300).run(&(1..bytes.len()), |cut| {
            fs::write(&path, &bytes[..cut]).unwrap();
            let bag = Bag::open(&path).unwrap();
            let (found, losses) = read(&bag, Order::File);
            prop_assert!(all.starts_with(&found), "cut at {}", cut);
            prop_assert_eq!(losses.len(), 1);
            prop_assert!(losses[0].at_byte <= cut as u64);
            let (timed, timed_losses) = read(&bag, Order::LogTime);
            prop_assert_eq!(&timed, &found);
            prop_assert_eq!(timed_losses.len(), 1);
            prop_assert_eq!(bag.message_count(), found.len() as u64);
            Ok(())
        });
        cuts.unwrap();
        // A later cut never gives less.
        let mut before = 0;
        for cut in (1..bytes.len()).step_by(97) {
            fs::write(&path, &bytes[..cut]).unwrap();
            let (found, _) = read(&Bag::open(&path).unwrap(), Order::File);
            assert!(found.len() >= before, "{compression:?}: cut at {cut}");
            partial += usize::from(found.len() > before);
            before = found.len();
        }
        assert!(partial > 5, "{compression:?}: {partial}");
    }
}

#[test]
fn prop_flipped_bits_give_no_wrong_message_and_at_least_one_loss() {
    for compression in [
        ChunkCompression::None,
        ChunkCompression::Lz4,
        ChunkCompression::Zstd,
    ] {
        let home = tempfile::tempdir().unwrap();
        let (bytes, path) = whole(home.path(), compression);
        let all = originals();
        let flips = proptest::collection::vec((0..bytes.len(), 1_u8..=255), 1..4);
        let outcome = runner(300).run(&flips, |flips| {
            let mut damaged = bytes.clone();
            for (at, bits) in &flips {
                damaged[*at] ^= bits;
            }
            prop_assume!(damaged != bytes);
            fs::write(&path, &damaged).unwrap();
            let bag = Bag::open(&path).unwrap();
            let (found, losses) = read(&bag, Order::File);
            prop_assert!(is_part_of(&found, &all), "{:?}", flips);
            prop_assert!(!losses.is_empty(), "{:?}: {} read", flips, found.len());
            let (timed, _) = read(&bag, Order::LogTime);
            prop_assert!(timed.iter().all(|m| all.contains(m)), "{:?}", flips);
            Ok(())
        });
        outcome.unwrap();
    }
}

#[test]
fn prop_arbitrary_bytes_never_panic() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("noise.mcap");
    let noise = proptest::collection::vec(any::<u8>(), 0..600);
    let outcome = runner(400).run(
        &(noise, any::<bool>(), 1_u8..16),
        |(noise, magic, opcode)| {
            let mut bytes = Vec::new();
            if magic {
                // Looks like a file, then like one record of each kind with noise in it.
                bytes.extend_from_slice(mcap::MAGIC);
                bytes.push(opcode);
                bytes.extend_from_slice(&(noise.len() as u64).to_le_bytes());
            }
            bytes.extend_from_slice(&noise);
            if magic {
                bytes.extend_from_slice(mcap::MAGIC);
            }
            fs::write(&path, &bytes).unwrap();
            let bag = match Bag::open(&path) {
                Err(RecorderError::NotMcap { .. } | RecorderError::Empty { .. }) if !magic => {
                    return Ok(());
                }
                opened => opened.unwrap(),
            };
            for order in [Order::File, Order::LogTime] {
                let mut messages = bag.messages(order);
                while messages.next_event().is_some() {}
            }
            for name in bag.attachment_names() {
                let _ = bag.attachment(name);
            }
            Ok(())
        },
    );
    outcome.unwrap();
}

#[test]
fn a_spoiled_chunk_is_left_out_and_the_next_one_is_read() {
    let home = tempfile::tempdir().unwrap();
    let (mut bytes, path) = whole(home.path(), ChunkCompression::None);
    // Inside the text of one message in the first third of the file.
    let words = "line 35: Größe".as_bytes();
    let at = bytes.windows(words.len()).position(|w| w == words).unwrap();
    bytes[at] = b'L';
    fs::write(&path, &bytes).unwrap();
    let bag = Bag::open(&path).unwrap();
    let (found, losses) = read(&bag, Order::File);
    assert!(is_part_of(&found, &originals()));
    assert_eq!(found.last(), originals().last());
    let left_out = MESSAGES as usize - found.len();
    assert!((1..20).contains(&left_out), "{left_out}");
    assert!(
        matches!(losses[0].reason, LossReason::ChunkCrc { .. }),
        "{losses:?}"
    );
    assert!(
        matches!(losses[1].reason, LossReason::FileCrc { .. }),
        "{losses:?}"
    );
    assert_eq!(losses.len(), 2);
}

/// The body of the second chunk of a file.
fn second_chunk(bytes: &[u8]) -> usize {
    let mut at = mcap::MAGIC.len();
    let mut chunks = 0;
    loop {
        let length = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize;
        chunks += usize::from(bytes[at] == mcap::records::op::CHUNK);
        if chunks == 2 {
            return at + 9;
        }
        at += 9 + length;
    }
}

#[test]
fn a_chunk_whose_header_states_another_length_is_named_with_both_lengths() {
    for compression in [ChunkCompression::None, ChunkCompression::Lz4] {
        for more in [1_u64, 1_000] {
            let home = tempfile::tempdir().unwrap();
            let (mut bytes, path) = whole(home.path(), compression);
            let at = second_chunk(&bytes) + 16;
            let length = u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
            bytes[at..at + 8].copy_from_slice(&(length + more).to_le_bytes());
            fs::write(&path, &bytes).unwrap();
            let (found, losses) = read(&Bag::open(&path).unwrap(), Order::LogTime);
            assert!(is_part_of(&found, &originals()));
            let words = losses[0].to_string();
            let stated = format!("{length} bytes, its header states {}", length + more);
            assert!(
                words.contains(&stated) || words.contains("decompressed"),
                "{words}"
            );
            let is_plain = compression == ChunkCompression::None;
            assert!(!is_plain || words.contains(&stated), "{words}");
        }
    }
}

#[test]
fn a_recovered_bag_is_whole_and_holds_what_could_be_read() {
    let home = tempfile::tempdir().unwrap();
    let (bytes, path) = whole(home.path(), ChunkCompression::Zstd);
    fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    let (readable, _) = read(&Bag::open(&path).unwrap(), Order::File);
    assert!(readable.len() > 10);
    let to = home.path().join("recovered");
    let recovered = recover(&path, &to, &RecorderConfig::default()).unwrap();
    assert_eq!(recovered.losses.len(), 1);
    assert_eq!(recovered.summary.messages_written, readable.len() as u64);
    let bag = Bag::open(&to).unwrap();
    let (found, losses) = read(&bag, Order::File);
    assert_eq!((found, losses.len()), (readable, 0));
    let again = recover(&path, &to, &RecorderConfig::default());
    assert!(again.unwrap_err().to_string().contains("exists already"));
}
