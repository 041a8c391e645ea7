//! The diagnosis as one object: what `abbe diagnose --json` writes and the node publishes.
//!
//! Lengths are µm, as people read them. A number that does not exist is absent (`null`), never zero.
//!
//! Keys keep their name and meaning. A key that was added later (`why`) is optional, so that older reports are read. Figures for
//! pages alone are kept in the type and not written; `None` there is a report that was read.

pub(crate) mod description;
pub mod figures;
pub(crate) mod floor;
pub(crate) mod follows;
pub(crate) mod localise;
pub(crate) mod places;

use serde::{Deserialize, Serialize};
use serde_json::Value;

pub use self::floor::Vibration;
pub use self::follows::Follows;
pub use crate::judgement::{Check, CheckId, Side, Verdict};

/// Name and version of this form.
pub const SCHEMA: &str = "abbe.gap/1";

/// The whole report.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GapReport {
    /// [`SCHEMA`].
    pub schema: String,
    /// What was read.
    pub inputs: Inputs,
    /// Noise of each channel, from repeats.
    pub noise_floor: Vec<NoiseFloor>,
    /// How far simulator and machine are apart.
    pub gap: Gap,
    /// Where the gap lies, the largest share first.
    pub r#where: Vec<Place>,
    /// Which effects cause it, the surest first.
    pub causes: Vec<Cause>,
    /// What no effect of the catalogue explains.
    pub unknown: Unknown,
    /// How far the gap shrinks on runs that were held out.
    pub shrink: Shrink,
    /// Effects that the recording could not have shown.
    pub not_excited: Vec<NotExcited>,
    /// What to measure next, the most telling per minute first.
    pub next_experiments: Vec<NextExperiment>,
    /// Time the diagnosis took, s; filled in by whoever has a clock.
    pub runtime_s: f64,
    /// Whether the size of each named effect of the mean holds over the session, in the order of `causes`; absent where none is named.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub over_session: Vec<OverSession>,
    /// What changed between repeats and no named effect explains, or a set-up that moved would make as well; absent where nothing did.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub does_not_repeat: Vec<DoesNotRepeat>,
    /// Channels of logs that go with thermometers; absent where none does.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub follows: Vec<Follows>,
    /// What of each bag was lost or left out, null where nothing was; absent where all were whole.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub loss: Vec<Value>,
    /// Defaults of the machine file that the diagnosis uses, as `axes.X.lead_mm = 10.0`; absent without any.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub machine_defaults: Vec<String>,
    /// The simulator in the place of the machine file's own, and what of the recording has a match in it; absent without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub simulated: Option<Value>,
    /// What was not considered; absent where everything was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub made_with: Option<MadeWith>,
    /// Figures with a limit, and how they stand to it; absent without limits.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub alarms: Option<Value>,
}

/// What a diagnosis did not consider.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MadeWith {
    /// Ids of effects.
    pub without: Vec<String>,
    /// Ids of rules that were switched off.
    pub ablated: Vec<String>,
}

/// Whether the size of a named effect holds over the session.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OverSession {
    /// Id of the effect.
    pub effect: String,
    /// What it acts on.
    pub axis: String,
    /// The first run that shows it, where it was not there from the begin.
    pub from_run: Option<u32>,
    /// Whether one size holds while it is there.
    pub holds: bool,
    /// From which run on it has another size, where a step is found.
    pub changes_from_run: Option<u32>,
    /// By how much that is another, as a share of its size.
    pub change_share: Option<f64>,
    /// By how much it grows in an hour, as a share of its size, where it grows.
    pub growth_share_per_h: Option<f64>,
    /// Chance of as much in noise; absent where too few runs repeat one another.
    pub chance: Option<f64>,
}

