//! The fewest recordings out of a list that make wanted components estimable.
//!
//! # Model
//!
//! With A the sum of the outer products of a programme's scaled rows and δ = 1e-12 of its trace:
//!
//! ```text
//!   unseen share of unknown j = δ [(A + δ)⁻¹]_jj → (I − X⁺X)_jj                          (1)
//! ```
//!
//! A is a sum over recordings, and (1) one Cholesky factorisation: thousands of programmes can be tried. All
//! sets of one, two, three, .. recordings are tried in turn while they are few enough; the first size that
//! works is the least, and of equal size the one with the smallest greatest uncertainty is taken. Where
//! there are too many, recordings are added one by one, each that which removes most of the unseen share, and
//! those found superfluous are taken out again: a small programme, not proven to be the smallest. The answer is
//! confirmed by the decomposition that `identify` uses.

use machine::Kinematics;
use nalgebra::DMatrix;

use super::{information, planned, preflight_of};
use crate::equations::Equations;
use crate::error::IdentifyError;
use crate::identify::{Identification, IdentifyOptions};
use crate::recording::{Place, Recording};
use crate::spectrum::Visibility;
use crate::unknown::{Unknown, Unknowns};

/// δ of (1), to the trace.
const RIDGE: f64 = 1e-12;
/// Unseen share below which an unknown counts as seen; (1) is exact to the square of the condition times δ.
const SEEN: f64 = 1e-3;

/// How hard to look.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Search {
    /// Programmes that are tried before the search goes on one by one.
    pub programmes: usize,
    /// Standard uncertainty of a station, mm.
    pub station_uncertainty_mm: f64,
}

impl Default for Search {
    fn default() -> Self {
        Self {
            programmes: 4_000,
            station_uncertainty_mm: 1e-4,
        }
    }
}

/// A programme.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// Indices into the list, ascending; empty: nothing wanted can be seen.
    pub recordings: Vec<usize>,
    /// Whether no smaller programme exists.
    pub is_least: bool,
    /// Wanted coefficients that not even the whole list makes estimable.
    pub beyond_the_list: Vec<Unknown>,
    /// What the programme sees; `None` where it is empty.
    pub seen: Option<Identification>,
}

/// Looks for the fewest of `places` with which every coefficient that `wanted` accepts is estimable.
///
/// # Errors
/// As [`preflight`](super::preflight).
pub fn choose(
    kinematics: &Kinematics,
    places: &[Place],
    options: &IdentifyOptions,
    wanted: impl Fn(&Unknown) -> bool,
    search: &Search,
) -> Result<Choice, IdentifyError> {
    choose_beside(kinematics, &[], places, options, wanted, search)
}

/// The same, for what `already` planned recordings do not see; they belong to every programme.
///
/// # Errors
/// As [`preflight`](super::preflight).
pub fn choose_beside(
    kinematics: &Kinematics,
    already: &[Recording],
    places: &[Place],
    options: &IdentifyOptions,
    wanted: impl Fn(&Unknown) -> bool,
    search: &Search,
) -> Result<Choice, IdentifyError> {
    let with = |idx: &[usize]| -> Vec<Recording> {
        let first = already.iter().map(|r| r.run).max().unwrap_or(0) + 1;
        let added = idx.iter().map(|idx| &places[*idx]).zip(first..);
        let added = added.map(|(place, run)| planned(run, place, search.station_uncertainty_mm));
        already.iter().cloned().chain(added).collect()
    };
    let all: Vec<usize> = (0..places.len()).collect();
    let whole = preflight_of(kinematics, &with(&all), options)?;
    let before = if already.is_empty() {
        None
    } else {
        Some(preflight_of(kinematics, already, options)?)
    };
    let is_seen = |seen: &Identification, j: usize| seen.visibility[j] == Visibility::Estimable;
    let asked: Vec<usize> = (0..whole.n_coefficients)
        .filter(|j| wanted(&whole.unknowns[*j]))
        .collect();
    let (goal, beyond): (Vec<usize>, Vec<usize>) =
        asked.into_iter().partition(|j| is_seen(&whole, *j));
    let beyond_the_list = beyond.iter().map(|j| whole.unknowns[*j].clone()).collect();
    let is_done = before
        .as_ref()
        .is_some_and(|before| goal.iter().all(|j| is_seen(before, *j)));
    if goal.is_empty() || is_done {
        return Ok(Choice {
            recordings: Vec::new(),
            is_least: true,
            beyond_the_list,
            seen: before,
        });
    }
    let list = List::new(kinematics, already, places, options, goal);
    let (recordings, is_least) = match list.smallest(search.programmes) {
        Ok(found) => (found, true),
        Err(next_size) => (list.one_by_one(), next_size == 0),
    };
    let seen = preflight_of(kinematics, &with(&recordings), options)?;
    Ok(Choice {
        recordings,
        is_least,
        beyond_the_list,
        seen: Some(seen),
    })
}

