//! The strongest tone in the residuals, and how probable it is that noise alone makes one.
//!
//! # Model
//!
//! At each frequency a sine and a cosine are fitted to each trace's residuals (Lomb and Scargle's
//! periodogram, so times need not be equal), phases of the traces independent:
//!
//! ```text
//!   D(f) = Σ_k Δ_k(f)                      fall of the sum of squares, K traces             (1)
//!   z(f) = D(f)/max(variance, median D nearby / median χ²_2K)   ~ χ²_2K without a tone       (2)
//!   chance = M P(χ²_2K > z),  M = 3 T (f_max − f_min)                                       (3)
//! ```
//!
//! The median in (2) is over a window of 64 independent frequencies: where residuals are not white
//! the floor is that of their own neighbourhood. M in (3) counts the grid's frequencies closer than
//! 1/T as well, so the chance is too large rather than too small.
//!
//! A vibration of one axis is seen times cos θ or sin θ, as two lines a turn's frequency to either side.
//! So from the strongest line three shapes are tried, radius, first and second axis, and the greatest
//! total Δ is taken; chance is that of the line.
//!
//! Between f_min = the least lobes of the fastest trace and f_max = 0.45 sampling rates of the slowest.
//!
//! Whether f or the number of lobes a turn stays is decided by traces of another angular speed, each
//! searched within 1/T of both; where neither is there, it stays open.
//!
//! # References
//! \[1\] J. D. Scargle, Astrophys. J. 263 (1982) 835-853, doi:10.1086/160554.

use std::f64::consts::TAU;

use rustfft::num_complex::Complex;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::config::BreakdownConfig;
use super::maximum::{by_curvature, greatest};
use super::noise::median;
use super::projector::Projector;
use super::robust::Fit;
use super::scene::{Scene, Trace};
use super::spectrum::{Frequencies, sums};
use super::term::{Quadrature, RowKey, Term};
use super::tone::{hz_of_lobes, lobes_of_hz};

/// Grid points in 1/T.
const OVERSAMPLING: f64 = 4.0;
/// Independent frequencies in the window of (2).
const WINDOW: f64 = 64.0;
/// Highest frequency, in sampling rates.
const BELOW_NYQUIST: f64 = 0.45;
/// Angular speeds nearer than this share are one.
const SAME_SPEED: f64 = 0.05;
/// Frequencies that are tried about an expected one.
const ABOUT: i32 = 8;
/// Most points of the grid.
const MAX_FREQUENCY_POINTS: f64 = 200_000.0;

/// A tone that may be there.
#[derive(Clone, Debug)]
pub(super) struct Tone {
    pub terms: Vec<Term>,
    pub gain_mm2: f64,
    pub chance: f64,
    pub uncertainty_hz: f64,
    pub detectable_mm: f64,
}

/// One trace's times, residuals and weights.
struct Series {
    time_s: Vec<f64>,
    weighted_mm: Vec<f64>,
    weight: Vec<f64>,
    direction: Vec<[f64; 2]>,
}

impl Series {
    fn new(trace: &Trace, fit: &Fit) -> Self {
        let rows = trace.rows().filter(|row| fit.weights[*row] > 0.0);
        let (mut time_s, mut weighted_mm, mut weight) = (Vec::new(), Vec::new(), Vec::new());
        let mut direction = Vec::new();
        for row in rows {
            let root = trace.root(row - trace.first_row);
            time_s.push(trace.points[row - trace.first_row].time_s);
            weighted_mm.push(fit.weights[row] * root * fit.residuals_mm[row]);
            weight.push(fit.weights[row] * root * root);
            direction.push(trace.points[row - trace.first_row].direction);
        }
        Self {
            time_s,
            weighted_mm,
            weight,
            direction,
        }
    }

    fn duration_s(&self) -> f64 {
        self.time_s.last().unwrap_or(&0.0) - self.time_s.first().unwrap_or(&0.0)
    }

    /// Δ_k at one frequency, of the radius or of an axis.
    fn gain(&self, hz: f64, along: Option<usize>) -> f64 {
        let phasors = self
            .time_s
            .iter()
            .zip(&self.direction)
            .map(|(t, direction)| {
                let (sin, cos) = (TAU * hz * t).sin_cos();
                let seen = along.map_or(1.0, |axis| direction[axis]);
                (sin * seen, cos * seen)
            });
        let (mut rs, mut rc, mut ss, mut cc, mut sc) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for ((sin, cos), (r, w)) in phasors.zip(self.weighted_mm.iter().zip(&self.weight)) {
            rs += r * sin;
            rc += r * cos;
            ss += w * sin * sin;
            cc += w * cos * cos;
            sc += w * sin * cos;
        }
        gain_of(rs, rc, ss, cc, sc)
    }

