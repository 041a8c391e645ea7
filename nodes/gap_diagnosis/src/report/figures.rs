//! What the pages draw beside the numbers of the report.
//!
//! Lengths are µm (mK for a thermometer, mrad for a rotary axis), as people read them.

use std::fmt;

use metrology::number::decimals_of;
use serde::{Deserialize, Serialize};

use crate::judgement::veto::Veto;
use crate::session::thermal::{GoesWith, ThermalFit};

mod course;
mod no_run;
pub(crate) mod over_session;

pub use course::Course;
pub use no_run::NoRun;

/// Everything that is drawn.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Figures {
    /// Where the gap lies: channel against covariate.
    pub heat: HeatMap,
    /// Held-out runs (all runs where none were held out) before and after the named effects.
    pub traces: Vec<Trace>,
    /// What can be told from what on this recording.
    pub isolability: Isolability,
    /// Root mean square of each held-out run.
    pub held_out: Vec<HeldOut>,
    /// What each of several named effects closes by itself; empty for fewer than two, and where nothing was held out.
    #[serde(default)]
    pub apart: Vec<Apart>,
    /// Intervals of the shares of the report's places, in their order; absent where too few runs were read.
    #[serde(default)]
    pub share_intervals: Vec<Option<[f64; 2]>>,
    /// Drift of each channel of the logs.
    #[serde(default)]
    pub drifts: Vec<Drift>,
}

/// Drift of a channel of the logs, with a model and the temperatures beside it, at the same instants.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Drift {
    /// The channel.
    pub channel: String,
    /// Since the session's begin, h.
    pub time_h: Vec<f64>,
    /// Machine minus simulator, µm.
    pub deviation_um: Vec<f64>,
    /// What thermometers, else the named effects, say of it, µm; empty without either.
    pub model_um: Vec<f64>,
    /// Whether the model is that of thermometers.
    pub is_by_thermometers: bool,
    /// All thermometers that were read.
    pub temperatures: Vec<Temperature>,
}

/// A thermometer at the instants of a [`Drift`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Temperature {
    /// Its name in the machine file.
    pub thermometer: String,
    /// What it read, °C.
    pub degc: Vec<f64>,
}

/// One of several named effects by itself, on held-out runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Apart {
    /// Id of the effect.
    pub effect: String,
    /// What it acts on.
    pub axis: String,
    /// Root mean square where it alone is added to the simulator.
    pub rms_um_alone: f64,
    /// Its share of what all of them close together (Shapley's); absent where that is nothing.
    pub share: Option<f64>,
}

/// Standard score of the residual, channel against covariate.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct HeatMap {
    /// Channel and direction, one a row.
    pub rows: Vec<String>,
    /// Covariates, one a column.
    pub columns: Vec<String>,
    /// Standard score; absent where the channel has no such covariate.
    pub z: Vec<Vec<Option<f64>>>,
    /// The same once the named effects are simulated.
    pub z_after: Vec<Vec<Option<f64>>>,
}

/// What the abscissa of a trace is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Abscissa {
    /// Angle about the centre of the circle, rad: drawn in polar form.
    Angle,
    /// Position along the line, mm.
    Position,
    /// Time since the begin of the run, s.
    Time,
    /// Number of the touch.
    Touch,
    /// Time since the first touch of the session, min.
    SessionTime,
}

/// One channel of one run, or one surface over all runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trace {
    /// The run; of a surface, the first.
    pub run: u32,
    /// The channel.
    pub channel: String,
    /// E.g. `circle XY R100 F2000 cw`.
    pub title: String,
    /// What `at` is.
    pub abscissa: Abscissa,
    /// Places.
    pub at: Vec<f64>,
    /// Machine minus simulator, as the machine file stands, set-up floated.
    pub before_um: Vec<f64>,
    /// Machine minus simulator with the named effects, set-up floated.
    pub after_um: Vec<f64>,
    /// Standard deviation that noise alone has.
    pub floor_um: f64,
}

