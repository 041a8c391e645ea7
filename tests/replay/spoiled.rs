//! One spoiled message in a recording: every verb leaves it out alone, names topic, reason and number, ends with 3, and says
//! of everything else what it says without that message.

use std::fs::File;
use std::path::Path;
use std::time::{Duration, Instant};

use abbe_tests::program::{Process, command, domain, root};
use nix::sys::signal::Signal;
use serde_json::Value;
use tempfile::TempDir;

use crate::contract::changed_of;
use crate::rewrite::{Change, Copied, Described, rewrite};

/// Number of these tests' domain among those of their process.
const DOMAIN: u16 = 4;
/// A player of its own runs beside the one above.
const DOMAIN_OF_PAUSE: u16 = 5;
const END: Duration = Duration::from_secs(120);

/// What a verb did with a bag.
pub struct Done {
    /// Exit code.
    pub code: i32,
    /// What it said.
    pub said: String,
    /// What it wrote.
    pub json: Value,
}

/// Exit code of the program, and what it said.
pub fn run(arguments: &[&str]) -> (i32, String) {
    let ended = Process::start(command(0, arguments)).ended_within(END);
    (ended.status.code().unwrap(), ended.said)
}

/// What a report says of a bag.
pub fn report(bag: &Path) -> Done {
    let home = tempfile::tempdir().unwrap();
    let (out, bag) = (home.path().display().to_string(), bag.display().to_string());
    let (code, said) = run(&["report", &bag, "--out", &out]);
    let text = std::fs::read_to_string(home.path().join("report.json")).unwrap();
    let page = std::fs::read_to_string(home.path().join("report.html")).unwrap();
    assert_eq!(code == 3, page.contains("NOT WHOLE"), "{said}");
    Done {
        code,
        said,
        json: serde_json::from_str(&text).unwrap(),
    }
}

fn check(bag: &Path) -> Done {
    let bag = bag.display().to_string();
    let (code, said) = run(&["check", &bag]);
    let (_, json) = run(&["check", &bag, "--json"]);
    let json = &json[..=json.rfind('}').unwrap()];
    Done {
        code,
        said,
        json: serde_json::from_str(json).unwrap(),
    }
}

fn folder(name: &str) -> std::path::PathBuf {
    root().join("bags").join(name)
}

fn spoil(bag: &str, change: &dyn Fn(&mut Vec<Copied>)) -> TempDir {
    changed_of(
        &folder(bag),
        &Change {
            messages: Some(change),
            ..Change::default()
        },
    )
}

/// A message of a topic, by its number from the middle on.
fn in_the_middle(messages: &[Copied], topic: &str) -> usize {
    let of_topic = messages
        .iter()
        .enumerate()
        .filter(|(_, m)| m.topic == topic);
    let places: Vec<usize> = of_topic.map(|(place, _)| place).collect();
    places[places.len() / 2]
}

/// A NaN in the last number of a message.
fn nan_at_the_end(data: &mut [u8]) {
    let at = (data.len() - 4) / 8 * 8 - 4;
    data[at..at + 8].copy_from_slice(&f64::NAN.to_le_bytes());
}

/// Ways to spoil the bytes of a message, and the reason that is reported.
type Spoil = (&'static str, fn(&mut Vec<u8>), &'static str);
const SPOILS: [Spoil; 5] = [
    (
        "truncated",
        |data| data.truncate(data.len() / 2),
        "malformed",
    ),
    ("empty", Vec::clear, "encoding"),
    (
        "of another encoding",
        |data| *data = b"{\"x\": 1}".to_vec(),
        "encoding",
    ),
    ("longer", |data| data.extend([0; 64]), "malformed"),
    ("not a number", |data| nan_at_the_end(data), "not_finite"),
];

