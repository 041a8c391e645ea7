//! Lines as an adapter sends them (SHDR).
//!
//! ```text
//!   time|key|value|key|value…                                   values
//!   time|key|LEVEL|code|severity|qualifier|text                 a condition
//!   time|key|code|text                                          a message
//!   time|key|count|rate|v v v…                                  a time series
//!   * command: value     * PONG 10000                           for the agent
//! ```
//!
//! `time` is a date with a fraction of a second, milliseconds since an instant of the adapter's, or empty; a
//! duration may follow after `@`. A key may have a device before it (`device:key`). A bar within a value is
//! written `\|`. The line does not say what it is: that is known of the key, and of a key that nobody has
//! described a line is a condition where its second field is a level and it has seven fields.
//!
//! # Holds when
//! An adapter puts a condition, message or time series on a line of its own, as adapters do.
//!
//! # References
//! \[1\] MTConnect C++ agent (`mtconnect/cppagent`), README, "Adapter Agent Protocol". \[2\] See [`crate::observation`].

use crate::observation::{
    AlarmLevel, AlarmReport, MachineTime, Observation, Told, UNAVAILABLE, read_stamp,
};

/// How the fields behind a key are to be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// One field: a value.
    Value,
    /// Five fields: level, code, severity, qualifier, text.
    Condition,
    /// Two fields: code and text.
    Message,
    /// Three fields: count, rate, values.
    Series,
}

/// What a line was.
#[derive(Clone, Debug, PartialEq)]
pub enum Line {
    /// Observations with one stamp.
    Observations(Vec<Observation>),
    /// An answer to our `PING`: the adapter wants to be asked this often.
    Pong {
        /// Period, ms.
        period_ms: f64,
    },
    /// Another command for an agent, or an asset; nothing for us.
    Command,
    /// Not readable.
    Malformed(Flaw),
}

/// Why a line cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Flaw {
    /// There is no bar in it.
    #[error("no bar in it")]
    NoFields,
    /// The stamp is none.
    #[error("stamp {text:?} is none")]
    Stamp {
        /// What stands there.
        text: String,
    },
    /// A key without what belongs to it.
    #[error("key {key:?}: {fields} fields behind it, needs {needed}")]
    Fields {
        /// Key.
        key: String,
        /// Fields behind it.
        fields: usize,
        /// Fields that it needs.
        needed: usize,
    },
    /// A level that is none.
    #[error("key {key:?}: level {level:?} is none")]
    Level {
        /// Key.
        key: String,
        /// What stands there.
        level: String,
    },
    /// A time series whose numbers are none or not as many as it says.
    #[error("key {key:?}: time series of {count:?} values is none")]
    Series {
        /// Key.
        key: String,
        /// How many it says.
        count: String,
    },
}

/// Reads a line; `shape` says what is known of a key (`None`: nothing).
#[must_use]
pub fn read(line: &str, shape: impl Fn(&str) -> Option<Shape>) -> Line {
    if let Some(command) = line.strip_prefix('*') {
        return self::command(command.trim());
    }
    observations(line, shape).map_or_else(Line::Malformed, |found| {
        found.map_or(Line::Command, Line::Observations)
    })
}

fn command(command: &str) -> Line {
    let period = command.strip_prefix("PONG").map(str::trim);
    let period_ms = period.and_then(|period| period.parse::<f64>().ok());
    match period_ms.filter(|period_ms| period_ms.is_finite() && *period_ms > 0.0) {
        Some(period_ms) => Line::Pong { period_ms },
        None => Line::Command,
    }
}

/// The fields between bars; `\|` is a bar within a field.
fn fields(line: &str) -> Vec<String> {
    let mut fields = vec![String::new()];
    let mut letters = line.chars().peekable();
    while let Some(letter) = letters.next() {
        let bar_follows = letters.peek() == Some(&'|');
        let field = fields.last_mut().expect("there is one from the start on");
        match letter {
            '\\' if bar_follows => field.extend(letters.next()),
            '|' => fields.push(String::new()),
            other => field.push(other),
        }
    }
    fields
}

fn time(text: &str) -> Result<MachineTime, Flaw> {
    let text = text.trim();
    let stamp = text
        .split_once('@')
        .map_or(text, |(stamp, _duration)| stamp);
    if stamp.is_empty() {
        return Ok(MachineTime::Absent);
    }
    if let Some(stamp) = read_stamp(stamp) {
        return Ok(MachineTime::Absolute(stamp));
    }
    // A century of milliseconds: beyond that it is a mistake, and no sum may overflow.
    let relative = stamp.parse::<f64>().ok();
    let relative = relative.filter(|at_ms| (0.0..3.2e12).contains(at_ms));
    relative
        .map(MachineTime::Relative)
        .ok_or_else(|| Flaw::Stamp {
            text: stamp.to_owned(),
        })
}

