//! Location errors from readings of a machine whose truth is its own product of matrices.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]
#![expect(clippy::print_stderr, reason = "figures that were seen are said")]

mod bench;
mod closed_forms;
mod coverage;
mod expectation;
mod faults;
mod messages;
mod properties;