#[test]
fn a_report_is_of_the_others_as_without_the_spoiled_message() {
    let (bag, topic) = ("grid_circles", "/grid/position");
    let without = spoil(bag, &|messages| {
        messages.remove(in_the_middle(messages, topic));
    });
    let without = report(without.path());
    assert_eq!(without.code, 0, "{}", without.said);
    for (how, change, reason) in SPOILS {
        if reason == "not_finite" {
            continue;
        }
        let bad = spoil(bag, &|messages| {
            let place = in_the_middle(messages, topic);
            change(&mut messages[place].data);
        });
        let found = report(bad.path());
        assert_eq!(found.code, 3, "{how}: {}", found.said);
        assert_eq!(found.json["tests"], without.json["tests"], "{how}");
        let left_out = &found.json["loss"]["left_out"];
        assert_eq!(left_out[0]["topic"], topic, "{how}: {left_out:#}");
        assert_eq!(left_out[0]["reason"], reason, "{how}");
        assert_eq!(left_out[0]["messages"], 1);
        assert!(left_out[0]["first"]["number"].as_u64().unwrap() > 100);
        let line = format!("abbe: {topic}: 1 of ");
        assert!(found.said.contains(&line), "{how}: {}", found.said);
    }
}

#[test]
fn a_report_of_a_bag_with_a_number_that_is_none_says_where_it_stood() {
    let topic = "/axes/state";
    let bad = spoil("grid_circles", &|messages| {
        let place = in_the_middle(messages, topic);
        nan_at_the_end(&mut messages[place].data);
    });
    let found = report(bad.path());
    assert_eq!(found.code, 3, "{}", found.said);
    let left_out = &found.json["loss"]["left_out"][0];
    assert_eq!(left_out["reason"], "not_finite", "{left_out:#}");
    assert!(left_out["what"].as_str().unwrap().contains("NaN"));
    let [log_ns, stamp_s] = [
        left_out["first"]["log_time_ns"].as_i64().unwrap(),
        left_out["first"]["stamp_s_ns"][0].as_i64().unwrap(),
    ];
    assert!(
        (log_ns / 1_000_000_000 - stamp_s).abs() <= 1,
        "{left_out:#}"
    );
}

fn described(bag: &str, topic: &'static str, change: fn(&mut Described)) -> TempDir {
    let describe = move |of: &str, described: &mut Described| {
        if of == topic {
            change(described);
        }
    };
    changed_of(
        &folder(bag),
        &Change {
            describe: Some(&describe),
            ..Change::default()
        },
    )
}

#[expect(clippy::type_complexity, reason = "a table of three")]
const OF_OTHERS: [(fn(&mut Described), &str, &str); 3] = [
    (
        |described| {
            described.type_name = "std_msgs/msg/Float64".to_owned();
            described.definition = b"float64 data\n".to_vec();
            described.type_hash.clear();
        },
        "foreign_type",
        "std_msgs/msg/Float64",
    ),
    (
        |described| described.type_name = "other_pkg/msg/Thing".to_owned(),
        "foreign_type",
        "other_pkg/msg/Thing",
    ),
    (
        |described| described.type_hash = format!("RIHS01_{}", "1".repeat(64)),
        "other_version",
        "RIHS01_1111",
    ),
];

#[test]
fn a_topic_of_another_type_or_version_is_left_out_of_a_report_and_of_a_check() {
    for (change, reason, words) in OF_OTHERS {
        let bag = described("grid_circles", "/geometry/model", change);
        let found = report(bag.path());
        assert_eq!(found.code, 3, "{}", found.said);
        assert_eq!(found.json["loss"]["left_out"][0]["reason"], reason);
        assert!(found.said.contains(words), "{}", found.said);
        let circles = found.json["tests"].as_array().unwrap().len();
        assert!(circles > 0, "{}", found.said);
        let found = check(bag.path());
        assert_eq!(found.code, 3, "{}", found.said);
        assert_eq!(found.json["loss"]["left_out"][0]["reason"], reason);
        assert!(found.said.contains(words), "{}", found.said);
    }
}

