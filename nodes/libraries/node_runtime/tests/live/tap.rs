use std::sync::Arc;
use std::sync::mpsc::channel;
use std::time::Duration;

use abbe_msgs::std_msgs::msg::Int64;
use abbe_msgs::{Durability, Qos, Reliability, from_cdr, to_cdr};
use metrology::Stamp;
use node_runtime::names::NodeNames;
use node_runtime::tap::{PublishReport, RawPublisher, RawTap, Selection, TapEvent};

use super::puppet::{environment, topic, wait};

fn names(name: &str) -> NodeNames {
    NodeNames::new(name, &[]).unwrap()
}

#[test]
fn a_tap_finds_topics_and_gets_every_sample_with_its_stamps() {
    const COUNT: i64 = 2_000;
    let environment = environment(14);
    let topics = [
        topic::<Int64>("deep", Qos::RELIABLE_DEEP),
        topic::<Int64>("/cell/latched", Qos::LATCHED),
        topic::<Int64>("ignored", Qos::RELIABLE),
    ];
    let patience = Duration::from_millis(100);
    let mut publisher =
        RawPublisher::start(&environment, &names("mirror"), &topics, 100, patience).unwrap();
    let number = |data| Arc::from(to_cdr(&Int64 { data }));
    assert!(publisher.publish(1, None, number(-1)));
    let (sender, events) = channel();
    let selection = Selection::Matching(vec!["/deep".to_owned(), "/cell/*".to_owned()]);
    let tap = RawTap::start(&environment, &names("tap"), selection, move |event| {
        let _ = sender.send(event);
    })
    .unwrap();
    let mut found = Vec::new();
    let mut latched = None;
    while found.len() < 2 || latched.is_none() {
        match wait(&events, "the topics", Some) {
            TapEvent::Found(topic) => found.push(topic),
            TapEvent::Sample(sample) => latched = Some(sample),
            other => panic!("{other:?}"),
        }
    }
    found.sort_by(|a, b| a.name.cmp(&b.name));
    let described: Vec<_> = found
        .iter()
        .map(|t| {
            (
                t.name.as_str(),
                t.type_name.as_str(),
                t.qos.reliability,
                t.qos.durability,
            )
        })
        .collect();
    let (reliable, type_name) = (Reliability::Reliable, "std_msgs/msg/Int64");
    assert_eq!(
        described,
        [
            (
                "/cell/latched",
                type_name,
                reliable,
                Durability::TransientLocal
            ),
            ("/deep", type_name, reliable, Durability::Volatile),
        ]
    );
    assert_eq!(latched.unwrap().topic.name, "/cell/latched");
    std::thread::sleep(Duration::from_millis(300));
    for data in 0..COUNT {
        let source = Some(Stamp::from_nanos(1_000_000_000 + data));
        assert!(publisher.publish(0, source, number(data)));
        assert!(publisher.publish(2, None, number(data)));
    }
    for data in 0..COUNT {
        let sample = wait(&events, "a sample", |event| match event {
            TapEvent::Sample(sample) => Some(sample),
            _ => None,
        });
        assert_eq!(from_cdr::<Int64>(&sample.bytes).unwrap().data, data);
        assert_eq!((sample.lost, sample.sequence), (0, data + 1));
        let source = sample.source.unwrap() - Stamp::from_nanos(1_000_000_000 + data);
        assert!(source.nanos().abs() <= 1);
        assert!(sample.received > sample.source.unwrap());
    }
    assert_eq!(publisher.stop().unwrap(), PublishReport::default());
    tap.stop().unwrap();
}
