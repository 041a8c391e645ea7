//! The noise floor as the report has it, with the vibrations in it.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use twin::Channel;

use crate::config::GapConfig;
use crate::judgement::guard;
use crate::noise::{Noise, vibration};
use crate::report::NoiseFloor;
use crate::search::searched::Base;

/// A vibration that is alike in the runs of a channel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Vibration {
    /// Plane of the runs, where the channel's direction depends on it; otherwise empty.
    pub plane: String,
    /// Frequency, as sampled: it or an alias of it, Hz.
    pub frequency_hz: f64,
    /// Half of the 95 % interval of the frequency, Hz.
    pub frequency_half_width_hz: f64,
    /// Root mean square of it, µm.
    pub rms_um: f64,
    /// Runs that show it.
    pub runs: usize,
    /// Runs that are long enough to.
    pub of: usize,
    /// Readings a second.
    pub sampled_hz: f64,
    /// Where all runs have one feed: the period of an error along the path that would look the same, mm.
    pub period_mm: Option<f64>,
    /// Chance of as much in noise, over all frequencies and channels that were looked at.
    pub chance: f64,
}

/// Noise of each channel, and whether the session has that of the repeats.
pub(crate) fn of(
    base: &Base<'_>,
    inflation: &BTreeMap<Channel, f64>,
    config: &GapConfig,
) -> Vec<NoiseFloor> {
    let channels: Vec<&Channel> = base.noise.keys().collect();
    let mut vibrations = vibration::of(base.session, base.residual, &channels);
    let of = |(channel, noise): (&Channel, &Noise)| NoiseFloor {
        channel: channel.to_string(),
        sigma_um: 1e3 * noise.reading_sigma_mm,
        ar: noise.within.coefficients[noise.within.order()].clone(),
        between_runs_um: Some(1e3 * noise.between.total_mm()),
        repeats: noise.repeats,
        reproduced: guard::reproduces(channel, inflation, config),
        vibrations: vibrations.remove(channel).unwrap_or_default(),
    };
    base.noise.iter().map(of).collect()
}
