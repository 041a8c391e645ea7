//! The noise floor of each channel, from repeats.
//!
//! # Model
//!
//! A difference of repeats has the noise of one run: autoregression within the run plus the smooth field of
//! `field`, plus what their set-ups leave open where these differ.
//!
//! ```text
//!   d = B c + e,   c ~ N(0, Lambda(p, l, o, d)),   e autoregressive        (1)
//!   phi, v from the autocovariance of d - B (B'B)^-1 B' d;  order by BIC   (2)
//!   log L = -1/2 log |I + G| - 1/2 (d'd - g'(I + G)^-1 g)                  (3)
//! ```
//!
//! with G and g the filtered, scaled B'B and B'd. (3) is taken over grids of amplitude and length, first of
//! the field over place, then of offset and drift. A few repeats leave an amplitude open by a factor; its
//! posterior quantile `CAUTION` is used rather than the best value, so that a lucky pair of repeats does not
//! name a cause.
//!
//! # Holds when
//! All runs of a channel have the noise that its repeats have, at the spacing of their stations in time.
//!
//! # References
//! \[1\] G. Schwarz, Ann. Stat. 6, 1978 (BIC). \[2\] H. D. Patterson, R. Thompson, Biometrika 58, 1971
//! (variances from contrasts).

use std::collections::BTreeMap;

use machine::twin::{Channel, Session};
use nalgebra::{DMatrix, DVector};

use crate::config::GapConfig;
use crate::field::{self, Mode, Smooth};
use crate::repeats::{self, Contrasts};
use crate::rows::{Block, Rows, count};
use crate::whitener::Autoregression;

/// Noise of one channel.
#[derive(Clone, Debug)]
pub struct Noise {
    /// Within a run, between rows.
    pub within: Autoregression,
    /// Between runs.
    pub between: Smooth,
    /// Standard deviation of a row within a run, mm.
    pub row_sigma_mm: f64,
    /// Standard deviation of a reading within a run, mm.
    pub reading_sigma_mm: f64,
    /// Runs that were repeats (of touches: touches).
    pub repeats: usize,
    /// Independent rows that the variance is known from.
    pub freedom: f64,
    /// Independent coefficients that the field between runs is known from.
    pub field_freedom: f64,
}

impl Noise {
    /// The same with another variance.
    pub fn scaled(&self, ratio: f64) -> Self {
        let mut scaled = self.clone();
        let size = ratio.sqrt();
        for variance in &mut scaled.within.variances {
            *variance *= ratio;
        }
        scaled.row_sigma_mm *= size;
        scaled.reading_sigma_mm *= size;
        scaled
    }

    /// Standard deviation of a row about the truth, mm.
    pub fn total_mm(&self) -> f64 {
        self.row_sigma_mm.hypot(self.between.total_mm())
    }
}

/// Share of the posterior that an amplitude is taken at.
const CAUTION: f64 = 0.7;
/// Coefficients of the field between runs that one difference tells about.
const FIELD_MODES: usize = 6;
/// Fewest rows of differences that say what noise is.
const FEWEST_ROWS: usize = 6;

/// Noise of every channel that was repeated.
pub fn noise(
    session: &Session,
    rows: &Rows,
    residual: &[f64],
    config: &GapConfig,
) -> BTreeMap<Channel, Noise> {
    repeats::contrasts(session, rows, residual)
        .into_iter()
        .filter_map(|(channel, groups)| {
            let found = of_channel(session, rows, &groups, config)?;
            Some((channel, found))
        })
        .collect()
}

/// One difference with its modes, before and after the filter.
struct Difference {
    values: DVector<f64>,
    kinds: Vec<Mode>,
    modes: DMatrix<f64>,
    open: DMatrix<f64>,
}

