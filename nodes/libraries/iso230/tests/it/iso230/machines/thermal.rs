//! ISO 230-3: hours of drift, read at two heights in the shop that drifts as well.

use std::f64::consts::TAU;

use iso230::budget::DeviceUncertainty;
use iso230::thermal::{
    Artefact, ArtefactTemperature, DriftBudget, DriftCause, DriftChannel, DriftResult, DriftTest,
    GrowthReads, evaluate, scatter_mm,
};
use metrology::axis::Axis;
use rand_pcg::Pcg64Mcg;

use super::{Held, MACHINES, UM, between, hold_clause, machine, normal, shares, within_limits};

/// Three hours, a reading a minute.
const READINGS: u32 = 181;
const HOUR_S: f64 = 3600.0;
const HEIGHTS_MM: [f64; 2] = [100.0, 260.0];

/// Warming with two time constants, and the day in the shop.
fn warming(rng: &mut Pcg64Mcg, times_s: &[f64]) -> Vec<f64> {
    let part = |rng: &mut Pcg64Mcg, least_s, greatest_s| {
        [UM * 8.0 * normal(rng), between(rng, least_s, greatest_s)]
    };
    let parts = [part(rng, 300.0, 1800.0), part(rng, 2400.0, 9000.0)];
    let shop = [
        UM * between(rng, 0.2, 2.0),
        between(rng, 1200.0, 20_000.0),
        between(rng, 0.0, TAU),
    ];
    let at = |t: &f64| {
        let warm: f64 = parts
            .iter()
            .map(|[a, tau]| a * (1.0 - (-t / tau).exp()))
            .sum();
        warm + shop[0] * (TAU * t / shop[1] + shop[2]).sin()
    };
    times_s.iter().map(at).collect()
}

/// What a certified sensor reads: off by a wave over its range, at every reading normal with the certificate's u, and noise.
fn read(rng: &mut Pcg64Mcg, truth_mm: &[f64], (standard_mm, wave_mm): (f64, f64)) -> Vec<f64> {
    let size_mm = [0; 2].map(|_| standard_mm * normal(rng));
    let off_mm = |x: f64| {
        let (sin, cos) = (TAU * x / wave_mm).sin_cos();
        size_mm[0] * cos + size_mm[1] * sin
    };
    let noise_mm = 0.1 * standard_mm;
    truth_mm
        .iter()
        .map(|x| x + off_mm(*x) + noise_mm * normal(rng))
        .collect()
}

/// After an hour, range, and slope of the last hour by the two sums of a regression.
fn of_truth(times_s: &[f64], values: &[f64]) -> [f64; 3] {
    let last: Vec<(f64, f64)> = times_s
        .iter()
        .zip(values)
        .map(|(t, x)| (*t, *x))
        .filter(|(t, _)| *t >= 2.0 * HOUR_S)
        .collect();
    let n = last.len() as f64;
    let (t0, x0) = last
        .iter()
        .fold((0.0, 0.0), |(a, b), (t, x)| (a + t / n, b + x / n));
    let (top, bottom) = last.iter().fold((0.0, 0.0), |(a, b), (t, x)| {
        (a + (t - t0) * (x - x0), b + (t - t0).powi(2))
    });
    [
        values[60] - values[0],
        super::linear::range(values),
        top / bottom,
    ]
}

/// What the budget of a test states.
#[derive(Clone, Copy)]
struct Stated {
    /// The period of the sensors' error.
    period: bool,
    mandrel: Known,
}

/// What is known of the mandrel's growth.
#[derive(Clone, Copy)]
enum Known {
    /// No mandrel is stated.
    Rigid,
    /// The range of its temperature.
    Range,
    /// Its temperature, by a thermometer.
    Read,
}

/// A mandrel that grows, and what the budget has of it.
struct Mandrel {
    growth_mm: Vec<f64>,
    stated: Option<Artefact>,
}

