//! The search for a programme: greedy start, then exchange, within a number of evaluations.
//!
//! Programmes are made for growing minutes. Each begins where the one before it ended, and with nothing; the better of the two is
//! improved by exchange: a test is taken out and another put in, or a whole set-up is left out and its time given to others.
//! A programme of more minutes is never worse, since that of fewer is among its beginnings and a test only adds.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::DMatrix;
use twin::Channel;

use super::separability::{Aim, Score, shown};
use crate::preflight::WANTED_REPEATS;

/// Most programmes that are judged for one time.
const MOST_EVALUATIONS: usize = 2400;
/// Least gain of a test that is worth a minute.
const LEAST_GAIN: f64 = 1e-6;

/// A candidate, as the search knows it.
pub struct Entry {
    /// Information that 1, 2, ... repeats add.
    pub grams: Vec<DMatrix<f64>>,
    /// Time of one repeat, min.
    pub minutes: f64,
    /// Its set-up.
    pub set_up: usize,
    /// Time of the set-up, min.
    pub set_up_min: f64,
    /// Channels that some test of a programme has to repeat.
    pub channels: BTreeSet<Channel>,
    /// Whether it may be chosen.
    pub is_at_hand: bool,
}

/// Repeats of each candidate with what they add up to.
#[derive(Clone, Debug)]
pub struct Programme {
    /// By candidate.
    pub repeats: Vec<usize>,
    /// Information.
    pub gram: DMatrix<f64>,
    /// What it is worth.
    pub score: Score,
}

/// Candidates and aims.
pub struct Field<'f> {
    aims: &'f [Aim],
    /// The candidates.
    pub entries: Vec<Entry>,
    /// Effects that all candidates at hand together would name at their stated size.
    pub reachable: Vec<bool>,
}

/// Programmes that may still be judged.
struct Purse(usize);

impl Purse {
    fn take(&mut self) -> bool {
        let is_left = self.0 > 0;
        self.0 = self.0.saturating_sub(1);
        is_left
    }
}

impl<'f> Field<'f> {
    /// The field of some candidates.
    pub fn new(aims: &'f [Aim], entries: Vec<Entry>) -> Self {
        let n = aims.last().map_or(0, |aim| aim.columns.end);
        let at_hand = entries.iter().filter(|entry| entry.is_at_hand);
        let whole = at_hand
            .filter_map(|entry| entry.grams.last())
            .fold(DMatrix::zeros(n, n), |sum, gram| sum + gram);
        let found = shown(&whole, aims);
        let reachable = found
            .iter()
            .zip(aims)
            .map(|(shown, aim)| shown.separability(aim) >= 1.0)
            .collect();
        Self {
            aims,
            entries,
            reachable,
        }
    }

    /// A programme without a test.
    fn empty(&self) -> Programme {
        let n = self.aims.last().map_or(0, |aim| aim.columns.end);
        let gram = DMatrix::zeros(n, n);
        Programme {
            repeats: vec![0; self.entries.len()],
            score: Score::of(&gram, self.aims, &self.reachable),
            gram,
        }
    }

    /// Time that some repeats take, set-ups included, min.
    pub fn minutes(&self, repeats: &[usize]) -> f64 {
        let mut set_ups = BTreeMap::<usize, f64>::new();
        let mut tests = 0.0;
        for (entry, repeats) in self.entries.iter().zip(repeats) {
            if *repeats > 0 {
                let _ = set_ups.insert(entry.set_up, entry.set_up_min);
                tests += entry.minutes * crate::search::rows::count(*repeats);
            }
        }
        tests + set_ups.values().sum::<f64>()
    }

    /// Whether every channel has a test that is repeated as often as a noise floor wants.
    fn is_repeated(&self, repeats: &[usize]) -> bool {
        let used = || self.entries.iter().zip(repeats).filter(|(_, n)| **n > 0);
        let is_whole = |(entry, n): &(&Entry, &usize)| **n >= WANTED_REPEATS.min(entry.grams.len());
        let whole: BTreeSet<&Channel> = used()
            .filter(is_whole)
            .flat_map(|(entry, _)| &entry.channels)
            .collect();
        used().all(|(entry, _)| entry.channels.iter().all(|channel| whole.contains(channel)))
    }