/// `None`: an asset, which is nothing for us.
fn observations(
    line: &str,
    shape: impl Fn(&str) -> Option<Shape>,
) -> Result<Option<Vec<Observation>>, Flaw> {
    let fields = fields(line);
    let [stamp, rest @ ..] = fields.as_slice() else {
        return Err(Flaw::NoFields);
    };
    if rest.is_empty() {
        return Err(Flaw::NoFields);
    }
    if rest.first().is_some_and(|key| key.starts_with('@')) {
        return Ok(None);
    }
    let time = time(stamp)?;
    let mut found = Vec::new();
    let mut left = rest;
    while let Some((key, behind)) = left.split_first() {
        // A line that ends in a bar has an empty field at its end.
        if key.is_empty() && behind.is_empty() && !found.is_empty() {
            break;
        }
        let shape = shape(key).unwrap_or_else(|| guess(behind, found.is_empty()));
        let (told, rest) = told(key, shape, behind)?;
        found.push(Observation {
            time,
            key: key.trim().to_owned(),
            name: None,
            told,
        });
        left = rest;
    }
    Ok(Some(found))
}

/// What the fields behind a key that nobody described look like.
fn guess(behind: &[String], is_first: bool) -> Shape {
    let has_level = behind.first().and_then(|word| AlarmLevel::read(word));
    if is_first && behind.len() == 5 && has_level.is_some() {
        Shape::Condition
    } else {
        Shape::Value
    }
}

fn told<'a>(key: &str, shape: Shape, behind: &'a [String]) -> Result<(Told, &'a [String]), Flaw> {
    let missing = |needed| Flaw::Fields {
        key: key.to_owned(),
        fields: behind.len(),
        needed,
    };
    let is_absent = |text: &str| text.trim().eq_ignore_ascii_case(UNAVAILABLE);
    match (shape, behind) {
        (Shape::Value, [value, rest @ ..]) => Ok((value_of(value), rest)),
        (Shape::Value, []) => Err(missing(1)),
        (Shape::Condition, [level, rest @ ..]) => {
            let report = AlarmReport {
                level: AlarmLevel::read(level.trim()).ok_or_else(|| Flaw::Level {
                    key: key.to_owned(),
                    level: level.clone(),
                })?,
                code: text_at(rest, 0),
                severity: text_at(rest, 1),
                qualifier: text_at(rest, 2),
                text: text_at(rest, 3),
            };
            Ok((Told::Alarm(report), rest.get(4..).unwrap_or_default()))
        }
        (Shape::Condition, []) => Err(missing(5)),
        (Shape::Message | Shape::Series, [only, ..]) if is_absent(only) => {
            Ok((Told::Unavailable, &[]))
        }
        (Shape::Message, [_code, text, rest @ ..]) => Ok((value_of(text), rest)),
        (Shape::Message, _) => Err(missing(2)),
        (Shape::Series, [count, rate, values, rest @ ..]) => {
            Ok((series(key, count, rate, values)?, rest))
        }
        (Shape::Series, _) => Err(missing(3)),
    }
}

fn text_at(fields: &[String], at: usize) -> String {
    fields
        .get(at)
        .map(|text| text.trim().to_owned())
        .unwrap_or_default()
}

fn value_of(text: &str) -> Told {
    let text = text.trim();
    if text.eq_ignore_ascii_case(UNAVAILABLE) {
        Told::Unavailable
    } else {
        Told::Value(text.to_owned())
    }
}

fn series(key: &str, count: &str, rate: &str, values: &str) -> Result<Told, Flaw> {
    read_series(count.trim().parse().ok(), rate, values).ok_or_else(|| Flaw::Series {
        key: key.to_owned(),
        count: count.to_owned(),
    })
}

