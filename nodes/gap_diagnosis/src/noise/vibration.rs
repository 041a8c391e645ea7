//! A vibration that is alike in all runs, as a narrow line in the spectrum of the noise within runs.
//!
//! # Model
//!
//! ```text
//!   P_r(f) = mean over the segments of run r of |FFT(w (e - a - b t))|2       (1)   w: Hann
//!   A(f)   = mean over r of P_r(f) / median P_r                               (2)
//!   q(f)   = A(f) / max(median of A below f, median of A above f)             (3)
//!   chance = N Pr(F(2K, 6K) >= q)                                             (4)
//!   f0     = sum f (A - B) / sum (A - B),   about the line                    (5)
//!   rms2   = sum of (P - B) about the line, P the mean of (1)                 (6)
//!   Z      = sum over tests of n R2,   R = |sum c_r| / sum |c_r|              (7)
//! ```
//!
//! e is the residual of the readings of one channel, of a plate or ballbar in one plane, evenly sampled; N the number of
//! frequencies, lengths of segments and channels that are looked at, K the segments that (2) is worth. No slope and no hump of
//! noise that is wider than [`spectrum`]'s neighbours is a line. Each run has to show it as well, at a chance of
//! [`CHANCE_OF_ONE_RUN`].
//!
//! An error along the path has a frequency at one feed, too, and then one phase in all repeats: (7), with phases about the middle
//! of the path, is above what random phases reach. Such a line is not reported here.
//!
//! It names no cause. Readings slower than ten a second are not looked at. Amplitude and frequency may wander by the width of
//! the neighbours; of a frequency that wanders farther, (6) is the middle: a lower bound. Where the sampling is slower than twice
//! the frequency, an alias is seen.
//!
//! # Agreement
//! `white_noise_has_no_line`: none in 1,000 seeds. `val_numpy_vibration`: a series of numpy whose amplitude and phase wander
//! is met to 0.2 Hz and a tenth of its size.
//!
//! # References
//! \[1\] R. A. Fisher, Proc. R. Soc. A 125, 1929 (chance of a line). \[2\] P. D. Welch, IEEE Trans. Audio 15, 1967 (1).

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::TAU;

use metrology::sample::TestPlane;
use rustfft::num_complex::Complex64;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use twin::{Channel, Run, Session};

use crate::noise::repeats::same_condition;
use crate::report::Vibration;
use crate::search::rows::count;

mod spectrum;
#[cfg(test)]
mod tests;

use spectrum::{Spectrum, Window, median};

/// (4) at which a line is reported.
const MAX_CHANCE: f64 = 1e-3;
/// Chance at which one run shows a line.
const CHANCE_OF_ONE_RUN: f64 = 0.05;
/// Share of the runs that show it.
const MIN_SHARE_WITH_LINE: f64 = 2.0 / 3.0;
/// Fewest runs that show it, where not all do.
const MIN_RUNS_WITH_LINE: usize = 3;
/// Chance of (7) below which a line has one phase in all repeats.
const ONE_PHASE: f64 = 0.01;
/// Most lines of a channel.
const MOST_LINES: usize = 3;
/// Lengths of segments.
const SEGMENT_LENGTHS: [usize; 2] = [128, 4096];
/// Longest time between readings of a vibration, s: slower cycles are of heating or cooling.
const LONGEST_PERIOD_S: f64 = 0.1;
/// Sampling periods that differ by less are one.
const ONE_PERIOD_WITHIN: f64 = 0.02;
/// Feeds that differ by less are one.
const ONE_FEED_WITHIN: f64 = 0.05;

/// The noise of one run of one channel.
struct Sampled {
    run: usize,
    period_s: f64,
    time_s: Vec<f64>,
    values_um: Vec<f64>,
}

impl Sampled {
    /// Readings of a channel in a run.
    fn new(session: &Session, run: usize, channel: &Channel, residual_mm: &[f64]) -> Option<Self> {
        let own = &session.runs[run];
        let read = own.readings.iter().zip(residual_mm);
        let read = read.filter(|(reading, mm)| reading.channel == *channel && mm.is_finite());
        let (time_s, values_um): (Vec<f64>, Vec<f64>) = read
            .filter_map(|(reading, mm)| Some((own.time_of(reading)?, 1e3 * mm)))
            .unzip();
        let mut steps: Vec<f64> = time_s.windows(2).map(|two| two[1] - two[0]).collect();
        let period_s = median(&mut steps);
        (period_s > 0.0).then_some(Self {
            run,
            period_s,
            time_s,
            values_um,
        })
    }

