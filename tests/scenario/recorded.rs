//! What the bag of a run holds.

use abbe_msgs::topics::Topic;
use abbe_msgs::{Message, Wire, from_cdr};
use metrology::sample::{AxisState, TestSegment};
use recorder::{Bag, Event, Order};

/// Every message of a topic in the order of recording.
pub fn all<M: Message + Wire>(bag: &Bag, topic: &Topic<M>) -> Vec<M::Inner> {
    let mut found = Vec::new();
    for_each(bag, topic, |message| found.push(message));
    found
}

/// Takes every message of a topic in the order of recording.
pub fn for_each<M: Message + Wire>(bag: &Bag, topic: &Topic<M>, mut take: impl FnMut(M::Inner)) {
    let mut messages = bag.messages(Order::LogTime);
    while let Some(event) = messages.next_event() {
        match event {
            Event::Message(message) => {
                let name = &bag.topic(message.topic).topic;
                if name.trim_start_matches('/') == topic.name {
                    let decoded: M = from_cdr(message.data).unwrap();
                    take(decoded.into_inner().unwrap());
                }
            }
            Event::Loss(loss) => panic!("{}: {loss:?}", topic.name),
        }
    }
}

/// Begin and end of each test, in the order in which they began.
pub fn tests(segments: &[TestSegment]) -> Vec<(&TestSegment, &TestSegment)> {
    let begins = segments.iter().filter(|segment| segment.begin);
    begins
        .map(|begin| {
            let mut ends = segments.iter().filter(|s| !s.begin && s.run == begin.run);
            (begin, ends.next().unwrap())
        })
        .collect()
}

/// The last state of each rest of the command that lasts, between two instants.
pub fn stops<'a>(
    states: &'a [AxisState],
    (begin, end): (&TestSegment, &TestSegment),
    least_s: f64,
) -> Vec<&'a AxisState> {
    let within = states
        .iter()
        .filter(|state| state.received_at >= begin.at && state.received_at <= end.at);
    let within: Vec<&AxisState> = within.collect();
    let rests = within.chunk_by(|a, b| (a.commanded.xyz() - b.commanded.xyz()).norm() < 1e-9);
    rests
        .filter_map(|rest| {
            let (first, last) = (rest.first()?, rest.last()?);
            let lasted_s = (last.received_at - first.received_at).as_secs_f64();
            (lasted_s >= least_s).then_some(*last)
        })
        .collect()
}

/// Size that `share` of the sizes do not exceed.
pub fn quantile(mut sizes: Vec<f64>, share: f64) -> f64 {
    sizes.sort_by(f64::total_cmp);
    let place = (share * sizes.len() as f64).ceil() as usize;
    sizes[place.saturating_sub(1)]
}
