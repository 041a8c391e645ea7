//! Lines as an adapter sends them (SHDR), read as the reference agent reads them.
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
//! duration may follow after `@`. A key may have a device before it (`device:key`). [`fields`] says how a line is cut
//! and [`block`] what a block of several lines is. The line does not say what it is: that is known of the key.
//!
//! | what | reading |
//! |---|---|
//! | a key that nobody described | it and one field behind it are passed over; after `* shdrVersion: 2`, it alone |
//! | a condition, message or series | takes its fields, as many as there are; what follows on the line is let go, after `* shdrVersion: 2` read |
//! | a key whose fields are missing | its value is not known |
//! | a value whose key is empty | left out and reported |
//! | a quote or a block that does not end | reported; the block's field is left out |
//! | an invalid time | the line is published with the time of its receipt, in a log with the stamp of the line beside it |
//! | an asset (`@…@`) | ends the line |
//!
//! What was read before a flaw stays. On purpose it differs from the reference in this: a condition that nobody
//! described is reported when its line has the form of one (level WARNING or FAULT, seven fields, a qualifier HIGH, LOW or
//! empty), so that an alarm is not lost for a mapping that is not whole. A stamp's offset is heeded (the reference
//! passes over it), and so is a leap second. `relativeTime` and `device` are for an agent and change nothing here.
//!
//! # Agreement
//! `val_cppagent_a_table_of_lines_is_read_as_the_reference_agent_reads_it` (tests), its sources and tests read, not run.
//!
//! # References
//! \[1\] MTConnect C++ agent (`mtconnect/cppagent` 2.5), `src/mtconnect/pipeline/shdr_token_mapper.cpp`,
//! `timestamp_extractor.hpp`, `source/adapter/shdr/`. \[2\] See [`crate::observation`].

use crate::observation::{
    AlarmLevel, AlarmReport, MachineTime, Observation, Told, UNAVAILABLE, read_stamp,
};

pub mod block;
mod fields;
mod flaw;

pub use crate::observation::Shape;
pub use block::Record;
pub use fields::{cut, fields};
pub use flaw::Flaw;

/// What a line was.
#[derive(Clone, Debug, PartialEq)]
pub enum Line {
    /// Nothing stands in it.
    Empty,
    /// Observations with one stamp.
    Observations(Vec<Observation>),
    /// An answer to our `PING`: the adapter wants to be asked this often.
    Pong {
        /// Period, ms.
        period_ms: f64,
    },
    /// From here on lines are of this version of SHDR.
    Version(u32),
    /// Another command for an agent; nothing for us.
    Command,
}

/// What a line was, and what was wrong with it.
#[derive(Clone, Debug, PartialEq)]
pub struct Reading {
    /// What could be read.
    pub line: Line,
    /// Whether it had an asset, which is nothing for us.
    pub has_asset: bool,
    /// What could not be read.
    pub flaws: Vec<Flaw>,
}

impl Reading {
    const fn of(line: Line) -> Self {
        Self {
            line,
            has_asset: false,
            flaws: Vec::new(),
        }
    }
}

/// Reads a record of an adapter that speaks `version`; `shape` says what is known of a key (`None`: nothing).
#[must_use]
pub fn read(record: &Record, version: u32, shape: impl Fn(&str) -> Option<Shape>) -> Reading {
    if record.head.trim().is_empty() && record.body.is_none() {
        return record.flaw.clone().map_or_else(
            || Reading::of(Line::Empty),
            |flaw| Reading {
                flaws: vec![flaw],
                ..Reading::of(Line::Observations(Vec::new()))
            },
        );
    }
    if let Some(command) = record.head.strip_prefix('*') {
        return Reading {
            flaws: record.flaw.iter().cloned().collect(),
            ..Reading::of(self::command(command.trim()))
        };
    }
    let (mut fields, open_quote) = cut(&record.head);
    if let (Some(body), Some(last)) = (&record.body, fields.last_mut()) {
        *last = format!("{last}\n{body}").trim().to_owned();
    }
    if record.flaw.is_some() {
        // The field in which the block began has no contents, or not all.
        fields.pop();
    }
    let mut observing = Observing::new(version, shape);
    observing.flaws.extend(record.flaw.clone());
    let open_quote = open_quote.map(|field| Flaw::Quote { field });
    observing.flaws.extend(open_quote);
    observing.read(&fields)
}

