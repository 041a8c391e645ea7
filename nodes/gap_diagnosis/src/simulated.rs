//! Another simulator in the place of the twin's nominal prediction.
//!
//! # Model
//!
//! A run of the recording and one of the simulator that are the same test are compared at equal places of the commanded
//! path, never at equal times. With y what an instrument read beyond its command, and n what the twin predicts with the
//! effects of the machine file:
//!
//! ```text
//!   y'(p) = y_real(p) - y_sim(p) + n(p)                                    (1)
//! ```
//!
//! `diagnose` takes n from y' as from every reading, so that y_real - y_sim is diagnosed. Signatures and shrink are the
//! twin's, added to that.
//!
//! `runs` says which run is matched with which, `places` where on its path a reading lies. What has no match is left out
//! and counted with its reason.
//!
//! Zeros and set-ups float in both: where the simulator has several within one of the recording, each pair of them is one
//! of its own.
//!
//! # Holds when
//! Effects add up, so that the twin's signature of one does not depend on which simulator it is added to.

use std::collections::BTreeMap;
use std::fmt;

use machine::MachineFile;
use metrology::sample::TestSegment;
use serde::{Deserialize, Serialize};
use twin::effects::{self, Effect};
use twin::{Reading, Run, Session, Twin, TwinError, simulate};

use crate::search::nuisance::plane_name;

mod places;
mod runs;

/// Fewest readings with a match that are diagnosed.
pub const FEWEST_READINGS: usize = 12;

/// How many were matched, of how many.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Share {
    /// Matched.
    pub matched: usize,
    /// All of the recording.
    pub of: usize,
}

/// What of a recording a simulator was matched with.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Matched {
    /// Runs; one counts where any of its readings has a match.
    pub runs: Share,
    /// Readings of all channels.
    pub readings: Share,
    /// Runs without a repeat of their own in the simulator: its last run of the test stands in.
    pub stood_in: usize,
    /// What was left out, by reason and channel.
    pub unmatched: Vec<Unmatched>,
}

/// What was left out for one reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Unmatched {
    /// Why.
    pub reason: Reason,
    /// Channel, e.g. `radial`; empty for whole runs.
    pub channel: String,
    /// Whole runs.
    pub runs: usize,
    /// Readings, those of whole runs included.
    pub readings: usize,
}

/// Why something of the recording has no match, that which lacks most first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// No test of this kind, plane and axes.
    Kind,
    /// The test elsewhere, of another size, or with another stylus.
    Place,
    /// The test at another feed.
    Feed,
    /// The test in the other sense.
    Sense,
    /// No such channel.
    Channel,
    /// The path of the simulator's run does not pass there, or was not read there.
    OffPath,
    /// The readings about it are too far apart.
    Hole,
    /// The readings about it are of other directions of motion.
    Direction,
    /// No such touch.
    Touch,
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Kind => "the simulator has no test of this kind, plane and axes",
            Self::Place => {
                "the simulator has the test only elsewhere, of another size or with another stylus"
            }
            Self::Feed => "the simulator has the test only at another feed",
            Self::Sense => "the simulator has the test only in the other sense",
            Self::Channel => "the simulator does not read this channel",
            Self::OffPath => "the simulator's run has no reading at this place of the path",
            Self::Hole => "the simulator's readings are too far apart there",
            Self::Direction => {
                "the simulator turns round between its readings there, or passes in the other direction only"
            }
            Self::Touch => "the simulator has no such touch",
        })
    }
}

impl fmt::Display for Unmatched {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            reason,
            channel,
            runs,
            readings,
        } = self;
        match (runs, channel.as_str()) {
            (0, channel) => write!(f, "{readings} readings of {channel}: {reason}"),
            (1, _) => write!(f, "1 run: {reason}"),
            (runs, _) => write!(f, "{runs} runs: {reason}"),
        }
    }
}

