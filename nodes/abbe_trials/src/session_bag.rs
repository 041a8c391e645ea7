//! A trial's session as a bag, as a recorder would have written it.

use std::path::Path;

use abbe_msgs::topics::{self, Topic};
use abbe_msgs::{Message, Qos, Wire, to_cdr};
use anyhow::{Context, Result};
use metrology::Stamp;
use metrology::stamp::{Host, NANOS_PER_S};
use recorder::{
    Channel, ChannelId, ChunkCompression, Directory, MessageStamp, RecorderConfig, Recording,
    RunContext,
};
use trials::shop::Samples;
use trials::{Rig, Sample, measure};

/// Simulated time passes quickly: a chunk may span this much of it.
const FLUSH_S: f64 = 60.0;

/// A bag that is written.
struct SessionBag {
    recording: Recording<Directory>,
    channels: Vec<(String, ChannelId)>,
    messages: u32,
}

/// Measures on a rig and writes what is read into a bag.
///
/// # Errors
/// When the rig cannot be measured or the bag not written.
pub fn write(rig: &Rig, path: &Path, machine_text: String) -> Result<()> {
    let mut bag = SessionBag::begin(path, machine_text, rig.start_s)?;
    let mut outcome = Ok(());
    measure(rig, &mut |at, sample| {
        if outcome.is_ok() {
            outcome = bag.take(at, &sample);
        }
    })?;
    outcome?;
    bag.recording.finish()?;
    Ok(())
}

/// Writes samples in their order into a bag.
///
/// # Errors
/// When the bag cannot be written.
pub fn write_samples(samples: &Samples, path: &Path, machine_text: String) -> Result<()> {
    let start_s = samples
        .first()
        .map_or(0, |(at, _)| at.nanos() / NANOS_PER_S);
    let mut bag = SessionBag::begin(path, machine_text, start_s)?;
    for (at, sample) in samples {
        bag.take(*at, sample)?;
    }
    bag.recording.finish()?;
    Ok(())
}

impl SessionBag {
    fn begin(path: &Path, machine_text: String, start_s: i64) -> Result<Self> {
        let name = path
            .file_name()
            .context("bag without a name")?
            .to_string_lossy();
        let config = RecorderConfig {
            compression: ChunkCompression::Zstd,
            flush_period_s: FLUSH_S,
            ..RecorderConfig::default()
        };
        let mut recording = Recording::begin(Directory::create(path)?, &name, config)?;
        recording.add_context(&RunContext {
            start_time_nanos: u64::try_from(start_s * NANOS_PER_S).context("start of a session")?,
            commit: abbe::COMMIT.to_owned(),
            machine_file: Some(machine_text),
            ..RunContext::default()
        })?;
        Ok(Self {
            recording,
            channels: vec![],
            messages: 0,
        })
    }

    fn take(&mut self, at: Stamp<Host>, sample: &Sample) -> Result<()> {
        match sample {
            Sample::State(state) => self.write(at, &topics::AXES_STATE, state),
            Sample::Grid(sample) => self.write(at, &topics::GRID_POSITION, sample),
            Sample::Length(sample) => self.write(at, &topics::LENGTH_POSITION, sample),
            Sample::Trigger(trigger) => self.write(at, &topics::PROBE_TRIGGER, trigger),
            Sample::Segment(segment) => self.write(at, &topics::TEST_SEGMENT, segment),
            Sample::Temperature(sample) => {
                let name = topics::TEMPERATURE.of(&sample.sensor)?;
                let message = abbe_msgs::sensor_msgs::msg::Temperature::from_inner(sample);
                self.put(at, &name, topics::TEMPERATURE.qos, &message)
            }
        }
    }

    fn write<M: Message + Wire>(
        &mut self,
        at: Stamp<Host>,
        topic: &Topic<M>,
        inner: &M::Inner,
    ) -> Result<()> {
        self.put(at, topic.name, topic.qos, &M::from_inner(inner))
    }

    fn put<M: Message>(
        &mut self,
        at: Stamp<Host>,
        name: &str,
        qos: Qos,
        message: &M,
    ) -> Result<()> {
        let known = self.channels.iter().find(|(topic, _)| topic == name);
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
                self.channels.push((name.to_owned(), channel));
                channel
            }
        };
        let stamp = MessageStamp {
            log_time_nanos: at.nanos(),
            publish_time_nanos: at.nanos(),
            sequence: self.messages,
        };
        self.recording.write(channel, stamp, &to_cdr(message))?;
        self.messages = self.messages.wrapping_add(1);
        Ok(())
    }
}
