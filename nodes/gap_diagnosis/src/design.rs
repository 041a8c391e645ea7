//! The tests of a programme, chosen for the time that there is, so that effects are found and told apart.
//!
//! # Model
//!
//! A candidate is a test as an ideal machine would record it, with the time that it takes and the set-up that it stands in.
//! Repeated r times it adds to the information on the columns of all effects what it does with noise of 1/r the variance,
//! while the simulator's error of form stays (`information`):
//!
//! ```text
//!   S = sum S_c(r_c)                                                      (1)
//!   d_i = s_i sqrt(S_ii),   a_ij = s_i sqrt(S_ii - S_ij S_jj^-1 S_ji)     (2)
//!   q_i = min(d_i / D_0, min_j a_ij / A_0)                                (3)
//! ```
//!
//! with s the stated size of an effect, D_0 the least D at which a form of so many columns is named and A_0 the distance that
//! decides between two explanations (`next`). The programme of a time has the greatest worst q of the effects that all candidates
//! together would show; of two that are equal in this, the one with more weight above the limit of naming (`search`).
//!
//! ```text
//!   named from = typical max((D_0 + 1.64) / d_i, A_0 / min_j a_ij),   d, a at the typical size   (4)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | q | `separability` | 1 |
//! | named from | `named_from` | of the parameter |
//!
//! # Holds when
//! The noise is what the floors state. Each candidate is a set-up of its own in (1), so what several of one set-up show together is
//! more. Shapes are at their typical values. A cause is sought by the fewest effects: (2) compares pairs.
//!
//! # References
//! \[1\] V. V. Fedorov, Theory of Optimal Experiments, 1972 (exchange).
//! \[2\] A. C. Atkinson, V. V. Fedorov, Biometrika 62, 1975 (designs that discriminate between models).

mod ballbar;
mod forecast;
mod information;
mod search;
mod second_round;
mod separability;

use std::collections::{BTreeMap, BTreeSet};

use machine::MachineFile;
use metrology::check_between;
use nalgebra::DMatrix;
use serde::Serialize;
use twin::effects::{self, Kind, Moment};
use twin::{Channel, Instrument, Session, Twin};

use crate::config::GapConfig;
use crate::diagnose::considered;
use crate::error::GapError;
use crate::preflight::{FLOOR_UM, Floors, WANTED_REPEATS};
use crate::search::signature::Instance;
use information::Own;
use search::{Entry, Field};
use separability::Aim;

pub use ballbar::{Bar, ballbar};
pub use second_round::second_round;

/// Minutes that a result is printed for beside the wanted ones.
pub const LADDER_MIN: [f64; 4] = [10.0, 20.0, 40.0, 80.0];
/// Range of the minutes of a programme.
pub const MINUTES: [f64; 2] = [1.0, 480.0];
/// Most candidates of one design: each is simulated with every effect of the catalogue.
pub const MOST_CANDIDATES: usize = 64;
/// Greatest weight of an effect.
pub const MOST_WEIGHT: f64 = 100.0;
/// Least size of an effect as a share of the greatest.
const LEAST_SHARE: f64 = 1e-9;

/// A test that could be made.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// In words, for people; unique.
    pub title: String,
    /// What an ideal machine would record of it once.
    pub session: Session,
    /// How long it takes once, settling included, min.
    pub minutes: f64,
    /// The set-up that it stands in, a key of [`Order::set_up_min`].
    pub set_up: String,
    /// How often it may be repeated, 1 to [`WANTED_REPEATS`].
    pub most_repeats: usize,
    /// Whether its instrument is at hand; others are named where they would part what stays together.
    pub is_at_hand: bool,
}

/// An effect that is likelier than others, or of another size.
#[derive(Clone, Debug, PartialEq)]
pub struct Likely {
    /// Id in the catalogue.
    pub effect: String,
    /// What it acts on; none: everything that it can act on.
    pub axis: Option<String>,
    /// The size that is to be named, of its first parameter; none: the typical one.
    pub size: Option<f64>,
    /// How much it counts, 0 to [`MOST_WEIGHT`]; others count 1.
    pub weight: f64,
}

/// What a programme is designed for.
#[derive(Clone, Debug)]
pub struct Order<'o> {
    /// The machine, with the instruments that candidates use.
    pub machine: &'o MachineFile,
    /// Noise of the instruments; those without are not read.
    pub floors: &'o Floors,
    /// Time that each set-up takes once, min.
    pub set_up_min: &'o BTreeMap<String, f64>,
    /// Time that there is, set-ups included, min.
    pub minutes: f64,
    /// Effects that count otherwise than the rest.
    pub likely: &'o [Likely],
    /// Settings of the diagnosis.
    pub config: &'o GapConfig,
}

