//! The bag of a recorder whose clock was set back while it wrote.

use std::time::{Duration, Instant};

use abbe_msgs::topics::{self, Topic};
use abbe_msgs::{Message, from_cdr, to_cdr};
use recorder::{Bag, Event, Order};

use crate::stepped_cell::Cell;

/// What may be on its way when the recorder is told to end.
const ON_ITS_WAY: Duration = Duration::from_millis(500);
/// How long a recorder may have heard nothing before its clock was set, s.
const SILENCE_S: f64 = 5.0;

/// A message of a bag: when it was received, s, and its bytes.
type Recorded = (f64, Vec<u8>);

/// Messages of a topic in the order of the file; the bag is read to its end without a loss.
fn recorded(bag: &Bag, topic: &str) -> Vec<Recorded> {
    let names: Vec<&str> = bag.topics().iter().map(|t| t.topic.as_str()).collect();
    let mut found = Vec::new();
    let mut events = bag.messages(Order::File);
    while let Some(event) = events.next_event() {
        match event {
            Event::Message(message) if names[message.topic.index()] == topic => {
                let received_s = message.log_time_nanos as f64 * 1e-9;
                found.push((received_s, message.data.to_vec()));
            }
            Event::Message(_) => {}
            Event::Loss(loss) => panic!("{loss}"),
        }
    }
    found
}

/// The bag opens, holds all that was received, says by how much its clock went back, and its times go on from there.
pub fn check(cell: &Cell, began: Instant, back: Instant, stopped: Instant, back_s: f64) {
    let bag = Bag::open(cell.bag()).unwrap();
    let states = holds_all(cell, &bag, &topics::AXES_STATE, began, stopped);
    holds_all(cell, &bag, &topics::COMPENSATION, began, stopped);
    holds_all(cell, &bag, &topics::THERMAL_MODEL, began, stopped);
    let closing = bag.metadata("abbe.recording").unwrap();
    eprintln!("{closing:?}");
    let times: u64 = closing["messages_back_in_time"].parse().unwrap();
    assert!(times >= 1);
    let largest_s = closing["largest_step_back_ns"].parse::<f64>().unwrap() * 1e-9;
    let missing_s = back_s - largest_s;
    assert!((0.0..SILENCE_S).contains(&missing_s), "{largest_s} s");
    let after = &states[step(&states).unwrap()..];
    assert_eq!(step(after), None);
    let spanned_s = after.last().unwrap().0 - after[0].0;
    let passed_s = stopped.duration_since(back).as_secs_f64();
    assert!((spanned_s - passed_s).abs() < 2.0, "{spanned_s} {passed_s}");
    unheard(cell, &bag, back);
    let mut by_time = bag.messages(Order::LogTime);
    let mut n = 0;
    while let Some(event) = by_time.next_event() {
        n += u64::from(matches!(event, Event::Message(_)));
    }
    assert_eq!(n, bag.message_count());
}

/// From the first message that both have, everything that the witness heard is in the bag, in the same order. Which of
/// the two a new writer meets first is open.
fn holds_all<M: Message>(
    cell: &Cell,
    bag: &Bag,
    topic: &Topic<M>,
    began: Instant,
    stopped: Instant,
) -> Vec<Recorded> {
    let name = format!("/{}", topic.name);
    let found = recorded(bag, &name);
    // Written anew, so that padding at the end does not count.
    let written: Vec<Vec<u8>> = found
        .iter()
        .map(|(_, data)| to_cdr(&from_cdr::<M>(data).unwrap()))
        .collect();
    let until = stopped.checked_sub(ON_ITS_WAY).unwrap();
    let heard = cell.graph.since(topic, began);
    let heard: Vec<Vec<u8>> = heard
        .iter()
        .take_while(|(at, _)| *at < until)
        .map(|(_, message)| to_cdr(message))
        .collect();
    let first_heard = heard.iter().position(|bytes| *bytes == written[0]);
    let first_written = written.iter().position(|bytes| *bytes == heard[0]);
    let of_witness = &heard[first_heard.unwrap_or(0)..];
    let of_bag = match (first_heard, first_written) {
        (None, None) => panic!("{name}: nothing that both have"),
        (Some(_), _) => &written[..],
        (None, Some(first)) => &written[first..],
    };
    let n = of_witness.len();
    assert!(of_bag.len() >= n, "{name}: {} of {n}", of_bag.len());
    let differs = (0..n).find(|&place| of_bag[place] != of_witness[place]);
    assert_eq!(differs, None, "{name}: of {n}");
    eprintln!("{name}: {n} messages are in the bag");
    found
}

/// Of best effort a participant hears nothing until its clock has passed where it was (RustDDS 0.15): the witness, whose
/// clock is right, hears what the recorder does not.
fn unheard(cell: &Cell, bag: &Bag, back: Instant) {
    let said = cell.graph.since(&topics::JOINT_STATES, back).len();
    let all = recorded(bag, &format!("/{}", topics::JOINT_STATES.name));
    let heard = step(&all).map_or(0, |place| all.len() - place);
    eprintln!("joint states since the clock was set back: {said} said, {heard} recorded");
    assert!(said > 100);
    assert_eq!(heard, 0);
}

/// Where times go back by more than messages overtake each other.
fn step(messages: &[Recorded]) -> Option<usize> {
    (1..messages.len()).find(|&place| messages[place].0 < messages[place - 1].0 - 1.0)
}
