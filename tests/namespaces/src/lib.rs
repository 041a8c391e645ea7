//! Networks, mounts and processes that belong to one test alone.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]
#![expect(
    clippy::disallowed_methods,
    reason = "tests wait, read the environment and make files"
)]
#![expect(clippy::print_stdout, reason = "a test's output is passed on")]
#![expect(clippy::print_stderr, reason = "a test states what it leaves out")]

mod alone;
mod isolated;

pub use alone::{alone, multicast_on_loopback, small_disk};
pub use isolated::isolated;