fn of_channel(
    session: &Session,
    rows: &Rows,
    groups: &[Contrasts],
    config: &GapConfig,
) -> Option<Noise> {
    let differences: Vec<Difference> = groups
        .iter()
        .flat_map(|group| differences(session, rows, group))
        .collect();
    let modes = |d: &Difference| d.values.len().min(FIELD_MODES);
    let field_freedom = count(differences.iter().map(modes).sum());
    let total: usize = differences.iter().map(|d| d.values.len()).sum();
    if total < FEWEST_ROWS {
        return None;
    }
    let (within, freedom) = autoregression(&differences, config.most_ar)?;
    let filtered: Vec<Difference> = differences
        .into_iter()
        .map(|difference| difference.filtered(&within))
        .collect();
    let between = amplitudes(&filtered, within.variances[0].sqrt());
    let places: Vec<usize> = groups
        .iter()
        .flat_map(|group| group.blocks.clone())
        .collect();
    let blocks: Vec<&Block> = places.iter().map(|place| &rows.blocks[*place]).collect();
    let row_sigma_mm = within.variances[0].sqrt();
    let within_row = repeats::within_row_variance(&session.runs, &blocks);
    let repeats = groups
        .iter()
        .map(|group| group.values.len() + 1)
        .max()
        .unwrap_or(0);
    Some(Noise {
        row_sigma_mm,
        reading_sigma_mm: (row_sigma_mm.powi(2) + within_row).sqrt(),
        within,
        between,
        repeats,
        freedom,
        field_freedom,
    })
}

fn differences(session: &Session, rows: &Rows, group: &Contrasts) -> Vec<Difference> {
    let block = &rows.blocks[group.blocks[0]];
    let (kinds, modes) = field::modes(&session.runs[block.run], block);
    let modes = modes.select_rows(&group.rows);
    let open = open_columns(block, group, &kinds, &modes);
    let difference = |values: &Vec<f64>| Difference {
        values: DVector::from_vec(values.clone()),
        kinds: kinds.clone(),
        modes: modes.clone(),
        open: open.clone(),
    };
    group.values.iter().map(difference).collect()
}

/// What floats between the repeats: the offset where zeros differ; centre and radius of a ballbar.
fn open_columns(
    block: &Block,
    group: &Contrasts,
    kinds: &[Mode],
    modes: &DMatrix<f64>,
) -> DMatrix<f64> {
    let floats = |kind: &Mode| match kind {
        Mode::Offset => {
            (!group.one_zero && group.blocks.len() > 1) || block.channel == Channel::Radial
        }
        Mode::Place(k) => *k == 1 && block.channel == Channel::Radial,
        Mode::Drift => false,
    };
    let open: Vec<usize> = (0..kinds.len()).filter(|k| floats(&kinds[*k])).collect();
    modes.select_columns(&open)
}

impl Difference {
    fn filtered(mut self, within: &Autoregression) -> Self {
        within.filter(self.values.as_mut_slice());
        for mut column in self.modes.column_iter_mut() {
            within.filter(column.as_mut_slice());
        }
        for mut column in self.open.column_iter_mut() {
            within.filter(column.as_mut_slice());
        }
        let basis = crate::nuisance::orthonormal(
            self.values.len(),
            self.open.column_iter().map(|c| c.into_owned()),
        );
        self.values -= &basis * basis.tr_mul(&self.values);
        self.modes -= &basis * basis.tr_mul(&self.modes);
        self
    }

    /// What no smooth mode explains.
    fn rough(&self) -> (DVector<f64>, usize) {
        if self.values.len() < 3 * self.modes.ncols() {
            return (self.values.clone(), 0);
        }
        let basis = crate::nuisance::orthonormal(
            self.values.len(),
            self.modes.column_iter().map(|c| c.into_owned()),
        );
        let rough = &self.values - &basis * basis.tr_mul(&self.values);
        (rough, basis.ncols())
    }
}

/// (2) over all differences, and the rows it is known from.
fn autoregression(differences: &[Difference], most: usize) -> Option<(Autoregression, f64)> {
    let mut sums = vec![0.0; most + 1];
    let mut freedom = 0.0;
    let mut longest = 0;
    for difference in differences {
        let (rough, used) = difference.rough();
        freedom += count(rough.len() - used);
        longest = longest.max(rough.len());
        for (lag, sum) in sums.iter_mut().enumerate().take(rough.len()) {
            *sum += (lag..rough.len())
                .map(|t| rough[t] * rough[t - lag])
                .sum::<f64>();
        }
    }
    if sums[0] <= 0.0 {
        return None;
    }
    for sum in &mut sums {
        *sum /= freedom;
    }
    if longest < 30 {
        sums.truncate(1);
    }
    let full = Autoregression::levinson(&sums);
    let bic = |order: usize| freedom * full.variances[order].ln() + count(order) * freedom.ln();
    let order = (0..=full.order()).min_by(|a, b| bic(*a).total_cmp(&bic(*b)))?;
    Some((full.up_to(order), freedom))
}

