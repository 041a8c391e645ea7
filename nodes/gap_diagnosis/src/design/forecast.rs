//! What designed programmes will show, what stays together in the wanted one, and what would part or show it.

use nalgebra::DMatrix;

use super::information::Own;
use super::search::{Entry, Field, Programme};
use super::separability::{self, Aim, Shown, between, cos, is_named, named, parted, shown};
use super::{Aimed, Candidate, Design, Hidden, Order, Remedy, Rung, Together};
use crate::next::lever;
use crate::search::rows::count;

/// Everything that a forecast is made of.
pub struct Climbed<'c> {
    /// The candidates.
    pub candidates: &'c [Candidate],
    /// What was wanted.
    pub order: &'c Order<'c>,
    /// Effects with their columns.
    pub owns: &'c [Own],
    /// The same with sizes and weights.
    pub aims: &'c [Aim],
    /// The candidates' information.
    pub field: &'c Field<'c>,
    /// Minutes, growing.
    pub minutes: &'c [f64],
    /// The programmes of these minutes.
    pub programmes: &'c [Programme],
}

/// The whole answer.
pub fn forecast(climbed: &Climbed<'_>) -> Design {
    let found: Vec<Vec<Shown>> = climbed
        .programmes
        .iter()
        .map(|programme| shown(&programme.gram, climbed.aims))
        .collect();
    let is_wanted = |minutes: &&f64| (**minutes - climbed.order.minutes).abs() < 1e-9;
    let wanted = climbed.minutes.iter().take_while(|m| !is_wanted(m)).count();
    let (together, hidden, unsure) = match (climbed.programmes.get(wanted), found.get(wanted)) {
        (Some(programme), Some(shown)) => (
            climbed.together(programme, shown),
            climbed.hidden(programme, shown),
            climbed.unsure(shown),
        ),
        _ => (vec![], vec![], vec![]),
    };
    Design {
        rungs: climbed.rungs(&found),
        wanted,
        effects: climbed.effects(&found),
        together,
        hidden,
        unsure,
    }
}

