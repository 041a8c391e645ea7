//! A bag of another program with thermometers and displacements alone, as the table of a log.
//!
//! Such a bag says neither axis nor test. Each displacement is a row; a temperature stands in the rows that follow it for at most
//! a minute. Lengths are in metres, as REP 103 has them, or in what a topic's name ends with (`_mm`, `_um`).

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Result, bail};
use recorder::{Bag, Event, Order, TopicInfo};

/// Package of our own messages: a bag that has one of them is no foreign log.
const OWN_PACKAGE: &str = "abbe_msgs/";
const TEMPERATURE: &str = "sensor_msgs/msg/Temperature";
/// How long a temperature holds, ns.
const HOLDS_NS: u64 = 60_000_000_000;
/// Most rows of a log.
const MOST_DISPLACEMENTS: usize = 2_000_000;

/// How a displacement is held by a type: whether behind a header, and its numbers.
const DISPLACEMENTS: [(&str, bool, Numbers); 5] = [
    ("geometry_msgs/msg/PointStamped", true, Numbers::Xyz),
    ("geometry_msgs/msg/Vector3Stamped", true, Numbers::Xyz),
    ("sensor_msgs/msg/Range", true, Numbers::RangeOfFour),
    ("std_msgs/msg/Float64", false, Numbers::Double),
    ("std_msgs/msg/Float32", false, Numbers::Single),
];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Numbers {
    Xyz,
    /// A byte, field of view, least and greatest, and the range.
    RangeOfFour,
    Double,
    Single,
}

/// A log as a table, and what its columns are made of.
#[derive(Clone, Debug, PartialEq)]
pub struct Log {
    /// CSV with a line of names.
    pub table: String,
    /// For people: topics, types, units, and what was not used.
    pub lines: Vec<String>,
    /// Messages and parts of the bag that could not be used.
    pub n_lost: usize,
}

/// The log that a bag holds; none where it has messages of ours, or no displacement that is known.
///
/// # Errors
/// When two topics have a displacement, or it has more rows than a log may.
pub fn of(path: &Path) -> Result<Option<Log>> {
    // Who opens it as a bag says why it is none.
    let Ok(bag) = Bag::open(path) else {
        return Ok(None);
    };
    let topics = bag.topics();
    let is_own = |info: &TopicInfo| info.type_name.starts_with(OWN_PACKAGE);
    let moved: Vec<&TopicInfo> = topics.iter().filter(|own| held(own).is_some()).collect();
    let [moved] = moved[..] else {
        if moved.len() > 1 && !topics.iter().any(is_own) {
            let names: Vec<&str> = moved.iter().map(|own| own.topic.as_str()).collect();
            bail!(
                "{}: displacements on {}: must be one topic of a log: record or convert one of them alone",
                path.display(),
                names.join(", ")
            );
        }
        return Ok(None);
    };
    if topics.iter().any(is_own) {
        return Ok(None);
    }
    Reading::new(moved).log(&bag).map(Some)
}

/// How a topic holds a displacement.
fn held(info: &TopicInfo) -> Option<(bool, Numbers)> {
    let known = DISPLACEMENTS.iter().find(|known| known.0 == info.type_name);
    known.map(|(_, has_header, numbers)| (*has_header, *numbers))
}

/// One row of the log.
struct Row {
    at_ns: u64,
    moved_um: Vec<f64>,
    degc: Vec<Option<f64>>,
}

struct Reading<'b> {
    moved: &'b TopicInfo,
    has_header: bool,
    numbers: Numbers,
    um_per_unit: f64,
    unit: &'static str,
    rows: Vec<Row>,
    /// Topics of thermometers, each with the time and value of its last reading.
    last: BTreeMap<String, (u64, f64)>,
    n_unread: usize,
}

