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
//! name a cause; likewise `CAUTION_WITHIN` of the variance within runs, which a dozen touches leave open by a third.
//!
//! Repeats that differ by less than the encoder can tell (a machine that is simulated without noise differs by
//! nothing at all) have the noise of its resolution r, white: v = r2 / 12 \[3\].
//!
//! # Holds when
//! All runs of a channel have the noise that its repeats have, at their own pace (`pace`). Where nothing was repeated
//! `unrepeated` has the noise of logs, and single runs in motion have what their smooth modes leave.
//!
//! # References
//! \[1\] G. Schwarz, Ann. Stat. 6, 1978 (BIC). \[2\] H. D. Patterson, R. Thompson, Biometrika 58, 1971
//! (variances from contrasts). \[3\] JCGM 100:2008 (GUM), F.2.2.1 (resolution of a digital indication).

pub(crate) mod bootstrap;
pub(crate) mod form_error;
pub(crate) mod joins;
pub(crate) mod normal;
pub(crate) mod pace;
pub(crate) mod repeats;
pub(crate) mod stack;
pub(crate) mod unrepeated;
pub(crate) mod vibration;
pub(crate) mod whitener;
pub(crate) mod whiteness;

use std::collections::BTreeMap;

use machine::MachineFile;
use machine::file::AxisEntry;
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};
use twin::{Channel, Run, Session};

use crate::config::GapConfig;
use crate::noise::joins::Joins;
use crate::noise::pace::{Pace, Repeated};
use crate::noise::repeats::Contrasts;
use crate::noise::whitener::Autoregression;
use crate::search::field::{self, Mode, Smooth};
use crate::search::rows::{Block, Rows, count};
use crate::session::log::LONG_S;

mod both_ways;
mod memory;
mod within_runs;

/// Noise of one channel.
#[derive(Clone, Debug)]
pub struct Noise {
    /// Within a run, between rows, at the pace of the repeats.
    pub within: Autoregression,
    /// The same at other paces.
    pub pace: Pace,
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
        scaled.within = scaled.within.scaled(ratio);
        scaled.pace = scaled.pace.scaled(ratio);
        scaled.row_sigma_mm *= size;
        scaled.reading_sigma_mm *= size;
        scaled
    }

    /// Within a block, at its pace.
    pub fn within(&self, run: &Run, block: &Block) -> Autoregression {
        let row_s = pace::row_s(run, block);
        let at_pace = row_s.and_then(|row_s| self.pace.at(row_s));
        at_pace.unwrap_or_else(|| self.within.clone())
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
pub(crate) const MIN_NOISE_ROWS: usize = 6;
/// Fewest rows that say what it is at a pace of its own.
const FEWEST_OF_A_PACE: f64 = 60.0;

/// A session's readings as rows, with the residual of each reading of each run, mm.
#[derive(Clone, Copy)]
pub struct Readings<'r> {
    /// The machine as its file describes it.
    pub machine: &'r MachineFile,
    /// The session.
    pub session: &'r Session,
    /// Its rows.
    pub rows: &'r Rows,
    /// By run.
    pub residual: &'r [Vec<f64>],
}

/// Noise of every channel that was repeated, and of the logs of the others (of long logs, where anything was repeated), else of
/// single runs in motion; `raw` is the residual of each row. What changed at `steps` (first runs after each) is no noise.
pub fn noise(
    readings: Readings<'_>,
    raw: &[f64],
    steps: &[usize],
    config: &GapConfig,
) -> BTreeMap<Channel, Noise> {
    let beside = |steps: &[usize]| -> BTreeMap<Channel, Noise> {
        let groups = repeats::contrasts(readings.session, readings.rows, raw, steps);
        let of = |(channel, groups): (Channel, Vec<Contrasts>)| {
            let found = of_channel(readings, &groups, config)?;
            Some((channel, found))
        };
        groups.into_iter().filter_map(of).collect()
    };
    // Where a channel has no repeats but across the steps, these are in its noise.
    let mut repeated = beside(&[]);
    if !steps.is_empty() {
        repeated.extend(beside(steps));
    }
    let least_s = if repeated.is_empty() { 0.0 } else { LONG_S };
    let mut all = unrepeated::noise(readings, raw, least_s);
    if all.is_empty() && repeated.is_empty() {
        all = within_runs::noise(readings, raw, config);
    }
    all.extend(repeated);
    all
}