/// A change between repeats that no named effect explains, or that a set-up that moved would make as well.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DoesNotRepeat {
    /// The channel that changed most.
    pub channel: String,
    /// What was touched there; absent of other channels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub feature: Option<String>,
    /// By how much, µm.
    pub size_um: f64,
    /// The last run before, of those that show it.
    pub last_run: u32,
    /// The first run after.
    pub from_run: u32,
    /// Whether nothing else changed than the place of the set-up; a shift of a reference point, which may be named, does the same.
    pub of_set_up: bool,
    /// Whether it went on evenly, from the first run that shows it (`last_run`) to the last one (`from_run`); absent of a step.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub evenly: bool,
    /// Chance of as much in noise.
    pub chance: f64,
}

/// What was read.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Inputs {
    /// The bags.
    pub bags: Vec<Bag>,
    /// SHA-256 of the machine file, hexadecimal.
    pub machine_sha256: String,
}

/// One bag.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bag {
    /// As the user gave it.
    pub path: String,
    /// SHA-256 of its files in order, hexadecimal.
    pub sha256: String,
    /// Runs in it.
    pub runs: usize,
    /// Readings in it.
    pub samples: usize,
}

/// Noise of one channel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoiseFloor {
    /// Channel, e.g. `grid.u`.
    pub channel: String,
    /// Standard deviation of a reading within a run, µm.
    pub sigma_um: f64,
    /// Coefficients of the autoregression within a run.
    pub ar: Vec<f64>,
    /// Standard deviation of the smooth deviation between runs, µm; for pages, no part of the form.
    #[serde(default, skip_serializing)]
    pub between_runs_um: Option<f64>,
    /// Runs that were repeats.
    pub repeats: usize,
    /// Whether the residual's own scatter agrees with what the repeats show.
    pub reproduced: bool,
    /// Vibrations that are alike in the runs; absent where none is found.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub vibrations: Vec<Vibration>,
}

/// Size of the gap.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gap {
    /// Root mean square after set-up nuisances, µm.
    pub rms_um: f64,
    /// 95 % of the residuals are within it, µm.
    pub p95_um: f64,
    /// What noise alone would give, µm.
    pub floor_um: f64,
    /// Whether there is a gap at all.
    pub above_floor: bool,
    /// The same for each channel.
    pub per_channel: Vec<ChannelGap>,
}

/// Size of the gap in one channel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChannelGap {
    /// Channel.
    pub channel: String,
    /// As in [`Gap`].
    pub rms_um: f64,
    /// As in [`Gap`].
    pub p95_um: f64,
    /// As in [`Gap`].
    pub floor_um: f64,
    /// As in [`Gap`].
    pub above_floor: bool,
}

/// Where a part of the gap lies.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Place {
    /// Channel.
    pub channel: String,
    /// Direction of the error, e.g. `X`.
    pub direction: String,
    /// What it goes with, e.g. `sense*log_distance_since_reversal_x`.
    pub covariate: String,
    /// Share of the structured gap that only this explains, 0 to 1.
    pub share_unique: f64,
    /// Share that this and others explain as well.
    pub share_shared: f64,
    /// Chance of so much in noise, over all places that were looked at.
    pub p_value: f64,
    /// Standard score.
    pub z: f64,
    /// The same under each condition.
    pub per_condition: Vec<Condition>,
}

/// One condition of a test.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Condition {
    /// E.g. `feed 3000 mm/min`.
    pub condition: String,
    /// Root mean square of this part under it, µm.
    pub rms_um: f64,
}

/// How sure a cause is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// It is the cause.
    Named,
    /// It looks like it, but fails a veto.
    Surrogate,
    /// It or one that cannot be told from it on this recording.
    Set,
}

