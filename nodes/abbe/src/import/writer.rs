//! Writes samples of a made-up motion into a bag.

use std::path::Path;

use abbe_msgs::topics::{self, Topic};
use abbe_msgs::{Message, Qos, Wire, to_cdr};
use anyhow::{Context, Result, anyhow, bail};
use machine::MachineFile;
use metrology::sample::{AngleSample, AxisState, LengthSample, TemperatureSample, TestSegment};
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
            RecorderConfig::default(),
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
        })
    }

    /// Lets time pass.
    pub fn wait(&mut self, time_s: f64) {
        self.at += Span::from_secs_f64(time_s);
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
                "{time_s} s after the first row: must not be before the row above, which is at {before_s} s"
            );
        }
        self.at = at;
        Ok(())
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
    pub fn finish(self) -> Result<u64> {
        self.recording.finish()?;
        Ok(self.messages)
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
        let known = self.channels.iter().find(|(topic, _)| *topic == name);
        let channel = match known {
            Some((_, channel)) => *channel,
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
        self.recording.write(channel, stamp, &to_cdr(message))?;
        self.messages += 1;
        Ok(())
    }
}
