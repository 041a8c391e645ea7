//! Numbers of an agent that go back, leap, repeat, or begin anew with every part: nothing is silenced by them, and the
//! account has what was left out. No socket: documents as an agent sends them, at stated times.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use metrology::stamp::{Host, NANOS_PER_S};
use metrology::{Stage, Stamp};
use mtconnect_bridge::config::{AgentConfig, ConnectionConfig, Source};
use mtconnect_bridge::mapping::MapFile;
use mtconnect_bridge::stage::{IoCommand, IoEvent};
use mtconnect_bridge::{BridgeConfig, BridgeStage, Input, Output, Settings};
use proptest::prelude::*;

const MAP: &str = "values:\n  ex: {is: execution}\n";
/// 2026-01-05T08:00:00Z.
const NOW_S: i64 = 1_767_600_000;

/// A bridge and what an agent answers it.
struct Talk {
    stage: BridgeStage,
    at: Stamp<Host>,
    said: Vec<Output>,
    /// Outputs whose questions have been answered.
    answered: usize,
}

/// A document of states of the program: number and word.
fn document(instance: u64, first: u64, next: u64, told: &[(u64, &str)]) -> String {
    let values: String = told
        .iter()
        .map(|(number, word)| {
            format!(r#"<Execution dataItemId="ex" sequence="{number}" timestamp="2026-01-05T08:00:00Z">{word}</Execution>"#)
        })
        .collect();
    format!(
        r#"<MTConnectStreams><Header instanceId="{instance}" firstSequence="{first}" nextSequence="{next}"/><Streams><DeviceStream><ComponentStream><Events>{values}</Events></ComponentStream></DeviceStream></Streams></MTConnectStreams>"#
    )
}

const PROBE: &str = r#"<MTConnectDevices><Header instanceId="7"/><Devices><Device name="m"><DataItems><DataItem id="ex" type="EXECUTION"/></DataItems></Device></Devices></MTConnectDevices>"#;
const OUT_OF_RANGE: &str = r#"<MTConnectError><Header instanceId="7"/><Errors><Error errorCode="OUT_OF_RANGE">from is above the last</Error></Errors></MTConnectError>"#;

impl Talk {
    /// With an agent whose next number is 10.
    fn begun() -> Self {
        let config = BridgeConfig {
            source: Source::Agent,
            host: "mill".to_owned(),
            port: 5000,
            log_file: None,
            log_longest_pause_s: BridgeConfig::default_longest_pause_s(),
            map_file: String::new(),
            connection: ConnectionConfig::default(),
            agent: AgentConfig::default(),
        };
        let settings = Settings::new(&config, &MapFile::from_yaml(MAP).unwrap()).unwrap();
        let mut talk = Self {
            stage: BridgeStage::new(&settings),
            at: Stamp::from_nanos(NOW_S * NANOS_PER_S),
            said: Vec::new(),
            answered: 0,
        };
        talk.step(Input::Tick);
        talk.whole(PROBE);
        talk.whole(&document(7, 1, 10, &[(9, "READY")]));
        talk.stream();
        talk.answered = talk.said.len();
        talk
    }

    fn step(&mut self, input: Input) {
        self.stage.step(self.at, input, &mut self.said).unwrap();
    }

    fn whole(&mut self, body: &str) {
        let body = body.as_bytes().to_vec();
        self.step(Input::Io(IoEvent::Answered { status: 200, body }));
    }

    fn stream(&mut self) {
        let content_type = "multipart/x-mixed-replace;boundary=b".to_owned();
        self.step(Input::Io(IoEvent::Began { content_type }));
    }

    fn part(&mut self, body: &str) {
        let part = format!("--b\nContent-length: {}\n\n{body}", body.len());
        self.step(Input::Io(IoEvent::Received(part.into_bytes())));
    }

    fn wait(&mut self, seconds: i64) {
        self.at = Stamp::from_nanos(self.at.nanos() + seconds * NANOS_PER_S);
        self.step(Input::Tick);
    }

    /// Answers whatever is asked, over the pauses, until a stream has begun.
    fn answer_all(&mut self, current: &str) {
        for _ in 0..10 {
            let mut news = self.said[self.answered..].iter().rev();
            let asked = news.find_map(|output| match output {
                Output::Io(IoCommand::Get { path } | IoCommand::Stream { path }) => {
                    Some(path.clone())
                }
                _ => None,
            });
            self.answered = self.said.len();
            match asked.as_deref() {
                Some("/probe") => self.whole(PROBE),
                Some("/current") => self.whole(current),
                Some(_) => return self.stream(),
                None => self.wait(31),
            }
        }
    }

    /// Texts in the order in which they were published.
    fn values(&self) -> Vec<&str> {
        let all = self.said.iter().filter_map(|output| match output {
            Output::Value(value) => Some(value.text.as_str()),
            _ => None,
        });
        all.collect()
    }

    fn conditions(&self) -> Vec<String> {
        let all = self.said.iter().filter_map(|output| match output {
            Output::Condition(condition) => Some(condition.to_string()),
            _ => None,
        });
        all.collect()
    }

    /// What the agent was asked, without what follows the number.
    fn asked(&self) -> Vec<&str> {
        let all = self.said.iter().filter_map(|output| match output {
            Output::Io(IoCommand::Get { path } | IoCommand::Stream { path }) => {
                path.split('&').next()
            }
            _ => None,
        });
        all.collect()
    }
}

#[test]
fn numbers_that_go_back_without_a_new_instance_are_reported_and_what_holds_is_published() {
    let mut talk = Talk::begun();
    talk.part(&document(
        7,
        1,
        1000,
        &[(998, "ACTIVE"), (999, "FEED_HOLD")],
    ));
    // A gap from 10 to 998: what holds is asked again.
    talk.whole(&document(7, 1, 1000, &[(999, "FEED_HOLD")]));
    talk.stream();
    talk.part(&document(7, 1, 6, &[(5, "STOPPED")]));
    talk.wait(1);
    talk.whole(&document(7, 1, 6, &[(5, "STOPPED")]));
    talk.stream();
    talk.part(&document(7, 1, 7, &[(6, "INTERRUPTED")]));
    let wanted = ["READY", "ACTIVE", "FEED_HOLD", "STOPPED", "INTERRUPTED"];
    assert_eq!(talk.values(), wanted);
    let back = "the agent's numbers go back from 1000 to 6 while its instance stays: what holds is asked anew; 1 so far";
    assert!(
        talk.conditions().contains(&back.to_owned()),
        "{:?}",
        talk.conditions()
    );
    assert_eq!(talk.asked().last(), Some(&"/sample?from=6"));
}

#[test]
fn an_agent_that_refuses_a_number_since_it_counts_anew_is_reported() {
    let mut talk = Talk::begun();
    let body = OUT_OF_RANGE.as_bytes().to_vec();
    talk.step(Input::Io(IoEvent::Answered { status: 404, body }));
    talk.whole(&document(7, 1, 4, &[(3, "ACTIVE")]));
    assert_eq!(talk.values(), ["READY", "ACTIVE"]);
    let back = talk.conditions();
    let back = back.iter().find(|one| one.contains("go back from 10 to 4"));
    assert!(back.is_some(), "{:?}", talk.conditions());
    assert_eq!(talk.asked().last(), Some(&"/sample?from=4"));
}

/// An agent that calls every number out of range sends no values: its machine would seem to stand.
#[test]
fn an_agent_that_refuses_every_number_is_reported() {
    let mut talk = Talk::begun();
    for _ in 0..3 {
        let body = OUT_OF_RANGE.as_bytes().to_vec();
        talk.step(Input::Io(IoEvent::Answered { status: 404, body }));
        talk.wait(1);
        talk.whole(&document(7, 1, 10, &[(9, "READY")]));
    }
    let conditions = talk.conditions();
    let refused = conditions.iter().filter(|one| one.contains("OUT_OF_RANGE"));
    assert_eq!(refused.count(), 1, "{conditions:?}");
}

#[test]
fn one_number_near_the_greatest_silences_no_part_behind_it() {
    for wrong in [1_000_000, u64::MAX - 1, u64::MAX] {
        let mut talk = Talk::begun();
        talk.part(&document(7, 1, wrong, &[(10, "ACTIVE")]));
        talk.part(&document(7, 1, 12, &[(11, "STOPPED")]));
        talk.wait(1);
        talk.whole(&document(7, 1, 12, &[(11, "STOPPED")]));
        assert_eq!(talk.values(), ["READY", "ACTIVE", "STOPPED"], "{wrong}");
        let asked = talk.asked();
        assert_eq!(asked.last(), Some(&"/sample?from=12"), "{asked:?}");
    }
}

#[test]
fn what_comes_twice_is_published_once_and_is_in_the_account_with_what_was_lost() {
    let mut talk = Talk::begun();
    talk.part(&document(
        7,
        1,
        12,
        &[
            (8, "OLD"),
            (10, "ACTIVE"),
            (10, "ACTIVE"),
            (11, "FEED_HOLD"),
        ],
    ));
    talk.part(&document(7, 1, 31, &[(30, "STOPPED")]));
    talk.whole(&document(7, 1, 31, &[(30, "STOPPED")]));
    assert_eq!(talk.values(), ["READY", "ACTIVE", "FEED_HOLD", "STOPPED"]);
    talk.wait(61);
    let said = talk.conditions();
    let account = said
        .iter()
        .find(|one| one.contains("answers taken"))
        .unwrap();
    assert!(
        account.contains("2 observations that came before"),
        "{account}"
    );
    assert!(
        account.contains("18 observations that the agent lost"),
        "{account}"
    );
}

#[test]
fn what_is_missing_within_a_part_is_asked_again_once_and_published_once() {
    for missing in [11..13, 11..12, 12..20] {
        let mut talk = Talk::begun();
        let word = |number: u64| format!("W{number}");
        let words: Vec<String> = (10..=missing.end).map(word).collect();
        let all: Vec<(u64, &str)> = (10..).zip(words.iter().map(String::as_str)).collect();
        let has = |number: u64| !missing.contains(&number);
        let told: Vec<_> = all
            .iter()
            .copied()
            .filter(|(number, _)| has(*number))
            .collect();
        let next = missing.end + 1;
        talk.part(&document(7, 1, next, &told));
        let from = format!("/sample?from={}", missing.start);
        assert_eq!(talk.asked().last(), Some(&from.as_str()));
        // What still comes of the stream that was given up is not heard.
        talk.part(&document(7, 1, next + 1, &[(next, "LATE")]));
        let behind = all
            .iter()
            .copied()
            .filter(|(number, _)| *number >= missing.start);
        talk.whole(&document(7, 1, next, &behind.collect::<Vec<_>>()));
        let wanted: Vec<&str> = ["READY"]
            .into_iter()
            .chain(words.iter().map(String::as_str))
            .collect();
        assert_eq!(talk.values(), wanted);
        let from = format!("/sample?from={next}");
        assert_eq!(talk.asked().last(), Some(&from.as_str()));
        let lost = talk
            .conditions()
            .into_iter()
            .filter(|one| one.contains("lost"));
        assert_eq!(lost.count(), 0);
    }
}

#[test]
fn what_an_agent_lost_within_a_part_is_counted_and_not_asked_for_without_end() {
    let mut talk = Talk::begun();
    talk.part(&document(7, 1, 14, &[(10, "A"), (13, "D")]));
    // It has 11 and 12 no more, and lacks 14 and 15 besides.
    talk.whole(&document(7, 1, 17, &[(13, "D"), (16, "G")]));
    assert_eq!(talk.values(), ["READY", "A", "D", "G"]);
    assert_eq!(talk.asked().last(), Some(&"/current"));
    talk.whole(&document(7, 1, 17, &[(16, "G")]));
    talk.stream();
    let so_far = talk.asked().len();
    talk.part(&document(7, 1, 20, &[(17, "H"), (19, "J")]));
    assert_eq!(talk.asked().len(), so_far, "asked again without a pause");
    assert_eq!(talk.values(), ["READY", "A", "D", "G", "H", "J"]);
    talk.wait(1);
    talk.whole(&document(7, 1, 20, &[(19, "J")]));
    assert_eq!(talk.values().len(), 6);
    talk.wait(61);
    let said = talk.conditions();
    let account = said.iter().find(|one| one.contains("answers taken"));
    let account = account.unwrap();
    assert!(
        account.contains("5 observations that the agent lost"),
        "{account}"
    );
}

#[test]
fn an_observation_that_cannot_be_read_is_not_missing() {
    let mut talk = Talk::begun();
    let part = document(7, 1, 13, &[(10, "A"), (11, "B"), (12, "C")]);
    talk.part(&part.replacen(r#" dataItemId="ex" sequence="11""#, r#" sequence="11""#, 1));
    assert_eq!(talk.values(), ["READY", "A", "C"]);
    let lost = talk
        .conditions()
        .into_iter()
        .filter(|one| one.contains("lost"));
    assert_eq!(lost.count(), 0);
}

#[test]
fn an_agent_of_another_instance_with_every_part_is_asked_after_pauses() {
    let mut talk = Talk::begun();
    talk.part(&document(8, 1, 10, &[(9, "ACTIVE")]));
    assert_eq!(talk.asked().last(), Some(&"/current"));
    talk.whole(&document(8, 1, 10, &[(9, "ACTIVE")]));
    talk.stream();
    let so_far = talk.asked().len();
    talk.part(&document(9, 1, 10, &[(9, "STOPPED")]));
    assert_eq!(talk.asked().len(), so_far, "asked again without a pause");
    talk.wait(1);
    assert_eq!(talk.asked().len(), so_far + 1);
    talk.whole(&document(9, 1, 10, &[(9, "STOPPED")]));
    assert_eq!(talk.values(), ["READY", "ACTIVE", "STOPPED"]);
}

#[test]
fn a_condition_under_the_key_of_a_value_is_in_the_account() {
    let mut talk = Talk::begun();
    let fault = r#"<Condition><Fault dataItemId="ex" nativeCode="17" sequence="10" timestamp="2026-01-05T08:00:00Z">hot</Fault></Condition></ComponentStream>"#;
    let part = document(7, 1, 11, &[]).replace("</ComponentStream>", fault);
    talk.part(&part);
    assert_eq!(talk.values(), ["READY"]);
    talk.wait(61);
    let said = talk.conditions();
    let account = said
        .iter()
        .find(|one| one.contains("answers taken"))
        .unwrap();
    let wanted =
        "1 values published; 1 values that the mapping takes for conditions, or the reverse";
    assert!(account.contains(wanted), "{account}");
}

proptest! {
    /// Whatever the numbers of heads and observations are: no panic, and the last state of a good agent is published.
    #[test]
    fn prop_whatever_the_numbers_the_last_state_is_published(
        parts in proptest::collection::vec((0_u64..9, any::<u64>(), any::<u64>(), any::<u64>()), 0..8),
    ) {
        let mut talk = Talk::begun();
        for (instance, first, next, number) in parts {
            talk.part(&document(instance, first, next, &[(number, "ACTIVE")]));
            talk.answer_all(&document(instance, first, next, &[(number, "FEED_HOLD")]));
        }
        // A stream that is silent for a minute is given up, and all that holds is taken anew.
        for _ in 0..3 {
            let good = document(7, 1, 20, &[(19, "STOPPED")]);
            talk.wait(60);
            talk.answer_all(&good);
            talk.part(&good);
        }
        prop_assert_eq!(talk.values().last().copied(), Some("STOPPED"));
    }
}