/// (3) over the grids.
fn amplitudes(filtered: &[Difference], row_sigma_mm: f64) -> Smooth {
    let ratios: Vec<f64> = (0..14).map(|k| 0.03 * 1.6_f64.powi(k)).collect();
    let free = 1e3 * row_sigma_mm;
    let with_place = |ratio: f64, length_rad: f64| Smooth {
        place_mm: ratio * row_sigma_mm,
        length_rad,
        offset_mm: free,
        drift_mm: free,
    };
    let mut smooth = Smooth {
        length_rad: 0.5,
        ..Smooth::default()
    };
    let has = |mode: fn(&Mode) -> bool| filtered.iter().any(|d| d.kinds.iter().any(mode));
    if has(|mode| matches!(mode, Mode::Place(_))) {
        let lengths = [0.2, 0.35, 0.6, 1.0];
        let of_length = |length: f64| -> Vec<f64> {
            ratios
                .iter()
                .map(|r| likelihood(filtered, &with_place(*r, length)))
                .collect()
        };
        let table: Vec<Vec<f64>> = lengths.iter().map(|length| of_length(*length)).collect();
        let best = |row: &Vec<f64>| row.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let length = (0..lengths.len())
            .max_by(|a, b| best(&table[*a]).total_cmp(&best(&table[*b])))
            .unwrap_or(0);
        smooth.length_rad = lengths[length];
        smooth.place_mm = cautious(&ratios, &table[length]) * row_sigma_mm;
    }
    let place = smooth;
    let offset = |ratio: f64| Smooth {
        offset_mm: ratio * row_sigma_mm,
        drift_mm: free,
        ..place
    };
    smooth.offset_mm = row_sigma_mm * profile(filtered, &ratios, offset);
    let place = smooth;
    let drift = |ratio: f64| Smooth {
        drift_mm: ratio * row_sigma_mm,
        ..place
    };
    if has(|mode| matches!(mode, Mode::Drift)) {
        smooth.drift_mm = row_sigma_mm * profile(filtered, &ratios, drift);
    }
    smooth
}

fn profile(filtered: &[Difference], ratios: &[f64], smooth: impl Fn(f64) -> Smooth) -> f64 {
    let logs: Vec<f64> = ratios
        .iter()
        .map(|ratio| likelihood(filtered, &smooth(*ratio)))
        .collect();
    cautious(ratios, &logs)
}

/// Quantile of the posterior on a grid of ratios equal in the logarithm.
fn cautious(ratios: &[f64], logs: &[f64]) -> f64 {
    let best = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let weights: Vec<f64> = ratios
        .iter()
        .zip(logs)
        .map(|(ratio, log)| (log - best).exp() / (1.0 + ratio * ratio))
        .collect();
    let total: f64 = weights.iter().sum();
    let mut sum = 0.0;
    for (ratio, weight) in ratios.iter().zip(&weights) {
        sum += weight;
        if sum >= CAUTION * total {
            return *ratio;
        }
    }
    ratios[ratios.len() - 1]
}

fn likelihood(filtered: &[Difference], smooth: &Smooth) -> f64 {
    filtered
        .iter()
        .map(|difference| one_likelihood(difference, smooth))
        .sum()
}

fn one_likelihood(difference: &Difference, smooth: &Smooth) -> f64 {
    let scale: DVector<f64> = DVector::from_iterator(
        difference.kinds.len(),
        difference.kinds.iter().map(|kind| smooth.of(*kind)),
    );
    let mut gram = difference.modes.tr_mul(&difference.modes);
    let mut along = difference.modes.tr_mul(&difference.values);
    along.component_mul_assign(&scale);
    for i in 0..gram.nrows() {
        for j in 0..gram.ncols() {
            gram[(i, j)] *= scale[i] * scale[j];
        }
        gram[(i, i)] += 1.0;
    }
    let Some(cholesky) = gram.cholesky() else {
        return f64::NEG_INFINITY;
    };
    let log_det: f64 = cholesky
        .l_dirty()
        .diagonal()
        .iter()
        .map(|d| 2.0 * d.ln())
        .sum();
    let explained = along.dot(&cholesky.solve(&along));
    -0.5 * log_det - 0.5 * (difference.values.norm_squared() - explained)
}
