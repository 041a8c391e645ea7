//! How well the clocks of hosts were found, by the recorder's bag.

use std::path::Path;

use abbe_msgs::topics;
use metrology::sample::HostClock;
use metrology::stamp::Span;

use super::bag;
use crate::computer_clock::ClockError;

/// What a drift may be off by, s/s, where its own uncertainty is not larger.
const DRIFT_LIMIT: f64 = 15e-6;

/// Of a bag's maps of a host, those of the last `judged` tell its clock within `limit_s` beside half of what the ways to the
/// reference and back differ by, all within their own bound, and its drift within 15 us/s, or within what offsets of
/// their standard uncertainty leave open over the exchanges' span (a busy computer widens it).
///
/// # Panics
/// When they do not, or there is none.
pub fn is_found(
    bag: &Path,
    host: &str,
    truth: ClockError,
    unequal_s: f64,
    (limit_s, judged): (f64, Span),
) {
    let maps: Vec<HostClock> = bag::messages(bag, &topics::HOST_CLOCK)
        .into_iter()
        .map(|(_, clock)| clock)
        .filter(|clock| clock.host == host)
        .collect();
    let last = maps.last().unwrap_or_else(|| panic!("no map of {host}"));
    let from = last.map.at() - judged;
    let (mut worst_s, mut worst_drift) = (0.0_f64, 0.0_f64);
    for clock in maps.iter().filter(|clock| clock.map.at() >= from) {
        let at = clock.map.at();
        let off_s = clock.map.offset(at).as_secs_f64() - truth.true_offset_s(at) - unequal_s;
        worst_s = worst_s.max(off_s.abs());
        let true_drift = -truth.drift / (1.0 + truth.drift);
        worst_drift = worst_drift.max((clock.map.drift() - true_drift).abs());
        assert!(
            (off_s + unequal_s).abs() <= clock.bound_s,
            "{host}: beyond its bound"
        );
    }
    eprintln!(
        "{host}: {} maps, the last of {} exchanges over {:.1} s: offset off by {:.1} us at most beside {:.0} us of unequal ways, \
         drift by {:.2} us/s; u {:.1} us, bound {:.0} us, least round trip {:.2} ms",
        maps.len(),
        last.n,
        last.span_s,
        worst_s * 1e6,
        unequal_s * 1e6,
        worst_drift * 1e6,
        last.standard_uncertainty_s * 1e6,
        last.bound_s * 1e6,
        last.least_round_trip_s * 1e3
    );
    assert!(worst_s <= limit_s, "{host}: {worst_s} s");
    let drift_limit = DRIFT_LIMIT.max(last.standard_uncertainty_s / last.span_s);
    assert!(worst_drift <= drift_limit, "{host}: {worst_drift}");
}
