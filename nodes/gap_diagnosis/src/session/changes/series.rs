//! The coefficients of repeated blocks over the session, and what steps leave of them.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};
use twin::{Channel, Session, Touch};

use super::{MOST_CHANCE, touched};
use crate::noise::repeats;
use crate::search::field::{self, Mode};
use crate::search::nuisance::orthonormal;
use crate::search::rows::{Rows, count, time_s};
use crate::session::log;

/// Highest harmonic of the patterns.
const MOST_HARMONICS: usize = 4;

/// Coefficient of one pattern in one block.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    pub group: usize,
    pub run: usize,
    pub time_s: f64,
    pub value_mm: f64,
}

/// One pattern of one channel over the session.
#[derive(Clone, Debug)]
pub(super) struct Series {
    pub channel: Channel,
    /// The first of the touches of a place.
    pub touch: Option<Touch>,
    pub points: Vec<Point>,
    /// Whether it is the place of a set-up.
    pub is_shared: bool,
    /// Powers of time beside which steps are looked for.
    pub powers: usize,
    /// Temperatures at the points, one column for each lagged thermometer.
    pub by_heat: Vec<Vec<f64>>,
}

/// Coefficients of all patterns of repeated blocks.
pub(super) fn series(
    session: &Session,
    rows: &Rows,
    raw: &[f64],
    set_ups: &[[u32; 2]],
) -> Vec<Series> {
    let mut all = BTreeMap::<(Channel, usize, [u32; 2]), Series>::new();
    let groups = repeats::groups(session, rows);
    let repeated = groups.iter().enumerate().filter(|(_, own)| own.len() > 1);
    let mut touches = vec![];
    let warmings = touched::warmings(session);
    for (group, own) in repeated {
        if rows.blocks[own[0]].channel == Channel::Touch {
            touches.extend(touched::of_group(
                session,
                (group, own),
                rows,
                raw,
                &warmings,
            ));
            continue;
        }
        for block in own.iter().map(|place| &rows.blocks[*place]) {
            let run = &session.runs[block.run];
            if matches!(block.channel, Channel::Thermometer(_)) || log::is_log(run) {
                continue;
            }
            let (kinds, modes) = field::modes(run, block);
            let wanted: Vec<usize> = (0..kinds.len())
                .filter(|k| !matches!(kinds[*k], Mode::Place(n) if n > MOST_HARMONICS))
                .collect();
            let modes = modes.select_columns(&wanted);
            let values = DVector::from_column_slice(&raw[block.range()]);
            let Some(sizes) = solved(&modes, &values) else {
                continue;
            };
            for (pattern, kind) in wanted.iter().map(|k| kinds[*k]).enumerate() {
                let radial = block.channel == Channel::Radial && kind == Mode::Place(1);
                let is_shared = kind == Mode::Offset || radial;
                // A place under another zero, or set up anew, is another place.
                let own = set_ups.get(block.run).filter(|_| is_shared);
                let set_up = own.copied().unwrap_or_default();
                let key = (block.channel.clone(), pattern, set_up);
                let own = all.entry(key).or_insert_with(|| Series {
                    channel: block.channel.clone(),
                    touch: None,
                    points: vec![],
                    is_shared,
                    powers: 0,
                    by_heat: vec![],
                });
                own.points.push(Point {
                    group,
                    run: block.run,
                    time_s: time_s(run, &block.rows[0]),
                    value_mm: sizes[pattern],
                });
            }
        }
    }
    all.into_values()
        .chain(touches)
        .filter(|own| own.points.len() > 3)
        .collect()
}

/// Least squares; `None` where the rows do not separate the columns.
fn solved(columns: &DMatrix<f64>, values: &DVector<f64>) -> Option<DVector<f64>> {
    if columns.nrows() < 2 * columns.ncols() || values.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let gram = columns.tr_mul(columns).cholesky()?;
    Some(gram.solve(&columns.tr_mul(values)))
}

impl Series {
    /// What is touched.
    pub fn feature(&self) -> Option<String> {
        self.touch.as_ref().map(|touch| touch.feature_id.clone())
    }

    pub fn groups(&self) -> Vec<usize> {
        let mut groups: Vec<usize> = self.points.iter().map(|point| point.group).collect();
        groups.sort_unstable();
        groups.dedup();
        groups
    }

    pub fn column(&self, of: impl Fn(&Point) -> f64) -> DVector<f64> {
        DVector::from_iterator(self.points.len(), self.points.iter().map(of))
    }

    /// One column a group, or one for all where the set-up has one place.
    pub fn by_group(&self, of: &dyn Fn(&Point) -> f64) -> Vec<DVector<f64>> {
        if self.is_shared {
            return vec![self.column(of)];
        }
        let of_group =
            |group: usize| self.column(|point| if point.group == group { of(point) } else { 0.0 });
        self.groups().into_iter().map(of_group).collect()
    }

