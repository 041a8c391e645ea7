//! Stores on a real PostgreSQL server, which each test starts on loopback.

#![expect(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "tests start a server, wait for it, print figures, and stop at the first surprise"
)]

mod authority;
#[path = "../it/example.rs"]
#[expect(dead_code, reason = "the other test program uses the rest")]
mod example;
mod fleet;
mod server;
mod tls;
mod writing;
