//! How much runs at targets that follow one another are apart, whatever drifts through all of them.
//!
//! # Model
//!
//! Runs of one axis are read one after another, so that a drift of the machine goes on from the end of one to the begin of the next.
//! With e the readings of run k less the mean of all runs at each row, and u from -1 to 1 the time within the run:
//!
//! ```text
//!   e_k = o_k + d_k u,   j_k = (o_(k+1) - d_(k+1)) - (o_k + d_k)          (1)
//!   var j = 4 s^2 + 8 v / N                                               (2)
//! ```
//!
//! The mean of all runs takes the mean drift of a run with it, the same of every j; beside their mean the j have what runs differ by
//! with no course in time. s is taken for the standard deviation of offset and drift; v is the variance of a row, N their number.
//! One or two joins hardly determine s: [`PRIOR_JOINS`] of the size that the deviation over place has are counted with them, and of what is
//! likely the quantile `CAUTION` is used, of three runs [`CAUTION_OF_FEW`].
//!
//! # Holds when
//! No pause between two runs is longer than a run; joins across a change (`changes`) are left out.

use metrology::sample::TestKind;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use twin::{Channel, Session};

use super::CAUTION;
use crate::search::rows::{Block, count, time_s};

/// Joins of the usual size that are counted with those that were seen.
const PRIOR_JOINS: f64 = 2.0;
/// Fewest runs: of two the one join is what they drift by or what they are apart by.
const MIN_RUNS: usize = 3;
/// Fewest rows of a line.
const MIN_ROWS: usize = 3;
/// Share of the posterior of s below what is used with one join beside the mean: three runs go one way by chance now and then.
const CAUTION_OF_FEW: f64 = 0.95;
/// Joins beside the mean from which `CAUTION` is enough.
const MANY: f64 = 1.5;
/// Least part of the standard deviation of a row that s is taken for.
const LEAST_APART_SHARE: f64 = 0.03;

/// What runs show at their joins.
#[derive(Clone, Debug, PartialEq)]
pub struct Joins {
    /// Sum of the squares of j less their mean, mm2.
    square_mm2: f64,
    /// Joins less the mean.
    freedom: f64,
    /// N of (2).
    rows: f64,
}

/// Time and readings of one run.
struct Joined {
    /// First and last row, s.
    ends_s: [f64; 2],
    /// Of each row, s.
    at_s: Vec<f64>,
    /// Residual of each row, mm.
    mm: Vec<f64>,
    run: usize,
}

impl Joins {
    /// Of blocks that repeat one test, with the rows that all have; `None` where they are no runs at targets of a length, or do not
    /// follow one another.
    pub fn new(
        session: &Session,
        blocks: &[&Block],
        rows: &[Vec<usize>],
        residual: &[f64],
        steps: &[usize],
    ) -> Option<Self> {
        let mut runs: Vec<Joined> = { blocks.iter().zip(rows) }
            .map(|(block, rows)| Joined::new(session, block, rows, residual))
            .collect::<Option<_>>()?;
        runs.sort_by(|a, b| a.ends_s[0].total_cmp(&b.ends_s[0]));
        let duration_s = |run: &Joined| run.ends_s[1] - run.ends_s[0];
        let follows = |two: &[Joined]| {
            let pause_s = two[1].ends_s[0] - two[0].ends_s[1];
            pause_s >= 0.0 && pause_s <= duration_s(&two[0]).max(duration_s(&two[1]))
        };
        let n = runs.first()?.mm.len();
        let is_short = n < MIN_ROWS || runs.len() < MIN_RUNS;
        if is_short || !runs.windows(2).all(follows) {
            return None;
        }
        let mean_mm: Vec<f64> = (0..n)
            .map(|row| runs.iter().map(|run| run.mm[row]).sum::<f64>() / count(runs.len()))
            .collect();
        let ends_mm: Vec<[f64; 2]> = runs.iter().map(|run| run.line_mm(&mean_mm)).collect();
        let is_changed =
            |from: usize, to: usize| steps.iter().any(|step| from < *step && to >= *step);
        let joins_mm: Vec<f64> = (1..runs.len())
            .filter(|k| !is_changed(runs[k - 1].run, runs[*k].run))
            .map(|k| ends_mm[k][0] - ends_mm[k - 1][1])
            .collect();
        let mean = joins_mm.iter().sum::<f64>() / count(joins_mm.len().max(1));
        Some(Self {
            square_mm2: joins_mm.iter().map(|j| (j - mean).powi(2)).sum(),
            freedom: count(joins_mm.len().saturating_sub(1)),
            rows: count(n),
        })
    }
}

