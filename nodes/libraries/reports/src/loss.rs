//! What of a bag was lost or left out, as every verb that reads bags tells it: on the terminal, at the head of a page, as JSON, by
//! the exit code.

use std::process::ExitCode;

use node_runtime::complain;
use recorder::Loss;
use replayer::{Account, Leaps, Reading, TopicAccount};
use serde_json::{Value, json};

/// Exit code for what was done with loss.
pub const DONE_WITH_LOSS: u8 = 3;

/// The exit code of a verb that has done its work.
pub fn exit_code(is_whole: bool) -> ExitCode {
    if is_whole {
        ExitCode::SUCCESS
    } else {
        ExitCode::from(DONE_WITH_LOSS)
    }
}

/// Prints what was lost or left out to standard error.
pub fn complain_of(reading: &Reading) {
    for line in reading.lines().into_iter().chain(reading.leaps.line()) {
        complain!("abbe: {line}");
    }
}

/// What of bags was lost or left out, in words.
pub fn lines(readings: &[Reading]) -> Vec<String> {
    readings.iter().flat_map(Reading::lines).collect()
}

/// The head of a page whose bag is not whole.
pub fn in_words(reading: &Reading) -> Vec<String> {
    let mut lines = Vec::new();
    let mut losses = reading.losses.iter();
    if let Some(last) = losses.rfind(|loss| !loss.reason.is_beside_messages()) {
        let n = last.messages_read;
        lines.push(format!(
            "NOT WHOLE: a part of this bag was lost. Everything below comes from what could be read, {n} messages before the last gap; a test that was cut off is missing or has fewer readings."
        ));
    } else if !reading.losses.is_empty() {
        lines.push(
            "NOT WHOLE: what stands beside the messages of this bag is damaged. Every message was read.".to_owned(),
        );
    }
    lines.extend(reading.losses.iter().map(|loss| format!("Lost: {loss}.")));
    let n = reading.account.left_out();
    if n > 0 {
        lines.push(format!(
            "NOT WHOLE: {n} messages of this bag could not be used and were left out. Everything below comes from the others."
        ));
    }
    let left_out = reading.account.lines();
    lines.extend(left_out.map(|line| format!("Left out: {line}.")));
    lines.extend(reading.leaps.line().map(|line| format!("Note: {line}.")));
    lines
}

/// What was lost or left out, for machines; null: nothing.
pub fn as_json(reading: &Reading) -> Value {
    if reading.is_whole() {
        return Value::Null;
    }
    let places: Vec<Value> = reading.losses.iter().map(place).collect();
    let topics = reading.account.topics.iter();
    let left_out: Vec<Value> = topics.flat_map(left_out).collect();
    json!({ "places": places, "left_out": left_out })
}

fn place(loss: &Loss) -> Value {
    json!({
        "file": loss.file.display().to_string(),
        "at_byte": loss.at_byte,
        "reason": loss.reason.to_string(),
        "messages_read_before": loss.messages_read,
    })
}

fn left_out(topic: &TopicAccount) -> Vec<Value> {
    let of_topic = |it: &replayer::LeftOut| {
        json!({
            "topic": topic.topic,
            "type": topic.type_name,
            "reason": it.reason,
            "messages": it.messages,
            "of": topic.messages,
            "what": it.what,
            "first": {
                "number": it.first.number,
                "log_time_ns": it.first.log_time_nanos,
                "stamp_s_ns": it.first.stamp,
            },
        })
    };
    topic.left_out.iter().map(of_topic).collect()
}

/// The leaps of the log times, for machines; null: none.
pub fn leaps_as_json(leaps: &Leaps) -> Value {
    match leaps.longest {
        None => Value::Null,
        Some(longest) => json!({ "count": leaps.count, "longest": longest }),
    }
}

/// The account by topic, for machines: messages read are those used, those left out, and those that no test needed.
pub fn account_as_json(account: &Account) -> Value {
    let row = |topic: &TopicAccount| {
        let left_out: u64 = topic.left_out.iter().map(|it| it.messages).sum();
        json!({
            "topic": topic.topic,
            "type": topic.type_name,
            "messages": topic.messages,
            "used": topic.used,
            "left_out": left_out,
            "not_needed": topic.not_needed(),
        })
    };
    account.topics.iter().map(row).collect()
}

#[cfg(test)]
mod tests {
    use recorder::LossReason;
    use replayer::{LeftOut, Place, Reason};

    use super::*;

    fn reading() -> Reading {
        let left_out = LeftOut {
            reason: Reason::NotFinite,
            messages: 2,
            first: Place {
                number: 5,
                log_time_nanos: 7_000_000_001,
                stamp: Some((7, 0)),
            },
            what: "velocity[Z]: NaN".to_owned(),
        };
        let loss = Loss {
            file: "bag_0.mcap".into(),
            at_byte: 4000,
            reason: LossReason::NoEnd,
            messages_read: 17,
        };
        Reading {
            account: Account {
                topics: vec![TopicAccount {
                    topic: "/axes/state".to_owned(),
                    type_name: "abbe_msgs/msg/AxisState".to_owned(),
                    messages: 9,
                    used: 6,
                    left_out: vec![left_out],
                }],
            },
            losses: vec![loss],
            ..Reading::default()
        }
    }

    #[test]
    fn losses_and_left_outs_are_told_in_every_form() {
        let lines = in_words(&reading());
        assert_eq!(lines.len(), 4, "{lines:?}");
        assert!(lines[0].contains("17 messages before the last gap"));
        assert!(lines[2].starts_with("NOT WHOLE: 2 messages"), "{lines:?}");
        let told = "Left out: /axes/state: 2 of 9 messages left out, not finite: velocity[Z]: NaN";
        assert!(lines[3].starts_with(told), "{lines:?}");
        let json = as_json(&reading());
        assert_eq!(json["places"][0]["at_byte"], 4000);
        assert_eq!(json["left_out"][0]["reason"], "not_finite");
        assert_eq!(json["left_out"][0]["first"]["stamp_s_ns"], json!([7, 0]));
        let account = account_as_json(&reading().account);
        assert_eq!(account[0]["used"], 6);
        assert_eq!(account[0]["left_out"], 2);
        assert_eq!(account[0]["not_needed"], 1);
        assert!(as_json(&Reading::default()).is_null());
        assert!(in_words(&Reading::default()).is_empty());
    }

    #[test]
    fn leaps_are_reported_and_are_no_loss() {
        let mut reading = Reading::default();
        assert!(leaps_as_json(&reading.leaps).is_null());
        reading.leaps.pass(0, 7_200_000_000_000);
        let lines = in_words(&reading);
        let begin = "Note: log times: 1 leap of more than 60 min; the longest is 2.0 h,";
        assert!(lines.len() == 1 && lines[0].starts_with(begin), "{lines:?}");
        assert!(as_json(&reading).is_null() && reading.is_whole());
        let json = leaps_as_json(&reading.leaps);
        assert_eq!(json["longest"]["to_nanos"], 7_200_000_000_000_u64);
    }
}
