//! The diagnosis of simulator against machine as it is published.

use crate::stamp::{Host, Stamp};

/// How sure a cause is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GapStatus {
    /// It is the cause.
    Named,
    /// It looks like it, but fails a check.
    Surrogate,
    /// It or one that cannot be told from it.
    Set,
}

/// A parameter of an effect with its 95 % interval, in the unit that ends its name.
#[derive(Clone, Debug, PartialEq)]
pub struct GapParameter {
    /// Key in the machine file.
    pub name: String,
    /// Estimate.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// One cause.
#[derive(Clone, Debug, PartialEq)]
pub struct GapCause {
    /// Id of the effect in the catalogue.
    pub effect: String,
    /// What it acts on; empty: the machine as a whole.
    pub axis: String,
    /// How sure.
    pub status: GapStatus,
    /// Probability, 0 to 1.
    pub confidence: f64,
    /// Size over noise, whitened.
    pub whitened_size: f64,
    /// Its parameters.
    pub parameters: Vec<GapParameter>,
}

/// Where simulator and machine differ, which effects cause it, how far the gap shrinks.
#[derive(Clone, Debug, PartialEq)]
pub struct GapSummary {
    /// When it was made.
    pub at: Stamp<Host>,
    /// The runs that were looked at.
    pub runs: Vec<u32>,
    /// Root mean square of machine minus simulator, mm.
    pub rms_mm: f64,
    /// 95 % of it are within this, mm.
    pub p95_mm: f64,
    /// What noise alone would give, mm.
    pub floor_mm: f64,
    /// Whether there is a gap at all.
    pub above_floor: bool,
    /// The causes, the surest first.
    pub causes: Vec<GapCause>,
    /// Whether a rest is there that no effect of the catalogue explains.
    pub has_unknown: bool,
    /// What that rest goes with.
    pub unknown_covariate: String,
    /// Runs that were held out.
    pub held_out_runs: Vec<u32>,
    /// Root mean square on them before the named effects are simulated, mm; NaN: none were held out.
    pub rms_before_mm: f64,
    /// The same after, mm.
    pub rms_after_mm: f64,
    /// Share of the gap that is closed; NaN: there was none, or no run was held out.
    pub gap_closed: f64,
    /// What to measure next; empty: nothing.
    pub next_experiment: String,
    /// The whole report as JSON text of the form `abbe.gap/1`.
    pub json: String,
}
