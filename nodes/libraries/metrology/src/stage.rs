//! The seam between mathematics and everything else: events in, events out.

use crate::stamp::{Host, Stamp};

/// A node's whole computation. Time arrives with the event; a timer tick is an event.
///
/// A live node, a composed scenario and a replay call the same `step`; a stage reads no clock, file,
/// environment or entropy, so equal events give equal outputs.
pub trait Stage {
    /// What the stage is told.
    type Input;
    /// What it says; a condition worth reporting is an output too.
    type Output;
    /// A broken contract of the input; a bad *measurement* is an output instead.
    type Error: std::error::Error + Send + Sync + 'static;

    /// Handles one event that happened `at`, appending what follows from it to `out`.
    ///
    /// # Errors
    /// When the input breaks the stage's contract; the stage stays usable and unchanged by it.
    fn step(
        &mut self,
        at: Stamp<Host>,
        input: Self::Input,
        out: &mut Vec<Self::Output>,
    ) -> Result<(), Self::Error>;
}