    /// Whether some repeats can be made within a time.
    fn is_feasible(&self, repeats: &[usize], budget_min: f64) -> bool {
        self.minutes(repeats) <= budget_min + 1e-9 && self.is_repeated(repeats)
    }

    fn programme(&self, repeats: Vec<usize>, gram: DMatrix<f64>) -> Programme {
        Programme {
            score: Score::of(&gram, self.aims, &self.reachable),
            repeats,
            gram,
        }
    }

    /// A programme with other repeats of one candidate.
    fn changed(&self, from: &Programme, place: usize, to: usize) -> (Vec<usize>, DMatrix<f64>) {
        let mut repeats = from.repeats.clone();
        let mut gram = from.gram.clone();
        let grams = &self.entries[place].grams;
        if let Some(before) = repeats[place].checked_sub(1) {
            gram -= &grams[before];
        }
        if let Some(after) = to.checked_sub(1) {
            gram += &grams[after];
        }
        repeats[place] = to;
        (repeats, gram)
    }

    /// The fewest further repeats of a candidate that can be made.
    fn next_repeats(&self, from: &Programme, place: usize, budget_min: f64) -> Option<usize> {
        let entry = &self.entries[place];
        if !entry.is_at_hand {
            return None;
        }
        let mut repeats = from.repeats.clone();
        let mut more = from.repeats[place] + 1..=entry.grams.len();
        more.find(|n| {
            repeats[place] = *n;
            self.is_feasible(&repeats, budget_min)
        })
    }

    /// Adds the test that gains most per minute, until none gains or fits.
    fn grow(&self, mut programme: Programme, budget_min: f64, purse: &mut Purse) -> Programme {
        loop {
            let before_min = self.minutes(&programme.repeats);
            let mut best: Option<(f64, Programme)> = None;
            for place in 0..self.entries.len() {
                let Some(to) = self.next_repeats(&programme, place, budget_min) else {
                    continue;
                };
                if !purse.take() {
                    return best.map_or(programme, |(_, found)| found);
                }
                let (repeats, gram) = self.changed(&programme, place, to);
                let took_min = (self.minutes(&repeats) - before_min).max(1e-3);
                let found = self.programme(repeats, gram);
                let gain = (found.score.sum - programme.score.sum) / took_min;
                let is_best = best.as_ref().is_none_or(|(most, _)| gain > *most);
                if gain > LEAST_GAIN && is_best && !programme.score.is_above(&found.score) {
                    best = Some((gain, found));
                }
            }
            match best {
                Some((_, found)) => programme = found,
                None => return programme,
            }
        }
    }

    /// The first change that makes it better: one test for another, or a set-up left out.
    fn exchanged(&self, from: &Programme, budget_min: f64, purse: &mut Purse) -> Option<Programme> {
        for out in (0..self.entries.len()).filter(|place| from.repeats[*place] > 0) {
            for fewer in (0..from.repeats[out]).rev() {
                let (repeats, gram) = self.changed(from, out, fewer);
                let without = Programme {
                    repeats,
                    gram,
                    score: from.score,
                };
                for place in (0..self.entries.len()).filter(|place| *place != out) {
                    let Some(to) = self.next_repeats(&without, place, budget_min) else {
                        continue;
                    };
                    if !purse.take() {
                        return None;
                    }
                    let (repeats, gram) = self.changed(&without, place, to);
                    let found = self.programme(repeats, gram);
                    if found.score.is_above(&from.score) {
                        return Some(found);
                    }
                }
            }
        }
        None
    }

    /// The programme without one set-up, grown again.
    fn without_set_up(
        &self,
        from: &Programme,
        budget_min: f64,
        purse: &mut Purse,
    ) -> Option<Programme> {
        let used = self.entries.iter().zip(&from.repeats);
        let set_ups: BTreeSet<usize> = used
            .filter(|(_, n)| **n > 0)
            .map(|(entry, _)| entry.set_up)
            .collect();
        for set_up in set_ups {
            let mut rest = from.clone();
            for place in 0..self.entries.len() {
                if self.entries[place].set_up == set_up {
                    (rest.repeats, rest.gram) = self.changed(&rest, place, 0);
                }
            }
            if !self.is_repeated(&rest.repeats) {
                continue;
            }
            let rest = self.programme(rest.repeats, rest.gram);
            let found = self.grow(rest, budget_min, purse);
            if found.score.is_above(&from.score) {
                return Some(found);
            }
        }
        None
    }

