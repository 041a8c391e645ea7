//! Writes samples of a made-up motion into a bag.

use std::collections::BTreeSet;
use std::hash::{DefaultHasher, Hasher};
use std::path::Path;

use abbe_msgs::msg::AxisState as AxisStateMessage;
use abbe_msgs::topics::{self, Topic};
use abbe_msgs::{Message, Qos, Wire, to_cdr};
use anyhow::{Context, Result, anyhow, bail};
use machine::MachineFile;
use metrology::sample::{
    AngleSample, AxisState, LengthSample, ProbedFeature, ProbedPoint, TemperatureSample,
    TestSegment,
};
use metrology::stamp::Span;
use metrology::{Axis, AxisSet, PerAxis, Stamp, epoch};
use recorder::{
    Channel, ChannelId, Directory, MessageStamp, RecorderConfig, Recording, RunContext,
};

/// A bag that is written.
pub struct Writer {
    recording: Recording<Directory>,
    channels: Vec<(String, ChannelId)>,
    axes: AxisSet,
    at: Stamp<metrology::Host>,
    start: Stamp<metrology::Host>,
    messages: u64,
    /// Of the instant at hand: channel, length and hash of each message.
    written: BTreeSet<(usize, usize, u64)>,
    repeated: u64,
    /// The instant of the row at hand, and how many rows before it have the same.
    row: Option<(Stamp<metrology::Host>, i64)>,
    crowded: u64,
}

/// Counts of a finished bag.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BagCount {
    /// Messages of the bag.
    pub messages: u64,
    /// Readings that were not written, since the bag has an equal one of the same time.
    pub repeated: u64,
    /// Rows of the time of the row before them.
    pub crowded: u64,
}

impl BagCount {
    /// Lines about readings that were not written, and rows that were written apart.
    pub fn in_words(self) -> Vec<String> {
        let (n, n_crowded) = (self.repeated, self.crowded);
        let repeated = (n > 0).then(|| {
            format!(
                "{n} readings have time and value of one before them in their column: written once"
            )
        });
        let crowded = (n_crowded > 0).then(|| {
            format!("{n_crowded} rows have the time of the row before them: written 1 ns apart, in their order")
        });
        repeated.into_iter().chain(crowded).collect()
    }
}

impl Writer {
    /// Begins a bag with its machine file, and with what the map states beside the readings, as YAML.
    ///
    /// # Errors
    /// When the folder exists or cannot be written.
    pub fn begin(
        path: &Path,
        (machine, text): (&MachineFile, String),
        start_s: i64,
        stated: Option<String>,
    ) -> Result<Self> {
        let name = path.file_name().context("-o: no folder name")?;
        let mut recording = Recording::begin(
            Directory::create(path)?,
            &name.to_string_lossy(),
            RecorderConfig::read_when_finished(),
        )?;
        let at = epoch::whole_seconds(start_s, 0).map_err(|error| anyhow!("start_s = {error}"))?;
        recording.add_context(&RunContext {
            start_time_nanos: at.nanos().cast_unsigned(),
            commit: env!("ABBE_COMMIT").to_owned(),
            machine_file: Some(text),
            parameters: stated
                .map(|text| ("import".to_owned(), text))
                .into_iter()
                .collect(),
            ..RunContext::default()
        })?;
        Ok(Self {
            recording,
            channels: vec![],
            axes: machine.axis_set(),
            at,
            start: at,
            messages: 0,
            written: BTreeSet::new(),
            repeated: 0,
            row: None,
            crowded: 0,
        })
    }

    /// Lets time pass.
    pub fn wait(&mut self, time_s: f64) {
        self.go_to(self.at + Span::from_secs_f64(time_s));
    }

    fn go_to(&mut self, at: Stamp<metrology::Host>) {
        if at != self.at {
            self.at = at;
            self.written.clear();
        }
    }

    /// Goes to a time after the begin of the measurement.
    ///
    /// # Errors
    /// When it has passed.
    pub fn wait_until(&mut self, time_s: f64) -> Result<()> {
        let at = self.start + Span::from_secs_f64(time_s);
        if at < self.at {
            let before_s = (self.at - self.start).as_secs_f64();
            bail!(
                "{time_s} s after the first row: must not be before the row above, which is at {before_s} s: put the rows in the order of their times"
            );
        }
        self.go_to(at);
        Ok(())
    }

    /// Goes to the time of a row of a log. Of several rows with one time, as of a logger that writes whole minutes, none is lost.
    ///
    /// # Errors
    /// When it has passed.
    pub fn begin_row(&mut self, time_s: f64) -> Result<()> {
        let at = self.start + Span::from_secs_f64(time_s);
        match self.row {
            Some((before, n)) if before == at => {
                self.row = Some((at, n + 1));
                self.crowded += 1;
                self.go_to(at + Span::from_nanos(n + 1));
                Ok(())
            }
            _ => {
                self.row = Some((at, 0));
                self.wait_until(time_s)
            }
        }
    }

