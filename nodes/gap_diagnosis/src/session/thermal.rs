//! Which thermometer a log goes with, and with which lag, by what it predicts.
//!
//! # Model
//!
//! ```text
//!   y = o + sum_k a_k L(tau_k) T_k + e                                    (1)
//!   PRESS = sum_f |y_f - X_f b_(f)|^2,   b_(f) from all runs but f        (2)
//!   share = 1 - PRESS / PRESS of o alone                                  (3)
//! ```
//!
//! T_k is the warming of a thermometer, L(tau) a lag of first order (`History::lagged_temperature`). Every thermometer
//! that was read is tried alone, at no lag and at the lags of a grid, then every two of them together at fewer lags, then one
//! beside the best two; the lags of the best set are refined. A larger set is taken where it leaves [`WORTH`] of (2) or
//! less: two bodies that grow against each other show little of either, and the best thermometer alone is then none of the
//! two. Nothing is chosen by its fit: a run (or a part of one log) is always predicted from the others.
//!
//! A body in which heat spreads answers with more than one time. A thermometer is therefore tried with two lags and sizes of one
//! sign, before another thermometer is, and taken so where that leaves [`WORTH_OF_A_LAG`] of (2) or less. Its lag is then their mean,
//! weighed by the sizes, and its size their sum.
//!
//! A thermometer that moved by less than [`moved::LEAST_MOVED`] times its own noise is not tried (`moved`), and no set with a size above
//! [`MOST_UM_PER_K`]: the slow change of a room by 0.1 K has the shape of any warm-up.
//!
//! Sizes are of all runs; their standard errors are those of the jackknife over the runs \[3\], which neighbouring readings that
//! share noise do not make too small; of parts of one or two runs they are rather too small.
//!
//! This finds what goes with what. Whether it is a cause, and which, is for the effects of the catalogue to show.
//!
//! # Holds when
//! Runs are under one zero: that of most of them is looked at. Of one or two runs, thirds of each are left out in turn, of short ones
//! thirds of all rows. Neighbouring runs of one log share slow noise, so
//! that (3) is rather too good than too bad.
//!
//! # References
//! \[1\] D. M. Allen, Technometrics 16, 1974 (PRESS). \[2\] ISO 230-3:2020, clauses 5 and 6. \[3\] R. G. Miller, Biometrika 61,
//! 1974 (jackknife).

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use twin::{Channel, History, Session};

use crate::noise::stack::Stack;
use crate::report::figures::Note;
use crate::search::rows::{Block, count, time_s};
use crate::session::log;

pub(crate) mod moved;
mod sums;

use sums::{Fold, Sums, fold, in_parts, merged};

/// One thermometer of (1).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GoesWith {
    /// Its name in the machine file.
    pub thermometer: String,
    /// Size, µm/K.
    pub um_per_k: f64,
    /// Its standard error, by the sizes without one run each; zero where they are all the same, µm/K.
    #[serde(default)]
    pub standard_error_um_per_k: f64,
    /// Lag, min.
    pub lag_min: f64,
}

/// How much of a channel thermometers explain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ThermalFit {
    /// The best set.
    pub by: Vec<GoesWith>,
    /// (3) of it.
    pub share: f64,
    /// The best two alone, with (3) of each.
    pub alone: Vec<(String, f64)>,
    /// Thermometers that predict hardly worse in the place of one of the set.
    #[serde(default)]
    pub near: Vec<String>,
}

impl ThermalFit {
    /// Thermometers that may move the tip: those of the set, and those that predict hardly worse.
    pub(crate) fn thermometers(&self) -> impl Iterator<Item = &String> {
        self.by.iter().map(|one| &one.thermometer).chain(&self.near)
    }
}