/// What can be told from what.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Isolability {
    /// Effects with what they act on, e.g. `backlash X`.
    pub names: Vec<String>,
    /// Cosine between the signatures of two.
    pub cos: Vec<Vec<f64>>,
    /// Sine of the angle to everything that all other effects of other kinds can imitate together.
    pub sin_alone: Vec<f64>,
    /// Smallest size that would be found in 95 of 100 sessions, in the unit of `unit`.
    pub detectable: Vec<f64>,
    /// Amplitude that `detectable` is a value of, e.g. `width_um`.
    pub unit: Vec<String>,
}

/// One held-out run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeldOut {
    /// The run.
    pub run: u32,
    /// E.g. `circle XY R100 F2000 cw`.
    pub title: String,
    /// Root mean square before.
    pub before_um: f64,
    /// Root mean square after.
    pub after_um: f64,
    /// What noise alone would give.
    pub floor_um: f64,
}

/// Something a reader of the report should know.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[expect(missing_docs, reason = "the sentence names each field")]
pub enum Note {
    /// A channel was left out.
    NoRepeats { channel: String },
    /// Readings were left out.
    Dropped { channel: String, readings: usize },
    /// The machine has thermometers, and none was recorded.
    NoTemperatures,
    /// Nothing was repeated: the noise of a log is that of its neighbouring readings.
    NoiseWithin {
        channel: String,
        sigma_um: f64,
        between_um: f64,
        /// Whether nothing at all was repeated.
        lowers: bool,
    },
    /// One log by itself was cut into parts.
    InParts { parts: usize, minutes: f64 },
    /// A log goes with thermometers: how much they explain of runs that they were not fitted to.
    GoesWith { channel: String, found: ThermalFit },
    /// The spindle's growth came out negative: for 10 K (without a thermometer: in the end).
    ShrinksWarming { um: f64, by_thermometer: bool },
    /// A thermometer was silent for longer than usual: the longest time, the runs before and after it, and how often besides.
    Unread {
        thermometer: String,
        hours: f64,
        runs: [u32; 2],
        more: usize,
    },
    /// Of a recording with too many runs only some are diagnosed.
    FewerRuns { runs: usize, of: usize },
    /// The noise of the repeats is not that of the session.
    NotReproduced {
        channel: String,
        inflation: f64,
        /// Whether that keeps every effect from being named; else this channel's readings count for less.
        withdraws: bool,
    },
    /// Too few runs to flip signs.
    FewRuns { runs: usize },
    /// Nothing could be held out.
    NothingHeldOut,
    /// So few runs were held out that each is to be looked at.
    FewHeldOut { runs: usize },
    /// No trials stand behind the confidences yet.
    NotRecalibrated,
    /// What is left is not white.
    NotWhite {
        channel: String,
        blocks: usize,
        of: usize,
    },
    /// An effect was found and is not written to a machine file.
    NotWritten { effect: String, others: Vec<String> },
    /// Sizes of a named effect of which each alone could be nothing.
    OnlyTogether {
        effect: String,
        parameters: Vec<String>,
        d: f64,
    },
    /// What goes with a thermometer that no effect goes with was taken out of a channel.
    ThermalFloat {
        channel: String,
        thermometer: String,
        lag_min: f64,
    },
    /// The lost motion of a named effect is another one at other places: its least and its greatest at the places that were read.
    Varies {
        effect: String,
        from_um: f64,
        to_um: f64,
    },
    /// Something looks like an effect and is not named, for these reasons.
    OnlyLooksLike { effect: String, why: Vec<Veto> },
    /// What changed over the session, or is left beside a name.
    Course(Course),
    /// Of what is left open nothing is proposed.
    NoRun(NoRun),
}

fn worse_noise(
    f: &mut fmt::Formatter<'_>,
    channel: &str,
    inflation: f64,
    withdraws: bool,
) -> fmt::Result {
    let then = if withdraws {
        "nothing is named"
    } else {
        "its readings count for so much less"
    };
    write!(
        f,
        "{channel}: noise floor not reproduced by the session, its variance is {inflation:.2} times that of the repeats; \
         {then}"
    )
}