fn command(command: &str) -> Line {
    if let Some(period) = command.strip_prefix("PONG") {
        let digits = period.trim_start();
        let end = digits.find(|c: char| !c.is_ascii_digit() && c != '.');
        let period_ms = digits[..end.unwrap_or(digits.len())].parse::<f64>().ok();
        let is_positive = |period_ms: &f64| period_ms.is_finite() && *period_ms > 0.0;
        return match period_ms.filter(is_positive) {
            Some(period_ms) => Line::Pong { period_ms },
            None => Line::Command,
        };
    }
    match command.split_once(':') {
        Some((name, value)) if name.trim().eq_ignore_ascii_case("shdrversion") => {
            let whole = value.trim().split('.').next().unwrap_or_default();
            Line::Version(whole.parse().unwrap_or(1))
        }
        _ => Line::Command,
    }
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
    // Longer than a century of milliseconds it is a mistake, and no sum may overflow.
    let relative = stamp.parse::<f64>().ok();
    let relative = relative.filter(|at_ms| (0.0..3.2e12).contains(at_ms));
    relative
        .map(MachineTime::Relative)
        .ok_or_else(|| Flaw::Stamp {
            text: stamp.to_owned(),
        })
}

/// The time of a record, where it has one; a log is replayed by it.
#[must_use]
pub fn time_of(record: &Record) -> MachineTime {
    let is_command = record.head.starts_with('*') || record.head.trim().is_empty();
    let stamp = record.head.split('|').next().filter(|_| !is_command);
    stamp.map_or(MachineTime::Absent, |stamp| {
        time(stamp).unwrap_or(MachineTime::Absent)
    })
}

/// A line of observations that is read.
struct Observing<F> {
    version: u32,
    shape: F,
    time: MachineTime,
    found: Vec<Observation>,
    flaws: Vec<Flaw>,
}

/// What the fields behind a key became, and how many of them.
type Taken = (Option<Told>, usize);

impl<F: Fn(&str) -> Option<Shape>> Observing<F> {
    const fn new(version: u32, shape: F) -> Self {
        Self {
            version,
            shape,
            time: MachineTime::Absent,
            found: Vec::new(),
            flaws: Vec::new(),
        }
    }

    fn read(mut self, fields: &[String]) -> Reading {
        let [stamp, rest @ ..] = fields else {
            return self.done(false);
        };
        if rest.is_empty() {
            self.flaws.push(Flaw::NoFields);
            return self.done(false);
        }
        let is_asset = |key: &String| key.starts_with('@');
        match time(stamp) {
            Ok(time) => self.time = time,
            Err(flaw) if !rest.first().is_some_and(is_asset) => self.flaws.push(flaw),
            Err(_) => {}
        }
        let (mut left, mut follows_unknown) = (rest, false);
        while let Some((key, behind)) = left.split_first() {
            if is_asset(key) {
                return self.done(true);
            }
            // A line that ends in a bar has an empty field at its end.
            if key.is_empty() && behind.is_empty() {
                break;
            }
            let known = (self.shape)(key).or_else(|| self.guess(behind));
            let used = match known {
                Some(shape) => self.known(key, shape, behind),
                None => self.unknown(key, behind, follows_unknown),
            };
            follows_unknown = known.is_none();
            left = behind.get(used..).unwrap_or_default();
            if self.version < 2 && used > 1 {
                self.let_go(key, left);
                break;
            }
        }
        self.done(false)
    }

    fn done(self, has_asset: bool) -> Reading {
        Reading {
            line: Line::Observations(self.found),
            has_asset,
            flaws: self.flaws,
        }
    }

    fn tell(&mut self, key: &str, told: Told) {
        self.found.push(Observation {
            time: self.time,
            key: key.to_owned(),
            name: None,
            told,
        });
    }

    fn known(&mut self, key: &str, shape: Shape, behind: &[String]) -> usize {
        let (told, used) = self.told(key, shape, behind);
        if let Some(told) = told {
            self.tell(key, told);
        }
        used
    }

    /// Passes over a key that nobody described; of several in a row the first is handed on, to be named.
    fn unknown(&mut self, key: &str, behind: &[String], follows_unknown: bool) -> usize {
        let is_pair = self.version < 2;
        match behind.first().filter(|value| is_pair && !value.is_empty()) {
            Some(value) if key.is_empty() => self.flaws.push(Flaw::Key {
                value: value.clone(),
            }),
            None if is_pair && behind.is_empty() => self.missing(key, 0, 1),
            _ => {}
        }
        if !key.is_empty() && (is_pair || !follows_unknown) {
            let value = behind.first().filter(|_| is_pair);
            self.tell(key, Told::Value(value.cloned().unwrap_or_default()));
        }
        usize::from(is_pair).min(behind.len())
    }

