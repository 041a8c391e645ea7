//! Which set of effects explains the residual best: forward, backward and swapped, several sets at a time.
//!
//! # Model
//!
//! ```text
//!   C(S) = |z - A_S beta|^2 + q ln n + 2 |S| ln K                         (1)
//!   p(S) proportional to exp(-C(S) / 2)                                   (2)
//! ```
//!
//! | symbol | here |
//! |---|---|
//! | q | `Form::price` over the set |
//! | n | rows less floats |
//! | K | instances that the recording could show |
//!
//! # References
//! \[1\] J. Chen, Z. Chen, Biometrika 95, 2008 (extended BIC).

use std::collections::{BTreeMap, BTreeSet};

use twin::effects::{Moment, Targets};

use crate::noise::normal::{Fit, Normal};
use crate::search::rows::count;
use crate::search::signature::{Form, Library};

/// The free part of a wide form is at most this share of the rest of its signature.
pub const MOST_FREE: f64 = 0.5;

/// Forms of one instance that are tried beside a set before it is given up.
pub const MOST_FORMS: usize = 16;

/// Effects that are curves along an axis.
const CURVES: [&str; 2] = ["pitch_error", "straightness"];

/// Greatest height of a curve over the travel that was not read at targets along the axis, µm: over a small part of a travel, as
/// in a bore, a curve of hundreds of micrometres is as good as any other slope.
const MOST_OF_TRAVEL_UM: f64 = 90.0;

/// A member whose own signature is this many times what the whole set explains (in squares) only cancels another.
pub const MOST_CANCELLING: f64 = 2.0;

/// A set of forms, growing places among the signatures.
pub type Set = Vec<usize>;

/// The search and everything it visited.
pub struct Search<'l> {
    signatures: &'l Library,
    normal: &'l Normal,
    square: f64,
    log_rows: f64,
    log_instances: f64,
    /// C of every set that was visited.
    pub visited: BTreeMap<Set, f64>,
}

/// Limits of a search.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Sets that are followed side by side.
    pub beam: usize,
    /// Most effects in one set.
    pub most_effects: usize,
    /// Whether a member may be swapped for another effect.
    pub swaps: bool,
}

impl<'l> Search<'l> {
    /// A search over the forms of all signatures; `square` is |z|^2, `freedom` is n.
    pub fn new(signatures: &'l Library, normal: &'l Normal, square: f64, freedom: f64) -> Self {
        Self {
            signatures,
            normal,
            square,
            log_rows: freedom.max(2.0).ln(),
            log_instances: count(signatures.seen().max(2)).ln(),
            visited: BTreeMap::from([(vec![], square)]),
        }
    }

    /// Columns of a set.
    pub fn columns(&self, set: &[usize]) -> Vec<usize> {
        set.iter()
            .flat_map(|form| self.signatures.forms[*form].columns.clone())
            .collect()
    }

    /// Amplitudes of a set, in units of their typical sizes.
    pub fn fit(&self, set: &[usize]) -> Fit {
        self.normal.solve(&self.columns(set))
    }

    fn price(&self, set: &[usize]) -> f64 {
        let parameters: usize = set
            .iter()
            .map(|form| self.signatures.forms[*form].price)
            .sum();
        count(parameters) * self.log_rows + 2.0 * count(set.len()) * self.log_instances
    }

    /// C of a set, infinite where a size is one that physics does not have.
    pub fn score(&mut self, set: &Set) -> f64 {
        if let Some(score) = self.visited.get(set) {
            return *score;
        }
        let fit = self.fit(set);
        let is_sound = self.is_physical(set, &fit) && self.keeps_form(set, &fit);
        let score = if is_sound && !self.cancels(set, &fit) {
            self.square - fit.gain + self.price(set)
        } else {
            f64::INFINITY
        };
        self.visited.insert(set.clone(), score);
        score
    }