/// Share of the posterior of a variance within runs below what is used.
const CAUTION_WITHIN: f64 = 0.9;
/// How much greater a variance that is known from so many rows may well be.
pub fn doubt(freedom: f64) -> f64 {
    let law = ChiSquared::new(freedom.max(1.0)).ok();
    law.map_or(1.0, |law| {
        freedom.max(1.0) / law.inverse_cdf(1.0 - CAUTION_WITHIN)
    })
}

/// One difference with its modes, before and after the filter.
struct Difference {
    /// Duration of a row and time between readings, s, and the variance within a row, mm2; none without a pace.
    paced: Option<[f64; 3]>,
    values: DVector<f64>,
    kinds: Vec<Mode>,
    modes: DMatrix<f64>,
    open: DMatrix<f64>,
}

fn of_channel(readings: Readings<'_>, groups: &[Contrasts], config: &GapConfig) -> Option<Noise> {
    let rows = readings.rows;
    let differences: Vec<Difference> = groups
        .iter()
        .flat_map(|group| differences(readings, group))
        .collect();
    let modes = |d: &Difference| d.values.len().min(FIELD_MODES);
    let field_freedom = count(differences.iter().map(modes).sum());
    let total: usize = differences.iter().map(|d| d.values.len()).sum();
    if total < MIN_NOISE_ROWS {
        return None;
    }
    let all: Vec<&Difference> = differences.iter().collect();
    let channel = &rows.blocks[groups.first()?.blocks[0]].channel;
    let least_mm2 = resolution_mm(readings.machine, channel).powi(2) / 12.0;
    let (within, freedom) = autoregression(&all, config.most_ar, least_mm2)?;
    let pace = Pace::new(&repeated(&differences, config.most_ar, least_mm2));
    let doubt = doubt(freedom);
    let (within, pace) = (within.scaled(doubt), pace.scaled(doubt));
    let filtered: Vec<Difference> = differences
        .into_iter()
        .map(|difference| {
            let at_pace = difference.paced.and_then(|[row_s, ..]| pace.at(row_s));
            difference.filtered(&at_pace.unwrap_or_else(|| within.clone()))
        })
        .collect();
    let mut between = amplitudes(&filtered, within.variances[0].sqrt());
    let joined: Option<Vec<&Joins>> = groups.iter().map(|group| group.joins.as_ref()).collect();
    if let Some(joined) = joined {
        let apart_mm = joins::apart_mm(&joined, within.variances[0].sqrt(), between.place_mm);
        (between.offset_mm, between.drift_mm) = (apart_mm, apart_mm);
    }
    let places: Vec<usize> = groups
        .iter()
        .flat_map(|group| group.blocks.clone())
        .collect();
    let blocks: Vec<&Block> = places.iter().map(|place| &rows.blocks[*place]).collect();
    let row_sigma_mm = (within.variances[0] / doubt).sqrt();
    let within_row = repeats::within_row_variance(readings.residual, &blocks);
    let repeats = groups
        .iter()
        .map(|group| group.values.len() + 1)
        .max()
        .unwrap_or(0);
    Some(Noise {
        row_sigma_mm,
        reading_sigma_mm: (row_sigma_mm.powi(2) + within_row).sqrt(),
        within,
        pace,
        between,
        repeats,
        freedom,
        field_freedom,
    })
}

fn differences(readings: Readings<'_>, group: &Contrasts) -> Vec<Difference> {
    let block = &readings.rows.blocks[group.blocks[0]];
    let (kinds, modes) = field::modes(&readings.session.runs[block.run], block);
    let modes = modes.select_rows(&group.rows);
    let open = open_columns(block, group, &kinds, &modes);
    let paced = paced(readings, group);
    let difference = |values: &Vec<f64>| Difference {
        paced,
        values: DVector::from_vec(values.clone()),
        kinds: kinds.clone(),
        modes: modes.clone(),
        open: open.clone(),
    };
    group.values.iter().map(difference).collect()
}