#[test]
fn a_check_leaves_out_a_spoiled_result_and_tells_what_may_come_of_a_spoiled_input() {
    for (how, change, _) in SPOILS {
        let bad = spoil("cold_reference", &|messages| {
            let place = in_the_middle(messages, "/probe/point");
            change(&mut messages[place].data);
        });
        let found = check(bad.path());
        if how == "not a number" {
            // These bytes are a number of the message: it is readable and another one than was computed.
            assert_eq!(found.code, 1, "{how}: {}", found.said);
            continue;
        }
        assert_eq!(found.code, 3, "{how}: {}", found.said);
        assert!(found.json["doubtful"].is_null(), "{how}: {}", found.said);
        let left_out = &found.json["loss"]["left_out"][0];
        assert_eq!(left_out["topic"], "/probe/point", "{how}");
        let bad = spoil("cold_reference", &|messages| {
            let place = in_the_middle(messages, "/probe/trigger");
            change(&mut messages[place].data);
        });
        let found = check(bad.path());
        assert_eq!(found.code, 3, "{how}: {}", found.said);
        assert!(!found.json["doubtful"].is_null(), "{how}: {}", found.said);
        assert!(
            found.said.contains("which may come of that"),
            "{}",
            found.said
        );
        let left_out = &found.json["loss"]["left_out"][0];
        assert_eq!(left_out["topic"], "/probe/trigger", "{how}");
        assert_eq!(left_out["messages"], 1, "{how}");
    }
}

/// A changed copy of the bag that rosbag2 recorded.
fn touches(change: &dyn Fn(&mut Vec<Copied>), describe: &dyn Fn(&str, &mut Described)) -> TempDir {
    let home = tempfile::tempdir().unwrap();
    let from = folder("rosbag2_touches").join("rosbag2_touches_0.mcap");
    let change = Change {
        messages: Some(change),
        describe: Some(describe),
        ..Change::default()
    };
    rewrite(&from, home.path(), &change);
    home
}

/// What a diagnosis says of a bag, without what tells one bag and one hour from another.
fn diagnosed(bag: &Path) -> Done {
    let machine = root().join("launch_configs/gap_first/machine.yaml");
    let [bag, machine] = [bag, &machine].map(|path| path.display().to_string());
    let (code, said) = run(&["diagnose", &bag, "--machine", &machine, "--json", "-"]);
    let end = said.find("\n}").unwrap() + 2;
    let mut json: Value = serde_json::from_str(&said[..end]).unwrap();
    json["runtime_s"] = Value::Null;
    json["inputs"] = Value::Null;
    Done { code, said, json }
}

#[test]
fn a_diagnosis_is_of_the_others_as_without_the_spoiled_message() {
    let topic = "/axes/state";
    let as_it_is = |_: &str, _: &mut Described| ();
    let without = touches(
        &|messages| {
            messages.remove(in_the_middle(messages, topic));
        },
        &as_it_is,
    );
    let without = diagnosed(without.path());
    assert_eq!(without.code, 0, "{}", without.said);
    for (how, change, reason) in SPOILS {
        let bad = touches(
            &|messages| {
                let place = in_the_middle(messages, topic);
                change(&mut messages[place].data);
            },
            &as_it_is,
        );
        let mut found = diagnosed(bad.path());
        assert_eq!(found.code, 3, "{how}: {}", found.said);
        let loss = found.json.as_object_mut().unwrap().remove("loss").unwrap();
        assert_eq!(found.json, without.json, "{how}");
        let left_out = &loss[0]["left_out"][0];
        assert_eq!(left_out["topic"], topic, "{how}: {left_out:#}");
        assert_eq!(left_out["reason"], reason, "{how}: {left_out:#}");
        assert_eq!(left_out["messages"], 1, "{how}");
    }
    for (change, reason, words) in OF_OTHERS {
        let of_others = |of: &str, described: &mut Described| {
            if of == "/temperature/bed" {
                change(described);
            }
        };
        let found = diagnosed(touches(&|_| (), &of_others).path());
        assert_eq!(found.code, 3, "{}", found.said);
        let left_out = &found.json["loss"][0]["left_out"][0];
        assert_eq!(left_out["topic"], "/temperature/bed");
        assert_eq!(left_out["reason"], reason);
        assert!(found.said.contains(words), "{}", found.said);
    }
}

