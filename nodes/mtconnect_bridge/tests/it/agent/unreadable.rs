//! Parts of a stream that cannot be read, in whole or by a letter.

use super::*;

#[test]
fn a_part_that_cannot_be_read_is_left_out_and_said_and_the_next_is_told() {
    let (port, paths) = serve(vec![
        told(devices(7)),
        told(streams(7, 1, 10, &[exec(4, "READY")])),
        Answer::Parts(
            vec![
                "<MTConnectStreams><Header".to_owned(),
                streams(7, 1, 16, &[exec(15, "STOPPED")]),
            ],
            false,
        ),
        told(streams(7, 1, 18, &[exec(17, "HELD")])),
        open(streams(7, 1, 18, &[exec(16, "ACTIVE"), exec(17, "HELD")])),
    ]);
    let said = heard(&mut bridge(port), |output| is_value(output, "HELD"));
    assert_eq!(values(&said), ["READY", "STOPPED", "ACTIVE", "HELD"]);
    let words: Vec<String> = conditions(&said).iter().map(ToString::to_string).collect();
    assert!(
        words
            .iter()
            .any(|one| one.starts_with("/sample: a part is left out: no XML")),
        "{words:?}"
    );
    assert!(
        words.contains(&"5 observations lost between 10 and 15; 5 so far".to_owned()),
        "{words:?}"
    );
    // Nothing was unknown in between.
    let lost = |one: &&Condition| {
        matches!(
            one,
            Condition::Disconnected { .. } | Condition::Value(ValueCondition::Absent { .. })
        )
    };
    assert_eq!(conditions(&said).into_iter().find(lost), None);
    let asked = asked(&paths);
    let wanted = [
        "/probe",
        "/current",
        "/sample?from=10",
        "/current",
        "/sample?from=16",
    ];
    assert_eq!(asked, wanted);
}

/// The agent's `current` stays behind: the number of the part is asked once all the same.
#[test]
fn a_part_that_cannot_be_read_is_not_asked_again() {
    let (port, paths) = serve(vec![
        told(devices(7)),
        told(streams(7, 1, 10, &[exec(4, "READY")])),
        Answer::Parts(vec!["A<B</a>".to_owned(), streams(7, 1, 12, &[])], false),
        told(streams(7, 1, 10, &[exec(4, "READY")])),
        open(streams(7, 1, 13, &[exec(12, "STOPPED")])),
    ]);
    let said = heard(&mut bridge(port), |output| is_value(output, "STOPPED"));
    assert_eq!(values(&said), ["READY", "STOPPED"]);
    let words: Vec<String> = conditions(&said).iter().map(ToString::to_string).collect();
    assert!(
        words.contains(&"2 observations lost between 10 and 12; 2 so far".to_owned()),
        "{words:?}"
    );
    assert_eq!(asked(&paths)[4], "/sample?from=12");
}

#[test]
fn a_letter_that_may_not_stand_in_xml_costs_itself_alone() {
    let (port, paths) = serve(vec![
        told(devices(7)),
        told(streams(7, 1, 10, &[exec(4, "P&#x1;")])),
        Answer::Parts(
            vec![
                streams(7, 1, 11, &[exec(10, "A&B")]),
                streams(7, 1, 12, &[exec(11, "A&#1;C")]),
                streams(7, 1, 13, &[exec(12, "STOPPED")]),
            ],
            false,
        ),
    ]);
    let said = heard(&mut bridge(port), |output| is_value(output, "STOPPED"));
    let words = ["P\u{fffd}", "A\u{fffd}B", "A\u{fffd}C", "STOPPED"];
    assert_eq!(values(&said), words);
    let replaced = conditions(&said)
        .into_iter()
        .filter(|one| matches!(one, Condition::Replaced { .. }));
    assert_eq!(replaced.count(), 3);
    assert_eq!(asked(&paths).len(), 3);
}

