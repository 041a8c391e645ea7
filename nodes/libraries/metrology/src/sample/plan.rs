//! What the sequencer is doing.

use crate::stamp::{Host, Stamp};

/// State of a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "self-evident")]
pub enum PlanState {
    Waiting,
    Running,
    Done,
    Failed,
}

/// What the sequencer is doing.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanStatus {
    /// When that changed.
    pub at: Stamp<Host>,
    /// State of the plan.
    pub state: PlanState,
    /// Step, from 1; 0: none.
    pub step: u32,
    /// Steps of the plan.
    pub steps: u32,
    /// What it does, in words.
    pub activity: String,
    /// Current run; 0: none.
    pub run: u32,
    /// Share of the step that is over, 0 to 1.
    pub progress: f64,
    /// Why it failed; empty: it did not.
    pub message: String,
}
