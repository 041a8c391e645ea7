//! The noise floor of logs where no test was repeated.
//!
//! # Model
//!
//! Within a run it is that of neighbouring rows, (3) of `log`, white, greater by what so few rows leave open (`noise`); where
//! neighbours share part of it, it is an autoregression (`memory`). What the thermometers predict that the log goes with
//! (`thermal`) is taken out before.
//! Between runs it is what the logs, or the parts of one, differ by in their offset and drift, with the caution of so few, and at most
//! `log::ASSUMED_BETWEEN_UM`. Where nothing else was repeated a confidence counts [`CONFIDENCE`] of what it
//! would with repeats: that the noise is white within the run, and how a second run would differ, nobody has seen.
//!
//! # Holds when
//! Logs that stand. A test in motion has an error at every place, which neighbours along the path do not separate from noise:
//! its noise within a run is what the smooth modes leave (`noise`), and what a second run differs by is [`between_in_motion`].

use std::collections::BTreeMap;

use statrs::distribution::{ChiSquared, ContinuousCDF};
use twin::{Channel, Session};

use crate::noise::pace::Pace;
use crate::noise::repeats;
use crate::noise::whitener::Autoregression;
use crate::noise::{self, Noise, Readings, memory};
use crate::report::figures::Note;
use crate::search::field::Smooth;
use crate::search::rows::{Block, count};
use crate::session::log::{self, ASSUMED_BETWEEN_UM};
use crate::session::thermal;

/// Shares of the posterior that the amplitudes between logs are taken at, and the freedom from which on the smaller one is.
const CAUTION: f64 = 0.7;
const CAUTION_OF_FEW: f64 = 0.95;
const MIN_FREEDOM: f64 = 2.0;
/// Fewest rows of a log whose offset and drift are looked at.
const LEAST_ROWS_OF_A_LINE: usize = 10;
/// Factor of a confidence whose noise floor is from no repeats; stated, not measured.
pub const CONFIDENCE: f64 = 0.8;

/// Noise of every channel of the logs of a session that last so long.
pub fn noise(readings: Readings<'_>, raw: &[f64], least_s: f64) -> BTreeMap<Channel, Noise> {
    let mut blocks = BTreeMap::<Channel, Vec<&Block>>::new();
    for block in &readings.rows.blocks {
        let run = &readings.session.runs[block.run];
        let lasts_s = log::since_s(readings.session, block).last().copied();
        let is_long = lasts_s.is_some_and(|lasts_s| lasts_s >= least_s);
        if log::is_log(run) && log::is_read(&block.channel) && is_long {
            blocks.entry(block.channel.clone()).or_default().push(block);
        }
    }
    let of = |(channel, blocks): (Channel, Vec<&Block>)| {
        let found = of_channel(readings, &channel, &blocks, raw)?;
        Some((channel, found))
    };
    blocks.into_iter().filter_map(of).collect()
}

fn of_channel(
    readings: Readings<'_>,
    channel: &Channel,
    blocks: &[&Block],
    raw: &[f64],
) -> Option<Noise> {
    // What a body that was read makes the log do is no noise, however fast its temperature goes up and down.
    let beside_heat = thermal::less_heat(readings.session, raw, blocks);
    let raw = beside_heat.as_deref().unwrap_or(raw);
    let least_mm2 = noise::resolution_mm(readings.machine, channel).powi(2) / 12.0;
    let (variance_mm2, freedom) = log::variance_within(readings.session, blocks, raw, least_mm2)?;
    let white = (Autoregression::white(variance_mm2), freedom);
    let (within, freedom) = memory::shared(readings.session, blocks, raw).unwrap_or(white);
    let variance_mm2 = within.variances[0].max(least_mm2);
    let within_row = repeats::within_row_variance(readings.residual, blocks);
    let [offset_mm, drift_mm] = between_logs(readings.session, blocks, raw, &within);
    Some(Noise {
        within: within.scaled(noise::doubt(freedom)),
        pace: Pace::default(),
        between: Smooth {
            offset_mm,
            drift_mm,
            length_rad: 0.5,
            ..Smooth::default()
        },
        row_sigma_mm: variance_mm2.sqrt(),
        reading_sigma_mm: (variance_mm2 + within_row).sqrt(),
        repeats: 1,
        freedom,
        field_freedom: 1.0,
    })
}