    /// Its parts without a gap.
    fn pieces(&self) -> Vec<Vec<f64>> {
        let mut pieces = vec![];
        let mut piece = vec![];
        let mut last_s = f64::NAN;
        for (at_s, um) in self.time_s.iter().zip(&self.values_um) {
            let steps = (at_s - last_s) / self.period_s;
            if (0.5..1.5).contains(&steps) || piece.is_empty() {
                piece.push(*um);
            } else {
                pieces.push(std::mem::replace(&mut piece, vec![*um]));
            }
            last_s = *at_s;
        }
        pieces.push(piece);
        pieces
    }

    fn longest(&self) -> usize {
        self.pieces().iter().map(Vec::len).max().unwrap_or(0)
    }
}

/// A line in the spectra of some runs.
struct Line {
    place: usize,
    chance: f64,
    runs: usize,
}

/// Vibrations of every channel whose noise is known.
pub(crate) fn of(
    session: &Session,
    residual: &[Vec<f64>],
    channels: &[&Channel],
) -> BTreeMap<Channel, Vec<Vibration>> {
    let mut looked_at = BTreeMap::<(Channel, &str), Vec<Sampled>>::new();
    for channel in channels {
        if matches!(channel, Channel::Touch | Channel::Thermometer(_)) {
            continue;
        }
        for (run, own) in residual.iter().enumerate() {
            if let Some(sampled) = Sampled::new(session, run, channel, own) {
                let key = ((*channel).clone(), plane(&session.runs[run], channel));
                looked_at.entry(key).or_default().push(sampled);
            }
        }
    }
    let looks = looked_at.len();
    let mut found = BTreeMap::<Channel, Vec<Vibration>>::new();
    for ((channel, plane), runs) in looked_at {
        let mut own = of_runs(session, runs, looks);
        own.iter_mut()
            .for_each(|line| plane.clone_into(&mut line.plane));
        if !own.is_empty() {
            found.entry(channel).or_default().extend(own);
        }
    }
    found
}

/// The plane of a run, where the channel's direction depends on it; otherwise empty.
fn plane(run: &Run, channel: &Channel) -> &'static str {
    match (channel, run.segment.plane) {
        (Channel::GridU | Channel::GridV | Channel::Radial, TestPlane::Xy) => "XY",
        (Channel::GridU | Channel::GridV | Channel::Radial, TestPlane::Yz) => "YZ",
        (Channel::GridU | Channel::GridV | Channel::Radial, TestPlane::Zx) => "ZX",
        _ => "",
    }
}

/// Vibrations of the runs of one of so many channels, by the longest segments that show one.
fn of_runs(session: &Session, mut runs: Vec<Sampled>, channels: usize) -> Vec<Vibration> {
    let mut periods: Vec<f64> = runs.iter().map(|run| run.period_s).collect();
    let period_s = median(&mut periods);
    if period_s > LONGEST_PERIOD_S {
        return vec![];
    }
    runs.retain(|run| (run.period_s / period_s - 1.0).abs() < ONE_PERIOD_WITHIN);
    let lengths = lengths(&runs);
    let looks = channels * lengths.len();
    let mut found = lengths
        .into_iter()
        .map(|length| by_segments(session, &runs, &Window::new(length), looks));
    let mut found = found.find(|found| !found.is_empty()).unwrap_or_default();
    if let Some(speed_mm_s) = one_feed(session, &runs) {
        for line in &mut found {
            line.period_mm = Some(speed_mm_s / line.frequency_hz);
        }
    }
    found
}

