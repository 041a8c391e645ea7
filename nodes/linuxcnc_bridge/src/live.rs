//! The stage together with its sockets and processes: what the ROS shell drives.
//!
//! To its driver it is an ordinary stage that wants a tick every few milliseconds; each tick hands
//! over all that has come from outside since the last, with the instants at which it came.

use std::convert::Infallible;
use std::path::Path;

use machine::MachineFile;
use metrology::Stage;
use metrology::sample::AxisCompensation;
use metrology::stamp::{Host, Stamp};

use crate::config::{BridgeConfig, Settings};
use crate::error::BridgeError;
use crate::io::account::Account;
use crate::io::start::Controller;
use crate::io::{Address, BridgeIo};
use crate::stage::{BridgeStage, Input, Output};

/// What the shell tells.
#[derive(Clone, Debug, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "one at a time; a box would allocate at 1 kHz"
)]
pub enum LiveInput {
    /// A program is to be run.
    Goal {
        /// Number of the goal.
        goal: u64,
        /// Text of the program.
        program: String,
    },
    /// A program is called off.
    Cancel {
        /// Number of the goal.
        goal: u64,
    },
    /// What is to be added to the commands.
    Compensation(AxisCompensation),
    /// Time has passed.
    Tick,
    /// The bridge is to stop.
    Shutdown,
}

/// A bridge at work.
#[derive(Debug)]
pub struct LiveBridge {
    stage: BridgeStage,
    // Before the controller, so that its processes leave HAL before HAL ends.
    io: BridgeIo,
    _controller: Option<Controller>,
    said: Vec<Output>,
}

impl LiveBridge {
    /// Checks the configuration, starts LinuxCNC where the configuration says so (its INI file lies
    /// relative to `folder`), and looks for it.
    ///
    /// # Errors
    /// A wrong configuration, or LinuxCNC cannot be started.
    pub fn open(
        config: &BridgeConfig,
        machine: &MachineFile,
        folder: &Path,
    ) -> Result<Self, BridgeError> {
        let stage = BridgeStage::new(&Settings::new(config, machine)?);
        let controller = match &config.start_ini {
            Some(ini) => Some(Controller::start(config, &folder.join(ini))?),
            None => None,
        };
        let io = BridgeIo::start(Address {
            host: config.connection.host.clone(),
            port: config.connection.port,
            account: Account::ordinary(&config.user)?,
        })?;
        Ok(Self::new(stage, io, controller))
    }

    /// A bridge over `io`; `controller`, where it was started here, ends with it.
    #[must_use]
    pub fn new(stage: BridgeStage, io: BridgeIo, controller: Option<Controller>) -> Self {
        Self {
            stage,
            io,
            _controller: controller,
            said: Vec::new(),
        }
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
        match input {
            LiveInput::Goal { goal, program } => self.pass(at, Input::Goal { goal, program }, out),
            LiveInput::Cancel { goal } => self.pass(at, Input::Cancel { goal }, out),
            LiveInput::Compensation(offsets) => self.pass(at, Input::Compensation(offsets), out),
            LiveInput::Shutdown => self.pass(at, Input::Shutdown, out),
            LiveInput::Tick => {
                while let Some((came_at, event)) = self.io.event() {
                    self.pass(came_at, Input::Io(event), out)?;
                }
                self.pass(at, Input::Tick, out)
            }
        }
    }
}