/// One cause.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cause {
    /// Id of the effect: the name of its file in the catalogue.
    pub effect: String,
    /// Axis, pair or component it acts on; empty for the machine as a whole.
    pub axis: String,
    /// How sure.
    pub status: Status,
    /// Recalibrated probability.
    pub confidence: f64,
    /// Its parameters, in the units of the machine file.
    pub parameters: Vec<ParameterValue>,
    /// Whitened size: root of its expected gain in chi-square.
    #[serde(rename = "D")]
    pub d: f64,
    /// What looks like it.
    pub confusable_with: Vec<Confusable>,
    /// Whether it has one size under all conditions.
    pub constancy: Constancy,
    /// The checks that its status follows from; empty in a report of a version without them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub why: Vec<Check>,
}

/// A parameter with its 95 % interval.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterValue {
    /// Key in the machine file.
    pub name: String,
    /// Estimate.
    pub value: f64,
    /// Lower end of the 95 % interval.
    pub low: f64,
    /// Upper end of the 95 % interval.
    pub high: f64,
    /// Whether it rails at its physical bound.
    pub at_bound: bool,
    /// Whether the recording tells more of it than its physical range does; for pages, no part of the form.
    #[serde(default, skip_serializing)]
    pub determined: Option<bool>,
}

/// Something that looks like a cause.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Confusable {
    /// Id of the effect.
    pub effect: String,
    /// What it acts on.
    pub axis: String,
    /// Cosine of the angle between the two signatures on this recording.
    pub cos: f64,
    /// Whether the data exclude it.
    pub excluded: bool,
}

/// Whether an effect has one size under all conditions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Constancy {
    /// No split shows two sizes.
    pub passed: bool,
    /// Standard score of the worst split.
    pub worst_z: f64,
    /// What the worst split is by; empty where none was possible.
    pub split_by: String,
}

/// What no effect explains.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Unknown {
    /// Whether there is such a rest.
    pub flagged: bool,
    /// Its score.
    pub score: f64,
    /// The score that noise exceeds in one of a hundred sessions.
    pub threshold: f64,
    /// What it looks like.
    pub description: Description,
}

/// What a rest looks like.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Description {
    /// What it goes with.
    pub covariate: String,
    /// Odd or even in the direction of motion; empty where it cannot be said.
    pub parity: String,
    /// Dominant period with its unit; empty where there is none.
    pub period: String,
    /// Exponent of its growth with feed: 0 geometry, 1 a delay, 2 inertia.
    pub feed_exponent: Option<f64>,
    /// Time constant, s.
    pub time_constant_s: Option<f64>,
}

/// How far the gap shrinks.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shrink {
    /// Runs that effects were found and sized on.
    pub fit_runs: Vec<u32>,
    /// Runs that were only predicted.
    pub held_out_runs: Vec<u32>,
    /// Root mean square on the held-out runs, µm.
    pub rms_um: BeforeAfter,
    /// 95th percentile on the held-out runs, µm.
    pub p95_um: BeforeAfter,
    /// 1 - (gap after / gap before) squared, above the floor; absent where there is no gap above it.
    pub gap_closed: Option<Interval>,
    /// What is left when one effect is taken out again.
    pub leave_one_out: Vec<LeftOut>,
}

/// Before and after the named effects are added to the simulator; absent without held-out runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BeforeAfter {
    /// Before.
    pub before: Option<f64>,
    /// After.
    pub after: Option<f64>,
}

/// A value with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Interval {
    /// Estimate.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// What is left without one of the named effects.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LeftOut {
    /// Id of the effect.
    pub effect: String,
    /// What it acts on.
    pub axis: String,
    /// Root mean square on the held-out runs without it, µm.
    pub rms_um_without: f64,
}

/// An effect that the recording did not excite.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NotExcited {
    /// Id of the effect.
    pub effect: String,
    /// What a recording must contain to show it.
    pub needs: String,
}

/// A run worth measuring.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NextExperiment {
    /// E.g. `circle XY R50 F3000 both senses`.
    pub run: String,
    /// What it tells apart.
    pub separates: Vec<String>,
    /// Squared distance that it would put between them.
    pub delta: f64,
    /// Time it takes.
    pub minutes: f64,
}