    pub fn means(&self) -> Vec<DVector<f64>> {
        let own = |group: usize| self.column(|p| f64::from(u8::from(p.group == group)));
        let means = self.groups().into_iter().map(own);
        means.chain(self.smooth(1..=self.powers)).collect()
    }

    pub fn stepped(&self, steps: &[usize]) -> Vec<DVector<f64>> {
        let of_step = |step: &usize| {
            let step = *step;
            self.by_group(&move |p: &Point| f64::from(u8::from(p.run >= step)))
        };
        steps.iter().flat_map(of_step).collect()
    }

    /// What some columns beside the means leave, as a sum of squares, and the freedom of that.
    pub fn left(&self, columns: Vec<DVector<f64>>) -> (f64, usize) {
        let n = self.points.len();
        let values = self.column(|point| point.value_mm);
        let basis = orthonormal(n, self.means().into_iter().chain(columns));
        let left = &values - &basis * basis.tr_mul(&values);
        (left.norm_squared(), n.saturating_sub(basis.ncols()))
    }

    /// What as many powers of time leave, beside those that are left out anyway.
    pub fn left_by_time(&self, most: usize) -> f64 {
        self.left(self.smooth(self.powers + 1..=self.powers + most))
            .0
    }

    /// Chance (2) of some steps beside others, before it is multiplied.
    pub fn chance(&self, beside: &[usize], with: &[usize]) -> f64 {
        let (before, free) = self.left(self.stepped(beside));
        let (after, left) = self.left(self.stepped(with));
        let used = free.saturating_sub(left);
        if used == 0 || left < 2 || before <= 0.0 {
            return 1.0;
        }
        let ratio = (before - after) / count(used) / (after / count(left)).max(before * 1e-15);
        FisherSnedecor::new(count(used), count(left)).map_or(1.0, |law| law.sf(ratio.max(0.0)))
    }

    /// Whether no run alone makes a step beside the others.
    pub fn is_of_several_runs(&self, beside: &[usize], with: &[usize]) -> bool {
        let is_there_without = |run: usize| {
            let points = self.points.iter().filter(|point| point.run != run);
            let rest = Self {
                points: points.copied().collect(),
                ..self.clone()
            };
            rest.chance(beside, with) < MOST_CHANCE
        };
        self.points.iter().all(|point| is_there_without(point.run))
    }

    /// Log-likelihood that steps gain.
    pub fn gain(&self, steps: &[usize]) -> f64 {
        let (before, free) = self.left(vec![]);
        let (after, left) = self.left(self.stepped(steps));
        if left < 2 || before <= 0.0 {
            return 0.0;
        }
        let per_freedom = (after / count(left)) / (before / count(free));
        0.5 * count(left) * -per_freedom.max(1e-12).ln()
    }

    /// Coefficient of one step beside the others, the largest of the groups, mm.
    pub fn size_mm(&self, steps: &[usize], at: usize) -> f64 {
        let sizes = self.sizes_mm(steps, at);
        sizes
            .iter()
            .fold(0.0, |largest, size| largest.max(size.abs()))
    }

    /// The same of each group, with its sign; none where they are not determined.
    pub fn sizes_mm(&self, steps: &[usize], at: usize) -> Vec<f64> {
        let means = self.means();
        let columns: Vec<DVector<f64>> = means.iter().cloned().chain(self.stepped(steps)).collect();
        let own = self.stepped(&steps[..1]).len();
        let first = means.len() + at * own;
        let svd = DMatrix::from_columns(&columns).svd(true, true);
        let sizes = svd.solve(&self.column(|point| point.value_mm), 1e-9);
        sizes.map_or_else(
            |_| vec![],
            |sizes| sizes.rows(first, own).iter().copied().collect(),
        )
    }

    /// The last digit of touches that are rounded, mm; zero of others.
    pub fn digit_mm(&self) -> f64 {
        let values = self.points.iter().map(|point| point.value_mm).collect();
        let of_touches = self
            .touch
            .as_ref()
            .map(|_| repeats::digit_mm([values].into_iter()));
        of_touches.unwrap_or(0.0)
    }

    /// Standard deviation of what steps leave, mm.
    pub fn deviation_mm(&self, steps: &[usize]) -> f64 {
        let (left, free) = self.left(self.stepped(steps));
        (left / count(free.max(1))).sqrt()
    }

    /// Whether both sides of a step have two runs, and the runs next to it.
    pub fn around(&self, step: usize) -> Option<[usize; 2]> {
        let mut runs: Vec<usize> = self.points.iter().map(|point| point.run).collect();
        runs.sort_unstable();
        runs.dedup();
        let at = runs.partition_point(|run| *run < step);
        (at >= 2 && runs.len() - at >= 2).then(|| [runs[at - 1], runs[at]])
    }
}