    /// Whether the fields behind a key that nobody described are those of an active condition.
    fn guess(&self, behind: &[String]) -> Option<Shape> {
        let [level, code, _severity, qualifier, _text] = behind else {
            return None;
        };
        let is_active = matches!(
            AlarmLevel::read(level),
            Some(AlarmLevel::Warning | AlarmLevel::Fault)
        );
        let is_qualifier = ["", "HIGH", "LOW"]
            .iter()
            .any(|word| qualifier.eq_ignore_ascii_case(word));
        let is_code = (self.shape)(code).is_none();
        (self.found.is_empty() && is_active && is_qualifier && is_code).then_some(Shape::Condition)
    }

    fn let_go(&mut self, key: &str, left: &[String]) {
        if left.iter().any(|field| !field.is_empty()) {
            self.flaws.push(Flaw::Behind {
                key: key.to_owned(),
                fields: left.len(),
            });
        }
    }

    fn missing(&mut self, key: &str, fields: usize, needed: usize) {
        self.flaws.push(Flaw::Fields {
            key: key.to_owned(),
            fields,
            needed,
        });
    }

    fn told(&mut self, key: &str, shape: Shape, behind: &[String]) -> Taken {
        match (shape, behind) {
            (Shape::Value, [value, ..]) => (Some(value_of(value)), 1),
            (Shape::Value | Shape::Message, []) => {
                self.missing(key, 0, if shape == Shape::Value { 1 } else { 2 });
                (Some(Told::Unavailable), 0)
            }
            (Shape::Condition, behind) => self.condition(key, behind),
            (Shape::Message, [only]) => {
                if !is_absent(only) {
                    self.missing(key, 1, 2);
                }
                (Some(Told::Unavailable), 1)
            }
            (Shape::Message, [code, text, ..]) => {
                let is_unknown = is_absent(code) && text.is_empty();
                let told = if is_unknown {
                    Told::Unavailable
                } else {
                    value_of(text)
                };
                (Some(told), 2)
            }
            (Shape::Series, behind) => self.series(key, behind),
        }
    }

    fn condition(&mut self, key: &str, behind: &[String]) -> Taken {
        let text_at = |at: usize| behind.get(at).cloned().unwrap_or_default();
        let Some(word) = behind.first() else {
            self.missing(key, 0, 1);
            return (Some(Told::Unavailable), 0);
        };
        let used = behind.len().min(5);
        let Some(level) = AlarmLevel::read(word) else {
            self.flaws.push(Flaw::Level {
                key: key.to_owned(),
                level: word.clone(),
            });
            return (None, used);
        };
        let report = AlarmReport {
            level,
            code: text_at(1),
            severity: text_at(2),
            qualifier: text_at(3),
            text: text_at(4),
        };
        (Some(Told::Alarm(report)), used)
    }

    fn series(&mut self, key: &str, behind: &[String]) -> Taken {
        let used = behind.len().min(3);
        if behind[..used].iter().any(|field| is_absent(field)) {
            return (Some(Told::Unavailable), used);
        }
        let [count, rate, values, ..] = behind else {
            self.missing(key, behind.len(), 3);
            return (None, used);
        };
        let series = read_series(count.parse().ok(), rate, values);
        if series.is_none() {
            self.flaws.push(Flaw::Series {
                key: key.to_owned(),
                count: count.clone(),
            });
        }
        (series, used)
    }
}

fn is_absent(text: &str) -> bool {
    text.eq_ignore_ascii_case(UNAVAILABLE)
}

fn value_of(text: &str) -> Told {
    if is_absent(text) {
        Told::Unavailable
    } else {
        Told::Value(text.to_owned())
    }
}

/// Slowest and fastest rate of a time series, 1/s; its first value must not lie years back.
const RATES_HZ: std::ops::RangeInclusive<f64> = 1e-4..=1e9;

/// A time series of `count` values (where it is told); `None`: a number is none, or their count differs.
#[must_use]
pub fn read_series(count: Option<usize>, rate: &str, values: &str) -> Option<Told> {
    let number = |text: &str| text.parse::<f64>().ok().filter(|value| value.is_finite());
    let values: Option<Vec<f64>> = values.split_whitespace().map(number).collect();
    let rate_hz = match rate.trim() {
        "" => None,
        rate => match number(rate)? {
            rate_hz if RATES_HZ.contains(&rate_hz) => Some(rate_hz),
            // That of the data item, which is not told here.
            rate_hz if rate_hz <= 0.0 => None,
            _ => return None,
        },
    };
    let values = values.filter(|values| count.is_none_or(|count| count == values.len()))?;
    Some(Told::Series { rate_hz, values })
}