/// A designed programme, and what it will show.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Design {
    /// The programmes by growing minutes, the wanted one among them.
    pub rungs: Vec<Rung>,
    /// The wanted one, a place in `rungs`.
    pub wanted: usize,
    /// Effects in the order of the catalogue.
    pub effects: Vec<Aimed>,
    /// Pairs that stay together in the wanted programme, the most alike first.
    pub together: Vec<Together>,
    /// Effects that the wanted programme does not show at their stated size.
    pub hidden: Vec<Hidden>,
    /// Effects that it shows at their stated size and is not sure to name: below (4), by noise or by another effect.
    pub unsure: Vec<String>,
}

/// The programme of some minutes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Rung {
    /// The time that there was, min.
    pub minutes: f64,
    /// The time that it takes, min.
    pub used_min: f64,
    /// Repeats of each test, by its title; in the order of the candidates.
    pub tests: Vec<(String, usize)>,
    /// Worst separability (3) of the effects that all candidates together would show.
    pub worst: f64,
    /// Effects that would be named at their stated size.
    pub named: usize,
}

/// One effect on one target.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Aimed {
    /// Id in the catalogue.
    pub effect: String,
    /// What it acts on; empty: the machine.
    pub axis: String,
    /// The amplitude that the sizes are values of.
    pub parameter: String,
    /// The stated size.
    pub stated: f64,
    /// How much it counts.
    pub weight: f64,
    /// (4) of each rung; absent where that is beyond what is physical.
    pub named_from: Vec<Option<f64>>,
}

/// Two effects that the wanted programme shows and does not tell apart.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Together {
    /// Their names.
    pub effects: [String; 2],
    /// Cosine between their signatures.
    pub cos: f64,
    /// What would part them.
    pub parted_by: Remedy,
}

/// An effect that the wanted programme does not show at its stated size.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Hidden {
    /// Its name.
    pub effect: String,
    /// What a recording must contain to show it, in words.
    pub needs: String,
    /// What would show it.
    pub shown_by: Remedy,
}

/// A test that would decide, or what else may.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Remedy {
    /// A test with an instrument at hand, and the minutes that it takes with its set-up.
    Test {
        /// Its title.
        title: String,
        /// Minutes with repeats and set-up.
        minutes: f64,
    },
    /// A test with an instrument that is not at hand.
    OtherInstrument {
        /// Its title.
        title: String,
        /// Minutes with repeats and set-up.
        minutes: f64,
    },
    /// No candidate does; what else could be changed.
    Beyond(String),
}

/// Designs the programme of some minutes, and those of [`LADDER_MIN`].
///
/// # Errors
/// For minutes, weights, sizes, effects, candidates or floors out of their range, and a machine that cannot be simulated.
pub fn design(candidates: &[Candidate], order: &Order<'_>) -> Result<Design, GapError> {
    check(candidates, order)?;
    let twin = Twin::new(order.machine)?;
    let kinds = considered(order.config)?;
    let means = kinds.iter().filter(|kind| kind.moment == Moment::Mean);
    let owns = information::columns(Instance::all(order.machine, means));
    let aims = aims(&owns, order)?;
    let grams = candidates
        .iter()
        .map(|candidate| information::of(candidate, &owns, &twin, order))
        .collect::<Result<Vec<_>, _>>()?;
    let field = Field::new(&aims, entries(candidates, grams, order)?);
    let ladder = ladder(order.minutes);
    let programmes = field.climb(&ladder);
    Ok(forecast::forecast(&forecast::Climbed {
        candidates,
        order,
        owns: &owns,
        aims: &aims,
        field: &field,
        minutes: &ladder,
        programmes: &programmes,
    }))
}

/// The minutes that programmes are made for, growing.
fn ladder(wanted_min: f64) -> Vec<f64> {
    let mut all: Vec<f64> = LADDER_MIN.into_iter().chain([wanted_min]).collect();
    all.sort_by(f64::total_cmp);
    all.dedup_by(|next, kept| (*next - *kept).abs() < 1e-9);
    all
}