impl Mandrel {
    /// One that warms or cools as the shop does.
    fn draw(rng: &mut Pcg64Mcg, times_s: &[f64], known: Known) -> Self {
        let tau_s = between(rng, 1200.0, 7200.0);
        let sense = if normal(rng) > 0.0 { 1.0 } else { -1.0 };
        let warm = |t: &f64| (1.0 - (-t / tau_s).exp()) / (1.0 - (-3.0 * HOUR_S / tau_s).exp());
        let length_mm = between(rng, 100.0, 300.0);
        match known {
            Known::Rigid => Self {
                growth_mm: vec![0.0; times_s.len()],
                stated: None,
            },
            Known::Range => {
                let range_k = between(rng, 0.1, 1.5);
                let whole_mm = sense * 11.5e-6 * length_mm * range_k;
                Self {
                    growth_mm: times_s.iter().map(|t| whole_mm * warm(t)).collect(),
                    stated: Some(Artefact {
                        length_mm,
                        expansion_per_k: 11.5e-6,
                        expansion_half_width_per_k: 0.0,
                        temperature: ArtefactTemperature::Range { range_k },
                    }),
                }
            }
            Known::Read => {
                let swing_k = sense * between(rng, 0.1, 3.0);
                let slow_k = between(rng, 0.0, 0.2);
                let (period_s, phase) = (between(rng, 2400.0, 14_400.0), between(rng, 0.0, TAU));
                let slow = |t: &f64| slow_k * (TAU * t / period_s + phase).sin();
                let degc = times_s.iter().map(|t| 20.0 + swing_k * warm(t) + slow(t));
                Self::read(rng, times_s, (length_mm, degc.collect()))
            }
        }
    }

    /// Of a length and true temperatures, with a thermometer and a stated coefficient that are off.
    fn read(rng: &mut Pcg64Mcg, times_s: &[f64], (length_mm, degc): (f64, Vec<f64>)) -> Self {
        let half_width_k = between(rng, 0.02, 0.2);
        let expansion_per_k = between(rng, 8e-6, 12.5e-6);
        let expansion_half_width_per_k = between(rng, 0.3e-6, 1.5e-6);
        let true_per_k = expansion_per_k + expansion_half_width_per_k * within_limits(rng);
        let growth_mm = degc.iter().map(|it| true_per_k * length_mm * (it - 20.0));
        Self {
            growth_mm: growth_mm.collect(),
            stated: Some(Artefact {
                length_mm,
                expansion_per_k,
                expansion_half_width_per_k,
                temperature: ArtefactTemperature::Read {
                    degc: thermometer(rng, times_s, (half_width_k, &degc)),
                    half_width_k,
                    growth_reads: GrowthReads::More,
                },
            }),
        }
    }
}

/// What a thermometer reads: off by a constant, and by a wander between knots 20 to 60 min apart.
fn thermometer(
    rng: &mut Pcg64Mcg,
    times_s: &[f64],
    (half_width_k, degc): (f64, &[f64]),
) -> Vec<f64> {
    let constant_k = between(rng, -0.5, 0.5);
    let every_s = between(rng, 1200.0, 3600.0);
    let begin = between(rng, 0.0, 1.0);
    let n = (3.0 * HOUR_S / every_s) as usize + 3;
    let knots_k: Vec<f64> = (0..n).map(|_| half_width_k * within_limits(rng)).collect();
    let off_k = |t: f64| {
        let place = begin + t / every_s;
        let (k, share) = (place as usize, place.fract());
        constant_k + (1.0 - share) * knots_k[k] + share * knots_k[k + 1]
    };
    { times_s.iter().zip(degc) }
        .map(|(t, it)| it + off_k(*t))
        .collect()
}