fn unread(
    f: &mut fmt::Formatter<'_>,
    thermometer: &str,
    hours: f64,
    [before, after]: [u32; 2],
    more: usize,
) -> fmt::Result {
    let place = if before == after {
        format!("in run {before}")
    } else {
        format!("between run {before} and run {after}")
    };
    let besides = match more {
        0 => String::new(),
        1 => ", and once more for less".to_owned(),
        times => format!(", and {times} times more for as long or less"),
    };
    write!(
        f,
        "thermometer {thermometer} was not read for {hours:.1} h {place}{besides}: its temperature is taken to go evenly \
         there; what lags it by less than a fifth of a pause of the whole recording is taken to be settled at its end"
    )
}

fn no_repeats(f: &mut fmt::Formatter<'_>, channel: &str) -> fmt::Result {
    write!(
        f,
        "{channel}: left out, no test was repeated on it; run one of its tests three times"
    )
}

fn by_thermometers(f: &mut fmt::Formatter<'_>, channel: &str, found: &ThermalFit) -> fmt::Result {
    let term = |one: &GoesWith| {
        let lag = if one.lag_min > 0.0 {
            format!("lagged by {:.1} min", one.lag_min)
        } else {
            "without a lag".to_owned()
        };
        let size = one.um_per_k.abs();
        let error = one.standard_error_um_per_k;
        let decimals = decimals_of(if error > 0.0 { error } else { 0.1 * size });
        format!(
            "{} {lag}, {:.decimals$} µm/K",
            one.thermometer, one.um_per_k
        )
    };
    let percent = |share: f64| 100.0 * share.max(0.0);
    let terms: Vec<String> = found.by.iter().map(term).collect();
    let alone = found.alone.iter();
    let alone = alone.map(|(id, share)| format!("{id} {:.1} %", percent(*share)));
    let alone: Vec<String> = alone.collect();
    write!(
        f,
        "{channel} goes with {}: on runs or parts of runs that were left out that explains {:.1} % (the best alone: {})",
        terms.join(", and with "),
        percent(found.share),
        alone.join(", ")
    )
}

fn noise_within(
    f: &mut fmt::Formatter<'_>,
    channel: &str,
    [sigma_um, between_um]: [f64; 2],
    lowers: bool,
) -> fmt::Result {
    let then = if lowers {
        ", and confidences are lower"
    } else {
        ""
    };
    write!(
        f,
        "{channel}: no test was repeated on it, so its noise is that within a run, {sigma_um:.2} µm; by how much a second \
         run would differ was not seen, {between_um:.2} µm is taken{then}: record the same again, three times in all"
    )
}

fn in_parts(f: &mut fmt::Formatter<'_>, parts: usize, minutes: f64) -> fmt::Result {
    write!(
        f,
        "one log: it is divided into {parts} runs of {minutes:.1} min, its parts, of which the last third is held out"
    )
}

fn few_runs(f: &mut fmt::Formatter<'_>, runs: usize) -> fmt::Result {
    write!(
        f,
        "{runs} runs are too few to flip signs; significance is from a parametric bootstrap"
    )
}

const NOTHING_HELD_OUT: &str =
    "nothing could be held out: record each test at a second radius, feed or place";

const NO_TEMPERATURES: &str = "no thermometer was recorded: what goes with a temperature cannot be named, and what goes \
    with time may be heat";

fn fewer_runs(f: &mut fmt::Formatter<'_>, runs: usize, of: usize) -> fmt::Result {
    write!(
        f,
        "{runs} of {of} runs are diagnosed, each condition's spread over the recording: all have too many readings"
    )
}

fn only_together(
    f: &mut fmt::Formatter<'_>,
    effect: &str,
    parameters: &[String],
    d: f64,
) -> fmt::Result {
    write!(
        f,
        "{effect}: {} stand for each other in this recording, so that the interval of its size holds 0; D {d:.1} is \
         that of the effect as a whole",
        parameters.join(", ")
    )
}

fn dropped(f: &mut fmt::Formatter<'_>, channel: &str, readings: usize) -> fmt::Result {
    write!(
        f,
        "{channel}: {readings} readings left out as outliers or no numbers"
    )
}

