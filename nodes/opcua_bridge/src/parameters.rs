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
    text("endpoint", "URL of the server: opc.tcp://HOST:PORT."),
    text(
        "map_file",
        "What each node is, relative to the parameter file; or ready:machine_tool, ready:machinery.",
    ),
    text(
        "security.mode",
        "none, sign or sign_and_encrypt; an endpoint with less is refused.",
    ),
    text(
        "security.policy",
        "Basic256Sha256, Aes128-Sha256-RsaOaep or Aes256-Sha256-RsaPss, for every mode but none.",
    ),
    text(
        "security.pki_folder",
        "Folder of the certificates (own, private, trusted, rejected), relative to the parameter file; an own certificate is made where there is none.",
    ),
    text("security.user", "User name; empty: anonymous."),
    text(
        "security.password_file",
        "File that holds the user's password, relative to the parameter file.",
    ),
    number(
        "subscription.sampling_ms",
        "ms",
        "The server is asked to look at each node this often.",
        (0.0, 60_000.0),
    ),
    number(
        "subscription.publishing_ms",
        "ms",
        "The server is asked to send what has changed this often.",
        (10.0, 60_000.0),
    ),
    number(
        "subscription.queue",
        "",
        "Changes of a node that the server keeps between two sendings.",
        (1.0, 10_000.0),
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
        (0.05, 86_400.0),
    ),
    number(
        "connection.reply_timeout_s",
        "s",
        "An answer later than this is none.",
        (0.1, 3600.0),
    ),
    number(
        "connection.keep_alive_s",
        "s",
        "The server is asked this often whether it runs; two answers missing end the connection.",
        (0.1, 3600.0),
    ),
    number(
        "connection.session_s",
        "s",
        "The server is asked to keep the session and what was not received so long after a break.",
        (1.0, 3600.0),
    ),
];