/// The information of every recording of a list.
struct List {
    /// Of the recordings that belong to every programme.
    already: DMatrix<f64>,
    grams: Vec<DMatrix<f64>>,
    goal: Vec<usize>,
}

/// How well a programme sees what is wanted.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Score {
    /// Sum of the unseen shares.
    unseen: f64,
    /// Greatest variance of a wanted unknown for unit noise.
    variance: f64,
    is_seen: bool,
}

impl List {
    fn new(
        kinematics: &Kinematics,
        already: &[Recording],
        places: &[Place],
        options: &IdentifyOptions,
        goal: Vec<usize>,
    ) -> Self {
        let numbered = (1..).zip(places);
        let added = numbered.map(|(number, place)| planned(number, place, 1.0));
        let recordings: Vec<Recording> = already.iter().cloned().chain(added).collect();
        let unknowns = Unknowns::of(&options.components, &recordings, &options.nuisances);
        let equations = Equations::new(
            kinematics,
            &options.components,
            &recordings,
            unknowns,
            options.radial_only,
        );
        let p = equations.unknowns.len();
        let mut before = DMatrix::zeros(p, p);
        for idx in 0..already.len() {
            before += information(&equations, idx);
        }
        Self {
            already: before,
            grams: (already.len()..recordings.len())
                .map(|idx| information(&equations, idx))
                .collect(),
            goal,
        }
    }

    /// (1); the columns that the programme does not touch are left out.
    fn score(&self, programme: &[usize]) -> Score {
        let p = self.already.ncols();
        let mut sum = self.already.clone();
        for idx in programme {
            sum += &self.grams[*idx];
        }
        let touched: Vec<usize> = (0..p).filter(|j| sum[(*j, *j)] > 0.0).collect();
        let ridge = RIDGE * sum.trace();
        let part = DMatrix::from_fn(touched.len(), touched.len(), |i, j| {
            sum[(touched[i], touched[j])] + if i == j { ridge } else { 0.0 }
        });
        let inverse = part.cholesky().map(|c| c.inverse());
        let variance_of = |j: &usize| -> Option<f64> {
            let place = touched.iter().position(|t| t == j)?;
            inverse.as_ref().map(|inverse| inverse[(place, place)])
        };
        let mut score = Score {
            unseen: 0.0,
            variance: 0.0,
            is_seen: true,
        };
        for j in &self.goal {
            let variance = variance_of(j).unwrap_or(1.0 / ridge.max(f64::MIN_POSITIVE));
            let unseen = (variance * ridge).min(1.0);
            score.unseen += unseen;
            score.is_seen &= unseen < SEEN;
            score.variance = score.variance.max(variance);
        }
        score
    }

    /// The best of the smallest programmes, or the size at which there were too many to try.
    fn smallest(&self, limit: usize) -> Result<Vec<usize>, usize> {
        let n = self.grams.len();
        let mut tried = 0_usize;
        for size in 1..=n {
            let count = (0..size).fold(1_usize, |c, k| c.saturating_mul(n - k) / (k + 1));
            tried = tried.saturating_add(count);
            if tried > limit {
                return Err(size);
            }
            let mut best: Option<(f64, Vec<usize>)> = None;
            let mut members: Vec<usize> = (0..size).collect();
            loop {
                let score = self.score(&members);
                let better = best
                    .as_ref()
                    .is_none_or(|(variance, _)| score.variance < *variance);
                if score.is_seen && better {
                    best = Some((score.variance, members.clone()));
                }
                if !crate::combination::next_subset(&mut members, n) {
                    break;
                }
            }
            if let Some((_, found)) = best {
                return Ok(found);
            }
        }
        Err(0)
    }

    fn one_by_one(&self) -> Vec<usize> {
        let n = self.grams.len();
        let mut programme: Vec<usize> = Vec::new();
        while programme.len() < n && (programme.is_empty() || !self.score(&programme).is_seen) {
            let with = |idx: usize| {
                let mut longer = programme.clone();
                longer.push(idx);
                self.score(&longer)
            };
            let key = |score: &Score| (score.unseen, score.variance);
            let rest = (0..n).filter(|idx| !programme.contains(idx));
            let best = rest
                .map(|idx| (key(&with(idx)), idx))
                .min_by(|(a, _), (b, _)| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
            let Some((_, idx)) = best else { break };
            programme.push(idx);
        }
        for idx in programme.clone() {
            let shorter: Vec<usize> = programme.iter().copied().filter(|k| *k != idx).collect();
            if !shorter.is_empty() && self.score(&shorter).is_seen {
                programme = shorter;
            }
        }
        programme.sort_unstable();
        programme
    }
}