/// Part of (2) that one more thermometer may leave.
const WORTH: f64 = 0.7;
/// Part of (2) that a thermometer leaves which predicts hardly worse in the place of another one.
const NEAR: f64 = 1.5;
/// Part of (2) that a second lag of a thermometer may leave.
const WORTH_OF_A_LAG: f64 = 0.7;
/// Two lags in place of one, over it, before they are refined.
const TWO_FOR_ONE: [[f64; 2]; 4] = [[0.1, 1.3], [0.3, 1.7], [0.5, 3.0], [0.9, 8.0]];
/// The best alone that are tried with two lags.
const MOST_WITH_TWO_LAGS: usize = 3;
/// Lags of two thermometers together, min.
const FEWER_LAGS_MIN: [f64; 8] = [0.0, 5.0, 10.0, 20.0, 40.0, 80.0, 160.0, 320.0];
/// Thermometers that are tried in twos.
const MOST_PAIRED: usize = 12;
/// Rows that are looked at; of more every so many.
const MOST_ROWS: usize = 1200;
/// Least (3) of a reported fit.
const MIN_SHARE_EXPLAINED: f64 = 0.5;
/// Lags that are tried beside none: from this, min, in steps of this factor.
const FIRST_LAG_MIN: f64 = 2.0;
const LAG_STEP: f64 = 1.3;
const TRIED_LAGS: i32 = 21;
/// The longest lag of a machine's body, min.
const MOST_LAG_MIN: f64 = 480.0;
/// The largest shift of a tip that a machine has, µm/K.
pub(crate) const MOST_UM_PER_K: f64 = 50.0;
/// Factors by which a lag is refined.
const REFINED: [f64; 3] = [1.12, 1.05, 1.02];

/// A note for every channel of the logs that goes with thermometers.
pub fn notes(stack: &Stack<'_>) -> Vec<Note> {
    let mut channels = BTreeMap::<&Channel, Vec<&Block>>::new();
    for block in &stack.rows.blocks {
        if log::is_log(&stack.session.runs[block.run]) && log::is_read(&block.channel) {
            channels.entry(&block.channel).or_default().push(block);
        }
    }
    let of = |(channel, blocks): (&Channel, Vec<&Block>)| {
        Some(Note::GoesWith {
            channel: channel.to_string(),
            found: Search::new(stack.session, &stack.raw, &blocks)?.found()?,
        })
    };
    channels.into_iter().filter_map(of).collect()
}

/// The residual of each row, mm, of one channel of logs less what the thermometers predict that it goes with; `None` where it
/// goes with none. Each run is predicted with sizes from the others, where they are left out as a whole.
pub(crate) fn less_heat(session: &Session, raw: &[f64], blocks: &[&Block]) -> Option<Vec<f64>> {
    let search = Search::new(session, raw, blocks)?;
    let best = search.best()?;
    if !best.is_found() {
        return None;
    }
    let sums = search.summed(&best.terms);
    let of_others = |block: &Block| {
        let fold = search.runs.iter().position(|run| *run == block.run)?;
        sums.without(sums.folds.get(fold)?)
    };
    let lagged: Vec<Vec<f64>> = best.terms.iter().map(|term| search.lagged(*term)).collect();
    let mut left = raw.to_vec();
    for block in blocks {
        let run = &session.runs[block.run];
        let sizes = of_others(block).unwrap_or_else(|| best.sizes.clone());
        for (row, mm) in block.rows.iter().zip(&mut left[block.range()]) {
            let at_s = time_s(run, row);
            let warming_k = lagged.iter().map(|lagged| search.history.at(lagged, at_s));
            let heat_um = sizes.iter().skip(1).zip(warming_k).map(|(um, k)| um * k);
            *mm -= 1e-3 * (sizes[0] + heat_um.sum::<f64>());
        }
    }
    Some(left)
}

/// Lagged temperatures that were computed, by thermometer and the bits of the lag.
type Columns<'s> = BTreeMap<(&'s str, u64), Rc<[f64]>>;

/// Readings of one channel under one zero.
struct Search<'s> {
    history: &'s History,
    /// Warming of every thermometer that was read, K.
    warming_k: BTreeMap<&'s str, Vec<f64>>,
    /// Rows of each run: instant, s, and reading, µm.
    folds: Vec<Vec<[f64; 2]>>,
    /// The runs of the folds; none where these are parts of runs.
    runs: Vec<usize>,
    /// What a thermometer with a lag shows at the rows of all runs, K, by the bits of the lag.
    columns: RefCell<Columns<'s>>,
}

/// A thermometer with its lag, s.
type Term<'s> = (&'s str, f64);

/// The best set of thermometers.
struct BestSet<'s> {
    terms: Vec<Term<'s>>,
    /// Of the offset, then of each, µm and µm/K.
    sizes: DVector<f64>,
    /// (2) of the set, and of the offset alone.
    left: f64,
    nothing: f64,
    /// Each thermometer alone with (2), the best first.
    alone: Vec<(f64, Term<'s>)>,
}

impl BestSet<'_> {
    /// (3).
    fn share(&self) -> f64 {
        1.0 - self.left / self.nothing
    }

    /// Whether it explains enough; a log that shows nothing goes with nothing.
    fn is_found(&self) -> bool {
        self.share() >= MIN_SHARE_EXPLAINED
    }
}