/// Why a recording cannot be compared with a simulator.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the message names each field")]
pub enum SimulatedError {
    /// Not one kind of test in common.
    #[error(
        "the simulator's tests are {found}, those of the recording {wanted}: none is of the same kind, plane and axes; \
         simulate the tests that were recorded"
    )]
    OtherKinds { found: String, wanted: String },
    /// Not one run in common.
    #[error(
        "none of the recording's {runs} runs is among the simulator's ({why}): simulate the tests that were recorded, \
         at their places and feeds and in their senses"
    )]
    NoRun { runs: usize, why: String },
    /// Hardly a reading in common.
    #[error(
        "{matched} of {of} readings can be compared with the simulator's, at least {least} are needed ({why}): \
         let the simulator write readings along the whole path of each test",
        least = FEWEST_READINGS
    )]
    TooFew {
        matched: usize,
        of: usize,
        why: String,
    },
    /// The session or the machine file cannot be simulated.
    #[error(transparent)]
    Twin(#[from] TwinError),
}

/// The recording with the simulator in the place of the twin's nominal prediction, (1), and what was matched.
///
/// # Errors
/// [`SimulatedError::OtherKinds`] and [`SimulatedError::NoRun`] where no run is in both, [`SimulatedError::TooFew`] where
/// fewer than [`FEWEST_READINGS`] readings are, [`SimulatedError::Twin`] for what the twin cannot simulate.
pub fn beside(
    machine: &MachineFile,
    real: &Session,
    simulated: &Session,
) -> Result<(Session, Matched), SimulatedError> {
    simulate::check(real)?;
    simulate::check(simulated)?;
    let twin = Twin::new(machine)?;
    let known = effects::known(machine)?;
    let known: Vec<&dyn Effect> = known.iter().map(|effect| &**effect).collect();
    let mut tally = Tally::default();
    let mut mountings = Mountings::new(real);
    let mut kept = vec![];
    for (run, pair) in real.runs.iter().zip(runs::pairs(real, simulated)) {
        if run.readings.is_empty() {
            continue;
        }
        let pair = match pair {
            Ok(pair) => pair,
            Err(reason) => {
                tally.whole_run(run, reason);
                continue;
            }
        };
        let other = &simulated.runs[pair.run];
        let readings = tally.matched(run, &places::values(run, other, pair.moving));
        if readings.is_empty() {
            continue;
        }
        tally.matched.stood_in += usize::from(pair.stands_in);
        let mut beside = Run {
            segment: mountings.of(&run.segment, &other.segment),
            motion: run.motion.clone(),
            touches: run.touches.clone(),
            readings,
        };
        let nominal = twin.predict(real, &beside, &known);
        for (reading, nominal) in beside.readings.iter_mut().zip(nominal) {
            reading.deviation += nominal; // (1)
        }
        kept.push(beside);
    }
    let matched = tally.finish(real, simulated)?;
    let session = Session {
        history: real.history.clone(),
        runs: kept,
        first_bag_ends: real.first_bag_ends,
    };
    Ok((session, matched))
}

/// What is counted while runs are matched.
#[derive(Default)]
struct Tally {
    matched: Matched,
    /// Runs and readings by reason and channel.
    lost: BTreeMap<(Reason, String), [usize; 2]>,
}

impl Tally {
    fn whole_run(&mut self, run: &Run, reason: Reason) {
        self.matched.runs.of += 1;
        self.matched.readings.of += run.readings.len();
        let [runs, readings] = self.lost.entry((reason, String::new())).or_default();
        *runs += 1;
        *readings += run.readings.len();
    }

    /// The readings with a match, less that; `values` has one entry a reading.
    fn matched(&mut self, run: &Run, values: &[Result<f64, Reason>]) -> Vec<Reading> {
        let mut kept = vec![];
        for (reading, value) in run.readings.iter().zip(values) {
            match value {
                Ok(simulated) => kept.push(Reading {
                    deviation: reading.deviation - simulated,
                    ..reading.clone()
                }),
                Err(reason) => {
                    let key = (*reason, reading.channel.to_string());
                    self.lost.entry(key).or_default()[1] += 1;
                }
            }
        }
        self.matched.runs.of += 1;
        self.matched.runs.matched += usize::from(!kept.is_empty());
        self.matched.readings.of += run.readings.len();
        self.matched.readings.matched += kept.len();
        kept
    }