/// Duration of a row and time between readings of a group of repeats, and their variance within a row.
fn paced(of: Readings<'_>, group: &Contrasts) -> Option<[f64; 3]> {
    let block = &of.rows.blocks[group.blocks[0]];
    let row_s = pace::row_s(&of.session.runs[block.run], block)?;
    let readings: usize = block.rows.iter().map(|row| row.readings.len()).sum();
    let reading_s = row_s * count(block.rows.len()) / count(readings);
    let blocks = group.blocks.iter().map(|at| &of.rows.blocks[*at]);
    let blocks: Vec<&Block> = blocks.collect();
    let within_row = repeats::within_row_variance(of.residual, &blocks);
    Some([row_s, reading_s, within_row])
}

/// What differences show at each pace.
fn repeated(differences: &[Difference], most: usize, least_mm2: f64) -> Vec<Repeated> {
    let mut paces = Vec::<(f64, Vec<&Difference>)>::new();
    for difference in differences {
        let Some([row_s, ..]) = difference.paced else {
            continue;
        };
        let same = |pace: &&mut (f64, _)| (pace.0 / row_s).ln().abs() < pace::SAME_PACE;
        match paces.iter_mut().find(same) {
            Some((_, own)) => own.push(difference),
            None => paces.push((row_s, vec![difference])),
        }
    }
    let of_pace = |(row_s, own): (f64, Vec<&Difference>)| {
        let (noise, freedom) = autoregression(&own, most, least_mm2)?;
        let [_, reading_s, within_row] = own.first()?.paced?;
        (freedom >= FEWEST_OF_A_PACE).then(|| Repeated {
            row_s,
            reading_s,
            autocovariances: autocovariances(&own, most).0,
            within_row,
            freedom,
            noise,
        })
    };
    paces.into_iter().filter_map(of_pace).collect()
}

/// What floats between the repeats: the offset where zeros differ; centre and radius of a ballbar; offset and drift of runs that join.
fn open_columns(
    block: &Block,
    group: &Contrasts,
    kinds: &[Mode],
    modes: &DMatrix<f64>,
) -> DMatrix<f64> {
    let floats = |kind: &Mode| match kind {
        Mode::Offset => {
            (!group.one_zero && group.blocks.len() > 1)
                || block.channel == Channel::Radial
                || group.joins.is_some()
        }
        Mode::Place(k) => *k == 1 && block.channel == Channel::Radial,
        Mode::Drift => group.joins.is_some(),
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
        let basis = crate::search::nuisance::orthonormal(
            self.values.len(),
            self.open.column_iter().map(|c| c.into_owned()),
        );
        self.values -= &basis * basis.tr_mul(&self.values);
        self.modes -= &basis * basis.tr_mul(&self.modes);
        self
    }

    /// What no smooth mode explains, and the modes that were taken out.
    fn rough(&self) -> (DVector<f64>, DMatrix<f64>) {
        let rows = self.values.len();
        if rows < 3 * self.modes.ncols() {
            return (self.values.clone(), DMatrix::zeros(rows, 0));
        }
        let modes = self.modes.column_iter().map(|c| c.into_owned());
        let basis = crate::search::nuisance::orthonormal(rows, modes);
        let rough = &self.values - &basis * basis.tr_mul(&self.values);
        (rough, basis)
    }
}

/// Resolution of an encoder, mm (rad for a rotary axis); zero where the machine file has none.
pub fn resolution_mm(machine: &MachineFile, channel: &Channel) -> f64 {
    let (axis, is_scale) = match channel {
        Channel::Motor(axis) => (axis, false),
        Channel::Scale(axis) => (axis, true),
        _ => return 0.0,
    };
    match machine.axes.get(axis) {
        Some(AxisEntry::Linear(linear)) if is_scale => {
            1e-3 * linear.scale_resolution_um.unwrap_or(0.0)
        }
        Some(AxisEntry::Linear(linear)) => 1e-3 * linear.encoder_resolution_um,
        Some(AxisEntry::Rotary(rotary)) => (rotary.encoder_resolution_arcsec / 3600.0).to_radians(),
        None => 0.0,
    }
}