    /// One tick of the axes.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn tick(&mut self, position: &PerAxis<f64>) -> Result<()> {
        self.write(
            &topics::AXES_STATE,
            topics::AXES_STATE.name.to_owned(),
            &AxisState {
                received_at: self.at,
                controller_at: Stamp::from_nanos(self.at.nanos()),
                axes: self.axes,
                commanded: *position,
                motor: *position,
                scale: PerAxis([f64::NAN; 6]),
                velocity: PerAxis::default(),
            },
        )
    }

    /// A reading of a length.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn length(&mut self, axis: Axis, displacement_mm: f64) -> Result<()> {
        self.length_of((axis, 1), displacement_mm)
    }

    /// A reading of one of several sensors along an axis, each with a zero of its own.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn length_of(&mut self, (axis, zero_id): (Axis, u32), displacement_mm: f64) -> Result<()> {
        self.write(
            &topics::LENGTH_POSITION,
            topics::LENGTH_POSITION.name.to_owned(),
            &LengthSample {
                at: self.at,
                axis,
                displacement_mm,
                zero_id,
            },
        )
    }

    /// A reading of an angle.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn angle(&mut self, axis: Axis, angle_rad: f64) -> Result<()> {
        self.write(
            &topics::ANGLE_POSITION,
            topics::ANGLE_POSITION.name.to_owned(),
            &AngleSample {
                at: self.at,
                axis,
                angle_rad,
                zero_id: 1,
            },
        )
    }

    /// A temperature.
    ///
    /// # Errors
    /// When it cannot be written, or the sensor's name is no ROS name.
    pub fn temperature(&mut self, sensor: &str, temperature_degc: f64) -> Result<()> {
        let name = topics::TEMPERATURE.of(sensor)?;
        let sample = TemperatureSample {
            at: self.at,
            sensor: sensor.to_owned(),
            temperature_degc,
            variance_k2: 0.0,
        };
        let message = abbe_msgs::sensor_msgs::msg::Temperature::from_inner(&sample);
        self.put(name, topics::TEMPERATURE.qos, &message)
    }

    /// A touch; its instant is now.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn touch(&mut self, point: &ProbedPoint) -> Result<()> {
        let point = ProbedPoint {
            received_at: self.at,
            ..point.clone()
        };
        let topic = &topics::PROBE_POINT;
        self.write(topic, topic.name.to_owned(), &point)
    }

    /// A shape that touches are of; its instant is now.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn feature(&mut self, feature: &ProbedFeature) -> Result<()> {
        let feature = ProbedFeature {
            at: self.at,
            ..feature.clone()
        };
        let topic = &topics::PROBE_FEATURE;
        self.write(topic, topic.name.to_owned(), &feature)
    }

    /// Begin or end of a run; its instant is now.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn segment(&mut self, segment: &TestSegment, begin: bool) -> Result<()> {
        let segment = TestSegment {
            at: self.at,
            begin,
            ..segment.clone()
        };
        self.write(
            &topics::TEST_SEGMENT,
            topics::TEST_SEGMENT.name.to_owned(),
            &segment,
        )
    }

    /// Ends the bag.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn finish(self) -> Result<BagCount> {
        self.recording.finish()?;
        Ok(BagCount {
            messages: self.messages,
            repeated: self.repeated,
            crowded: self.crowded,
        })
    }

    fn write<M: Message + Wire>(
        &mut self,
        topic: &Topic<M>,
        name: String,
        inner: &M::Inner,
    ) -> Result<()> {
        self.put(name, topic.qos, &M::from_inner(inner))
    }

    fn put<M: Message>(&mut self, name: String, qos: Qos, message: &M) -> Result<()> {
        let known = self.channels.iter().position(|(topic, _)| *topic == name);
        let place = known.unwrap_or(self.channels.len());
        let bytes = to_cdr(message);
        if !self.is_new(place, &bytes) {
            // Where the axes stand is no reading.
            self.repeated += u64::from(M::TYPE_NAME != AxisStateMessage::TYPE_NAME);
            return Ok(());
        }
        let channel = match known {
            Some(place) => self.channels[place].1,
            None => {
                let channel = self.recording.add_channel(&Channel {
                    topic: format!("/{name}"),
                    type_name: M::TYPE_NAME.to_owned(),
                    type_hash: M::TYPE_HASH.to_owned(),
                    definition: M::DEFINITION.to_owned(),
                    qos_yaml: qos.offered_qos_profiles(),
                })?;
                self.channels.push((name, channel));
                channel
            }
        };
        if !epoch::holds(self.at) {
            bail!("the measurement goes on beyond 2106-02-07: begin earlier (start_s)");
        }
        let nanos = self.at.nanos();
        let sequence = u32::try_from(self.messages).unwrap_or(u32::MAX);
        let stamp = MessageStamp {
            log_time_nanos: nanos,
            publish_time_nanos: nanos,
            sequence,
        };
        self.recording.write(channel, stamp, &bytes)?;
        self.messages += 1;
        Ok(())
    }

    /// Whether the bag has no message with these bytes of this topic and instant: a reader would leave the second one out as
    /// repeated.
    fn is_new(&mut self, channel: usize, bytes: &[u8]) -> bool {
        let mut hasher = DefaultHasher::new();
        hasher.write(bytes);
        self.written.insert((channel, bytes.len(), hasher.finish()))
    }
}