    fn finish(self, real: &Session, simulated: &Session) -> Result<Matched, SimulatedError> {
        let unmatched = self.lost.into_iter();
        let unmatched = unmatched.map(|((reason, channel), [runs, readings])| Unmatched {
            reason,
            channel,
            runs,
            readings,
        });
        let matched = Matched {
            unmatched: unmatched.collect(),
            ..self.matched
        };
        let whole = matched.unmatched.iter().filter(|lost| lost.runs > 0);
        let lost_runs: usize = whole.clone().map(|lost| lost.runs).sum();
        let why = || {
            let all: Vec<String> = matched.unmatched.iter().map(ToString::to_string).collect();
            all.join("; ")
        };
        let Share { matched: n, of } = matched.readings;
        if lost_runs == matched.runs.of {
            let mut reasons = whole.map(|lost| lost.reason);
            if reasons.all(|reason| reason == Reason::Kind) {
                return Err(SimulatedError::OtherKinds {
                    found: kinds(simulated),
                    wanted: kinds(real),
                });
            }
            return Err(SimulatedError::NoRun {
                runs: matched.runs.of,
                why: why(),
            });
        }
        if n < FEWEST_READINGS {
            return Err(SimulatedError::TooFew {
                matched: n,
                of,
                why: why(),
            });
        }
        Ok(matched)
    }
}

/// Kinds, planes and axes of the tests of a session.
fn kinds(session: &Session) -> String {
    let name = |run: &Run| {
        let kind = format!("{:?}", run.segment.kind).to_lowercase();
        let axes: String = runs::moving(run).iter().map(|axis| axis.letter()).collect();
        let plane = plane_name(run.segment.plane);
        let of = if plane.is_empty() {
            axes.as_str()
        } else {
            plane
        };
        format!("{kind} {of}").trim_end().to_owned()
    };
    let mut all: Vec<String> = session.runs.iter().map(name).collect();
    all.sort();
    all.dedup();
    all.join(", ")
}

/// Set-ups and zeros of both recordings together; those of the recording where the simulator has one in each.
struct Mountings {
    setups: Ids,
    zeros: Ids,
}

impl Mountings {
    fn new(real: &Session) -> Self {
        let greatest = |of: fn(&TestSegment) -> u32| {
            let all = real.runs.iter().map(|run| of(&run.segment));
            all.max().unwrap_or(0)
        };
        Self {
            setups: Ids::after(greatest(|segment| segment.setup_id)),
            zeros: Ids::after(greatest(|segment| segment.zero_id)),
        }
    }

    fn of(&mut self, real: &TestSegment, simulated: &TestSegment) -> TestSegment {
        TestSegment {
            setup_id: self.setups.of(real.setup_id, simulated.setup_id),
            zero_id: self.zeros.of(real.zero_id, simulated.zero_id),
            ..real.clone()
        }
    }
}

/// A number for each pair of numbers.
struct Ids {
    known: BTreeMap<(u32, u32), u32>,
    greatest: u32,
}

impl Ids {
    fn after(greatest: u32) -> Self {
        Self {
            known: BTreeMap::new(),
            greatest,
        }
    }

    fn of(&mut self, real: u32, simulated: u32) -> u32 {
        if let Some(id) = self.known.get(&(real, simulated)) {
            return *id;
        }
        let is_first = self.known.keys().all(|(known, _)| *known != real);
        let id = if is_first {
            real
        } else {
            self.greatest = self.greatest.saturating_add(1);
            self.greatest
        };
        self.known.insert((real, simulated), id);
        id
    }
}
