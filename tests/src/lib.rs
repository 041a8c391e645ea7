//! What no crate can test alone, and what those tests share: the built program, nodes as processes,
//! the graph as a witness hears it, Python as the other side, scenarios in a folder of their own.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]
#![expect(
    clippy::disallowed_methods,
    reason = "tests wait, look at clocks, read the environment and write files"
)]
#![expect(clippy::print_stderr, reason = "what is not tested is said")]

pub mod asker;
pub mod chromium;
pub mod computer_clock;
pub mod cyclone;
pub mod drift;
pub mod fast_dds;
pub mod foreseen;
pub mod graph;
pub mod hosts;
pub mod operator;
pub mod program;
pub mod python;
pub mod said;
pub mod scenario;
pub mod security;
pub mod zenoh;

pub use test_namespaces as namespace;