/// The files of an export, but the one that says of when they are.
fn exported(bag: &Path) -> (i32, String, Vec<(String, String)>) {
    let home = tempfile::tempdir().unwrap();
    let out = home.path().join("tables");
    let [bag, out_text] = [bag, &out].map(|path| path.display().to_string());
    let (code, said) = run(&["export", &bag, "--format", "csv", "--out", &out_text]);
    let entries = std::fs::read_dir(&out).unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut files: Vec<_> = names
        .filter(|name| name != "READ_ME_FIRST.txt")
        .map(|name| {
            let text = std::fs::read_to_string(out.join(&name)).unwrap();
            (name, text)
        })
        .collect();
    files.sort();
    (code, said, files)
}

#[test]
fn an_export_is_of_the_table_before_the_spoiled_one() {
    let topic = "/positioning/table";
    let last = |messages: &[Copied]| messages.iter().rposition(|m| m.topic == topic).unwrap();
    let without = spoil("dual_loop", &|messages| {
        messages.remove(last(messages));
    });
    let (code, said, wanted) = exported(without.path());
    assert_eq!((code, wanted.is_empty()), (0, false), "{said}");
    for (how, change, _) in SPOILS {
        let bad = spoil("dual_loop", &|messages| {
            let place = last(messages);
            change(&mut messages[place].data);
        });
        let (code, said, files) = exported(bad.path());
        assert_eq!(code, 3, "{how}: {said}");
        assert_eq!(files, wanted, "{how}");
        assert!(said.contains("/positioning/table: 1 of"), "{how}: {said}");
    }
}

#[test]
fn a_player_says_once_for_each_topic_and_reason_what_it_cannot_send() {
    let bad = touches(
        &|messages| {
            for (nth, spoil) in [
                (5, &b"\0"[..]),
                (9, &[]),
                (20, &[0, 0, 0, 0, 1]),
                (30, &[0, 9, 0, 0]),
            ] {
                let states = messages.iter_mut().filter(|m| m.topic == "/axes/state");
                states.into_iter().nth(nth).unwrap().data = spoil.to_vec();
            }
        },
        &|topic, described| {
            if topic == "/test/segment" {
                described.message_encoding = "json".to_owned();
            }
        },
    );
    let mut play = command(domain(DOMAIN), &["play", "--rate", "0", "--delay", "0"]);
    play.arg(bad.path());
    let ended = Process::start(play).ended_within(END);
    assert_eq!(ended.status.code(), Some(3), "{}", ended.said);
    for words in [
        "/axes/state: 4 of ",
        "left out, no plain CDR: 1 bytes: the encapsulation header alone has 4",
        "/test/segment: 6 of 6 messages left out, no plain CDR: its messages are json",
        " 10 lost",
    ] {
        assert!(ended.said.contains(words), "{words}: {}", ended.said);
    }
    let of_states = ended.said.matches("abbe: /axes/state").count();
    assert_eq!(of_states, 1, "{}", ended.said);
}

#[test]
fn a_player_that_waits_for_years_says_so_and_how_to_go_on() {
    let bad = touches(
        &|messages| (messages[0].header.log_time, messages[0].header.publish_time) = (0, 0),
        &|_, _| (),
    );
    let told = bad.path().join("told");
    let mut play = command(domain(DOMAIN_OF_PAUSE), &["play", "--delay", "0"]);
    play.arg(bad.path()).stderr(File::create(&told).unwrap());
    let playing = Process::start(play);
    let deadline = Instant::now() + END;
    let said = loop {
        let said = std::fs::read_to_string(&told).unwrap();
        if said.contains("waits for nothing") {
            break said;
        }
        assert!(Instant::now() < deadline, "{said}");
        std::thread::sleep(Duration::from_millis(50));
    };
    playing.signal(Signal::SIGINT);
    drop(playing.ended_within(END));
    let from = said
        .split("--from ")
        .nth(1)
        .unwrap_or_else(|| panic!("{said}"));
    let from_s = from.split(' ').next().unwrap();
    for words in [
        "years",
        "the recorder's clock was not set",
        "--rate 0 waits for nothing",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
    let mut play = command(
        domain(DOMAIN_OF_PAUSE),
        &["play", "--rate", "0", "--delay", "0"],
    );
    play.arg(bad.path()).args(["--from", from_s]);
    let ended = Process::start(play).ended_within(END);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
    assert!(
        ended.said.contains(": 13702 messages, 0 lost"),
        "{}",
        ended.said
    );
}