/// Standard deviations of what logs of one zero differ by in their offset and in the end of their drift, mm, each run beside what the
/// others predict of it: at most what is assumed of logs of which nothing is known.
fn between_logs(
    session: &Session,
    blocks: &[&Block],
    left: &[f64],
    within: &Autoregression,
) -> [f64; 2] {
    let lines: Vec<[f64; 3]> = { blocks.iter() }
        .filter_map(|block| line(session, block, left, within))
        .collect();
    let n = count(lines.len());
    let mean = lines.iter().map(|line| line[0]).sum::<f64>() / n.max(1.0);
    let own = lines.iter().map(|line| line[2]).sum::<f64>() / n.max(1.0);
    let deviation = |square: f64, freedom: f64, own: f64| {
        let assumed_mm = ASSUMED_BETWEEN_UM * 1e-3;
        let caution = if freedom < MIN_FREEDOM {
            CAUTION_OF_FEW
        } else {
            CAUTION
        };
        let law = ChiSquared::new(freedom).ok();
        let least = law.map_or(0.0, |law| law.inverse_cdf(1.0 - caution));
        let variance = square / least - own;
        let known = Some(variance.max(own).sqrt()).filter(|size| size.is_finite());
        known.map_or(assumed_mm, |size| size.min(assumed_mm))
    };
    let offsets: f64 = lines.iter().map(|line| (line[0] - mean).powi(2)).sum();
    let drifts: f64 = lines.iter().map(|line| line[1].powi(2)).sum();
    [
        deviation(offsets, n - 1.0, own),
        deviation(drifts, n, 3.0 * own),
    ]
}

/// Offset and end of the drift of a log, and the variance of that offset by its own noise.
fn line(
    session: &Session,
    block: &Block,
    left: &[f64],
    within: &Autoregression,
) -> Option<[f64; 3]> {
    let times_s = log::since_s(session, block);
    let rows = left.get(block.range())?;
    let (n, last_s) = (count(rows.len()), *times_s.last()?);
    if rows.len() < LEAST_ROWS_OF_A_LINE || last_s <= 0.0 {
        return None;
    }
    let along = |at_s: &f64| 2.0 * at_s / last_s - 1.0;
    let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / n;
    let middle = mean(&mut times_s.iter().map(along));
    let offset = mean(&mut rows.iter().copied());
    let spread = mean(&mut times_s.iter().map(|at_s| (along(at_s) - middle).powi(2)));
    let product = mean(
        &mut times_s
            .iter()
            .zip(rows)
            .map(|(at_s, mm)| (along(at_s) - middle) * mm),
    );
    let slope = product / spread;
    let share = { within.coefficients.last() }.and_then(|all| all.first());
    let share = share.map_or(0.0, |share| share.clamp(0.0, 0.95));
    let own = within.variances[0] * (1.0 + share) / (1.0 - share) / n;
    Some([offset - slope * middle, slope, own])
}

/// How a second run of a test in motion would differ: as much over place as in its offset and along the run.
pub fn between_in_motion() -> Smooth {
    let between_mm = ASSUMED_BETWEEN_UM * 1e-3;
    Smooth {
        place_mm: between_mm,
        offset_mm: between_mm,
        drift_mm: between_mm,
        length_rad: 0.5,
    }
}

/// Whether a noise floor is from no repeats.
pub fn is_assumed(noise: &BTreeMap<Channel, Noise>) -> bool {
    !noise.is_empty() && noise.values().all(|noise| noise.repeats < 2)
}

/// What a reader should know of such a floor, and of one log that was cut into parts.
pub fn notes(session: &Session, noise: &BTreeMap<Channel, Noise>) -> Vec<Note> {
    let mut notes = vec![];
    let assumed = noise.iter().filter(|(_, noise)| noise.repeats < 2);
    notes.extend(assumed.map(|(channel, own)| Note::NoiseWithin {
        channel: channel.to_string(),
        sigma_um: 1e3 * own.reading_sigma_mm,
        between_um: 1e3 * own.between.offset_mm.max(own.between.drift_mm),
        lowers: is_assumed(noise),
    }));
    let parts = session
        .runs
        .iter()
        .filter(|run| log::part(&run.segment).is_some());
    let parts: Vec<_> = parts.collect();
    if let (Some(first), Some(last)) = (parts.first(), parts.last()) {
        let at_s = |time: Option<f64>| time.unwrap_or(0.0);
        let begin = first.readings.first().and_then(|one| first.time_of(one));
        let end = last.readings.last().and_then(|one| last.time_of(one));
        notes.push(Note::InParts {
            parts: parts.len(),
            minutes: (at_s(end) - at_s(begin)) / 60.0 / crate::search::rows::count(parts.len()),
        });
    }
    notes
}
