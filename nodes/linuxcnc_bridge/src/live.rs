//! The stage together with its sockets and processes: what the ROS shell drives.
//!
//! To its driver it is an ordinary stage that wants a tick every few milliseconds; each tick hands
//! over all that has come from outside since the last, with the instants at which it came.

use std::convert::Infallible;
use std::path::{Path, PathBuf};

use machine::MachineFile;
use metrology::sample::AxisCompensation;
use metrology::stamp::{Host, Stamp};
use metrology::{Author, Stage};

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
    /// The bridge may act, or is to come to rest.
    Active(bool),
    /// The bridge is to stop.
    Shutdown,
}

/// What it takes to open a bridge, again and again.
#[derive(Clone, Debug)]
struct Opening {
    config: BridgeConfig,
    settings: Settings,
    /// Where the INI file lies.
    folder: PathBuf,
}

impl Opening {
    fn open(&self) -> Result<Work, BridgeError> {
        let config = &self.config;
        let controller = match &config.start_ini {
            Some(ini) => Some(Controller::start(config, &self.folder.join(ini))?),
            None => None,
        };
        let io = BridgeIo::start(Address {
            host: config.connection.host.clone(),
            port: config.connection.port,
            account: Account::ordinary(&config.user)?,
        })?;
        Ok(Work {
            stage: BridgeStage::new(&self.settings).inactive(),
            io,
            _controller: controller,
        })
    }
}

#[derive(Debug)]
struct Work {
    stage: BridgeStage,
    // Before the controller, so that its processes leave HAL before HAL ends.
    io: BridgeIo,
    _controller: Option<Controller>,
}

/// A bridge, open (at work) or closed.
#[derive(Debug)]
pub struct LiveBridge {
    opening: Option<Opening>,
    work: Option<Work>,
    said: Vec<Output>,
    /// How many publish offsets, since the last tick.
    publishers: Option<usize>,
}

impl LiveBridge {
    /// Checks the configuration and, where the bridge starts by itself, opens it; it is not active yet. The INI file
    /// of the configuration lies relative to `folder`.
    ///
    /// # Errors
    /// A wrong configuration, or LinuxCNC cannot be started.
    pub fn prepare(
        config: &BridgeConfig,
        machine: &MachineFile,
        folder: &Path,
    ) -> Result<Self, BridgeError> {
        let opening = Opening {
            config: config.clone(),
            settings: Settings::new(config, machine)?,
            folder: folder.to_owned(),
        };
        let mut bridge = Self {
            opening: Some(opening),
            work: None,
            said: Vec::new(),
            publishers: None,
        };
        if config.autostart {
            bridge.open()?;
        }
        Ok(bridge)
    }

    /// An active bridge over `io`; `controller`, where it was started here, ends with it.
    #[must_use]
    pub fn new(stage: BridgeStage, io: BridgeIo, controller: Option<Controller>) -> Self {
        Self {
            opening: None,
            work: Some(Work {
                stage,
                io,
                _controller: controller,
            }),
            said: Vec::new(),
            publishers: None,
        }
    }

    /// Starts LinuxCNC where the configuration says so, and looks for it; nothing where that was done.
    ///
    /// # Errors
    /// LinuxCNC cannot be started.
    pub fn open(&mut self) -> Result<(), BridgeError> {
        if let (None, Some(opening)) = (&self.work, &self.opening) {
            self.work = Some(opening.open()?);
        }
        Ok(())
    }

    /// So many publish offsets; the stage gets the number at the next tick.
    pub fn sees_publishers(&mut self, publishers: usize) {
        self.publishers = Some(publishers);
    }

    /// The offsets that come next are of this publisher.
    pub fn hears(&mut self, at: Stamp<Host>, author: Author) {
        if let Some(work) = &mut self.work {
            work.stage.hears(at, author);
        }
    }

    /// Leaves LinuxCNC, and ends it where it was started here.
    pub fn close(&mut self) {
        self.work = None;
    }

    fn pass(
        &mut self,
        at: Stamp<Host>,
        input: Input,
        out: &mut Vec<Output>,
    ) -> Result<(), Infallible> {
        let Some(work) = &mut self.work else {
            return Ok(());
        };
        work.stage.step(at, input, &mut self.said)?;
        for output in self.said.drain(..) {
            match output {
                Output::Io(command) => work.io.command(command),
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
            LiveInput::Active(active) => self.pass(at, Input::Active(active), out),
            LiveInput::Shutdown => self.pass(at, Input::Shutdown, out),
            LiveInput::Tick => {
                let event = |work: &mut Work| work.io.event();
                while let Some((came_at, event)) = self.work.as_mut().and_then(event) {
                    self.pass(came_at, Input::Io(event), out)?;
                }
                if let Some(publishers) = self.publishers.take() {
                    self.pass(at, Input::Publishers(publishers), out)?;
                }
                self.pass(at, Input::Tick, out)
            }
        }
    }
}
