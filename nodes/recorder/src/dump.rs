//! A bag as lines of JSON, one message a line, for people and for other programs.

use std::io::{self, Write};

use serde::Serialize;

use crate::error::RecorderError;
use crate::read::{Bag, Event, Loss, Order};
use crate::reflect::{Reflector, Value};

#[derive(Serialize)]
struct Line<'a> {
    topic: &'a str,
    #[serde(rename = "type")]
    type_name: &'a str,
    log_time_ns: u64,
    publish_time_ns: u64,
    sequence: u32,
    message: Value,
}

/// Writes `{"topic", "type", "log_time_ns", "publish_time_ns", "sequence", "message"}` for every
/// message in the order of recording; returns what the bag lacks.
///
/// # Errors
/// A definition or a message cannot be read, or the write failed.
pub fn dump_json(bag: &Bag, out: &mut impl Write) -> Result<Vec<Loss>, RecorderError> {
    let mut reflectors = Vec::new();
    for topic in bag.topics() {
        let reflector = Reflector::new(
            &topic.type_name,
            &topic.definition_encoding,
            &topic.definition,
        );
        reflectors.push(reflector.map_err(|source| RecorderError::Definition {
            topic: topic.topic.clone(),
            type_name: topic.type_name.clone(),
            source,
        })?);
    }
    let mut losses = Vec::new();
    let mut number = 0;
    let mut messages = bag.messages(Order::File);
    let failed = |source: io::Error| RecorderError::Dump { source };
    while let Some(event) = messages.next_event() {
        let message = match event {
            Event::Message(message) => message,
            Event::Loss(loss) => {
                losses.push(loss);
                continue;
            }
        };
        let topic = bag.topic(message.topic);
        let value = reflectors[message.topic.index()].decode(message.data);
        let value = value.map_err(|source| RecorderError::Decode {
            topic: topic.topic.clone(),
            message: number,
            log_time_nanos: message.log_time_nanos,
            source,
        })?;
        let line = Line {
            topic: &topic.topic,
            type_name: &topic.type_name,
            log_time_ns: message.log_time_nanos,
            publish_time_ns: message.publish_time_nanos,
            sequence: message.sequence,
            message: value,
        };
        serde_json::to_writer(&mut *out, &line).map_err(|error| failed(error.into()))?;
        out.write_all(b"\n").map_err(failed)?;
        number += 1;
    }
    out.flush().map_err(failed)?;
    Ok(losses)
}
