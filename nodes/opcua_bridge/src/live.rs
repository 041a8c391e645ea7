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
use crate::io::{BridgeIo, Credentials};
use crate::stage::{BridgeStage, Input, Output};

/// Events from the shell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LiveInput {
    /// Time has passed.
    Tick,
    /// The bridge is to stop.
    Shutdown,
}

/// Events in one tick at most, so that a machine that floods the bridge leaves it time for others.
const EVENTS_PER_TICK: usize = 64;

/// A bridge at work.
#[derive(Debug)]
pub struct LiveBridge {
    stage: BridgeStage,
    io: BridgeIo,
    said: Vec<Output>,
    waiting: Turns<Output>,
    clock: ArrivalClock,
}

impl LiveBridge {
    /// Starts the thread of the connection; it is made at the first tick.
    ///
    /// # Errors
    /// When the program was built without the client, the certificates cannot be read or made, or the system has no
    /// thread left.
    pub fn open(settings: &Settings, credentials: Credentials) -> Result<Self, BridgeError> {
        Ok(Self {
            stage: BridgeStage::new(settings),
            io: BridgeIo::start(settings, credentials)?,
            said: Vec::new(),
            waiting: Turns::default(),
            clock: ArrivalClock::default(),
        })
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
                Output::Io(command) => self.io.command(command),
                other => self.waiting.put(other),
            }
        }
        Ok(())
    }

    /// Takes events until they are many, or have much to say; whether the stage may take the time of the tick.
    ///
    /// It may not where what came is cut: a tick ends an instant, whose other positions may be in what was not taken.
    fn listen(&mut self, at: Stamp<Host>) -> Result<bool, Infallible> {
        for _ in 0..EVENTS_PER_TICK {
            if self.waiting.is_full() {
                return Ok(false);
            }
            let Some((came_at, event)) = self.io.event() else {
                return Ok(true);
            };
            self.pass(self.clock.shown(at, came_at), Input::Io(event))?;
        }
        Ok(false)
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
        // While much waits the machine waits too, and is not silent.
        if self.waiting.is_empty() && self.listen(at)? {
            self.pass(at, Input::Tick)?;
        }
        self.waiting.hand_over(out);
        Ok(())
    }
}