/// The same by segments of one length.
fn by_segments(
    session: &Session,
    runs: &[Sampled],
    window: &Window,
    looks: usize,
) -> Vec<Vibration> {
    let long = runs.iter().filter(|run| run.longest() >= window.length());
    let long: Vec<&Sampled> = long.collect();
    let spectra = long.iter().map(|run| window.mean_squares(&run.pieces()));
    let spectra: Vec<Spectrum> = spectra.flatten().collect();
    let Some(first) = long.first().filter(|_| spectra.len() > 1) else {
        return vec![];
    };
    let mean = Spectrum::mean(&spectra.iter().collect::<Vec<_>>());
    let resolution_hz = 1.0 / (first.period_s * count(window.length()));
    let reported = lines(&mean, &spectra, looks).into_iter().map(|line| {
        let (frequency_hz, frequency_half_width_hz) =
            frequency(&mean, &spectra, &line, resolution_hz);
        Vibration {
            frequency_hz,
            frequency_half_width_hz,
            rms_um: rms_um(&mean, &spectra, line.place),
            runs: line.runs,
            of: spectra.len(),
            sampled_hz: 1.0 / first.period_s,
            period_mm: None,
            plane: String::new(),
            chance: line.chance,
        }
    });
    let has_own_phase = |line: &Vibration| !has_one_phase(session, &long, line.frequency_hz);
    reported.filter(has_own_phase).collect()
}

/// Lengths of segments, the longest that three runs in four have first: a frequency that wanders is a line of short ones alone.
fn lengths(runs: &[Sampled]) -> Vec<usize> {
    let mut own: Vec<usize> = runs.iter().map(Sampled::longest).collect();
    own.retain(|length| *length >= SEGMENT_LENGTHS[0]);
    own.sort_unstable();
    let usual = own
        .get(own.len() / 4)
        .map(|usual| usual.min(&SEGMENT_LENGTHS[1]));
    let Some(longest) = usual
        .filter(|_| own.len() > 1)
        .map(|usual| 1 << usual.ilog2())
    else {
        return vec![];
    };
    let shorter = std::iter::successors(Some(longest), |length| Some(length / 2));
    shorter
        .take_while(|length| *length >= SEGMENT_LENGTHS[0])
        .collect()
}

/// The lines of a mean that its runs show, the surest first.
fn lines(mean: &Spectrum, spectra: &[Spectrum], looks: usize) -> Vec<Line> {
    let looked_at = count(mean.power.len() * looks);
    let chance = |place: usize| Some((place, mean.ratio(place)?.1 * looked_at));
    let all = (0..mean.power.len()).filter_map(chance);
    let mut sure: Vec<(usize, f64)> = all.filter(|(_, chance)| *chance < MAX_CHANCE).collect();
    // Chances of strong lines are all zero: of those the greatest comes first.
    let power = |place: usize| mean.power.get(place).copied().unwrap_or(0.0);
    sure.sort_by(|a, b| power(b.0).total_cmp(&power(a.0)));
    let mut taken = BTreeSet::<usize>::new();
    let mut found = vec![];
    for (place, chance) in sure {
        let about = mean.about(place);
        if about.clone().any(|k| taken.contains(&k)) {
            continue;
        }
        taken.extend(about);
        let shows = |own: &&Spectrum| {
            let near = place.saturating_sub(1)..=place + 1;
            let ratios = near.filter_map(|k| own.ratio(k));
            let least = ratios.map(|(_, chance)| chance).fold(1.0, f64::min);
            3.0 * least < CHANCE_OF_ONE_RUN
        };
        let runs = spectra.iter().filter(shows).count();
        let is_in_all = runs == spectra.len();
        let is_in_most = count(runs) >= MIN_SHARE_WITH_LINE * count(spectra.len());
        if is_in_all || (runs >= MIN_RUNS_WITH_LINE && is_in_most) {
            found.push(Line {
                place,
                chance,
                runs,
            });
        }
    }
    found.truncate(MOST_LINES);
    found
}

/// (5), and twice the standard error that the runs show of it, at least a quarter of the resolution.
fn frequency(mean: &Spectrum, spectra: &[Spectrum], line: &Line, resolution_hz: f64) -> (f64, f64) {
    let about = mean.about(line.place);
    let centre = |own: &Spectrum| {
        let level = own.level(line.place).unwrap_or(0.0);
        let parts = about.clone().filter_map(|k| {
            let above = (own.power.get(k)? - level).max(0.0);
            Some((count(k) * above, above))
        });
        let (moment, sum) = parts.fold((0.0, 0.0), |sum, part| (sum.0 + part.0, sum.1 + part.1));
        if sum > 0.0 {
            moment / sum
        } else {
            count(line.place)
        }
    };
    let middle = centre(mean);
    let squares: f64 = spectra
        .iter()
        .map(|own| (centre(own) - middle).powi(2))
        .sum();
    let n = count(spectra.len());
    let error = (squares / (n * (n - 1.0).max(1.0))).sqrt();
    (
        middle * resolution_hz,
        (2.0 * error).max(0.25) * resolution_hz,
    )
}

