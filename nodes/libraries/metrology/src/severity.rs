//! How much a condition matters that a stage reports.

/// How much a condition matters; the greater, the worse.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// A fact worth recording: as it should be, or so again.
    Info,
    /// It goes on, but not as told.
    Warn,
    /// Data is lost, or a function has stopped or cannot be trusted.
    Error,
}
