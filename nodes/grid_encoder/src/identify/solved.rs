//! One weighted solution, its residuals, and what follows from both; equations as in `identify`.

use nalgebra::{DMatrix, DVector};

use super::disturbance::{Disturbances, Separated};
use super::judge::{Judgement, alike_by_recording, pooled_inflation};
use super::{Combination, Disturbed, Identification, IdentifyOptions, LEAST_FREEDOM, Noise};
use crate::combination::estimable_supports;
use crate::equations::{Equations, PointRows};
use crate::error::IdentifyError;
use crate::recording::{Recording, median};
use crate::spectrum::Spectrum;
use crate::triangle::Triangle;

/// Change of a weight that counts as none.
const SAME_WEIGHT: f64 = 0.03;
/// Makes the median of distances a standard deviation for normal noise.
const MAD_TO_SIGMA: f64 = 1.4826;

/// Residuals that a median of one recording needs.
const LEAST_OF_RECORDING: usize = 20;

/// One number per coordinate, by recording and point: weights, or residuals.
type PerEquation = Vec<Vec<[f64; 2]>>;

/// Weights of (2).
pub(super) struct Weighting {
    /// 1, or less for an outlier.
    outlier: PerEquation,
    /// g of (3) by recording.
    noise: Vec<f64>,
    /// How many neighbours count as one, by recording: (3) of `judge`.
    alike: Vec<f64>,
}

impl Weighting {
    pub(super) fn even(recordings: &[Recording]) -> Self {
        let ones = |recording: &Recording| vec![[1.0; 2]; recording.points.len()];
        Self {
            outlier: recordings.iter().map(ones).collect(),
            noise: vec![1.0; recordings.len()],
            alike: vec![1.0; recordings.len()],
        }
    }

    pub(super) fn of(&self, (recording, point, k): (usize, usize, usize)) -> f64 {
        let noise = self.noise[recording];
        self.outlier[recording][point][k] / (noise * noise * self.alike[recording])
    }

    /// Equations that one of a recording counts as.
    pub(super) fn count(&self, recording: usize) -> f64 {
        1.0 / self.alike[recording]
    }

    /// w of every equation.
    fn all(&self) -> PerEquation {
        let scaled = |(recording, points): (usize, &Vec<[f64; 2]>)| {
            let each = 0..points.len();
            each.map(|point| [0, 1].map(|k| self.of((recording, point, k))))
                .collect()
        };
        self.outlier.iter().enumerate().map(scaled).collect()
    }
}

/// One weighted solution in units of the span.
pub(super) struct Solved {
    spectrum: Spectrum,
    beta: DVector<f64>,
    n_equations: usize,
    /// What is left of each equation besides disturbances, r/u, by recording and point; NaN where there is none.
    ratios: PerEquation,
    /// What β alone leaves.
    residuals_mm: PerEquation,
    separated: Option<Separated>,
}

impl Solved {
    pub(super) fn new(
        equations: &Equations,
        weighting: &Weighting,
        options: &IdentifyOptions,
    ) -> Result<Self, IdentifyError> {
        let unknowns = &equations.unknowns;
        let mut triangle = Triangle::new(unknowns.len(), unknowns.n_coefficients);
        for_each_row(equations, |place, row, y, u| {
            triangle.push(row, y, weighting.of(place).sqrt() / u);
        });
        let n_equations = triangle.n_rows();
        let (r, right, _) = triangle.finish();
        let spectrum = Spectrum::of(&r, n_equations, options.rank_tolerance)
            .ok_or(IdentifyError::NoDecomposition)?;
        let beta = spectrum.solve(&right);
        let gaps = |points: &Vec<[f64; 2]>| vec![[f64::NAN; 2]; points.len()];
        let mut residuals_mm: PerEquation = weighting.outlier.iter().map(gaps).collect();
        let mut ratios = residuals_mm.clone();
        for_each_row(equations, |(recording, point, k), row, y, u| {
            let fitted: f64 = row.iter().zip(beta.iter()).map(|(x, b)| x * b).sum();
            residuals_mm[recording][point][k] = y - fitted;
            ratios[recording][point][k] = (y - fitted) / u;
        });
        Ok(Self {
            spectrum,
            beta,
            n_equations,
            ratios,
            residuals_mm,
            separated: None,
        })
    }

    pub(super) fn rank(&self) -> usize {
        self.spectrum.rank
    }

    /// Leads from the orthonormal basis of what is seen to the unknowns in units of the span.
    pub(super) fn whitener(&self) -> DMatrix<f64> {
        self.spectrum.whitener()
    }

    pub(super) fn residual_mm(&self, (recording, point, k): (usize, usize, usize)) -> f64 {
        self.residuals_mm[recording][point][k]
    }

    /// Whether what is left is noise.
    pub(super) fn judgement(&self, equations: &Equations, weighting: &Weighting) -> Judgement {
        let weights = weighting.all();
        let chi_square = self.sums(weighting, &weights).chi_square;
        Judgement::of(equations, &self.ratios, &weights, self.rank(), chi_square)
    }