impl<'b> Reading<'b> {
    fn new(moved: &'b TopicInfo) -> Self {
        let (has_header, numbers) = held(moved).unwrap_or((false, Numbers::Double));
        let (um_per_unit, unit) = match () {
            () if moved.topic.ends_with("_um") => (1.0, "um, by its name"),
            () if moved.topic.ends_with("_mm") => (1e3, "mm, by its name"),
            () => (1e6, "m, as REP 103 has it"),
        };
        Self {
            moved,
            has_header,
            numbers,
            um_per_unit,
            unit,
            rows: vec![],
            last: BTreeMap::new(),
            n_unread: 0,
        }
    }

    fn log(mut self, bag: &Bag) -> Result<Log> {
        let warm: Vec<String> = { bag.topics().iter() }
            .filter(|info| info.type_name == TEMPERATURE)
            .map(|info| info.topic.clone())
            .collect();
        let mut messages = bag.messages(Order::LogTime);
        let mut losses = vec![];
        while let Some(event) = messages.next_event() {
            let message = match event {
                Event::Loss(loss) => {
                    losses.push(format!("warning, {loss}"));
                    continue;
                }
                Event::Message(message) => message,
            };
            let info = bag.topic(message.topic);
            if info.topic == self.moved.topic {
                self.take(message.data, message.log_time_nanos, &warm);
            } else if info.type_name == TEMPERATURE {
                self.warm(&info.topic, message.data, message.log_time_nanos);
            }
            if self.rows.len() > MOST_DISPLACEMENTS {
                bail!(
                    "{} has more than {MOST_DISPLACEMENTS} displacements: record at a lower rate",
                    self.moved.topic
                );
            }
        }
        Ok(self.into_log(bag, &warm, losses))
    }

    fn take(&mut self, data: &[u8], logged_ns: u64, warm: &[String]) {
        let Some((stamped_ns, moved)) = displacement(data, self.has_header, self.numbers) else {
            self.n_unread += 1;
            return;
        };
        let at_ns = stamped_ns.unwrap_or(logged_ns);
        let degc = warm.iter().map(|topic| {
            let (since_ns, degc) = self.last.get(topic)?;
            (logged_ns.saturating_sub(*since_ns) <= HOLDS_NS).then_some(*degc)
        });
        let degc = degc.collect();
        let moved_um = moved.iter().map(|value| value * self.um_per_unit).collect();
        self.rows.push(Row {
            at_ns,
            moved_um,
            degc,
        });
    }

    fn warm(&mut self, topic: &str, data: &[u8], logged_ns: u64) {
        match displacement(data, true, Numbers::Double) {
            Some((_, values)) if values.iter().all(|value| value.is_finite()) => {
                let degc = values.first().copied().unwrap_or(f64::NAN);
                self.last.insert(topic.to_owned(), (logged_ns, degc));
            }
            _ => self.n_unread += 1,
        }
    }

    fn into_log(self, bag: &Bag, warm: &[String], losses: Vec<String>) -> Log {
        let columns: Vec<(usize, String)> = self.columns();
        let mut table = String::from("time_s");
        for (_, name) in &columns {
            // Writing to a text has no errors.
            let _ = write!(table, ",{name}");
        }
        for topic in warm {
            let _ = write!(table, ",{} [degC]", thermometer(topic));
        }
        table.push('\n');
        for row in &self.rows {
            let (s, ns) = (row.at_ns / 1_000_000_000, row.at_ns % 1_000_000_000);
            let _ = write!(table, "{s}.{ns:09}");
            for (place, _) in &columns {
                let um = row.moved_um.get(*place).copied().unwrap_or(f64::NAN);
                let _ = write!(table, ",{um:.4}");
            }
            for degc in &row.degc {
                table.push(',');
                if let Some(degc) = degc {
                    let _ = write!(table, "{degc:.4}");
                }
            }
            table.push('\n');
        }
        let n_lost = self.n_unread + losses.len();
        let lines = self.lines(bag, &columns, losses);
        Log {
            table,
            lines,
            n_lost,
        }
    }

