//! Parameters of the bridge, as a person writes them, and the settings that follow from them.

use machine::file::{Latch, MachineFile};
use metrology::stamp::Span;
use metrology::{Axis, AxisSet, OffsetRule, PerAxis, check_between, check_parameters};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::BridgeError;

/// The parameter file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BridgeConfig {
    /// Machine file, relative to the parameter file.
    pub machine_file: String,
    /// Axis letter of each joint, from joint 0; the axes of the machine file.
    pub joints: Vec<Axis>,
    /// observe: a person releases the emergency stop, powers on and homes; power_on_and_home: the bridge does so when
    /// no joint is homed (simulated machines only).
    pub prepare: Prepare,
    /// INI file to start, relative to the parameter file; absent: LinuxCNC is started by others.
    #[serde(default)]
    pub start_ini: Option<String>,
    /// Whether the node configures and activates itself at its start; otherwise somebody does so (`ros2 lifecycle
    /// set`).
    #[serde(default = "BridgeConfig::default_autostart")]
    pub autostart: bool,
    /// Ordinary user who owns LinuxCNC's processes; used when the bridge runs as root.
    #[serde(default = "BridgeConfig::default_user")]
    pub user: String,
    /// The TCP interface.
    #[serde(default)]
    pub connection: ConnectionConfig,
    /// Limits of the compensation that is passed on.
    pub compensation: CompensationConfig,
}

/// What the bridge does when it finds LinuxCNC freshly started (no joint homed).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Prepare {
    /// Nothing: a person at the machine releases the emergency stop, powers on and homes.
    Observe,
    /// Release the emergency stop, power on and home: for simulated machines only.
    PowerOnAndHome,
}

/// The TCP interface and its times.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ConnectionConfig {
    /// Where linuxcncrsh listens.
    pub host: String,
    /// TCP port of linuxcncrsh.
    #[schemars(range(min = 1.0, max = 65_535.0))]
    pub port: u16,
    /// Password of the greeting.
    pub connect_password: String,
    /// Password that allows commands.
    pub enable_password: String,
    /// Time between looks at the controller's state.
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub poll_period_ms: f64,
    /// An answer later than this ends the connection.
    #[schemars(range(min = 100.0, max = 60_000.0))]
    pub reply_timeout_ms: f64,
    /// Time between attempts to connect.
    #[schemars(range(min = 10.0, max = 60_000.0))]
    pub reconnect_period_ms: f64,
    /// Homing must be over after this time.
    #[schemars(range(min = 1.0, max = 3600.0))]
    pub homing_timeout_s: f64,
    /// LinuxCNC must listen this long after its start.
    #[schemars(range(min = 1.0, max = 600.0))]
    pub start_timeout_s: f64,
}

impl Default for ConnectionConfig {
    fn default() -> Self {
        Self {
            host: "127.0.0.1".to_owned(),
            port: 5007,
            connect_password: "EMC".to_owned(),
            enable_password: "EMCTOO".to_owned(),
            poll_period_ms: 50.0,
            reply_timeout_ms: 5000.0,
            reconnect_period_ms: 500.0,
            homing_timeout_s: 60.0,
            start_timeout_s: 30.0,
        }
    }
}

/// Limits of the compensation that is passed on; HAL has its own limits behind these.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CompensationConfig {
    /// Greatest offset of a linear axis; a set with a larger one is refused whole.
    #[schemars(range(min = 0.1, max = 5000.0))]
    pub limit_um: f64,
    /// Greatest offset of a rotary axis.
    #[schemars(range(min = 0.1, max = 3600.0))]
    pub limit_arcsec: f64,
    /// Without news for this long the heartbeat stops and HAL fades the offsets out; a set that is stamped earlier or
    /// later than now by more, and by more than 0.5 s, is refused.
    #[schemars(range(min = 1.0, max = 60_000.0))]
    pub stale_after_ms: f64,
}

impl BridgeConfig {
    fn default_autostart() -> bool {
        true
    }

    fn default_user() -> String {
        "nobody".to_owned()
    }
}