    /// Equations (4) to (6) of `disturbance`, with ratios that are given or found.
    pub(super) fn separate(
        &mut self,
        equations: &Equations,
        weighting: &Weighting,
        disturbed: &Disturbed,
    ) {
        let disturbances = Disturbances::of(equations);
        let sums = disturbances.sums(self, weighting);
        let separated = match disturbed {
            Disturbed::Given { ratios } => sums.given(ratios),
            Disturbed::Found { start } => sums.estimated(*start),
            Disturbed::Ignored => None,
        };
        let Some(separated) = separated else { return };
        self.beta -= self.whitener() * &separated.correction;
        let mut entries = Vec::new();
        let (beta, residuals_mm, ratios) = (&self.beta, &mut self.residuals_mm, &mut self.ratios);
        for_each_row(equations, |place, row, y, u| {
            let (recording, point, k) = place;
            let fitted: f64 = row.iter().zip(beta.iter()).map(|(x, b)| x * b).sum();
            let disturbed_mm = disturbances.effect_mm(place, &separated.gamma, &mut entries);
            residuals_mm[recording][point][k] = y - fitted;
            ratios[recording][point][k] = (y - fitted - disturbed_mm) / u;
        });
        self.separated = Some(separated);
    }

    /// Counts neighbours that resemble each other as fewer, recording by recording.
    pub(super) fn weigh_neighbours(&self, weighting: &mut Weighting) {
        weighting.alike = alike_by_recording(&self.ratios, &weighting.all());
    }

    /// (2) and (3); whether a weight changed.
    pub(super) fn reweigh(&self, weighting: &mut Weighting, options: &IdentifyOptions) -> bool {
        let spread_of_all = spread(self.ratios.iter().flatten());
        let mut changed = false;
        for (recording, ratios) in self.ratios.iter().enumerate() {
            let mut spread_here = spread_of_all;
            if options.recording_noise && 2 * ratios.len() >= LEAST_OF_RECORDING {
                spread_here = spread(ratios.iter());
                let noise = &mut weighting.noise[recording];
                let new = spread_here.max(1.0);
                changed |= (new / *noise - 1.0).abs() > SAME_WEIGHT;
                *noise = new;
            }
            // With as many unknowns as equations half of the residuals may be zero.
            let bound = options.outlier_limit * spread_here;
            if bound <= 0.0 {
                continue;
            }
            let weights = weighting.outlier[recording].iter_mut().flatten();
            for (weight, ratio) in weights.zip(ratios.iter().flatten()) {
                let new = match (bound / ratio.abs()).powi(2) {
                    share if share < 1.0 => share,
                    _ => 1.0,
                };
                changed |= (new - *weight).abs() > SAME_WEIGHT;
                *weight = new;
            }
        }
        changed
    }

    /// Everything that is told, in own units; `judgement` is of the residuals before anything was separated.
    pub(super) fn into_identification(
        self,
        equations: &Equations,
        weighting: Weighting,
        options: &IdentifyOptions,
        judgement: Judgement,
    ) -> Identification {
        let rank = self.spectrum.rank;
        let freedom = self.n_equations.saturating_sub(rank);
        let weights = weighting.all();
        let sums = self.sums(&weighting, &weights);
        let variance_ratio = match (&self.separated, options.noise) {
            (Some(separated), _) => separated.variance_ratio,
            (None, Noise::FromResiduals) if freedom >= LEAST_FREEDOM => {
                sums.chi_square / freedom as f64
            }
            _ => 1.0,
        }; // s² of (1)
        let variance_inflation = match (&self.separated, options.noise) {
            (Some(_), _) => pooled_inflation(&self.ratios, &weights, &weighting.alike),
            (None, noise) => judgement.variance_inflation(noise),
        };
        let mut covariance = self.cofactor() * (variance_ratio * variance_inflation);
        self.widen(equations, &weighting, options, &mut covariance);
        let visibility = self.spectrum.visibility();
        let scale = &equations.scale;
        let n_coefficients = equations.unknowns.n_coefficients;
        let supports = estimable_supports(&self.spectrum.projector(), &visibility, n_coefficients);
        let combinations = supports
            .iter()
            .map(|support| combination(&support.weights, &self.beta, &covariance, scale))
            .collect();
        let mut values = DVector::from_fn(scale.len(), |j, _| self.beta[j] * scale[j]);
        put_back(equations, &mut values);
        let points = || equations.recordings.iter().flat_map(|r| &r.points);
        let separated = self.separated.as_ref().map(|separated| {
            Disturbances::of(equations).told(&separated.ratios, separated.variance_ratio)
        });
        Identification {
            components: options.components.clone(),
            unknowns: equations.unknowns.all.clone(),
            n_coefficients,
            covariance: DMatrix::from_fn(scale.len(), scale.len(), |i, j| {
                covariance[(i, j)] * scale[i] * scale[j]
            }),
            values,
            visibility,
            scale: scale.clone(),
            combinations,
            rank,
            gap: self.spectrum.gap,
            condition: self.spectrum.condition(),
            singular_values: self.spectrum.singular_values,
            noise_ratio: variance_ratio.sqrt(),
            residual_standard_deviation_mm: (sums.squares_mm2 / freedom.max(1) as f64).sqrt(),
            degrees_of_freedom: freedom,
            n_equations: self.n_equations,
            n_readings: points().map(|point| point.n_readings as usize).sum(),
            n_outliers: sums.n_outliers,
            judgement,
            variance_inflation,
            disturbances: separated,
            spans: equations.spans,
            weights,
            recording_noise: weighting.noise,
            residuals_mm: without_gaps(self.residuals_mm),
        }
    }

