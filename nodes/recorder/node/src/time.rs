//! When a message came: by the computer's clock, or by `/clock` where time is simulated.

use abbe_msgs::rosgraph_msgs::msg::Clock;
use abbe_msgs::{from_cdr, instant, topics};
use metrology::stamp::{Host, Stamp};
use node_runtime::tap::Tapped;
use node_runtime::{HostTime, Setup};
use recorder::{ChannelId, MessageStamp};

/// Most bytes of messages that wait for the first `/clock`; what comes beyond is lost.
const MAX_EARLY_BYTES: usize = 16 << 20;

/// By what a recording stamps what comes.
#[derive(Clone, Debug)]
pub enum Time {
    /// The computer's clock, or the reference's where it is related to it.
    Host(HostTime),
    /// The last message of this topic, `/clock` unless it is remapped, which must be among those that are recorded.
    Simulated(String),
}

impl Default for Time {
    fn default() -> Self {
        Self::Host(HostTime::default())
    }
}

impl Time {
    /// As a node's parameters have it.
    #[must_use]
    pub fn of(setup: &Setup) -> Self {
        if setup.use_sim_time() {
            Self::Simulated(setup.topic(topics::CLOCK.name))
        } else {
            Self::Host(setup.host_time())
        }
    }

    /// As a command line has it, by this computer's clock or by `/clock`.
    #[must_use]
    pub fn simulated(is_simulated: bool) -> Self {
        if is_simulated {
            Self::Simulated(topics::CLOCK.name.to_owned())
        } else {
            Self::default()
        }
    }
}

/// Stamps messages as they come.
pub(crate) struct Stamper {
    time: Time,
    now: Option<Stamp<Host>>,
}

impl Stamper {
    pub fn new(time: Time) -> Self {
        Self { time, now: None }
    }

    /// Takes `/clock` in, where time is simulated.
    ///
    /// # Errors
    /// The reason why one cannot be used.
    pub fn hear(&mut self, sample: &Tapped) -> Result<(), String> {
        if matches!(&self.time, Time::Simulated(clock) if *clock == sample.topic.name) {
            let clock: Clock = from_cdr(&sample.bytes).map_err(|error| error.to_string())?;
            let nanosec = clock.clock.nanosec;
            let at = instant(&clock.clock).ok_or_else(|| {
                format!("clock.nanosec = {nanosec}: must be below 1000000000; mend what publishes /clock")
            })?;
            self.now = Some(at);
        }
        Ok(())
    }

    /// The stamps of a message that has just come; `None`: no `/clock` has come yet.
    pub fn stamp(&self, sample: &Tapped) -> Option<MessageStamp> {
        let (received, sent) = match &self.time {
            Time::Host(host) => (host.shown(sample.received), sample.source),
            // Its writer's stamp is of the computer's clock, which tells nothing beside simulated time.
            Time::Simulated(_) => (self.now?, None),
        };
        Some(MessageStamp {
            log_time_nanos: received.nanos(),
            publish_time_nanos: sent.unwrap_or(received).nanos(),
            // The low half of the writer's count, as the file has room for it.
            sequence: (sample.sequence & i64::from(u32::MAX)) as u32,
        })
    }
}

/// Messages that came before the first `/clock`, in their order.
#[derive(Default)]
pub(crate) struct Early {
    pub samples: Vec<(ChannelId, Tapped)>,
    bytes: usize,
    is_full: bool,
}

impl Early {
    /// Keeps one; whether there was room. Once one did not fit, nothing after it is kept.
    pub fn keep(&mut self, channel: ChannelId, sample: &Tapped) -> bool {
        let own_bytes = sample.bytes.len() + size_of::<(ChannelId, Tapped)>();
        let bytes = self.bytes.saturating_add(own_bytes);
        self.is_full |= bytes > MAX_EARLY_BYTES;
        let has_room = !self.is_full;
        if has_room {
            self.bytes = bytes;
            self.samples.push((channel, sample.clone()));
        }
        has_room
    }
}
