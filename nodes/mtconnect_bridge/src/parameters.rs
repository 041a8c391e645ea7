//! Every parameter of the node with its unit, limits and meaning.

use metrology::ParameterDoc;

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

/// Every parameter with its unit, limits and meaning.
pub const PARAMETERS: &[ParameterDoc] = &[
    text(
        "source",
        "shdr: an adapter, in lines over TCP; agent: an agent, in XML over HTTP; log: a file of an adapter's lines, told at its own pace.",
    ),
    text("host", "Where the adapter or agent listens."),
    number(
        "port",
        "",
        "TCP port of the adapter (often 7878) or agent (often 5000).",
        (1.0, 65535.0),
    ),
    text(
        "log_file",
        "Lines of an adapter that were logged, relative to the parameter file; for the source log alone.",
    ),
    number(
        "log_longest_pause_s",
        "s",
        "A longer pause in a log is taken for a leap of the machine's clock: it is said, and the lines go on without it.",
        (60.0, 31_622_400.0),
    ),
    text(
        "map_file",
        "What each key is, relative to the parameter file.",
    ),
    number(
        "connection.reconnect_first_s",
        "s",
        "Time to the second attempt to connect; each further one waits twice as long.",
        (0.05, 3600.0),
    ),
    number(
        "connection.reconnect_longest_s",
        "s",
        "Longest time between attempts.",
        (0.05, 86400.0),
    ),
    number(
        "connection.reply_timeout_s",
        "s",
        "An answer of an agent later than this ends the connection.",
        (0.1, 3600.0),
    ),
    number(
        "connection.line_limit_bytes",
        "",
        "A longer line of an adapter is refused, with its length.",
        (64.0, 16777216.0),
    ),
    text(
        "agent.device",
        "Device among those of the agent; empty: all.",
    ),
    number(
        "agent.interval_ms",
        "ms",
        "Least time between two parts of its stream.",
        (0.0, 60000.0),
    ),
    number(
        "agent.heartbeat_ms",
        "ms",
        "The agent says at least this often that it lives; twice as long and a second without a word ends the connection.",
        (10.0, 600000.0),
    ),
    number(
        "agent.count",
        "",
        "Observations in one part at most.",
        (1.0, 100000.0),
    ),
];