    /// Δ_k of the radius at many frequencies: Σ w sin² and the like are those of twice the frequency.
    fn gains(&self, at: &Frequencies) -> Vec<f64> {
        let total: f64 = self.weight.iter().sum();
        let once = sums(&self.time_s, &self.weighted_mm, at);
        let twice = sums(&self.time_s, &self.weight, &at.doubled());
        let gain = |(r, w): (&Complex<f64>, &Complex<f64>)| {
            let (ss, cc, sc) = (0.5 * (total - w.re), 0.5 * (total + w.re), 0.5 * w.im);
            gain_of(r.im, r.re, ss, cc, sc)
        };
        once.iter().zip(&twice).map(gain).collect()
    }

    /// Greatest Δ_k within 1/T of a frequency.
    fn gain_about(&self, hz: f64, along: Option<usize>) -> f64 {
        let step_hz = 1.0 / (self.duration_s() * f64::from(ABOUT));
        let tried = (-ABOUT..=ABOUT).map(|i| self.gain(hz + step_hz * f64::from(i), along));
        tried.fold(0.0, f64::max)
    }
}

/// Fall of the sum of squares, from Σ r sin, Σ r cos, Σ sin², Σ cos² and Σ sin cos.
fn gain_of(rs: f64, rc: f64, ss: f64, cc: f64, sc: f64) -> f64 {
    let determinant = ss * cc - sc * sc;
    if determinant <= 1e-9 * (ss + cc).powi(2) {
        return 0.0;
    }
    (cc * rs * rs - 2.0 * sc * rs * rc + ss * rc * rc) / determinant
}

/// The frequencies to search; none where the samples are too far apart.
fn grid(scene: &Scene, series: &[Series], config: &BreakdownConfig) -> Option<Frequencies> {
    let fastest = scene
        .traces
        .iter()
        .map(|t| hz_of_lobes(config.least_lobes, t));
    let first_hz = fastest.fold(0.0, f64::max);
    let rate = |s: &Series| (s.time_s.len() as f64 - 1.0) / s.duration_s();
    let last_hz = BELOW_NYQUIST * series.iter().map(rate).fold(f64::INFINITY, f64::min);
    let longest_s = series.iter().map(Series::duration_s).fold(0.0, f64::max);
    let points = (last_hz - first_hz) * longest_s * OVERSAMPLING;
    let usable = (1.0..MAX_FREQUENCY_POINTS).contains(&points);
    usable.then(|| Frequencies {
        first_hz,
        step_hz: 1.0 / (longest_s * OVERSAMPLING),
        n: points as usize + 1,
    })
}

/// The strongest tone in the residuals of a fit, whether it is believable or not.
pub(super) fn strongest(projector: &Projector, config: &BreakdownConfig) -> Option<Tone> {
    let scene = projector.scene();
    let series: Vec<Series> = scene
        .traces
        .iter()
        .map(|t| Series::new(t, projector.fit))
        .collect();
    let frequencies = grid(scene, &series, config)?;
    let step_hz = frequencies.step_hz;
    let mut sums = vec![0.0; frequencies.n];
    for one in &series {
        for (sum, gain) in sums.iter_mut().zip(one.gains(&frequencies)) {
            *sum += gain;
        }
    }
    let chi = ChiSquared::new(2.0 * series.len() as f64).ok()?;
    let floors = floors(&sums, projector.fit.variance_mm2, &chi);
    let ratios = sums.iter().zip(&floors).map(|(sum, floor)| sum / floor);
    let (at, _) = ratios.enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let line_hz = frequencies.at_hz(at);
    let (hz, along) = shape(scene, &series, line_hz, step_hz);
    let total = |hz: f64| series.iter().map(|s| s.gain(hz, along)).sum::<f64>();
    let trials = 3.0 * frequencies.n as f64 / OVERSAMPLING;
    let needed = chi.inverse_cdf(1.0 - config.false_alarm / trials) * floors[at];
    let terms = terms(scene, &series, hz, along, floors[at], config);
    let gain_mm2 = projector.gain_of(&terms)?.0;
    Some(Tone {
        terms,
        gain_mm2,
        chance: (trials * chi.sf(sums[at] / floors[at])).min(1.0),
        uncertainty_hz: by_curvature(hz, 0.1 * step_hz, projector.fit.variance_mm2, total),
        detectable_mm: (2.0 * needed / scene.n_samples as f64).sqrt(),
    })
}