impl<'s> Search<'s> {
    /// None of too few runs for a prediction.
    fn new(session: &'s Session, raw: &[f64], blocks: &[&Block]) -> Option<Self> {
        let zero = |block: &Block| {
            let segment = &session.runs[block.run].segment;
            (segment.setup_id, segment.zero_id)
        };
        let mut zeros = BTreeMap::<(u32, u32), Vec<&Block>>::new();
        for block in blocks {
            zeros.entry(zero(block)).or_default().push(*block);
        }
        let most = zeros.into_values().max_by_key(Vec::len)?;
        let every = most.iter().map(|block| block.rows.len()).sum::<usize>() / MOST_ROWS + 1;
        let fold = |block: &&Block| -> Vec<[f64; 2]> {
            let run = &session.runs[block.run];
            let rows = block.rows.iter().zip(&raw[block.range()]);
            rows.step_by(every)
                .map(|(row, mm)| [time_s(run, row), 1e3 * mm])
                .collect()
        };
        let folds = in_parts(most.iter().map(fold).collect())?;
        let history = &session.history;
        let read = history.temperature_degc.iter();
        let moved = read.filter(|(_, degc)| moved::has_moved(degc));
        Some(Self {
            history,
            warming_k: moved
                .filter_map(|(id, _)| Some((id.as_str(), history.warming_k(id)?)))
                .collect(),
            runs: if folds.len() == most.len() {
                most.iter().map(|block| block.run).collect()
            } else {
                vec![]
            },
            folds,
            columns: RefCell::default(),
        })
    }

    /// What a reader is to know of the best set of thermometers; none that explains less than [`MIN_SHARE_EXPLAINED`].
    fn found(&self) -> Option<ThermalFit> {
        let best = self.best()?;
        let errors = self.standard_errors(&best.terms);
        let by = merged(&best.terms, best.sizes.as_slice());
        let of = |((id, size, lag_s), error): ((&str, f64, f64), &f64)| GoesWith {
            thermometer: id.to_owned(),
            um_per_k: size,
            standard_error_um_per_k: *error,
            lag_min: lag_s / 60.0,
        };
        let share = |press: f64| 1.0 - press / best.nothing;
        let named = |(press, (id, _)): &(f64, Term<'s>)| ((*id).to_owned(), share(*press));
        best.is_found().then(|| ThermalFit {
            by: by.into_iter().zip(&errors).map(of).collect(),
            share: best.share(),
            alone: best.alone.iter().take(2).map(named).collect(),
            near: self.near(&best),
        })
    }

    /// Thermometers that leave [`NEAR`] of what the best set leaves or less in the place of one of it.
    fn near(&self, best: &BestSet<'s>) -> Vec<String> {
        let is_other = |id: &&&'s str| best.terms.iter().all(|(own, _)| own != *id);
        let own: BTreeSet<&'s str> = best.terms.iter().map(|(id, _)| *id).collect();
        let replaces = |id: &'s str| {
            own.iter().any(|own| {
                let rest = best.terms.iter().filter(|(known, _)| known != own);
                let rest: Vec<Term<'s>> = rest.copied().collect();
                let Some((press, term)) = self.at_best_lag(id, &rest) else {
                    return false;
                };
                let is_near = |press: f64| press <= NEAR * best.left;
                if is_near(press) {
                    return true;
                }
                // With two lags it may be as good.
                let two = self.with_two_lags([rest, vec![term]].concat());
                self.press(&two).is_some_and(|(press, _)| is_near(press))
            })
        };
        let others = self.warming_k.keys().filter(is_other);
        others
            .filter(|id| replaces(id))
            .map(|id| (*id).to_owned())
            .collect()
    }

