//! What changes over a session, and what a name leaves, as a reader of the report should know it.

use std::fmt;

use serde::{Deserialize, Serialize};

/// A change, or a rest beside a name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[expect(missing_docs, reason = "the sentence names each field")]
pub enum Course {
    /// A named effect was not there from the begin of the session.
    Begins { effect: String, run: u32 },
    /// A named effect has more than one size: from a run on by a share of it, or growing by a share in an hour.
    NotOneSize {
        effect: String,
        run: Option<u32>,
        share: f64,
    },
    /// Something changed between repeats that no named effect explains, or that is no other than a set-up that moved.
    DoesNotRepeat {
        channel: String,
        #[serde(default)]
        feature: Option<String>,
        size_um: f64,
        runs: [u32; 2],
        of_set_up: bool,
        #[serde(default)]
        evenly: bool,
        chance: f64,
    },
    /// What the named effects leave of the held-out runs.
    Remainder {
        effects: Vec<String>,
        size_um: f64,
        floor_um: f64,
        run: u32,
        worst_um: f64,
    },
}

fn does_not_repeat(
    f: &mut fmt::Formatter<'_>,
    (channel, feature): (&str, Option<&str>),
    size_um: f64,
    [last, first]: [u32; 2],
    (of_set_up, evenly): (bool, bool),
    chance: f64,
) -> fmt::Result {
    let how = if evenly {
        format!("it went on changing evenly, by {size_um:.1} µm from run {last} to run {first}")
    } else {
        format!("it changed by {size_um:.1} µm between run {last} and run {first}")
    };
    let what = if of_set_up {
        "only the place of the set-up changed, or a reference point: look at clamps, holders and returns to the reference"
    } else {
        "no named effect explains it"
    };
    let of = feature
        .map(|feature| format!(" of {feature}"))
        .unwrap_or_default();
    write!(
        f,
        "{channel}{of} does not repeat: {how} (chance in noise {chance:.0e}); {what}"
    )
}

fn not_one_size(
    f: &mut fmt::Formatter<'_>,
    effect: &str,
    run: Option<u32>,
    share: f64,
) -> fmt::Result {
    let percent = 100.0 * share;
    match run {
        Some(run) => write!(
            f,
            "{effect} has not one size: from run {run} on it differs by {percent:+.0} % of the size given"
        ),
        None => write!(
            f,
            "{effect} has not one size: it changes by {percent:+.0} % of the size given in an hour"
        ),
    }
}

impl fmt::Display for Course {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Begins { effect, run } => write!(
                f,
                "{effect} from run {run} on: what is given is its size there beyond that of the runs before"
            ),
            Self::NotOneSize { effect, run, share } => not_one_size(f, effect, *run, *share),
            Self::DoesNotRepeat {
                channel,
                feature,
                size_um,
                runs,
                of_set_up,
                evenly,
                chance,
            } => does_not_repeat(
                f,
                (channel, feature.as_deref()),
                *size_um,
                *runs,
                (*of_set_up, *evenly),
                *chance,
            ),
            Self::Remainder {
                effects,
                size_um,
                floor_um,
                run,
                worst_um,
            } => {
                let what = if effects.is_empty() {
                    "something came after the runs that were fitted: the held-out runs are"
                        .to_owned()
                } else {
                    let named = effects.join(", ");
                    format!(
                        "{named}, and something that this does not explain: the held-out runs are still"
                    )
                };
                write!(
                    f,
                    "{what} off by {size_um:.2} µm rms, noise and form give {floor_um:.2} µm; most in run {run}, {worst_um:.2} µm"
                )
            }
        }
    }
}