    /// Whether some member is much larger than what the whole set explains: two look-alikes that all but cancel each other
    /// explain with what they differ by, which no two causes of a machine do.
    fn cancels(&self, set: &[usize], fit: &Fit) -> bool {
        let mut first = 0;
        set.len() > 1
            && set.iter().any(|form| {
                let columns = &self.signatures.forms[*form].columns;
                let sizes = &fit.sizes[first..first + columns.len()];
                first += columns.len();
                let own: f64 = (0..columns.len())
                    .flat_map(|i| (0..columns.len()).map(move |j| (i, j)))
                    .map(|(i, j)| sizes[i] * sizes[j] * self.normal.gram[(columns[i], columns[j])])
                    .sum();
                own > MOST_CANCELLING * fit.gain
            })
    }

    /// Whether the free part of every wide form only widens the form: one that is as large as the rest of its
    /// signature would be another effect under this one's name. Heights of a curve that may have any form are no such part,
    /// nor is what an effect of scatter has beside an even part, which is in the noise floor and has no signature.
    fn keeps_form(&self, set: &[usize], fit: &Fit) -> bool {
        let mut first = 0;
        set.iter().all(|form| {
            let entry = &self.signatures.forms[*form];
            let sizes = &fit.sizes[first..first + entry.columns.len()];
            first += entry.columns.len();
            let kind = self.signatures.instances[entry.instance].kind;
            let own = kind.parameters.len();
            let widens = |place: usize| place >= own && !kind.free[place - own].is_ordinate;
            let square = |is_free: bool| -> f64 {
                let wanted = |k: &usize| widens(entry.amplitudes[*k]) == is_free;
                let part: Vec<usize> = (0..sizes.len()).filter(wanted).collect();
                let of = |i: &usize, j: &usize| {
                    let gram = self.normal.gram[(entry.columns[*i], entry.columns[*j])];
                    sizes[*i] * sizes[*j] * gram
                };
                part.iter()
                    .flat_map(|i| part.iter().map(move |j| of(i, j)))
                    .sum()
            };
            let is_scatter = kind.moment == Moment::Variance;
            !entry.wide || is_scatter || square(true) <= MOST_FREE.powi(2) * square(false)
        })
    }

    fn is_physical(&self, set: &[usize], fit: &Fit) -> bool {
        let mut sizes = fit.sizes.iter();
        set.iter().all(|form| {
            let Form {
                instance,
                amplitudes,
                ..
            } = &self.signatures.forms[*form];
            let kind = self.signatures.instances[*instance].kind;
            let parameter = |place: usize| kind.parameters.iter().chain(kind.free).nth(place);
            amplitudes.iter().zip(sizes.by_ref()).all(|(place, size)| {
                parameter(*place).is_some_and(|p| {
                    let value = size * p.typical;
                    let most = 1.5 * p.low.abs().max(p.high.abs());
                    let is_far =
                        CURVES.contains(&kind.id) && !self.signatures.curves.contains(instance);
                    let most = if is_far {
                        most.min(MOST_OF_TRAVEL_UM)
                    } else {
                        most
                    };
                    value.abs() <= most && (p.low < 0.0 || value >= 0.0)
                })
            })
        })
    }

    /// Whether a set has one of two instances at most: they are the same, or the one growth of a spindle by one thermometer and by
    /// another. Which thermometer it goes with is tried; together they would make up what no single lag of either meets.
    fn excludes(&self, one: usize, other: usize) -> bool {
        let [a, b] = [one, other].map(|place| self.signatures.instances[place].kind);
        one == other || (a.id == b.id && a.targets == Targets::Spindle)
    }