impl Joined {
    fn new(session: &Session, block: &Block, rows: &[usize], residual: &[f64]) -> Option<Self> {
        let run = &session.runs[block.run];
        let is_length = matches!(block.channel, Channel::Length(_));
        if !is_length || run.segment.kind != TestKind::Positioning {
            return None;
        }
        let at_s: Vec<f64> = rows
            .iter()
            .map(|row| time_s(run, &block.rows[*row]))
            .collect();
        Some(Self {
            ends_s: [*at_s.first()?, *at_s.last()?],
            mm: rows.iter().map(|row| residual[block.start + row]).collect(),
            at_s,
            run: block.run,
        })
    }

    /// (1) at the first and the last row.
    fn line_mm(&self, mean_mm: &[f64]) -> [f64; 2] {
        let n = count(self.mm.len());
        let e = || self.mm.iter().zip(mean_mm).map(|(own, mean)| own - mean);
        let middle_s = self.at_s.iter().sum::<f64>() / n;
        let offset = e().sum::<f64>() / n;
        let along: f64 = e().zip(&self.at_s).map(|(e, t)| e * (t - middle_s)).sum();
        let square: f64 = self.at_s.iter().map(|t| (t - middle_s).powi(2)).sum();
        let slope = along / square.max(f64::MIN_POSITIVE);
        self.ends_s.map(|end_s| offset + slope * (end_s - middle_s))
    }
}

/// s of (2), mm; `usual_mm` is what it is taken for where no join was seen.
pub fn apart_mm(all: &[&Joins], row_sigma_mm: f64, usual_mm: f64) -> f64 {
    let freedom: f64 = all.iter().map(|joins| joins.freedom).sum();
    let square: f64 = all.iter().map(|joins| joins.square_mm2).sum();
    let rows = all
        .iter()
        .map(|joins| joins.rows)
        .fold(f64::INFINITY, f64::min);
    let of_mean_mm = 2.0 * row_sigma_mm / rows.sqrt();
    let prior = PRIOR_JOINS * 4.0 * usual_mm.max(of_mean_mm).powi(2);
    let counted = freedom + PRIOR_JOINS;
    let caution = if freedom > MANY {
        CAUTION
    } else {
        CAUTION_OF_FEW
    };
    let least = ChiSquared::new(counted).map_or(counted, |law| law.inverse_cdf(1.0 - caution));
    let of_noise = 8.0 * row_sigma_mm.powi(2) / rows;
    let variance = ((square + prior) / least - of_noise) / 4.0;
    variance
        .max((LEAST_APART_SHARE * row_sigma_mm).powi(2))
        .sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joins(square_mm2: f64, freedom: f64) -> Joins {
        Joins {
            square_mm2,
            freedom,
            rows: 30.0,
        }
    }

    /// By hand: 40 joins of 4 s^2 = 4 µm^2 each; the chi-square of 42 exceeds 36.9 in seven of ten, and noise is 8/30 of 0.01.
    #[test]
    fn eq2_many_joins_determine_how_far_runs_are_apart() {
        let found_um = 1e3 * apart_mm(&[&joins(160e-6, 40.0)], 0.1e-3, 0.0);
        let right_um = ((160.0 / 36.9 - 8.0 / 30.0 * 0.01) / 4.0_f64).sqrt();
        assert!((found_um - right_um).abs() < 0.01, "{found_um} {right_um}");
    }
}