    /// Covariance of β for s² = 1.
    fn cofactor(&self) -> DMatrix<f64> {
        let plain = self.spectrum.cofactor();
        let Some(separated) = &self.separated else {
            return plain;
        };
        let whitener = self.whitener();
        plain + &whitener * &separated.widening * whitener.transpose()
    }

    /// Adds what the plate's certificate leaves open.
    fn widen(
        &self,
        equations: &Equations,
        weighting: &Weighting,
        options: &IdentifyOptions,
        covariance: &mut DMatrix<f64>,
    ) {
        let whitener = self.whitener();
        let certificate = &options.certificate;
        certificate.widen(equations, weighting, &whitener, covariance);
    }

    fn sums(&self, weighting: &Weighting, weights: &PerEquation) -> Sums {
        let mut sums = Sums::default();
        let residuals = self.residuals_mm.iter().flatten().flatten();
        let ratios = self.ratios.iter().flatten().flatten();
        let outlier = weighting.outlier.iter().flatten().flatten();
        let weights = weights.iter().flatten().flatten();
        for (((residual, ratio), outlier), weight) in
            residuals.zip(ratios).zip(outlier).zip(weights)
        {
            if ratio.is_finite() {
                sums.chi_square += weight * ratio * ratio;
                sums.squares_mm2 += outlier * residual * residual;
                sums.n_outliers += usize::from(*outlier < 1.0);
            }
        }
        sums
    }
}

/// Adds the turns and offsets that were taken out beforehand.
fn put_back(equations: &Equations, values: &mut DVector<f64>) {
    for (setup_id, at) in &equations.unknowns.setup_at {
        values[*at] += equations.turns_rad.get(setup_id).copied().unwrap_or(0.0);
    }
    for (zero_id, at) in &equations.unknowns.zero_at {
        let zero_mm = equations.offsets_mm.get(zero_id).copied();
        let [u_mm, v_mm] = zero_mm.unwrap_or_default();
        values[*at] += u_mm;
        values[*at + 1] += v_mm;
    }
}

/// m of (2); zero without residuals.
fn spread<'a>(ratios: impl Iterator<Item = &'a [f64; 2]>) -> f64 {
    let sizes = ratios.flatten().filter(|r| r.is_finite()).map(|r| r.abs());
    let sizes: Vec<f64> = sizes.collect();
    MAD_TO_SIGMA * median(&sizes).unwrap_or(0.0)
}

#[derive(Default)]
struct Sums {
    chi_square: f64,
    squares_mm2: f64,
    n_outliers: usize,
}

fn combination(
    weights: &[(usize, f64)],
    beta: &DVector<f64>,
    covariance: &DMatrix<f64>,
    scale: &[f64],
) -> Combination {
    let variance: f64 = weights
        .iter()
        .flat_map(|(i, wi)| {
            weights
                .iter()
                .map(move |(j, wj)| wi * wj * covariance[(*i, *j)])
        })
        .sum();
    Combination {
        weights: weights
            .iter()
            .map(|(idx, w)| (*idx, w / scale[*idx]))
            .collect(),
        value_mm: weights.iter().map(|(idx, w)| w * beta[*idx]).sum(),
        standard_uncertainty_mm: variance.max(0.0).sqrt(),
    }
}

/// Calls `take` with (recording, point, equation of the point), row, right-hand side and uncertainty.
pub(super) fn for_each_row(
    equations: &Equations,
    mut take: impl FnMut((usize, usize, usize), &[f64], f64, f64),
) {
    let mut rows = PointRows::default();
    for (recording_idx, recording) in equations.recordings.iter().enumerate() {
        for (point_idx, point) in recording.points.iter().enumerate() {
            equations.fill(recording_idx, point, &mut rows);
            for (k, (row, y, u)) in rows.iter().enumerate() {
                take((recording_idx, point_idx, k), row, y, u);
            }
        }
    }
}

/// An equation that is not there leaves nothing.
fn without_gaps(mut residuals_mm: PerEquation) -> PerEquation {
    for residual in residuals_mm.iter_mut().flatten().flatten() {
        if residual.is_nan() {
            *residual = 0.0;
        }
    }
    residuals_mm
}