/// Checked settings in inner units.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Axis of each joint, from joint 0.
    pub joints: Vec<Axis>,
    /// Axes with a linear scale, in the order of the joints.
    pub scales: Vec<Axis>,
    /// The same as a set.
    pub axes: AxisSet,
    /// Servo period of the machine file.
    pub servo_period: Span,
    /// See [`Prepare`].
    pub prepare: Prepare,
    /// Password of the greeting.
    pub connect_password: String,
    /// Password that allows commands.
    pub enable_password: String,
    /// Time between looks at the controller's state.
    pub poll_period: Span,
    /// An answer later than this ends the connection.
    pub reply_timeout: Span,
    /// Time between attempts to connect.
    pub reconnect_period: Span,
    /// Homing must be over after this time.
    pub homing_timeout: Span,
    /// Greatest compensation, mm or rad.
    pub compensation_limit: PerAxis<f64>,
    /// Age at which compensation is stale.
    pub compensation_stale_after: Span,
    /// Pulse equivalent of the linear axes, mm.
    pub pulse_mm: f64,
    /// The mark of the machine file ([`machine::program_machine`]).
    pub mark: Option<u64>,
}

fn span(value: f64, unit_s: f64) -> Span {
    Span::from_secs_f64(value * unit_s)
}

fn word(key: &'static str, value: &str) -> Result<String, BridgeError> {
    if value.is_empty() || value.contains(|c: char| c.is_whitespace() || c.is_control()) {
        return Err(BridgeError::NotAWord {
            key,
            value: value.to_owned(),
        });
    }
    Ok(value.to_owned())
}

/// Those joints whose axis has a linear scale in the machine file.
fn scaled(joints: &[Axis], machine: &MachineFile) -> Vec<Axis> {
    let has_scale = |axis: &Axis| {
        machine
            .linear(*axis)
            .is_some_and(|linear| linear.scale_resolution_um.is_some())
    };
    joints.iter().copied().filter(has_scale).collect()
}

fn servo_period(machine: &MachineFile) -> Result<Span, BridgeError> {
    let period_ms = machine.control.servo_period_ms;
    check_between("control.servo_period_ms", period_ms, (0.01, 100.0))?;
    Ok(Span::from_secs_f64(period_ms * 1e-3))
}

impl Settings {
    /// Checks a configuration against the machine file.
    ///
    /// # Errors
    /// Values out of range, joints that are not the machine's axes, or a hardware latch.
    pub fn new(config: &BridgeConfig, machine: &MachineFile) -> Result<Self, BridgeError> {
        let axes: AxisSet = config.joints.iter().copied().collect();
        if axes != machine.axis_set() || axes.len() != config.joints.len() {
            return Err(BridgeError::JointsAndAxesDiffer {
                joints: config.joints.clone(),
                axes: machine.axis_set().iter().collect(),
            });
        }
        if machine.control.latch != Latch::Polled {
            return Err(BridgeError::LatchIsPolled);
        }
        check_parameters(config)?;
        let connection = &config.connection;
        let limit = &config.compensation;
        let linear_mm = limit.limit_um / 1000.0;
        let rotary_rad = (limit.limit_arcsec / 3600.0).to_radians();
        Ok(Self {
            joints: config.joints.clone(),
            scales: scaled(&config.joints, machine),
            axes,
            servo_period: servo_period(machine)?,
            prepare: config.prepare,
            connect_password: word("connection.connect_password", &connection.connect_password)?,
            enable_password: word("connection.enable_password", &connection.enable_password)?,
            poll_period: span(connection.poll_period_ms, 1e-3),
            reply_timeout: span(connection.reply_timeout_ms, 1e-3),
            reconnect_period: span(connection.reconnect_period_ms, 1e-3),
            homing_timeout: span(connection.homing_timeout_s, 1.0),
            compensation_limit: PerAxis::from_fn(|axis| {
                if axis.is_linear() {
                    linear_mm
                } else {
                    rotary_rad
                }
            }),
            compensation_stale_after: span(limit.stale_after_ms, 1e-3),
            pulse_mm: machine.control.pulse_equivalent_um * 1e-3,
            mark: machine::program_machine::mark_of(machine),
        })
    }

    /// Which offsets are passed on.
    #[must_use]
    pub fn offset_rule(&self) -> OffsetRule {
        OffsetRule {
            axes: self.axes,
            size_limit: self.compensation_limit,
            pulse_mm: self.pulse_mm,
            age_limit: OffsetRule::age_limit_of(self.compensation_stale_after),
        }
    }
}
