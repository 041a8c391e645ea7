//! What the parameters of [`crate::BridgeConfig`] mean, for `ros2 param describe` and the README.

use metrology::ParameterDoc;

/// Every parameter, in the order of [`crate::BridgeConfig`].
pub const PARAMETERS: &[ParameterDoc] = &[
    text(
        "machine_file",
        "Machine file, relative to the parameter file.",
    ),
    text(
        "joints",
        "Axis letter of each joint, from joint 0; the axes of the machine file.",
    ),
    text(
        "prepare",
        "observe: a person releases the emergency stop, powers on and homes; power_on_and_home: the bridge does so when no joint is homed (simulated machines only).",
    ),
    text(
        "start_ini",
        "INI file to start, relative to the parameter file; absent: LinuxCNC is started by others.",
    ),
    text(
        "autostart",
        "Whether the node configures and activates itself at its start; otherwise somebody does so (`ros2 lifecycle set`).",
    ),
    text(
        "user",
        "Ordinary user who owns LinuxCNC's processes; used when the bridge runs as root.",
    ),
    text("connection.host", "Where linuxcncrsh listens."),
    number(
        "connection.port",
        "",
        "TCP port of linuxcncrsh.",
        (1.0, 65_535.0),
    ),
    text("connection.connect_password", "Password of the greeting."),
    text(
        "connection.enable_password",
        "Password that allows commands.",
    ),
    number(
        "connection.poll_period_ms",
        "ms",
        "Time between looks at the controller's state.",
        (1.0, 1000.0),
    ),
    number(
        "connection.reply_timeout_ms",
        "ms",
        "An answer later than this ends the connection.",
        (100.0, 60_000.0),
    ),
    number(
        "connection.reconnect_period_ms",
        "ms",
        "Time between attempts to connect.",
        (10.0, 60_000.0),
    ),
    number(
        "connection.homing_timeout_s",
        "s",
        "Homing must be over after this time.",
        (1.0, 3600.0),
    ),
    number(
        "connection.start_timeout_s",
        "s",
        "LinuxCNC must listen this long after its start.",
        (1.0, 600.0),
    ),
    number(
        "compensation.limit_um",
        "µm",
        "Greatest offset of a linear axis; a set with a larger one is refused whole.",
        (0.1, 5000.0),
    ),
    number(
        "compensation.limit_arcsec",
        "arcsec",
        "Greatest offset of a rotary axis.",
        (0.1, 3600.0),
    ),
    number(
        "compensation.stale_after_ms",
        "ms",
        "Without news for this long the heartbeat stops and HAL fades the offsets out.",
        (1.0, 60_000.0),
    ),
];

const fn text(name: &'static str, description: &'static str) -> ParameterDoc {
    ParameterDoc {
        name,
        unit: "",
        description,
        range: None,
    }
}

const fn number(
    name: &'static str,
    unit: &'static str,
    description: &'static str,
    range: (f64, f64),
) -> ParameterDoc {
    ParameterDoc {
        name,
        unit,
        description,
        range: Some(range),
    }
}