fn tested(seed: u64, stated: Stated) -> Vec<Held> {
    let mut rng = machine(seed, 3);
    let times_s: Vec<f64> = (0..READINGS).map(|k| f64::from(k) * 60.0).collect();
    let standard_mm = UM * between(&mut rng, 0.05, 0.3);
    let wave_mm = UM * between(&mut rng, 3.0, 40.0);
    let mandrel = Mandrel::draw(&mut rng, &times_s, stated.mandrel);
    let truths: Vec<Vec<f64>> = HEIGHTS_MM
        .iter()
        .map(|_| warming(&mut rng, &times_s))
        .collect();
    let channel = |(truth_mm, height_mm): (&Vec<f64>, f64)| {
        let both = truth_mm.iter().zip(&mandrel.growth_mm);
        let moved_mm: Vec<f64> = both.map(|(x, growth)| x + growth).collect();
        DriftChannel {
            axis: Axis::X,
            height_mm,
            displacements_mm: read(&mut rng, &moved_mm, (standard_mm, wave_mm)),
        }
    };
    let test = DriftTest {
        cause: DriftCause::Spindle,
        channels: truths.iter().zip(HEIGHTS_MM).map(channel).collect(),
        drift_after_s: HOUR_S,
        rate_window_s: HOUR_S,
        longest_gap_s: 120.0,
        times_s: times_s.clone(),
    };
    let scatters = test.channels.iter().map(|channel| {
        let found = scatter_mm(&test.times_s, &channel.displacements_mm);
        found.unwrap().powi(2)
    });
    let budget = DriftBudget {
        sensor: DeviceUncertainty {
            expanded_uncertainty_mm: 2.0 * standard_mm,
            expanded_uncertainty_per_length: 0.0,
            coverage_factor: 2.0,
        },
        reading_scatter_mm: (scatters.sum::<f64>() / 2.0).sqrt(),
        sensor_error_period_mm: stated.period.then_some(wave_mm),
        artefact: mandrel.stated,
    };
    held_of(&evaluate(&test, &budget).unwrap(), &times_s, &truths)
}

/// Every figure with its interval and what it is for an exact instrument.
fn held_of(found: &DriftResult, times_s: &[f64], truths: &[Vec<f64>]) -> Vec<Held> {
    let low = found.displacements[0];
    let angle = found.angles[0];
    let apart_mm = HEIGHTS_MM[1] - HEIGHTS_MM[0];
    let turned: Vec<f64> = truths[0]
        .iter()
        .zip(&truths[1])
        .map(|(low, high)| (high - low) / apart_mm)
        .collect();
    let (x, b) = (of_truth(times_s, &truths[0]), of_truth(times_s, &turned));
    let held = |name, value, expanded, truth| Held {
        name,
        value,
        expanded,
        truth,
    };
    let (d, e) = (low.drift_after, low.range);
    let (rate, turn) = (low.final_rate, angle.final_rate);
    vec![
        held("d", d.value_mm, d.expanded_uncertainty_mm, x[0]),
        held("range", e.value_mm, e.expanded_uncertainty_mm, x[1]),
        held(
            "rate",
            rate.value_mm_s,
            rate.expanded_uncertainty_mm_s,
            x[2],
        ),
        held(
            "d of B",
            angle.drift_after.value_rad,
            angle.drift_after.expanded_uncertainty_rad,
            b[0],
        ),
        held(
            "range of B",
            angle.range.value_rad,
            angle.range.expanded_uncertainty_rad,
            b[1],
        ),
        held(
            "rate of B",
            turn.value_rad_s,
            turn.expanded_uncertainty_rad_s,
            b[2],
        ),
    ]
}

fn found(what: &str, stated: Stated) -> Vec<(&'static str, f64)> {
    let all: Vec<Vec<Held>> = (0..MACHINES).map(|seed| tested(seed, stated)).collect();
    shares(what, &all)
}

#[test]
fn iso230_3_u_holds_the_drift_and_the_tilt_of_the_machine() {
    let stated = Stated {
        period: true,
        mandrel: Known::Rigid,
    };
    hold_clause(&found("ISO 230-3", stated), &[]);
}

#[test]
fn iso230_3_u_holds_the_drift_beside_a_mandrel_that_is_read() {
    let stated = Stated {
        period: true,
        mandrel: Known::Read,
    };
    hold_clause(&found("ISO 230-3 with a mandrel that is read", stated), &[]);
}

#[test]
fn iso230_3_u_is_wide_where_the_mandrel_may_grow_at_any_time() {
    // It may have grown by its whole range at any time: U is a bound.
    let stated = Stated {
        period: true,
        mandrel: Known::Range,
    };
    let wide = ["d", "range", "rate"];
    hold_clause(&found("ISO 230-3 with a mandrel", stated), &wide);
}

#[test]
fn iso230_3_u_of_a_rate_is_wide_without_the_period_of_the_instruments_error() {
    let stated = Stated {
        period: false,
        mandrel: Known::Rigid,
    };
    let wide = ["rate", "rate of B"];
    hold_clause(&found("ISO 230-3 without a period", stated), &wide);
}
