//! How much of a recording is kept.

use super::recent::LATE_S;

/// How a session is gathered. Physics comes from the machine file.
#[derive(Clone, Debug, PartialEq)]
pub struct SessionConfig {
    /// Commanded motion before a run that is kept, so that play and friction know how they stand, s.
    pub lead_in_s: f64,
    /// Rest after which readings at a stop count, s.
    pub settle_s: f64,
    /// Most readings of one channel of a run in motion.
    pub readings_per_run: usize,
    /// Most ticks of a run that are held while it is open; later ones are counted and left out.
    pub ticks_per_run: usize,
    /// For how long a run that has ended waits for its last samples, s: of a live machine it is to be diagnosed soon.
    pub wait_s: f64,
    /// Spacing of the slow history, s.
    pub history_step_s: f64,
}

impl Default for SessionConfig {
    fn default() -> Self {
        Self {
            lead_in_s: 5.0,
            settle_s: 0.3,
            readings_per_run: 2000,
            ticks_per_run: 2_000_000,
            wait_s: LATE_S,
            history_step_s: 10.0,
        }
    }
}

impl SessionConfig {
    /// The same for recordings: a busy recorder may have taken a touch a minute late, and nobody waits for the diagnosis.
    #[must_use]
    pub fn of_bags() -> Self {
        Self {
            wait_s: 60.0,
            ..Self::default()
        }
    }
}