    /// Coordinates that changed, each with its column.
    fn columns(&self) -> Vec<(usize, String)> {
        let last_word = self.moved.topic.rsplit('/').next().unwrap_or_default();
        let axis = axis_of(last_word);
        let all: Vec<(usize, String)> = match self.numbers {
            Numbers::Xyz => ["x_um", "y_um", "z_um"]
                .map(str::to_owned)
                .into_iter()
                .enumerate()
                .collect(),
            _ => vec![(0, format!("{axis}_um"))],
        };
        let first = self
            .rows
            .first()
            .map(|row| row.moved_um.clone())
            .unwrap_or_default();
        let changes = |place: usize| {
            let mut values = self.rows.iter().filter_map(|row| row.moved_um.get(place));
            values.any(|value| Some(value) != first.get(place))
        };
        let changed: Vec<(usize, String)> = all
            .iter()
            .filter(|(place, _)| changes(*place))
            .cloned()
            .collect();
        if changed.is_empty() { all } else { changed }
    }

    fn lines(&self, bag: &Bag, columns: &[(usize, String)], losses: Vec<String>) -> Vec<String> {
        let names: Vec<&str> = columns.iter().map(|(_, name)| name.as_str()).collect();
        let mut lines = losses;
        lines.push(format!(
            "warning, no topic of Abbe in the bag: read as a log, {} of {} ({}, in {})",
            names.join(", "),
            self.moved.topic,
            self.moved.type_name,
            self.unit
        ));
        if self.n_unread > 0 {
            lines.push(format!(
                "warning, {} messages left out: no plain CDR of their type",
                self.n_unread
            ));
        }
        let unused = bag
            .topics()
            .iter()
            .filter(|info| info.topic != self.moved.topic && info.type_name != TEMPERATURE);
        lines.extend(unused.map(|info| format!("{} ({}): not used", info.topic, info.type_name)));
        lines
    }
}

/// The axis that a topic's name says with a letter of its own; Z is that of a spindle's growth.
fn axis_of(word: &str) -> char {
    let mut parts = word.split('_').filter(|part| part.len() == 1);
    let letter = parts.next().and_then(|part| part.chars().next());
    let known = letter.map(|letter| letter.to_ascii_lowercase());
    known
        .filter(|letter| "xyz".contains(*letter))
        .unwrap_or('z')
}

/// The name of a thermometer by its topic, without what says that it is one.
fn thermometer(topic: &str) -> String {
    let words = topic.split('/').filter(|word| !word.is_empty());
    let own = words.filter(|word| !word.starts_with("temp"));
    let own: Vec<&str> = own.collect();
    if own.is_empty() {
        "temperature".to_owned()
    } else {
        own.join("_")
    }
}

/// Stamp of a header, ns, and the numbers behind it.
fn displacement(
    data: &[u8],
    has_header: bool,
    numbers: Numbers,
) -> Option<(Option<u64>, Vec<f64>)> {
    let mut cdr = Cdr::of(data)?;
    let stamp = if has_header {
        Some(cdr.header()?)
    } else {
        None
    };
    let values = match numbers {
        Numbers::Xyz => (0..3).map(|_| cdr.double()).collect::<Option<Vec<f64>>>()?,
        Numbers::Double => vec![cdr.double()?],
        Numbers::Single => vec![cdr.single()?],
        Numbers::RangeOfFour => {
            cdr.take(1, 1)?;
            let four: Option<Vec<f64>> = (0..4).map(|_| cdr.single()).collect();
            vec![*four?.last()?]
        }
    };
    // A stamp of zero is that of a program that sets none.
    Some((stamp.filter(|stamp| *stamp > 0), values))
}

/// Little-endian plain CDR.
struct Cdr<'d> {
    payload: &'d [u8],
    at: usize,
}

impl<'d> Cdr<'d> {
    fn of(data: &'d [u8]) -> Option<Self> {
        let (head, payload) = data.split_first_chunk::<4>()?;
        (head[..2] == [0, 1]).then_some(Self { payload, at: 0 })
    }