impl Climbed<'_> {
    fn rungs(&self, found: &[Vec<Shown>]) -> Vec<Rung> {
        let all = self.programmes.iter().zip(self.minutes).zip(found);
        let rung = |((programme, minutes), shown): ((&Programme, &f64), &Vec<Shown>)| {
            let titled = self.candidates.iter().zip(&programme.repeats);
            Rung {
                minutes: *minutes,
                used_min: self.field.minutes(&programme.repeats),
                tests: titled
                    .filter(|(_, repeats)| **repeats > 0)
                    .map(|(candidate, repeats)| (candidate.title.clone(), *repeats))
                    .collect(),
                worst: programme.score.worst,
                named: named(shown, self.aims),
            }
        };
        all.map(rung).collect()
    }

    fn effects(&self, found: &[Vec<Shown>]) -> Vec<Aimed> {
        let of = |(k, (own, aim)): (usize, (&Own, &Aim))| {
            let first = own.first();
            let from = |shown: &Vec<Shown>| {
                let from = shown.get(k)?.named_from(aim)?;
                Some(from * first.typical)
            };
            Aimed {
                effect: own.instance.kind.id.to_owned(),
                axis: own.instance.target.to_string(),
                parameter: first.name.to_owned(),
                stated: aim.stated * first.typical,
                weight: aim.weight,
                named_from: found.iter().map(from).collect(),
            }
        };
        let all = self.owns.iter().zip(self.aims);
        all.enumerate().map(of).collect()
    }

    /// Pairs of which both are shown at their stated sizes, and either leaves too little of the other.
    fn together(&self, programme: &Programme, shown: &[Shown]) -> Vec<Together> {
        let seen: Vec<usize> = (0..self.aims.len())
            .filter(|k| self.aims[*k].stated * shown[*k].d >= self.aims[*k].least_d)
            .collect();
        let mut all = Vec::new();
        for (place, a) in seen.iter().enumerate() {
            for b in &seen[place + 1..] {
                let pair = [&self.aims[*a], &self.aims[*b]];
                if is_parted(&programme.gram, pair) {
                    continue;
                }
                let instances = [&self.owns[*a].instance, &self.owns[*b].instance];
                let parts = |gram: &DMatrix<f64>| is_parted(gram, pair);
                let ids = instances.map(|instance| instance.kind.id);
                all.push(Together {
                    effects: instances.map(crate::search::signature::Instance::name),
                    cos: cos(&programme.gram, pair),
                    parted_by: self.remedy(programme, &parts, &ids),
                });
            }
        }
        all.sort_by(|a, b| b.cos.total_cmp(&a.cos));
        all
    }

    fn hidden(&self, programme: &Programme, found: &[Shown]) -> Vec<Hidden> {
        let all = self.owns.iter().zip(self.aims).zip(found);
        let too_small = all.filter(|((_, aim), shown)| aim.stated * shown.d < aim.least_d);
        let hidden = |((own, aim), _): ((&Own, &Aim), &Shown)| {
            let first = aim.columns.start;
            let shows = |gram: &DMatrix<f64>| {
                let d = aim.stated * gram[(first, first)].max(0.0).sqrt();
                d >= aim.least_d + separability::SURE
            };
            let kind = own.instance.kind;
            Hidden {
                effect: own.instance.name(),
                needs: kind.needs.to_owned(),
                shown_by: self.remedy(programme, &shows, &[kind.id]),
            }
        };
        too_small.map(hidden).collect()
    }

    /// What is neither hidden nor named: together with both, every effect once.
    fn unsure(&self, found: &[Shown]) -> Vec<String> {
        let all = self.owns.iter().zip(self.aims).zip(found);
        let is_unsure = |((_, aim), shown): &((&Own, &Aim), &Shown)| {
            aim.stated * shown.d >= aim.least_d && !is_named(shown, aim)
        };
        all.filter(is_unsure)
            .map(|((own, _), _)| own.instance.name())
            .collect()
    }

    /// The shortest test that decides, one with an instrument at hand first.
    fn remedy(
        &self,
        programme: &Programme,
        decides: &dyn Fn(&DMatrix<f64>) -> bool,
        ids: &[&str],
    ) -> Remedy {
        let entries = self.field.entries.iter().zip(self.candidates).enumerate();
        let more = entries.filter_map(|(place, (entry, candidate))| {
            let most = entry.grams.last()?;
            let has = programme.repeats[place];
            let mut gram = &programme.gram + most;
            if let Some(before) = has.checked_sub(1) {
                gram -= &entry.grams[before];
            }
            let is_more = has < entry.grams.len() && decides(&gram);
            is_more.then(|| (self.minutes_more(programme, place, entry), candidate))
        });
        let best = more.min_by(|(a, one), (b, other)| {
            let at_hand = other.is_at_hand.cmp(&one.is_at_hand);
            at_hand.then(a.total_cmp(b))
        });
        match best {
            Some((minutes, candidate)) => {
                let title = candidate.title.clone();
                if candidate.is_at_hand {
                    Remedy::Test { title, minutes }
                } else {
                    Remedy::OtherInstrument { title, minutes }
                }
            }
            None => Remedy::Beyond(lever(ids)),
        }
    }

    /// What all repeats of a candidate take beyond a programme, min.
    fn minutes_more(&self, programme: &Programme, place: usize, entry: &Entry) -> f64 {
        let mut repeats = programme.repeats.clone();
        let more = entry.grams.len().saturating_sub(repeats[place]);
        let tests_min = entry.minutes * count(more);
        repeats[place] = entry.grams.len();
        (self.field.minutes(&repeats) - self.field.minutes(&programme.repeats)).max(tests_min)
    }
}

fn is_parted(gram: &DMatrix<f64>, pair: [&Aim; 2]) -> bool {
    between(gram, pair).into_iter().all(|left| left >= parted())
}