    /// The best form of each instance beside a set, the best first, with its set.
    fn beside(&mut self, set: &Set, most: usize) -> Vec<(f64, Set)> {
        let taken: BTreeSet<usize> = set
            .iter()
            .map(|form| self.signatures.forms[*form].instance)
            .collect();
        let open: Vec<usize> = (0..self.signatures.forms.len())
            .filter(|form| {
                let instance = self.signatures.forms[*form].instance;
                let is_aside = self.signatures.aside.contains_key(&instance);
                !is_aside && taken.iter().all(|own| !self.excludes(*own, instance))
            })
            .collect();
        let columns = self.columns(set);
        let groups = open
            .iter()
            .map(|form| &self.signatures.forms[*form].columns[..]);
        let gains = self.normal.gains_beside(&columns, groups);
        let mut worths = BTreeMap::<usize, Vec<(f64, usize)>>::new();
        for (form, gain) in open.into_iter().zip(gains) {
            let entry = &self.signatures.forms[form];
            let worth = gain - count(entry.price) * self.log_rows;
            worths
                .entry(entry.instance)
                .or_default()
                .push((worth, form));
        }
        let mut ranked: Vec<Vec<(f64, usize)>> = worths.into_values().collect();
        for forms in &mut ranked {
            forms.sort_by(|a, b| b.0.total_cmp(&a.0));
        }
        ranked.sort_by(|a, b| b[0].0.total_cmp(&a[0].0));
        let mut scored: Vec<(f64, Set)> = ranked
            .iter()
            .take(most)
            .map(|forms| self.best_sound(set, forms))
            .collect();
        scored.extend(self.curves_with_slopes(set));
        scored.sort_by(|a, b| a.0.total_cmp(&b.0));
        scored
    }

    /// The best form of each curve through targets together with its slope: neither alone may be worth a step where an error of any
    /// form has both.
    fn curves_with_slopes(&mut self, set: &Set) -> Vec<(f64, Set)> {
        let instance = |form: &usize| self.signatures.forms[*form].instance;
        let taken: BTreeSet<usize> = set.iter().map(instance).collect();
        let open = self.signatures.curves.difference(&taken).copied();
        let pairs: Vec<(usize, Set)> = open
            .filter_map(|curve| {
                let slope = self.signatures.slope_of(curve)?;
                let is_open = !taken.contains(&instance(&slope));
                is_open.then(|| (curve, with(set, slope)))
            })
            .collect();
        let of_pair = |(curve, beside): (usize, Set)| {
            let forms: Vec<usize> = (0..self.signatures.forms.len())
                .filter(|form| self.signatures.forms[*form].instance == curve)
                .collect();
            let groups = forms
                .iter()
                .map(|form| &self.signatures.forms[*form].columns[..]);
            let gains = self.normal.gains_beside(&self.columns(&beside), groups);
            let worth = |(form, gain): (usize, f64)| {
                let price = count(self.signatures.forms[form].price) * self.log_rows;
                (gain - price, form)
            };
            let mut ranked: Vec<(f64, usize)> = forms.into_iter().zip(gains).map(worth).collect();
            ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
            (beside, ranked)
        };
        let ranked: Vec<(Set, Vec<(f64, usize)>)> = pairs.into_iter().map(of_pair).collect();
        let ranked = ranked.into_iter().filter(|(_, forms)| !forms.is_empty());
        ranked
            .map(|(beside, forms)| self.best_sound(&beside, &forms))
            .collect()
    }

    /// The first of some forms of an instance, the best first, whose sizes beside a set physics lets be. A wide form that
    /// would be another effect under this one's name does not keep the instance's own form from the set.
    fn best_sound(&mut self, set: &Set, forms: &[(f64, usize)]) -> (f64, Set) {
        let mut tried = forms.iter().take(MOST_FORMS).map(|(_, form)| {
            let set = with(set, *form);
            (self.score(&set), set)
        });
        let first = tried.next().expect("an instance has a form");
        if first.0.is_finite() {
            return first;
        }
        tried.find(|(score, _)| score.is_finite()).unwrap_or(first)
    }