    fn take(&mut self, len: usize, aligned: usize) -> Option<&'d [u8]> {
        let begin = self.at.next_multiple_of(aligned);
        let end = begin.checked_add(len)?;
        let bytes = self.payload.get(begin..end)?;
        self.at = end;
        Some(bytes)
    }

    fn whole(&mut self) -> Option<u32> {
        Some(u32::from_le_bytes(self.take(4, 4)?.try_into().ok()?))
    }

    fn double(&mut self) -> Option<f64> {
        Some(f64::from_le_bytes(self.take(8, 8)?.try_into().ok()?))
    }

    fn single(&mut self) -> Option<f64> {
        let bytes = self.take(4, 4)?.try_into().ok()?;
        Some(f64::from(f32::from_le_bytes(bytes)))
    }

    /// The stamp of a header, ns; its frame is passed over.
    fn header(&mut self) -> Option<u64> {
        let (s, ns) = (self.whole()?, self.whole()?);
        let len = usize::try_from(self.whole()?).ok()?;
        self.take(len, 1)?;
        Some(u64::from(s) * 1_000_000_000 + u64::from(ns))
    }
}

#[cfg(test)]
mod tests {
    use recorder::{
        Channel, Directory, Durability, MessageStamp, QosProfile, RecorderConfig, Recording,
        Reliability, qos_to_yaml,
    };

    use super::*;
    use crate::report_bag::from_table;

    const BEGIN_S: i64 = 1_767_600_000;

    fn header(at_s: f64, frame: &str) -> Vec<u8> {
        let mut data = vec![0, 1, 0, 0];
        let at_ns = (at_s * 1e9).round() as i64;
        let s = u32::try_from(BEGIN_S + at_ns / 1_000_000_000).unwrap();
        let ns = u32::try_from(at_ns % 1_000_000_000).unwrap();
        let len = u32::try_from(frame.len() + 1).unwrap();
        for word in [s, ns, len] {
            data.extend(word.to_le_bytes());
        }
        data.extend(frame.as_bytes());
        data.push(0);
        data
    }

    fn with_doubles(mut data: Vec<u8>, values: &[f64]) -> Vec<u8> {
        while !(data.len() - 4).is_multiple_of(8) {
            data.push(0);
        }
        data.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        data
    }

    /// A displacement's content, by the time in s and its size in m.
    type Of = fn(f64, f64) -> Vec<u8>;

    /// Topic, type and content of a message after so many seconds.
    type Said = (&'static str, &'static str, f64, Vec<u8>);

    fn bag(folder: &Path, messages: &[Said]) -> std::path::PathBuf {
        let path = folder.join("bag");
        let directory = Directory::create(&path).unwrap();
        let mut recording = Recording::begin(directory, "bag", RecorderConfig::default()).unwrap();
        let mut known = BTreeMap::new();
        for (topic, type_name, at_s, data) in messages {
            let qos = QosProfile::keep_last(10, Reliability::Reliable, Durability::Volatile);
            let id = *known.entry(*topic).or_insert_with(|| {
                let channel = Channel {
                    topic: (*topic).to_owned(),
                    type_name: (*type_name).to_owned(),
                    type_hash: String::new(),
                    definition: String::new(),
                    qos_yaml: qos_to_yaml(&[qos]).unwrap(),
                };
                recording.add_channel(&channel).unwrap()
            });
            let nanos = BEGIN_S * 1_000_000_000 + (at_s * 1e9).round() as i64;
            let stamp = MessageStamp {
                log_time_nanos: nanos,
                publish_time_nanos: nanos,
                sequence: 0,
            };
            recording.write(id, stamp, data).unwrap();
        }
        recording.finish().unwrap();
        path
    }