/// (6).
fn rms_um(mean: &Spectrum, spectra: &[Spectrum], place: usize) -> f64 {
    let about = mean.about(place);
    let (from, to) = (about.start().saturating_sub(1), about.end() + 1);
    let of_run = |own: &Spectrum| {
        let level = own.level(place).unwrap_or(0.0);
        let above = (from..=to).filter_map(|k| Some(own.power.get(k)? - level));
        above.sum::<f64>().max(0.0)
    };
    let mean_square = spectra.iter().map(of_run).sum::<f64>() / count(spectra.len());
    mean_square.sqrt()
}

/// Whether (7) shows one phase in all repeats of tests in motion.
fn has_one_phase(session: &Session, runs: &[&Sampled], frequency_hz: f64) -> bool {
    let mut tests = Vec::<(&Run, Vec<Complex64>)>::new();
    for sampled in runs {
        let run = &session.runs[sampled.run];
        let Some(middle_s) = middle_s(run) else {
            continue;
        };
        let turns = sampled.time_s.iter().zip(&sampled.values_um);
        let turns = turns
            .map(|(at_s, um)| Complex64::from_polar(*um, -TAU * frequency_hz * (at_s - middle_s)));
        let amplitude: Complex64 = turns.sum();
        let phase = amplitude / amplitude.norm().max(f64::MIN_POSITIVE);
        match tests.iter_mut().find(|(of, _)| same_condition(of, run)) {
            Some((_, own)) => own.push(phase),
            None => tests.push((run, vec![phase])),
        }
    }
    let repeated = tests.iter().filter(|(_, own)| own.len() > 2);
    let together =
        repeated.map(|(_, own)| own.iter().sum::<Complex64>().norm_sqr() / count(own.len()));
    let together: Vec<f64> = together.collect();
    let law = ChiSquared::new(2.0 * count(together.len()));
    law.is_ok_and(|law| law.sf(2.0 * together.iter().sum::<f64>()) < ONE_PHASE)
}

/// Instant at which half of a run's way is gone; none of a run that stands.
fn middle_s(run: &Run) -> Option<f64> {
    let steps = way_mm(run);
    let whole: f64 = steps.iter().sum();
    let mut gone = 0.0;
    let place = steps.iter().position(|step| {
        gone += step;
        whole > 0.0 && gone >= 0.5 * whole
    });
    run.motion.time_s.get(place?).copied()
}

/// Way of the linear axes from each tick to the next.
fn way_mm(run: &Run) -> Vec<f64> {
    let motion = &run.motion;
    let step = |k: usize| {
        let squares = motion.axes.iter().filter(|axis| axis.is_linear());
        let squares = squares.filter_map(|axis| {
            let at = &motion.position[axis];
            Some((at.get(k + 1)? - at.get(k)?).powi(2))
        });
        squares.sum::<f64>().sqrt()
    };
    (0..motion.time_s.len().saturating_sub(1))
        .map(step)
        .collect()
}

/// The usual feed of the runs, mm/s, where it is one and none of them stands.
fn one_feed(session: &Session, runs: &[Sampled]) -> Option<f64> {
    let speed = |sampled: &Sampled| {
        let run = &session.runs[sampled.run];
        let ticks = run.motion.time_s.windows(2);
        let speeds = way_mm(run).into_iter().zip(ticks);
        let mut speeds: Vec<f64> = speeds.map(|(mm, two)| mm / (two[1] - two[0])).collect();
        median(&mut speeds)
    };
    let mut speeds: Vec<f64> = runs.iter().map(speed).collect();
    let usual = median(&mut speeds);
    let is_one = speeds
        .iter()
        .all(|own| (own / usual - 1.0).abs() < ONE_FEED_WITHIN);
    (usual > 0.0 && is_one).then_some(usual)
}