    /// The programme of a time, beginning with that of less.
    fn solve(&self, before: &Programme, budget_min: f64) -> Programme {
        let mut purse = Purse(MOST_EVALUATIONS);
        let mut best = self.grow(before.clone(), budget_min, &mut purse);
        let anew = self.grow(self.empty(), budget_min, &mut purse);
        if anew.score.is_above(&best.score) {
            best = anew;
        }
        while let Some(found) = self
            .without_set_up(&best, budget_min, &mut purse)
            .or_else(|| self.exchanged(&best, budget_min, &mut purse))
        {
            best = self.grow(found, budget_min, &mut purse);
        }
        best
    }

    /// The programmes of growing minutes.
    pub fn climb(&self, minutes: &[f64]) -> Vec<Programme> {
        let mut before = self.empty();
        let mut all = Vec::new();
        for budget_min in minutes {
            before = self.solve(&before, *budget_min);
            all.push(before.clone());
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use twin::Channel;

    use super::*;

    /// Three effects; each test shows some of them, a set-up is shared by two tests.
    fn field(aims: &[Aim]) -> Field<'_> {
        let entry = |diagonal: [f64; 3], minutes, set_up, channel| Entry {
            grams: (1..=3)
                .map(|n| {
                    DMatrix::from_diagonal(&nalgebra::DVector::from_row_slice(&diagonal))
                        * f64::from(n)
                })
                .collect(),
            minutes,
            set_up,
            set_up_min: 3.0,
            channels: [channel].into(),
            is_at_hand: true,
        };
        let entries = vec![
            entry([60.0, 0.0, 0.0], 1.0, 0, Channel::GridU),
            entry([10.0, 50.0, 0.0], 1.5, 0, Channel::GridU),
            entry([0.0, 0.0, 90.0], 0.5, 1, Channel::Touch),
            entry([20.0, 20.0, 20.0], 4.0, 2, Channel::Radial),
        ];
        Field::new(aims, entries)
    }

    fn aims() -> Vec<Aim> {
        (0..3).map(|k| Aim::new(k..k + 1, 1.0, 10.0, 1.0)).collect()
    }

    #[test]
    fn prop_more_minutes_are_never_worse_and_the_same_minutes_give_the_same() {
        let aims = aims();
        let field = field(&aims);
        let minutes = [2.0, 5.0, 7.0, 10.0, 14.0, 20.0, 40.0, 80.0];
        let found = field.climb(&minutes);
        for (pair, budget) in found.windows(2).zip(minutes.windows(2)) {
            assert!(pair[1].score.worst >= pair[0].score.worst, "{budget:?}");
        }
        for (programme, budget_min) in found.iter().zip(minutes) {
            assert!(field.minutes(&programme.repeats) <= budget_min + 1e-9);
            assert!(field.is_repeated(&programme.repeats));
        }
        let again = field.climb(&minutes);
        let repeats = |all: &[Programme]| -> Vec<Vec<usize>> {
            all.iter().map(|one| one.repeats.clone()).collect()
        };
        assert_eq!(repeats(&found), repeats(&again));
        assert!(found[7].score.worst > 1.0, "{:?}", found[7].score);
    }

    #[test]
    fn a_channel_is_read_only_where_one_of_its_tests_is_repeated_three_times() {
        let aims = aims();
        let field = field(&aims);
        assert!(!field.is_repeated(&[2, 2, 0, 0]));
        assert!(field.is_repeated(&[1, 3, 0, 0]));
        // 3 min of set-up and three repeats of 0.5 min are the least that can be done at all.
        assert!(field.climb(&[4.4])[0].repeats.iter().all(|n| *n == 0));
        assert_eq!(field.climb(&[4.5])[0].repeats, [0, 0, 3, 0]);
    }
}