    /// An hour and a half of a nose that grows by 20 um with 18 min, its bearing by 8 K with 15 min.
    fn grown(topic: &'static str, type_name: &'static str, of: Of) -> Vec<Said> {
        let mut all = vec![];
        for k in 0..540_u32 {
            let at_s = 10.0 * f64::from(k);
            let warm = 20.0 + 8.0 * (1.0 - (-at_s / 900.0).exp());
            let grown_m = 20e-6 * (1.0 - (-at_s / 1080.0).exp());
            let read = with_doubles(header(at_s, "spindle"), &[warm, 0.0]);
            all.push(("/temperature/spindle_front", TEMPERATURE, at_s, read));
            all.push((topic, type_name, at_s + 1.0, of(at_s + 1.0, grown_m)));
        }
        all
    }

    #[test]
    fn a_bag_with_a_temperature_and_a_displacement_alone_is_a_log() {
        let point = |at_s: f64, z_m: f64| with_doubles(header(at_s, "gauge"), &[0.0, 0.0, z_m]);
        let plain = |_: f64, z_m: f64| with_doubles(vec![0, 1, 0, 0], &[z_m]);
        let in_um = |_: f64, z_m: f64| with_doubles(vec![0, 1, 0, 0], &[1e6 * z_m]);
        let range = |at_s: f64, z_m: f64| {
            let mut data = header(at_s, "g");
            data.push(0);
            while !(data.len() - 4).is_multiple_of(4) {
                data.push(0);
            }
            data.extend(
                [0.1_f32, 0.0, 1.0, z_m as f32]
                    .iter()
                    .flat_map(|v| v.to_le_bytes()),
            );
            data
        };
        let kinds: [(&str, &str, Of); 4] = [
            ("/displacement", "geometry_msgs/msg/PointStamped", point),
            ("/gauge/z", "std_msgs/msg/Float64", plain),
            ("/gauge/z_um", "std_msgs/msg/Float64", in_um),
            ("/nose", "sensor_msgs/msg/Range", range),
        ];
        // By hand: after an hour 20 (1 - exp(-3600/1080)) um.
        let after_an_hour_um = 20.0 * (1.0 - (-3600.0_f64 / 1080.0).exp());
        for (topic, type_name, of) in kinds {
            let home = tempfile::tempdir().unwrap();
            let path = bag(home.path(), &grown(topic, type_name, of));
            let taken = from_table::of(&path, None).unwrap().unwrap();
            assert!(
                taken.lines.iter().any(|line| line.contains("axis Z")),
                "{:?}",
                taken.lines
            );
            let named = format!("z_um of {topic} ({type_name}");
            assert!(taken.lines[0].contains(&named), "{:?}", taken.lines);
            let log = super::of(&path).unwrap().unwrap();
            let second = |row: &str| row.split(',').nth(1).unwrap().parse().unwrap();
            let rows: Vec<f64> = log.table.lines().skip(1).map(second).collect();
            assert_eq!(rows.len(), 540);
            assert!(
                (rows[360] - after_an_hour_um).abs() < 0.05,
                "{topic}: {}",
                rows[360]
            );
        }
    }

    #[test]
    fn a_bag_of_two_displacements_is_refused_and_one_of_other_topics_is_no_log() {
        let plain = |value: f64| with_doubles(vec![0, 1, 0, 0], &[value]);
        let home = tempfile::tempdir().unwrap();
        let two = bag(
            home.path(),
            &[
                ("/x", "std_msgs/msg/Float64", 0.0, plain(0.0)),
                ("/y", "std_msgs/msg/Float64", 1.0, plain(0.0)),
            ],
        );
        let refused = format!("{:#}", of(&two).unwrap_err());
        assert!(refused.contains("displacements on /x, /y"), "{refused}");
        let home = tempfile::tempdir().unwrap();
        let other = bag(
            home.path(),
            &[("/s", "std_msgs/msg/String", 0.0, plain(0.0))],
        );
        assert_eq!(of(&other).unwrap(), None);
        assert_eq!(of(Path::new("no/bag")).unwrap(), None);
    }
}
