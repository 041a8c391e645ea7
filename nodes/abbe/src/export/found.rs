//! What a bag has for tables, and why it has nothing.

use std::path::Path;

use abbe_msgs::topics::{self, Topic};
use abbe_msgs::{Message, Wire, from_cdr};
use anyhow::{Context, Result};
use machine::export::selection::Measured;
use metrology::{Axis, AxisSet};
use recorder::{Bag, Event, Order};

/// What a bag has for an export.
#[derive(Default)]
pub(super) struct Found {
    /// The last table of each axis and the last models.
    pub measured: Measured,
    /// What could not be read, in words.
    pub losses: Vec<String>,
    /// Messages on each of [`SOURCES`]; `None`: the bag has no such topic.
    pub topics: [Option<u64>; 3],
}

/// Topics that tables are made of, and who publishes them when.
const SOURCES: [(&str, &str); 3] = [
    (
        topics::POSITIONING_TABLE.name,
        "deviations of an axis from its scale, by axis_compensation when a positioning run gives a table",
    ),
    (
        topics::GEOMETRY_MODEL.name,
        "geometric errors, by grid_encoder after its circles",
    ),
    (
        topics::THERMAL_MODEL.name,
        "thermal drift, by thermal_model after a block cycle that follows a cold one",
    ),
];

/// Whether `name` is `topic`; a machine's namespace may stand in front.
fn is(name: &str, topic: &str) -> bool {
    name == topic || name.ends_with(&format!("/{topic}"))
}

/// The last that a bag says of a machine's errors.
pub(super) fn read(path: &Path) -> Result<Found> {
    let bag = Bag::open(path)?;
    let mut found = Found::default();
    for info in bag.topics() {
        for ((topic, _), count) in SOURCES.iter().zip(&mut found.topics) {
            if is(&info.topic, topic) {
                *count.get_or_insert(0) += info.message_count;
            }
        }
    }
    let measured = &mut found.measured;
    let mut messages = bag.messages(Order::LogTime);
    while let Some(event) = messages.next_event() {
        let message = match event {
            Event::Message(message) => message,
            Event::Loss(loss) => {
                found.losses.push(loss.to_string());
                continue;
            }
        };
        let name = bag.topic(message.topic).topic.as_str();
        if is(name, topics::POSITIONING_TABLE.name) {
            let table = decode(&topics::POSITIONING_TABLE, message.data)?;
            let axis = table.axis;
            measured.tables[axis] = Some(table);
        } else if is(name, topics::THERMAL_MODEL.name) {
            measured.thermal = Some(decode(&topics::THERMAL_MODEL, message.data)?);
        } else if is(name, topics::GEOMETRY_MODEL.name) {
            measured.geometry = Some(decode(&topics::GEOMETRY_MODEL, message.data)?);
        }
    }
    Ok(found)
}

/// Each source of tables with why it gave none.
pub(super) fn looked_for(
    measured: &Measured,
    topics: [Option<u64>; 3],
    axes: AxisSet,
) -> Vec<String> {
    let of_axes = |known: AxisSet| {
        let names: Vec<String> = known.iter().map(|axis| axis.to_string()).collect();
        format!(
            "it is about {}, what of that is in no table is said above",
            names.join(" ")
        )
    };
    let tables: AxisSet = Axis::ALL
        .into_iter()
        .filter(|axis| measured.tables[*axis].is_some())
        .collect();
    let wanted: Vec<String> = axes.iter().map(|axis| axis.to_string()).collect();
    let mut lines: Vec<String> = SOURCES
        .iter()
        .zip(topics)
        .map(|((topic, what), messages)| {
            let why = match messages {
                None => {
                    "the bag has no such topic: the node was not there or not recorded".to_owned()
                }
                Some(0) => "the bag has the topic, but nothing was published".to_owned(),
                Some(_) if *topic == topics::POSITIONING_TABLE.name => of_axes(tables),
                Some(n) => {
                    format!("{n} messages, none that gives a table for these axes in this format")
                }
            };
            format!("{topic} ({what}): {why}")
        })
        .collect();
    lines.push(format!("for axes {}", wanted.join(" ")));
    lines
}

fn decode<M: Message + Wire>(topic: &Topic<M>, bytes: &[u8]) -> Result<M::Inner> {
    let message: M = from_cdr(bytes).with_context(|| topic.name.to_owned())?;
    message.into_inner().with_context(|| topic.name.to_owned())
}
