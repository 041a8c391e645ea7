//! The stage together with its sockets: what the ROS shell drives.
//!
//! To its driver it is an ordinary stage that wants a tick every few milliseconds; each tick hands over all that
//! has come from outside since the last, with the instants at which it came, by the node's clock.

use std::convert::Infallible;

use machine_report::ValueCondition;
use machine_report::turns::Turns;
use metrology::stamp::{Host, Stamp};
use metrology::{ArrivalClock, Stage};

use crate::config::Settings;
use crate::error::BridgeError;
use crate::io::{BridgeIo, LogFile};
use crate::stage::{BridgeStage, Input, IoEvent, Output};

/// What the shell tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LiveInput {
    /// Time has passed.
    Tick,
    /// The bridge is to stop.
    Shutdown,
}

/// Events in one tick at most, so that a machine that floods the bridge leaves it time for others.
const EVENTS_PER_TICK: usize = 256;
/// Bytes in one tick after which no further event is taken.
const BYTES_PER_TICK: usize = 1 << 20;

/// A bridge at work.
#[derive(Debug)]
pub struct LiveBridge {
    stage: BridgeStage,
    io: Option<BridgeIo>,
    log: Option<LogFile>,
    said: Vec<Output>,
    waiting: Turns<Output>,
    clock: ArrivalClock,
}

impl LiveBridge {
    /// Starts the thread of the connection; it is made at the first tick.
    ///
    /// # Errors
    /// When the system has no thread left.
    pub fn open(settings: &Settings) -> Result<Self, BridgeError> {
        Ok(Self {
            stage: BridgeStage::new(settings),
            io: Some(BridgeIo::start(settings.address.clone())?),
            log: None,
            said: Vec::new(),
            waiting: Turns::default(),
            clock: ArrivalClock::default(),
        })
    }

    /// Replays a log; no connection is made.
    #[must_use]
    pub fn of_log(settings: &Settings, log: LogFile) -> Self {
        Self {
            stage: BridgeStage::new(settings),
            io: None,
            log: Some(log),
            said: Vec::new(),
            waiting: Turns::default(),
            clock: ArrivalClock::default(),
        }
    }

    /// Reads the log as far as the stage wants it.
    fn read_log(&mut self, out: &mut Vec<Output>) {
        let Some(log) = &mut self.log else {
            return;
        };
        while self.stage.wants_log() {
            self.stage.read_log(log.read(), out);
        }
    }

    /// The same with what comes stamped by `clock`.
    #[must_use]
    pub fn stamped_by(self, clock: ArrivalClock) -> Self {
        Self { clock, ..self }
    }

    fn pass(&mut self, at: Stamp<Host>, input: Input) -> Result<(), Infallible> {
        self.stage.step(at, input, &mut self.said)?;
        for output in self.said.drain(..) {
            match output {
                Output::Io(command) => {
                    if let Some(io) = &self.io {
                        io.command(command);
                    }
                }
                other => self.waiting.put(other),
            }
        }
        Ok(())
    }

    /// Takes events until they are many, or have much to say; whether the stage may take the time of the tick.
    ///
    /// It may not where what came is cut: a tick ends an instant, whose other positions may be in what was not taken.
    fn listen(&mut self, at: Stamp<Host>) -> Result<bool, Infallible> {
        let mut bytes = 0;
        for _ in 0..EVENTS_PER_TICK {
            if bytes > BYTES_PER_TICK || self.waiting.is_full() {
                return Ok(false);
            }
            let Some((came_at, event)) = self.io.as_ref().and_then(BridgeIo::event) else {
                return Ok(true);
            };
            bytes += length(&event);
            self.pass(self.clock.shown(at, came_at), Input::Io(event))?;
        }
        Ok(false)
    }
}

const fn length(event: &IoEvent) -> usize {
    match event {
        IoEvent::Received(bytes) | IoEvent::Answered { body: bytes, .. } => bytes.len(),
        _ => 0,
    }
}

impl Stage for LiveBridge {
    type Input = LiveInput;
    type Output = Output;
    type Error = Infallible;

    fn step(
        &mut self,
        at: Stamp<Host>,
        input: LiveInput,
        out: &mut Vec<Output>,
    ) -> Result<(), Infallible> {
        if input == LiveInput::Shutdown {
            let count = self.waiting.end(out);
            let left = ValueCondition::LeftWaiting { count };
            out.extend((count > 0).then_some(Output::Condition(left.into())));
            self.pass(at, Input::Shutdown)?;
            self.waiting.hand_over(out);
            return Ok(());
        }
        self.read_log(out);
        // While much waits the machine waits too, and is not silent.
        if self.waiting.is_empty() && self.listen(at)? {
            self.pass(at, Input::Tick)?;
        }
        self.waiting.hand_over(out);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::condition::Condition;
    use crate::mapping::MapFile;
    use crate::{BridgeConfig, config};

    fn bridge() -> LiveBridge {
        let map = MapFile::from_yaml("values:\n  ex: {is: execution}\n").unwrap();
        let config = BridgeConfig {
            source: config::Source::Log,
            host: "mill".to_owned(),
            port: 1,
            log_file: Some("mill.log".to_owned()),
            log_longest_pause_s: BridgeConfig::default_longest_pause_s(),
            map_file: String::new(),
            connection: config::ConnectionConfig::default(),
            agent: config::AgentConfig::default(),
        };
        LiveBridge {
            stage: BridgeStage::new(&Settings::new(&config, &map).unwrap()),
            io: None,
            log: None,
            said: Vec::new(),
            waiting: Turns::default(),
            clock: ArrivalClock::default(),
        }
    }

    #[test]
    fn much_that_a_machine_says_is_handed_over_in_turns_and_never_holds_the_end_up() {
        let mut bridge = bridge();
        for _ in 0..2_500 {
            bridge.waiting.put(Output::Condition(Condition::Offered));
        }
        let at = Stamp::from_nanos(1_000);
        let mut said = vec![];
        bridge.step(at, LiveInput::Tick, &mut said).unwrap();
        assert_eq!(said.len(), 1_000);
        said.clear();
        bridge.step(at, LiveInput::Shutdown, &mut said).unwrap();
        let left = ValueCondition::LeftWaiting { count: 500 };
        let left = Output::Condition(left.into());
        assert!(said.contains(&left), "{:?}", said.last());
        assert_eq!(said.last(), Some(&Output::Stopped));
        assert!(said.len() < 1_010, "{}", said.len());
    }
}