/// A time series of `count` values (where it is told); `None`: a number is none, or their count differs.
#[must_use]
pub fn read_series(count: Option<usize>, rate: &str, values: &str) -> Option<Told> {
    let number = |text: &str| text.parse::<f64>().ok().filter(|value| value.is_finite());
    let values: Option<Vec<f64>> = values.split_whitespace().map(number).collect();
    let rate_hz = match rate.trim() {
        "" => None,
        rate => Some(number(rate)?).filter(|rate_hz| *rate_hz > 0.0),
    };
    let values = values.filter(|values| count.is_none_or(|count| count == values.len()))?;
    Some(Told::Series { rate_hz, values })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn none(_: &str) -> Option<Shape> {
        None
    }

    fn values(line: &str) -> Vec<(String, Told)> {
        match read(line, none) {
            Line::Observations(all) => all.into_iter().map(|o| (o.key, o.told)).collect(),
            other => panic!("{line}: {other:?}"),
        }
    }

    fn value(text: &str) -> Told {
        Told::Value(text.to_owned())
    }

    /// A line of the log of 2016-11-29, and one of the first of that day.
    #[test]
    fn val_nist_lines_are_read() {
        let line = "2016-11-29T09:29:02.072Z|Stemp|0";
        let Line::Observations(found) = read(line, none) else {
            panic!("{line}");
        };
        let stamp = MachineTime::Absolute(read_stamp("2016-11-29T09:29:02.072Z").unwrap());
        assert_eq!((found[0].time, &found[0].told), (stamp, &value("0")));
        let absent = values("2016-11-28T20:23:28.439772Z|coolant_temp|Unavailable");
        assert_eq!(absent, [("coolant_temp".to_owned(), Told::Unavailable)]);
    }

    #[test]
    fn one_line_tells_several_values_and_may_end_in_a_bar() {
        let pair = |key: &str, text| (key.to_owned(), value(text));
        let wanted = [pair("mill:Xabs", "1.5"), pair("Sload", "")];
        assert_eq!(values("|mill:Xabs|1.5|Sload|"), wanted);
        assert_eq!(values("|mill:Xabs|1.5|Sload||"), wanted);
        assert_eq!(values(r"|program|A\|B"), [pair("program", "A|B")]);
    }

    #[test]
    fn stamps_are_dates_milliseconds_or_nothing_and_may_have_a_duration() {
        let time = |line: &str| match read(line, none) {
            Line::Observations(found) => found[0].time,
            other => panic!("{other:?}"),
        };
        assert_eq!(time("1250.5|a|1"), MachineTime::Relative(1250.5));
        assert_eq!(time("|a|1"), MachineTime::Absent);
        let date = MachineTime::Absolute(read_stamp("2016-11-29T09:29:02Z").unwrap());
        assert_eq!(time("2016-11-29T09:29:02Z@10.5|a|1"), date);
        assert!(matches!(
            read("tomorrow|a|1", none),
            Line::Malformed(Flaw::Stamp { .. })
        ));
        assert!(matches!(read("-5|a|1", none), Line::Malformed(_)));
    }

    #[test]
    fn a_condition_has_five_fields_also_where_nobody_described_its_key() {
        let report = AlarmReport {
            level: AlarmLevel::Fault,
            code: "417".to_owned(),
            severity: "2".to_owned(),
            qualifier: "HIGH".to_owned(),
            text: "spindle too hot".to_owned(),
        };
        let line = "2016-11-29T09:29:02Z|stemp_c|FAULT|417|2|HIGH|spindle too hot";
        assert_eq!(values(line), [("stemp_c".to_owned(), Told::Alarm(report))]);
        let shape = |_: &str| Some(Shape::Condition);
        let short = read("|c|NORMAL", shape);
        assert!(matches!(short, Line::Observations(found)
            if matches!(&found[0].told, Told::Alarm(report) if report.level == AlarmLevel::Normal)));
        let wrong = read("|c|BROKEN||||", shape);
        assert!(matches!(wrong, Line::Malformed(Flaw::Level { .. })));
    }

    #[test]
    fn messages_and_time_series_are_read_by_their_shape() {
        let message = read("|m|17|refill oil", |_| Some(Shape::Message));
        assert!(
            matches!(message, Line::Observations(found) if found[0].told == value("refill oil"))
        );
        let told = Told::Series {
            rate_hz: Some(100.0),
            values: vec![1.0, -2.5, 3.0],
        };
        let series = read("|v|3|100|1 -2.5 3", |_| Some(Shape::Series));
        assert!(matches!(series, Line::Observations(found) if found[0].told == told));
        let wrong = read("|v|4|100|1 -2.5 3", |_| Some(Shape::Series));
        assert!(matches!(wrong, Line::Malformed(Flaw::Series { .. })));
        let absent = read("|v|UNAVAILABLE||", |_| Some(Shape::Series));
        assert!(matches!(absent, Line::Observations(found) if found[0].told == Told::Unavailable));
    }

    #[test]
    fn commands_are_no_values() {
        assert_eq!(
            read("* PONG 10000", none),
            Line::Pong {
                period_ms: 10_000.0
            }
        );
        for line in [
            "* device: mill",
            "* PONG",
            "* PONG nan",
            "|@ASSET@|7|CuttingTool|x",
        ] {
            assert_eq!(read(line, none), Line::Command, "{line}");
        }
        assert_eq!(read("garbage", none), Line::Malformed(Flaw::NoFields));
    }

    proptest! {
        #[test]
        fn prop_no_line_panics(line in "[\\|\\*\\\\@a-zA-Z0-9 .:\\-é]{0,60}", kind in 0_usize..5) {
            let shapes = [Shape::Value, Shape::Condition, Shape::Message, Shape::Series];
            let _ = read(&line, |_| shapes.get(kind).copied());
        }
    }
}