/// Otherwise the last values would look current.
#[test]
fn after_many_parts_that_cannot_be_read_no_value_is_known_any_more() {
    let (port, paths) = serve(vec![
        told(devices(7)),
        told(streams(7, 1, 10, &[exec(4, "READY")])),
        Answer::Parts(vec!["A<B</a>".to_owned(); 5], false),
        told(devices(7)),
        told(streams(7, 1, 10, &[exec(4, "READY")])),
        open(streams(7, 1, 13, &[exec(12, "STOPPED")])),
    ]);
    let said = heard(&mut bridge(port), |output| is_value(output, "STOPPED"));
    let is_absent = |one: &Condition| matches!(one, Condition::Value(ValueCondition::Absent { name, .. }) if name == "ex");
    assert!(conditions(&said).into_iter().any(is_absent));
    let left_out = |one: &&Condition| matches!(one, Condition::PartLeftOut { .. });
    assert_eq!(conditions(&said).into_iter().filter(left_out).count(), 3);
    assert_eq!(asked(&paths)[3], "/probe");
}

#[test]
fn a_current_that_stays_unreadable_is_asked_after_growing_pauses_and_each_is_told() {
    let broken = || told("<MTConnectStreams><Header".to_owned());
    let (port, paths) = serve(vec![
        told(devices(7)),
        told(streams(7, 1, 10, &[exec(4, "READY")])),
        // What was lost makes the bridge ask for what holds.
        open(streams(7, 40, 42, &[exec(41, "ACTIVE")])),
        broken(),
        told(devices(7)),
        broken(),
        told(devices(7)),
        broken(),
        told(devices(7)),
        told(streams(7, 40, 42, &[exec(41, "ACTIVE")])),
        open(streams(7, 40, 43, &[exec(42, "HELD")])),
    ]);
    let said = heard(&mut bridge(port), |output| is_value(output, "HELD"));
    let pauses_ms: Vec<f64> = conditions(&said)
        .into_iter()
        .filter_map(|one| match one {
            Condition::Disconnected { lost, retry_s, .. } => {
                let words = lost.to_string();
                assert!(words.starts_with("/current: no XML"), "{words}");
                Some((retry_s * 1e3).round())
            }
            _ => None,
        })
        .collect();
    assert_eq!(pauses_ms, [50.0, 100.0, 200.0]);
    let is_absent = |one: &Condition| matches!(one, Condition::Value(ValueCondition::Absent { name, .. }) if name == "ex");
    assert!(conditions(&said).into_iter().any(is_absent));
    assert_eq!(asked(&paths).len(), 11);
}

/// Between 10 and 40 the agent reported all its devices.
#[test]
fn numbers_of_other_devices_are_not_counted_as_lost() {
    let config = |port| BridgeConfig {
        agent: AgentConfig {
            device: "mill".to_owned(),
            ..AgentConfig::default()
        },
        ..config(port)
    };
    let (port, paths) = serve(vec![
        told(devices(7)),
        told(streams(7, 1, 10, &[exec(4, "READY")])),
        // Numbers of other devices lie between: nothing is lost.
        open(streams(7, 1, 30, &[exec(15, "ACTIVE"), exec(29, "HELD")])),
    ]);
    let said = heard(&mut opened(&config(port)), |output| {
        is_value(output, "HELD")
    });
    let is_gap = |one: &&Condition| one.name() == "sequence_gap";
    assert_eq!(conditions(&said).into_iter().find(is_gap), None);
    let (asked, first) = (asked(&paths), "/mill/sample?from=10");
    assert_eq!(asked, ["/mill/probe", "/mill/current", first]);
    let (port, _paths) = serve(vec![
        told(devices(7)),
        told(streams(7, 1, 10, &[exec(4, "READY")])),
        // The buffer ran over.
        open(streams(7, 40, 42, &[exec(41, "ACTIVE")])),
        told(streams(7, 40, 50, &[exec(45, "STOPPED")])),
    ]);
    let said = heard(&mut opened(&config(port)), |output| {
        is_value(output, "STOPPED")
    });
    let gaps: Vec<&Condition> = conditions(&said).into_iter().filter(is_gap).collect();
    let [gap] = gaps[..] else { panic!("{gaps:?}") };
    let words = gap.to_string();
    assert_eq!(gap.count(), Some(1));
    assert_eq!(gap.severity(), Severity::Warn);
    assert!(
        words.starts_with("the numbers from 10 to 40 of all the agent's devices were lost"),
        "{words}"
    );
    assert!(!words.contains("30"), "{words}");
}
