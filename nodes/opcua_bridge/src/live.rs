//! The stage together with its sockets: what the ROS shell drives.
//!
//! To its driver it is an ordinary stage that wants a tick every few milliseconds; each tick hands over all that
//! has come from outside since the last, with the instants at which it came.

use std::convert::Infallible;

use metrology::Stage;
use metrology::stamp::{Host, Stamp};

use crate::config::Settings;
use crate::error::BridgeError;
use crate::io::{BridgeIo, Credentials};
use crate::stage::{BridgeStage, Input, Output};

/// What the shell tells.
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
        })
    }

    fn pass(
        &mut self,
        at: Stamp<Host>,
        input: Input,
        out: &mut Vec<Output>,
    ) -> Result<(), Infallible> {
        self.stage.step(at, input, &mut self.said)?;
        for output in self.said.drain(..) {
            match output {
                Output::Io(command) => self.io.command(command),
                other => out.push(other),
            }
        }
        Ok(())
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
            return self.pass(at, Input::Shutdown, out);
        }
        for _ in 0..EVENTS_PER_TICK {
            let Some((came_at, event)) = self.io.event() else {
                break;
            };
            self.pass(came_at, Input::Io(event), out)?;
        }
        self.pass(at, Input::Tick, out)
    }
}
