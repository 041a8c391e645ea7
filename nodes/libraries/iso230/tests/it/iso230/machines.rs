//! How often U of a figure holds the truth, over simulated machines of which the formulas under test know nothing.
//!
//! Every machine has its own pitch error (lead, a wander between knots, a cycle), reversal, scatter, temperatures of scale
//! and reference, coefficients of expansion, misalignment, certified reference and drift. The budget says of each what a
//! user would know: certificates, limits, a thermometer that is off, and the range of a watch at rest before the test.
//!
//! The truth is the figure of the readings that an exact instrument would have had of the same runs at 20 °C, by the words
//! of the standard, written out here. `tests/validation/coverage_of_u.py` makes machines and figures of its own for axes,
//! probing and periodic errors. The machine's scatter is part of it: ISO 230 states figures of the runs that were made.

pub mod circle;
mod diagonals;
mod linear;
mod periodic;
mod probing;
mod rotary;
mod thermal;

use std::f64::consts::TAU;

use iso230::budget::Expansion;
use rand::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

/// Machines of each kind.
pub const MACHINES: u64 = 1000;
/// A micrometre, mm.
pub const UM: f64 = 1e-3;

pub fn normal(rng: &mut Pcg64Mcg) -> f64 {
    StandardNormal.sample(rng)
}

pub fn between(rng: &mut Pcg64Mcg, least: f64, greatest: f64) -> f64 {
    rng.random_range(least..greatest)
}

pub fn machine(seed: u64, kind: u64) -> Pcg64Mcg {
    Pcg64Mcg::seed_from_u64(kind * 1_000_000 + seed)
}

/// A figure as it was evaluated, with its U, and what it truly is.
#[derive(Clone, Copy)]
pub struct Held {
    pub name: &'static str,
    pub value: f64,
    pub expanded: f64,
    pub truth: f64,
}

/// Shares of machines of which U held the truth, in the order of the figures; printed with the mean
/// error in units of U.
pub fn shares(what: &str, all: &[Vec<Held>]) -> Vec<(&'static str, f64)> {
    let n = all.len() as f64;
    (0..all[0].len())
        .map(|i| {
            let figures = || all.iter().map(|machine| machine[i]);
            let held = figures().filter(|f| (f.value - f.truth).abs() <= f.expanded);
            let share = held.count() as f64 / n;
            let ratio = figures()
                .map(|f| (f.value - f.truth) / f.expanded)
                .sum::<f64>()
                / n;
            eprintln!(
                "{what} {}: {:.1} %, mean error {ratio:+.2} U",
                all[0][i].name,
                100.0 * share
            );
            (all[0][i].name, share)
        })
        .collect()
}