    /// The best set of thermometers.
    fn best(&self) -> Option<BestSet<'s>> {
        let nothing = self.press(&[])?.0;
        let mut alone = self.beside(&[]);
        alone.sort_by(|a, b| a.0.total_cmp(&b.0));
        let single = alone
            .iter()
            .take(MOST_WITH_TWO_LAGS)
            .filter_map(|(_, term)| {
                let terms = self.with_two_lags(self.refined(vec![*term]));
                Some((self.press(&terms)?.0, terms))
            });
        let (mut left, mut terms) = single.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let larger = self.best_two(&alone).map(|two| self.refined(two));
        for more in [
            larger.clone(),
            larger.and_then(|two| self.with_one_more(two)),
        ] {
            let Some(more) = more else { continue };
            let more = self.with_two_lags(more);
            let Some((press, _)) = self.press(&more) else {
                continue;
            };
            if press <= WORTH * left {
                (terms, left) = (more, press);
            }
        }
        let sizes = self.press(&terms)?.1;
        Some(BestSet {
            terms,
            sizes,
            left,
            nothing,
            alone,
        })
    }

    /// The best two thermometers together, at fewer lags; of many thermometers those that are best alone.
    fn best_two(&self, alone: &[(f64, Term<'s>)]) -> Option<Vec<Term<'s>>> {
        let ids: Vec<&'s str> = alone
            .iter()
            .take(MOST_PAIRED)
            .map(|(_, (id, _))| *id)
            .collect();
        let mut best: Option<(f64, [Term<'s>; 2])> = None;
        for (place, one) in ids.iter().enumerate() {
            for other in &ids[place + 1..] {
                for lags_min in FEWER_LAGS_MIN
                    .map(|a| FEWER_LAGS_MIN.map(|b| [a, b]))
                    .as_flattened()
                {
                    let two = [(*one, 60.0 * lags_min[0]), (*other, 60.0 * lags_min[1])];
                    let Some((press, _)) = self.press(&two) else {
                        continue;
                    };
                    if best.is_none_or(|(least, _)| press < least) {
                        best = Some((press, two));
                    }
                }
            }
        }
        best.map(|(_, two)| two.to_vec())
    }

    /// Some thermometers with the best one beside them.
    fn with_one_more(&self, terms: Vec<Term<'s>>) -> Option<Vec<Term<'s>>> {
        let tried = self.beside(&terms).into_iter();
        let (_, best) = tried.min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(self.refined([terms, vec![best]].concat()))
    }

    /// Every thermometer that is not among some terms, at the lag that is best beside them, with (2).
    fn beside(&self, terms: &[Term<'s>]) -> Vec<(f64, Term<'s>)> {
        let is_new = |id: &&&'s str| terms.iter().all(|(own, _)| own != *id);
        let new = self.warming_k.keys().filter(is_new);
        new.filter_map(|id| self.at_best_lag(id, terms)).collect()
    }

    /// A thermometer at the lag that is best beside some terms, with (2).
    fn at_best_lag(&self, id: &'s str, terms: &[Term<'s>]) -> Option<(f64, Term<'s>)> {
        let grid = (0..TRIED_LAGS).map(|k| 60.0 * FIRST_LAG_MIN * LAG_STEP.powi(k));
        let tried = std::iter::once(0.0).chain(grid).filter_map(|lag_s| {
            let term = (id, lag_s);
            let (press, _) = self.press(&[terms, &[term]].concat())?;
            Some((press, term))
        });
        tried.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// The terms with each lag in turn at its best.
    fn refined(&self, mut terms: Vec<Term<'s>>) -> Vec<Term<'s>> {
        for _ in 0..2 {
            for place in 0..terms.len() {
                let mut others = terms.clone();
                let (id, _) = others.remove(place);
                if let Some((_, best)) = self.at_best_lag(id, &others) {
                    terms[place] = best;
                }
                for factor in REFINED {
                    self.step(&mut terms, place, factor);
                    self.step(&mut terms, place, 1.0 / factor);
                }
            }
        }
        terms
    }

    /// The terms, those of one lag each, with a second one where it is worth it.
    fn with_two_lags(&self, mut terms: Vec<Term<'s>>) -> Vec<Term<'s>> {
        for place in 0..terms.len() {
            let Some((left, _)) = self.press(&terms) else {
                break;
            };
            let (id, lag_s) = terms[place];
            let lag_s = lag_s.max(60.0 * FIRST_LAG_MIN);
            let tried = TWO_FOR_ONE.iter().filter_map(|factors| {
                let mut two = terms.clone();
                two[place].1 = factors[0] * lag_s;
                two.push((id, (factors[1] * lag_s).min(60.0 * MOST_LAG_MIN)));
                Some((self.press(&two)?.0, two))
            });
            let Some((_, mut two)) = tried.min_by(|a, b| a.0.total_cmp(&b.0)) else {
                continue;
            };
            let last = two.len() - 1;
            for factor in [LAG_STEP, 1.0 / LAG_STEP, REFINED[0], 1.0 / REFINED[0]] {
                self.step(&mut two, place, factor);
                self.step(&mut two, last, factor);
            }
            if self
                .press(&two)
                .is_some_and(|(press, _)| press <= WORTH_OF_A_LAG * left)
            {
                terms = two;
            }
        }
        terms
    }

    /// Multiplies one lag by a factor as long as that helps.
    fn step(&self, terms: &mut Vec<Term<'s>>, place: usize, factor: f64) {
        let press = |terms: &[Term<'s>]| self.press(terms).map_or(f64::INFINITY, |found| found.0);
        for _ in 0..8 {
            let mut moved = terms.clone();
            moved[place].1 *= factor;
            if moved[place].1 > 60.0 * MOST_LAG_MIN
                || press(moved.as_slice()) >= press(terms.as_slice())
            {
                return;
            }
            *terms = moved;
        }
    }

    /// (2) of some terms, and the sizes from all runs: of the offset, then of each; none where they are not determined, or one is
    /// larger than a machine's.
    fn press(&self, terms: &[Term<'s>]) -> Option<(f64, DVector<f64>)> {
        let whole = self.summed(terms);
        let mut press = 0.0;
        for fold in &whole.folds {
            let sizes = whole.without(fold)?;
            let told = sizes.dot(&(&fold.gram * &sizes));
            press += fold.square - 2.0 * sizes.dot(&fold.along) + told;
        }
        let sizes = whole.gram.cholesky()?.solve(&whole.along);
        let is_of_machine = sizes.iter().skip(1).all(|um| um.abs() <= MOST_UM_PER_K);
        let is_of_one_sign = |(place, (id, _)): (usize, &Term<'s>)| {
            let first = terms
                .iter()
                .position(|(known, _)| known == id)
                .unwrap_or(place);
            sizes[1 + first] * sizes[1 + place] >= 0.0
        };
        let is_sound = is_of_machine && terms.iter().enumerate().all(is_of_one_sign);
        (press.is_finite() && is_sound).then_some((press, sizes))
    }

    /// Standard errors of the sizes of each thermometer by the jackknife; zeros where a run cannot be left out.
    fn standard_errors(&self, terms: &[Term<'s>]) -> Vec<f64> {
        let whole = self.summed(terms);
        let all: Option<Vec<DVector<f64>>> =
            whole.folds.iter().map(|fold| whole.without(fold)).collect();
        let all = all.unwrap_or_default();
        let n = count(all.len().max(1));
        let all: Vec<Vec<(&str, f64, f64)>> = { all.iter() }
            .map(|sizes| merged(terms, sizes.as_slice()))
            .collect();
        let error = |k: usize| {
            let sizes = || all.iter().map(|all| all[k].1);
            let mean = sizes().sum::<f64>() / n;
            let squares: f64 = sizes().map(|size| (size - mean).powi(2)).sum();
            ((n - 1.0) / n * squares).sqrt()
        };
        (0..merged(terms, &[]).len()).map(error).collect()
    }

    /// Sums of some terms, of each run and of all.
    fn summed(&self, terms: &[Term<'s>]) -> Sums {
        let series: Vec<Rc<[f64]>> = terms.iter().map(|term| self.column(*term)).collect();
        let mut first = 0;
        let mut folds = Vec::<Fold>::with_capacity(self.folds.len());
        for rows in &self.folds {
            folds.push(fold(rows, first, &series));
            first += rows.len();
        }
        let columns = terms.len() + 1;
        let mut gram = DMatrix::<f64>::zeros(columns, columns);
        let mut along = DVector::<f64>::zeros(columns);
        for fold in &folds {
            gram += &fold.gram;
            along += &fold.along;
        }
        Sums { folds, gram, along }
    }

    /// What a thermometer with a lag shows over the whole history, K.
    fn lagged(&self, (id, lag_s): Term<'s>) -> Vec<f64> {
        let warming_k = self.warming_k.get(id).map_or(&[][..], Vec::as_slice);
        if lag_s > 0.0 {
            self.history.lagged_temperature(warming_k, lag_s)
        } else {
            warming_k.to_vec()
        }
    }

    /// What a thermometer with a lag shows at the rows of all runs, K.
    fn column(&self, (id, lag_s): Term<'s>) -> Rc<[f64]> {
        let key = (id, lag_s.to_bits());
        if let Some(known) = self.columns.borrow().get(&key) {
            return Rc::clone(known);
        }
        let lagged = self.lagged((id, lag_s));
        let rows = self.folds.iter().flatten();
        let column: Rc<[f64]> = rows
            .map(|[at_s, _]| self.history.at(&lagged, *at_s))
            .collect();
        let _ = self.columns.borrow_mut().insert(key, Rc::clone(&column));
        column
    }
}