/// (2) over some differences, and the rows it is known from; white where they show less than `least_mm2`.
fn autoregression(
    differences: &[&Difference],
    most: usize,
    least_mm2: f64,
) -> Option<(Autoregression, f64)> {
    let (mut sums, freedom) = autocovariances(differences, most);
    if sums[0] <= least_mm2 {
        let resolved = Autoregression::levinson(&[least_mm2]);
        return (least_mm2 > 0.0 && freedom > 0.0).then_some((resolved, freedom));
    }
    let longest = differences.iter().map(|d| d.values.len()).max();
    if longest.unwrap_or(0) < 30 {
        sums.truncate(1);
    }
    let full = Autoregression::levinson(&sums);
    let bic = |order: usize| freedom * full.variances[order].ln() + count(order) * freedom.ln();
    let order = (0..=full.order()).min_by(|a, b| bic(*a).total_cmp(&bic(*b)))?;
    Some((full.up_to(order), freedom))
}

/// Autocovariances of the noise within runs, and the rows they are known from. The modes that are taken out (Q, P = I -
/// QQ') take their share of it with them, which makes neighbours look opposed; with G_k one where rows are k apart
///
/// ```text
///   E r'G_k r = sum_j S_kj gamma_j,   S_kj = <G_k, P G_j P>,   j = 0 .. p  (4)
///   (S + 2 / t2 diag(0, 1, .., 1)) gamma = r'G r                           (5)
/// ```
///
/// An autocovariance alike at all lags is just what the modes take out, so that S says next to nothing of it. White noise of
/// variance s2 scatters r'G r by 2 s4 S; with autocorrelations that are 0 but for a standard deviation t (`USUAL`), (5) is the
/// most probable answer. Memory beyond p rows is not in it: the field between runs takes what lasts longer.
fn autocovariances(differences: &[&Difference], most: usize) -> (Vec<f64>, f64) {
    let lags = most + 1;
    let mut sums = DVector::<f64>::zeros(lags);
    let mut shares = DMatrix::<f64>::zeros(lags, lags);
    let mut freedom = 0.0;
    for difference in differences {
        let (rough, basis) = difference.rough();
        let rows = rough.len();
        freedom += count(rows - basis.ncols());
        let moved: Vec<DMatrix<f64>> = (0..lags).map(|lag| neighbours(&basis, lag)).collect();
        let within: Vec<DMatrix<f64>> = moved.iter().map(|moved| basis.tr_mul(moved)).collect();
        for k in 0..lags.min(rows) {
            let products = (k..rows).map(|t| rough[t] * rough[t - k]);
            sums[k] += products.sum::<f64>() * pairs(k);
            shares[(k, k)] += count(rows - k) * pairs(k);
            for j in 0..lags {
                shares[(k, j)] += within[k].dot(&within[j]) - 2.0 * moved[k].dot(&moved[j]);
            }
        }
    }
    for lag in 1..lags {
        shares[(lag, lag)] += 2.0 / USUAL.powi(2);
    }
    let found = shares.lu().solve(&sums).filter(|found| found[0] > 0.0);
    let plain = || {
        let counted = (0..lags).map(|lag| pairs(lag) * freedom.max(1.0));
        sums.iter().zip(counted).map(|(sum, n)| sum / n).collect()
    };
    let found = found.map_or_else(plain, |found| found.as_slice().to_vec());
    (found, freedom)
}

/// How far from 0 autocorrelations between rows usually are.
const USUAL: f64 = 0.3;

/// How often a pair of rows this far apart is counted in G_k.
const fn pairs(lag: usize) -> f64 {
    if lag == 0 { 1.0 } else { 2.0 }
}

/// G_k Q.
fn neighbours(basis: &DMatrix<f64>, lag: usize) -> DMatrix<f64> {
    if lag == 0 {
        return basis.clone();
    }
    let rows = basis.nrows();
    DMatrix::from_fn(rows, basis.ncols(), |row, column| {
        let before = if row >= lag {
            basis[(row - lag, column)]
        } else {
            0.0
        };
        let after = if row + lag < rows {
            basis[(row + lag, column)]
        } else {
            0.0
        };
        before + after
    })
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

#[cfg(test)]
mod tests;