#[cfg(test)]
mod tests {
    use recorder::{Bag, Order};
    use replayer::reading;

    use super::*;

    const MACHINE: &str = include_str!("../../../../launch_configs/first_run/machine.yaml");

    /// A bag of a log: time in s, displacement in µm and temperature of each row.
    fn log(rows: &[(f64, f64, f64)]) -> BagCount {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("bag");
        let machine = MachineFile::parse(MACHINE, "machine.yaml").unwrap();
        let of_machine = (&machine, MACHINE.to_owned());
        let mut writer = Writer::begin(&path, of_machine, 1_767_600_000, None).unwrap();
        for (time_s, um, degc) in rows {
            writer.wait_until(*time_s).unwrap();
            writer.tick(&PerAxis::default()).unwrap();
            writer.length(Axis::Z, um * 1e-3).unwrap();
            writer.temperature("ambient", *degc).unwrap();
        }
        let written = writer.finish().unwrap();
        let bag = Bag::open(&path).unwrap();
        assert_eq!(bag.message_count(), written.messages);
        let wanted = [
            topics::AXES_STATE.name,
            topics::LENGTH_POSITION.name,
            topics::TEMPERATURE.base,
        ];
        let read = reading::read(&bag, Order::LogTime, &wanted, |_| {});
        assert!(read.is_whole(), "{:?}", read.lines());
        written
    }

    #[test]
    fn rows_of_one_time_leave_no_repeated_message_and_are_counted() {
        let usual = [(0.0, 1.0, 20.0), (60.0, 1.5, 20.0), (120.0, 2.0, 20.1)];
        assert_eq!(log(&usual).repeated, 0);
        assert!(log(&usual).in_words().is_empty());
        for (second, repeated) in [
            ((60.0, 1.6, 20.0), 1),
            ((60.0, 1.5, 20.3), 1),
            ((60.0, 1.5, 20.0), 2),
            ((60.0, 1.6, 20.3), 0),
            // The next instant with the readings of the one before.
            ((61.0, 1.5, 20.0), 0),
        ] {
            let [first, before, after] = usual;
            let found = log(&[first, before, second, after]);
            assert_eq!(found.repeated, repeated, "{second:?}");
            let is_named = found.in_words().first().is_some_and(|line| {
                line.starts_with(&format!("{repeated} readings have time and value"))
            });
            assert_eq!(is_named, repeated > 0);
        }
        let all_at_once = vec![(0.0, 1.0, 20.0); 50];
        assert_eq!(log(&all_at_once).repeated, 98);
    }

    #[test]
    fn rows_of_a_coarse_clock_are_all_kept_in_their_order() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("bag");
        let machine = MachineFile::parse(MACHINE, "machine.yaml").unwrap();
        let of_machine = (&machine, MACHINE.to_owned());
        let mut writer = Writer::begin(&path, of_machine, 1_767_600_000, None).unwrap();
        for k in 0..30_u32 {
            writer.begin_row(f64::from(k / 10) * 60.0).unwrap();
            writer.length(Axis::Z, f64::from(k % 3)).unwrap();
        }
        assert!(writer.begin_row(60.0).is_err(), "time goes on");
        let written = writer.finish().unwrap();
        assert_eq!((written.crowded, written.repeated), (27, 0));
        assert!(written.in_words()[0].starts_with("27 rows have the time of the row before"));
        let mut read = vec![];
        let bag = Bag::open(&path).unwrap();
        reading::read(
            &bag,
            Order::LogTime,
            &[topics::LENGTH_POSITION.name],
            |mut taken| {
                if let Some(length) = taken.of(&topics::LENGTH_POSITION) {
                    read.push((length.at.nanos(), length.displacement_mm));
                }
            },
        );
        let heights: Vec<f64> = read.iter().map(|(_, mm)| *mm).collect();
        let wanted: Vec<f64> = (0..30).map(|k| f64::from(k % 3)).collect();
        assert_eq!(heights, wanted);
        assert!(read.is_sorted_by(|a, b| a.0 < b.0));
    }
}