    /// Improves one set by taking out and by swapping until nothing helps.
    fn polished(&mut self, mut set: Set, swaps: bool) -> Set {
        loop {
            let now = self.score(&set);
            let mut best = (now - 1e-9, set.clone());
            for &form in &set.clone() {
                let less = without(&set, form);
                let score = self.score(&less);
                if score < best.0 {
                    best = (score, less.clone());
                }
                if swaps
                    && let Some((score, swapped)) = self.beside(&less, 4).into_iter().next()
                    && score < best.0
                {
                    best = (score, swapped);
                }
            }
            if best.1 == set {
                return set;
            }
            set = best.1;
        }
    }

    /// The best set found.
    pub fn run(&mut self, limits: Limits) -> Set {
        let mut beam: Vec<Set> = vec![vec![]];
        let mut best: Set = vec![];
        for _ in 0..limits.most_effects {
            let mut next = Vec::new();
            for set in &beam {
                next.extend(self.beside(set, 2 * limits.beam));
            }
            next.sort_by(|a, b| a.0.total_cmp(&b.0));
            next.dedup_by(|a, b| a.1 == b.1);
            next.truncate(limits.beam);
            beam = next
                .into_iter()
                .enumerate()
                .map(|(rank, (_, set))| {
                    if rank < 2 {
                        self.polished(set, limits.swaps)
                    } else {
                        set
                    }
                })
                .collect();
            beam.sort();
            beam.dedup();
            beam.sort_by(|a, b| self.visited[a].total_cmp(&self.visited[b]));
            let Some(first) = beam.first() else { break };
            if self.visited[first] >= self.visited[&best] - 1e-9 {
                break;
            }
            best.clone_from(first);
        }
        best
    }

    /// Visits what could stand in the place of each member: one other effect, or two.
    pub fn alternatives(&mut self, best: &Set, most: usize) {
        for &form in best {
            let less = without(best, form);
            let own = self.signatures.forms[form].instance;
            for (_, other) in self.beside(&less, most) {
                if other
                    .iter()
                    .all(|f| self.signatures.forms[*f].instance != own)
                {
                    self.beside(&other, most);
                }
            }
        }
    }
}

/// A set with one form more.
pub fn with(set: &[usize], form: usize) -> Set {
    let mut more = set.to_vec();
    more.push(form);
    more.sort_unstable();
    more
}

/// A set with one form less.
pub fn without(set: &[usize], form: usize) -> Set {
    set.iter().copied().filter(|f| *f != form).collect()
}

#[cfg(test)]
mod tests {
    use metrology::Axis;
    use nalgebra::DVector;
    use twin::effects::{self, Target};

    use super::*;
    use crate::search::signature::Instance;

    /// A play in its own form (one column) and in a wide one (a free column more).
    fn library() -> Library {
        let form = |columns: &[usize], amplitudes: &[usize], wide| Form {
            instance: 0,
            values: vec![0.0; 7],
            amplitudes: amplitudes.to_vec(),
            columns: columns.to_vec(),
            price: columns.len(),
            wide,
        };
        Library {
            curves: Default::default(),
            aside: Default::default(),
            shared: Default::default(),
            instances: vec![Instance {
                kind: effects::kind("backlash").unwrap(),
                target: Target::Axis(Axis::X),
                begins: None,
            }],
            forms: vec![form(&[0], &[0], false), form(&[0, 1], &[0, 1], true)],
            columns: [[1.0, 0.0], [0.0, 1.0]]
                .map(|column| DVector::from_row_slice(&column))
                .to_vec(),
            excited: vec![true],
        }
    }

    #[test]
    fn a_wide_form_that_is_mostly_free_does_not_keep_the_effects_own_form_out() {
        let library = library();
        // The free column explains most: under this name that would be another effect.
        let z = DVector::from_row_slice(&[8.0, 20.0]);
        let normal = library.normal(&z);
        let mut search = Search::new(&library, &normal, z.norm_squared(), 100.0);
        let limits = Limits {
            beam: 3,
            most_effects: 2,
            swaps: true,
        };
        assert_eq!(search.run(limits), vec![0]);
        assert!(search.visited[&vec![1]].is_infinite());
    }
}
