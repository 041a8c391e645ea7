//! Whether the bytes of a message that a replay puts in or compares can be used by anybody.

use abbe_msgs::topics::{self, Topic, TopicFamily};
use abbe_msgs::{Message, Wire, WireError, from_cdr};

/// Reads a message and says what is wrong with it.
pub(crate) type Usable = fn(&[u8]) -> Result<(), WireError>;

fn usable<M: Message + Wire>(bytes: &[u8]) -> Result<(), WireError> {
    from_cdr::<M>(bytes)?.to_inner().map(drop)
}

const fn of<M: Message + Wire>(topic: &Topic<M>) -> (&'static str, Usable) {
    (topic.name, usable::<M>)
}

const fn of_family<M: Message + Wire>(family: &TopicFamily<M>) -> (&'static str, Usable) {
    (family.base, usable::<M>)
}

/// Every raw or computed topic whose messages have an inner form.
static ALL: [(&str, Usable); 21] = [
    of(&topics::AXES_STATE),
    of(&topics::PROBE_TRIGGER),
    of(&topics::PROBE_POINT),
    of(&topics::PROBE_FEATURE),
    of(&topics::LATENCY),
    of(&topics::BLOCKS_MEASUREMENT),
    of(&topics::THERMAL_MODEL),
    of(&topics::THERMAL_UPDATE_REQUEST),
    of(&topics::GRID_POSITION),
    of(&topics::LENGTH_POSITION),
    of(&topics::ANGLE_POSITION),
    of(&topics::GEOMETRY_MODEL),
    of(&topics::GEOMETRY_ROTARY),
    of(&topics::POSITIONING_TABLE),
    of(&topics::COMPENSATION),
    of(&topics::TEST_SEGMENT),
    of(&topics::PLAN_STATUS),
    of(&topics::CLOCK_ANSWER),
    of(&topics::HOST_CLOCK),
    of_family(&topics::TEMPERATURE),
    of_family(&topics::MACHINE),
];

/// How messages of a topic are tried, by the name that `topics` has for it.
pub(crate) fn of_topic(name: &str) -> Option<Usable> {
    let found = ALL.iter().find(|(known, _)| *known == name);
    found.map(|(_, usable)| *usable)
}

#[cfg(test)]
mod tests {
    use abbe_msgs::topics::Origin;

    use super::*;

    #[test]
    fn every_topic_that_is_put_in_or_compared_is_tried() {
        // Joint states have no inner form; no node computes with them.
        let left = topics::all()
            .iter()
            .filter(|entry| entry.origin != Origin::Housekeeping && of_topic(entry.name).is_none());
        let left: Vec<&str> = left.map(|entry| entry.name).collect();
        assert_eq!(left, [topics::JOINT_STATES.name]);
    }
}