fn not_white(f: &mut fmt::Formatter<'_>, channel: &str, blocks: usize, of: usize) -> fmt::Result {
    write!(
        f,
        "{channel}: what is left is not white in {blocks} of {of} runs"
    )
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoRepeats { channel } => no_repeats(f, channel),
            Self::Dropped { channel, readings } => dropped(f, channel, *readings),
            Self::NoTemperatures => f.write_str(NO_TEMPERATURES),
            Self::NoiseWithin {
                channel,
                sigma_um,
                between_um,
                lowers,
            } => noise_within(f, channel, [*sigma_um, *between_um], *lowers),
            Self::GoesWith { channel, found } => by_thermometers(f, channel, found),
            Self::ShrinksWarming { um, by_thermometer } => shrinks(f, *um, *by_thermometer),
            Self::InParts { parts, minutes } => in_parts(f, *parts, *minutes),
            Self::Unread {
                thermometer,
                hours,
                runs,
                more,
            } => unread(f, thermometer, *hours, *runs, *more),
            Self::FewerRuns { runs, of } => fewer_runs(f, *runs, *of),
            Self::NotReproduced {
                channel,
                inflation,
                withdraws,
            } => worse_noise(f, channel, *inflation, *withdraws),
            Self::FewRuns { runs } => few_runs(f, *runs),
            Self::NothingHeldOut => f.write_str(NOTHING_HELD_OUT),
            Self::FewHeldOut { runs } => write!(
                f,
                "{runs} runs were held out: an interval of so few is rough, look at each"
            ),
            Self::NotRecalibrated => f.write_str(
                "confidences are not recalibrated by trials: read one above 0.9 as \"no rival in the catalogue\"",
            ),
            Self::NotWhite {
                channel,
                blocks,
                of,
            } => not_white(f, channel, *blocks, *of),
            Self::OnlyTogether {
                effect,
                parameters,
                d,
            } => only_together(f, effect, parameters, *d),
            Self::ThermalFloat {
                channel,
                thermometer,
                lag_min,
            } => thermal_float(f, channel, thermometer, *lag_min),
            Self::Varies {
                effect,
                from_um,
                to_um,
            } => varies(f, effect, [*from_um, *to_um]),
            Self::NotWritten { effect, others } => not_written(f, effect, others),
            Self::OnlyLooksLike { effect, why } => only_looks_like(f, effect, why),
            Self::NoRun(none) => none.fmt(f),
            Self::Course(course) => course.fmt(f),
        }
    }
}

fn shrinks(f: &mut fmt::Formatter<'_>, um: f64, by_thermometer: bool) -> fmt::Result {
    let over = if by_thermometer {
        "for 10 K"
    } else {
        "in the end"
    };
    write!(
        f,
        "growth of the spindle is negative ({um:.1} µm {over}): Z shrinks while the spindle warms; check the sign of the \
         gauge, as a nose that comes down reads as negative Z"
    )
}

fn thermal_float(
    f: &mut fmt::Formatter<'_>,
    channel: &str,
    thermometer: &str,
    lag_min: f64,
) -> fmt::Result {
    write!(
        f,
        "{channel}: what goes with {thermometer}, lagged by {lag_min:.1} min, was taken out before causes were searched; no effect of the catalogue goes with this thermometer"
    )
}

fn varies(f: &mut fmt::Formatter<'_>, effect: &str, [from_um, to_um]: [f64; 2]) -> fmt::Result {
    write!(
        f,
        "{effect} varies from {from_um:.1} to {to_um:.1} µm along the axis, at the places that were read"
    )
}

fn not_written(f: &mut fmt::Formatter<'_>, effect: &str, others: &[String]) -> fmt::Result {
    write!(
        f,
        "{effect} is not written to a machine file: {} would do as well on this recording",
        others.join(", ")
    )
}

fn only_looks_like(f: &mut fmt::Formatter<'_>, effect: &str, why: &[Veto]) -> fmt::Result {
    let why: Vec<String> = why.iter().map(Veto::to_string).collect();
    write!(f, "{effect} is not named: {}", why.join("; "))
}
