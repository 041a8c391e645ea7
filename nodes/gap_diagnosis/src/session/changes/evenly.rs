//! What goes on changing evenly between repeats, and has no step.
//!
//! # Model
//!
//! The coefficients of a pattern are fitted by a slope in time beside the mean of each group of repeats, one slope for all groups
//! where the set-up has one place:
//!
//! ```text
//!   c_gi = m_g + b_g t_i + e_gi,   t = 0 at the first run, 1 at the last   (1)
//! ```
//!
//! Its chance is that of F as in (2) of `changes`, over all patterns; its size is b.
//!
//! # Holds when
//! The rest of the named effects is given: a drift that is named leaves none.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};
use twin::Session;

use super::series::{Point, Series, series};
use super::{Change, LEAST_DEVIATIONS, LEAST_FORM_ERRORS, MOST_CHANCE};
use crate::config::GapConfig;
use crate::search::rows::{Rows, count};

/// Fewest runs of a pattern that show a slope.
const LEAST_RUNS_OF_SLOPE: usize = 6;

/// The largest even change of each channel that `rest`, in mm, shows; between its first and its last run.
pub fn find(
    session: &Session,
    rows: &Rows,
    rest: &[f64],
    set_ups: &[[u32; 2]],
    config: &GapConfig,
) -> Vec<Change> {
    let mut all = series(session, rows, rest, set_ups);
    all.iter_mut().for_each(|own| own.powers = 0);
    of(&all, config)
}

fn of(all: &[Series], config: &GapConfig) -> Vec<Change> {
    let found = all.iter().filter_map(|own| sloped(own, all.len(), config));
    let mut largest = Vec::<Change>::new();
    for change in found {
        let known = largest.iter_mut().find(|one| one.channel == change.channel);
        match known {
            Some(known) if known.size_mm < change.size_mm => *known = change,
            Some(_) => {}
            None => largest.push(change),
        }
    }
    largest
}

/// (1) of one pattern where it is no noise.
fn sloped(own: &Series, tried: usize, config: &GapConfig) -> Option<Change> {
    let mut runs: Vec<usize> = own.points.iter().map(|point| point.run).collect();
    runs.sort_unstable();
    runs.dedup();
    let between = [*runs.first()?, *runs.last()?];
    let slopes = own.slopes();
    let (before, free) = own.left(vec![]);
    let (after, left) = own.left(slopes.clone());
    let used = free.saturating_sub(left);
    if runs.len() < LEAST_RUNS_OF_SLOPE || used == 0 || left < 3 {
        return None;
    }
    let scatter = (after / count(left)).max(before * 1e-15);
    let ratio = (before - after) / count(used) / scatter;
    let law = FisherSnedecor::new(count(used), count(left)).ok()?;
    let chance = (law.sf(ratio.max(0.0)) * count(tried)).min(1.0);
    let size_mm = own.largest(slopes)?;
    let least_mm = LEAST_FORM_ERRORS * 1e-3 * config.form_error_um;
    let is_large = size_mm > least_mm.max(LEAST_DEVIATIONS * scatter.sqrt());
    (chance < MOST_CHANCE && is_large).then(|| Change {
        between,
        channel: own.channel.clone(),
        feature: own.feature(),
        size_mm,
        chance,
        is_set_up: own.is_shared,
        is_touched_alone: own.touch.is_some(),
        touches: vec![],
    })
}

impl Series {
    /// Columns of (1) beside the means.
    fn slopes(&self) -> Vec<DVector<f64>> {
        let times = || self.points.iter().map(|point| point.time_s);
        let first = times().fold(f64::INFINITY, f64::min);
        let last = times().fold(f64::NEG_INFINITY, f64::max);
        let span = (last - first).max(f64::MIN_POSITIVE);
        self.by_group(&move |p: &Point| (p.time_s - first) / span)
    }

    /// The largest coefficient of some columns beside the means, mm.
    fn largest(&self, columns: Vec<DVector<f64>>) -> Option<f64> {
        let means = self.means();
        let first = means.len();
        let all: Vec<DVector<f64>> = means.into_iter().chain(columns).collect();
        let svd = DMatrix::from_columns(&all).svd(true, true);
        let sizes = svd.solve(&self.column(|point| point.value_mm), 1e-9).ok()?;
        Some(sizes.rows(first, sizes.len() - first).amax())
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::drawn;
    use super::*;

    #[test]
    fn eq1_what_goes_on_evenly_is_found_with_its_size_from_the_first_to_the_last_run() {
        for seed in 0..20 {
            let found = of(
                &drawn(seed, 12, |run| 3e-4 * count(run)),
                &GapConfig::default(),
            );
            assert_eq!(found.len(), 1, "{found:?}");
            assert_eq!(found[0].between, [0, 11]);
            assert!((found[0].size_mm - 3.3e-3).abs() < 5e-4, "{found:?}");
        }
    }

    #[test]
    fn eq1_noise_goes_nowhere() {
        let found = (0..200)
            .filter(|seed| !of(&drawn(*seed, 12, |_| 0.0), &GapConfig::default()).is_empty());
        assert!(found.count() <= 4);
    }
}