/// Frequency and direction that explain most, from the strongest line.
fn shape(scene: &Scene, series: &[Series], line_hz: f64, step_hz: f64) -> (f64, Option<usize>) {
    let gains = series.iter().map(|s| s.gain(line_hz, None)).enumerate();
    let strongest = gains
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map_or(0, |(k, _)| k);
    let turn_hz = scene.traces[strongest].speed_rad_s() / TAU;
    // The line is as wide as its own trace is short.
    let steps = (0.5 / (series[strongest].duration_s() * step_hz)).ceil() as i32 + 1;
    let shapes = [
        (0.0, None),
        (1.0, Some(0)),
        (-1.0, Some(0)),
        (1.0, Some(1)),
        (-1.0, Some(1)),
    ];
    let refined = shapes.map(|(turns, along)| {
        let total = |hz: f64| series.iter().map(|s| s.gain(hz, along)).sum::<f64>();
        let tried = (-2 * steps..=2 * steps)
            .map(|i| line_hz + turns * turn_hz + 0.5 * step_hz * f64::from(i));
        let best = tried
            .map(|hz| (total(hz), hz))
            .max_by(|a, b| a.0.total_cmp(&b.0));
        let near_hz = best.map_or(line_hz, |(_, hz)| hz);
        let hz = greatest(near_hz - 0.5 * step_hz, near_hz + 0.5 * step_hz, total);
        (total(hz), hz, along)
    });
    let best = refined.into_iter().max_by(|a, b| a.0.total_cmp(&b.0));
    best.map_or((line_hz, None), |(_, hz, along)| (hz, along))
}

/// The unit of (2) at each point of the grid.
fn floors(sums: &[f64], variance_mm2: f64, chi: &ChiSquared) -> Vec<f64> {
    let window = (WINDOW * OVERSAMPLING) as usize;
    let of_block = |block: &[f64]| {
        let floor = median(block.to_vec()) / chi.inverse_cdf(0.5);
        vec![floor.max(variance_mm2); block.len()]
    };
    sums.chunks(window).flat_map(of_block).collect()
}

/// Columns of a tone: what is held the same is decided by traces of another angular speed.
fn terms(
    scene: &Scene,
    series: &[Series],
    hz: f64,
    along: Option<usize>,
    floor: f64,
    config: &BreakdownConfig,
) -> Vec<Term> {
    let gains = series.iter().map(|s| s.gain(hz, along)).enumerate();
    let strongest = gains
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map_or(0, |(k, _)| k);
    let own = &scene.traces[strongest];
    let per_turn = lobes_of_hz(hz, own);
    let is_other = |t: &Trace| (t.speed_rad_s() / own.speed_rad_s() - 1.0).abs() > SAME_SPEED;
    let others = || (0..series.len()).filter(|k| is_other(&scene.traces[*k]));
    let lobes = |k: usize| hz_of_lobes(per_turn, &scene.traces[k]);
    let greatest = |hz_of: &dyn Fn(usize) -> f64| {
        others()
            .map(|k| series[k].gain_about(hz_of(k), along))
            .fold(0.0, f64::max)
    };
    let (same_hz, same_lobes) = (greatest(&|_| hz), greatest(&lobes));
    // Some sixteen frequencies are tried in each trace.
    let trials = f64::from(2 * ABOUT) * series.len() as f64;
    let believed = |gain: f64| trials * (-0.5 * gain / floor).exp() < config.false_alarm;
    let axis = along.map(|axis| scene.axes[axis]);
    let key = match (believed(same_hz), believed(same_lobes)) {
        (false, false) => RowKey::VibrationOrLobes {
            hz,
            per_turn,
            along: axis,
        },
        _ if same_hz >= same_lobes => RowKey::Vibration { hz, along: axis },
        _ => RowKey::Lobes {
            per_turn,
            along: axis,
        },
    };
    let of_trace = |trace: usize| {
        let of_key = match key {
            RowKey::VibrationOrLobes { .. } if is_other(&scene.traces[trace]) => None,
            RowKey::Lobes { .. } => Some(lobes(trace)),
            _ => Some(hz),
        };
        let parts = [Quadrature::Sine, Quadrature::Cosine];
        of_key.map(|hz| {
            parts.map(|part| Term::Tone {
                trace,
                hz,
                along,
                key,
                part,
            })
        })
    };
    (0..series.len()).filter_map(of_trace).flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq1_the_gains_at_many_frequencies_are_the_fit_at_each() {
        let time_s: Vec<f64> = (0..500)
            .map(|i| 0.01 * f64::from(i) + 0.003 * f64::from(i % 7))
            .collect();
        let weighted_mm: Vec<f64> = time_s.iter().map(|t| (TAU * 7.3 * t).sin()).collect();
        let square: f64 = weighted_mm.iter().map(|r| r * r).sum();
        let series = Series {
            direction: vec![[1.0, 0.0]; time_s.len()],
            weight: vec![1.0; time_s.len()],
            time_s,
            weighted_mm,
        };
        let at = Frequencies {
            first_hz: 5.0,
            step_hz: 0.05,
            n: 100,
        };
        let gains = series.gains(&at);
        for i in [0, 46, 99] {
            let direct = series.gain(at.at_hz(i), None);
            assert!((gains[i] - direct).abs() < 1e-8 * (1.0 + direct), "{i}");
        }
        assert!((series.gain(7.3, None) - square).abs() < 1e-8 * square);
    }
}
