//! What can go wrong before or beneath the stage.

use std::path::PathBuf;

use metrology::Axis;
use metrology::bound::BoundError;
use metrology::number::number;

/// Errors of the bridge: its configuration, and starting and reaching LinuxCNC.
#[derive(Debug, thiserror::Error)]
pub enum BridgeError {
    /// A parameter outside its limits.
    #[error(transparent)]
    Parameter(#[from] BoundError),
    /// A word that goes over the wire would break the line.
    #[error("{key} = {value:?}: must be one word without white space")]
    NotAWord {
        /// Key in the parameter file.
        key: &'static str,
        /// What was read.
        value: String,
    },
    /// The joints of the configuration are not the axes of the machine file.
    #[error("joints = {joints:?}: the machine file has the axes {axes:?}")]
    JointsAndAxesDiffer {
        /// Axes by joint.
        joints: Vec<Axis>,
        /// Axes of the machine file.
        axes: Vec<Axis>,
    },
    /// The machine file describes another latch than LinuxCNC has.
    #[error("control.latch: LinuxCNC polls its probe input, the machine file must say `polled`")]
    LatchIsPolled,
    /// LinuxCNC is not installed.
    #[error("{program} is not installed: apt-get install {package}")]
    PackageMissing {
        /// The program that was looked for.
        program: &'static str,
        /// The Debian package that has it.
        package: &'static str,
    },
    /// Only one LinuxCNC runs on a computer.
    #[error("LinuxCNC already runs on this computer ({process}, process {pid}): only one can")]
    AlreadyRunning {
        /// Name of the process.
        process: String,
        /// Its id.
        pid: i32,
    },
    /// Somebody else holds the right to start LinuxCNC.
    #[error("{path}: another program of this suite runs LinuxCNC: only one can")]
    StartedElsewhere {
        /// The lock file.
        path: PathBuf,
    },
    /// The ordinary user does not exist.
    #[error(
        "user {user:?} does not exist: LinuxCNC refuses to run as root and needs an ordinary user"
    )]
    NoSuchUser {
        /// Name from the configuration.
        user: String,
    },
    /// LinuxCNC ended while it was starting.
    #[error("{ini}: LinuxCNC ended while starting; its last words: {last_words}")]
    EndedAtStart {
        /// The INI file.
        ini: PathBuf,
        /// End of what it printed.
        last_words: String,
    },
    /// LinuxCNC did not listen in time.
    #[error(
        "{ini}: LinuxCNC did not listen on port {port} within {limit_s} s; its last words: {last_words}", limit_s = number(*limit_s))]
    NotReady {
        /// The INI file.
        ini: PathBuf,
        /// TCP port.
        port: u16,
        /// How long was waited, s.
        limit_s: f64,
        /// End of what it printed.
        last_words: String,
    },
    /// A LinuxCNC that was killed left a queue of its sampler or streamer, which cannot be removed.
    #[error(
        "shared memory {id} of user {owner} is left from a LinuxCNC that was killed, and cannot be removed ({reason}): remove it as that user with `ipcrm -m {id}`"
    )]
    QueueLeftBehind {
        /// The memory's id in the system.
        id: u64,
        /// Id of the user who owns it.
        owner: u16,
        /// Why it could not be removed.
        reason: String,
    },
    /// A file, directory or process could not be used.
    #[error("{action} {path}")]
    Io {
        /// What was tried.
        action: &'static str,
        /// With which file or program.
        path: PathBuf,
        /// Why it failed.
        #[source]
        source: std::io::Error,
    },
}
