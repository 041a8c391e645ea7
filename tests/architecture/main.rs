//! One test for every invariant of ARCHITECTURE.md.
//!
//! Each module reads the tree ([`tree`], [`source`], [`packages`]), collects violations as lines of
//! `place: what is wrong`, and shows beside each test that a bad example is found. An invariant
//! that does not hold is mended where it is broken, never here.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#![expect(clippy::disallowed_methods, reason = "the tree under test is files")]

mod constants;
mod dependencies;
mod documents;
mod folders;
mod layouts;
mod messages;
mod names;
mod packages;
mod parameters;
mod purity;
mod scenarios;
mod source;
mod tree;
mod wording;

/// Fails with every violation on a line of its own.
#[track_caller]
fn check(violations: &[String]) {
    assert!(
        violations.is_empty(),
        "{} violations\n{}",
        violations.len(),
        violations.join("\n")
    );
}