/// Holds shares to what was found; `wanted` has the least and the greatest of each, in %.
pub fn hold(shares: &[(&'static str, f64)], wanted: &[(&str, f64, f64)]) {
    assert_eq!(shares.len(), wanted.len());
    for ((name, share), (of, least, greatest)) in shares.iter().zip(wanted) {
        assert_eq!(name, of);
        let percent = 100.0 * share;
        assert!(
            (*least..=*greatest).contains(&percent),
            "{name}: {percent} % is not {least} to {greatest} %"
        );
    }
}

/// Least and greatest share of machines, %, that the clause on coverage allows: 93 to 97, each with two standard deviations of
/// the share of [`MACHINES`] machines that are held so often.
pub fn clause() -> [f64; 2] {
    clause_of(MACHINES)
}

/// The same of another number of machines.
pub fn clause_of(machines: u64) -> [f64; 2] {
    let variance = |percent: f64| percent * (100.0 - percent) / machines as f64;
    let deviation = |percent: f64| variance(percent).sqrt();
    [93.0 - 2.0 * deviation(93.0), 97.0 + 2.0 * deviation(97.0)]
}

/// Holds every share to the clause; those that are `wide` for a reason that their test states may be greater, and are.
pub fn hold_clause(shares: &[(&'static str, f64)], wide: &[&str]) {
    let [least, greatest] = clause();
    for (name, share) in shares {
        let percent = 100.0 * share;
        let is_wide = wide.contains(name);
        assert!(
            percent >= least && (percent > greatest) == is_wide,
            "{name}: {percent} %, clause {least:.1} to {greatest:.1} %, wide: {is_wide}"
        );
    }
}

/// Drift of a machine at rest over time in units of the test's length: a trend, three waves, and unrest of each reading.
pub struct Drift {
    trend_mm: f64,
    waves: [[f64; 3]; 3],
    unrest_mm: f64,
}

impl Drift {
    pub fn draw(rng: &mut Pcg64Mcg, size_mm: f64) -> Self {
        let wave = |rng: &mut Pcg64Mcg| {
            let turns = between(rng, 0.25, 8.0);
            [
                size_mm * between(rng, 0.1, 0.5),
                turns,
                between(rng, 0.0, TAU),
            ]
        };
        Self {
            trend_mm: size_mm * normal(rng),
            waves: [wave(rng), wave(rng), wave(rng)],
            unrest_mm: 0.1 * size_mm,
        }
    }

    /// At a time, with the unrest of one reading.
    pub fn at(&self, time: f64, rng: &mut Pcg64Mcg) -> f64 {
        let waves = self.waves.iter();
        let waves: f64 = waves.map(|[a, f, p]| a * (TAU * f * time + p).sin()).sum();
        self.trend_mm * time + waves + self.unrest_mm * normal(rng)
    }

    /// Range of a watch as long as the test, before it, and the unrest of a reading by the spread about the line between its
    /// neighbours.
    pub fn watch(&self, rng: &mut Pcg64Mcg) -> [f64; 2] {
        let read: Vec<f64> = (0..60)
            .map(|k| self.at(f64::from(k) / 60.0 - 1.0, rng))
            .collect();
        let greatest = read.iter().copied().fold(f64::MIN, f64::max);
        let least = read.iter().copied().fold(f64::MAX, f64::min);
        let bends = read.windows(3).map(|x| x[1] - (x[0] + x[2]) / 2.0);
        let squares: f64 = bends.map(|bend| bend * bend / 1.5).sum();
        [greatest - least, (squares / 58.0).sqrt()]
    }

    /// Range of such a watch.
    pub fn watched_mm(&self, rng: &mut Pcg64Mcg) -> f64 {
        self.watch(rng)[0]
    }
}

/// Anywhere within limits of ± 1.
pub fn within_limits(rng: &mut Pcg64Mcg) -> f64 {
    between(rng, -1.0, 1.0)
}

/// Normal, with the standard deviation of such limits.
pub fn normal_as_limits(rng: &mut Pcg64Mcg) -> f64 {
    normal(rng) / 3.0_f64.sqrt()
}

/// A body that expands: what is stated of it, and by how much it truly does, mm/mm.
pub struct Body {
    pub stated: Expansion,
    pub growth: f64,
}

impl Body {
    /// At a temperature within ± `spread_k` of `about_k` above 20 °C.
    pub fn draw(rng: &mut Pcg64Mcg, about: (f64, f64), expansion_per_k: f64) -> Self {
        Self::draw_by(rng, about, expansion_per_k, within_limits)
    }

    /// The same with stated values that are wrong by `off`, in half widths.
    pub fn draw_by(
        rng: &mut Pcg64Mcg,
        (about_k, spread_k): (f64, f64),
        expansion_per_k: f64,
        off: fn(&mut Pcg64Mcg) -> f64,
    ) -> Self {
        let true_k = about_k + between(rng, -spread_k, spread_k);
        let half_width_k = between(rng, 0.1, 0.4);
        let half_width_per_k = 0.1 * expansion_per_k;
        let true_per_k = expansion_per_k + half_width_per_k * off(rng);
        Self {
            stated: Expansion {
                temperature_deviation_k: true_k + half_width_k * off(rng),
                temperature_half_width_k: half_width_k,
                expansion_per_k,
                expansion_half_width_per_k: half_width_per_k,
            },
            growth: true_per_k * true_k,
        }
    }
}

/// Pitch error and reversal of an axis at 20 °C.
pub struct Screw {
    lead: f64,
    knots_mm: Vec<f64>,
    knot_every_mm: f64,
    cycle: [f64; 3],
    reversal_mm: f64,
    reversal_slope: f64,
}

impl Screw {
    pub fn draw(rng: &mut Pcg64Mcg, travel_mm: f64) -> Self {
        let knot_every_mm = between(rng, 40.0, 120.0);
        let n = (travel_mm / knot_every_mm) as usize + 3;
        let mut at_mm = 0.0;
        let mut knot = || {
            at_mm += 0.8 * UM * normal(rng);
            at_mm
        };
        let knots_mm = (0..n).map(|_| knot()).collect();
        Self {
            lead: 12e-6 * normal(rng),
            knots_mm,
            knot_every_mm,
            cycle: [
                UM * between(rng, 0.0, 1.0),
                between(rng, 5.0, 20.0),
                between(rng, 0.0, TAU),
            ],
            reversal_mm: UM * between(rng, -1.0, 6.0),
            reversal_slope: 2e-6 * normal(rng),
        }
    }

    /// Error at a position from 0 on; `side` +1 where it is approached upwards, −1 downwards.
    pub fn error_mm(&self, at_mm: f64, side: f64) -> f64 {
        let place = at_mm / self.knot_every_mm;
        let (k, share) = (place as usize, place.fract());
        let wander_mm = self.knots_mm[k] + share * (self.knots_mm[k + 1] - self.knots_mm[k]);
        let [amplitude_mm, period_mm, phase] = self.cycle;
        let cycle_mm = amplitude_mm * (TAU * at_mm / period_mm + phase).sin();
        let reversal_mm = self.reversal_mm + self.reversal_slope * at_mm;
        self.lead * at_mm + wander_mm + cycle_mm + side * reversal_mm / 2.0
    }
}