fn check(candidates: &[Candidate], order: &Order<'_>) -> Result<(), GapError> {
    order.config.check()?;
    within("minutes", order.minutes, MINUTES)?;
    for floor in order.floors.values() {
        within("reading_um", floor.reading_um, FLOOR_UM)?;
        within("between_runs_um", floor.between_runs_um, FLOOR_UM)?;
    }
    for minutes in order.set_up_min.values() {
        within("set_up_min", *minutes, [0.0, 1e4])?;
    }
    count("candidates", candidates.len(), [1, MOST_CANDIDATES])?;
    for candidate in candidates {
        within("candidate_min", candidate.minutes, [1e-3, 1e4])?;
        count("most_repeats", candidate.most_repeats, [1, WANTED_REPEATS])?;
    }
    for one in order.likely {
        if effects::kind(&one.effect).is_none() {
            return Err(GapError::Unknown {
                what: "effect of the catalogue",
                name: one.effect.clone(),
            });
        }
        within("weight", one.weight, [0.0, MOST_WEIGHT])?;
        // Before anything is simulated: it takes a while.
        if let (Some(size), Some(limits)) = (one.size, size_limits(&one.effect)) {
            within("size", size, limits)?;
        }
    }
    Ok(())
}

fn within(name: &'static str, value: f64, [low, high]: [f64; 2]) -> Result<(), GapError> {
    Ok(check_between(name, value, (low, high))?)
}

fn count(key: &'static str, value: usize, [low, high]: [usize; 2]) -> Result<(), GapError> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(GapError::Count {
        key,
        value,
        low,
        high,
    })
}

/// Stated sizes and weights; a later entry of the list goes before an earlier one.
fn aims(owns: &[Own], order: &Order<'_>) -> Result<Vec<Aim>, GapError> {
    let fits = |one: &Likely, own: &Own| {
        one.effect == own.instance.kind.id
            && one
                .axis
                .as_ref()
                .is_none_or(|axis| *axis == own.instance.target.to_string())
    };
    for one in order.likely {
        if !owns.iter().any(|own| fits(one, own)) {
            return Err(GapError::Unknown {
                what: "effect that this machine can have",
                name: format!("{} {}", one.effect, one.axis.as_deref().unwrap_or_default())
                    .trim_end()
                    .to_owned(),
            });
        }
    }
    let aim = |own: &Own| -> Result<Aim, GapError> {
        let likely = order.likely.iter().rev().find(|one| fits(one, own));
        let first = own.first();
        let stated = likely.and_then(|one| one.size).unwrap_or(first.typical);
        let greatest = greatest(own.instance.kind);
        within("size", stated, [LEAST_SHARE * greatest, greatest])?;
        Ok(Aim::new(
            own.columns.clone(),
            stated / first.typical,
            greatest / first.typical,
            likely.map_or(1.0, |one| one.weight),
        ))
    };
    owns.iter().map(aim).collect()
}

/// Least and greatest size of an effect of the catalogue, in the unit of its first amplitude; `None`: there is none of
/// this id.
#[must_use]
pub fn size_limits(effect: &str) -> Option<[f64; 2]> {
    let greatest = greatest(effects::kind(effect)?);
    Some([LEAST_SHARE * greatest, greatest])
}

/// The greatest physical size of a kind's first amplitude.
fn greatest(kind: &Kind) -> f64 {
    information::first(kind).map_or(0.0, |first| first.high.max(-first.low))
}

fn entries(
    candidates: &[Candidate],
    grams: Vec<Vec<DMatrix<f64>>>,
    order: &Order<'_>,
) -> Result<Vec<Entry>, GapError> {
    let set_ups: Vec<(&String, &f64)> = order.set_up_min.iter().collect();
    let entry = |(candidate, grams): (&Candidate, Vec<DMatrix<f64>>)| -> Result<Entry, GapError> {
        let known = set_ups
            .iter()
            .position(|(name, _)| **name == candidate.set_up);
        let set_up = known.ok_or_else(|| GapError::Unknown {
            what: "set-up with a time",
            name: candidate.set_up.clone(),
        })?;
        Ok(Entry {
            grams,
            minutes: candidate.minutes,
            set_up,
            set_up_min: *set_ups[set_up].1,
            channels: repeated(&candidate.session, order.floors),
            is_at_hand: candidate.is_at_hand,
        })
    };
    candidates.iter().zip(grams).map(entry).collect()
}

/// Channels whose noise must come from repeats of a test: encoders are read beside every other instrument.
fn repeated(session: &Session, floors: &Floors) -> BTreeSet<Channel> {
    let readings = session.runs.iter().flat_map(|run| &run.readings);
    let is_own = |channel: &&Channel| {
        let instrument = channel.instrument();
        let is_beside = matches!(
            instrument,
            Instrument::Motor | Instrument::Scale | Instrument::Thermometer
        );
        !is_beside && floors.contains_key(&instrument)
    };
    let own = readings.map(|reading| &reading.channel).filter(is_own);
    own.cloned().collect()
}

#[cfg(test)]
mod tests;
