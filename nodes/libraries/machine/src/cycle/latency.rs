//! One surface touched at several feeds, repeated, for the estimate of the probe's latency.
//!
//! Feeds go up in one pass and down in the next, so that a linear drift of the surface cancels from
//! the slope over feed whenever the number of passes is even. A control that polls its probe input
//! would see every touch of one feed at the same phase of its servo period, since all begin at the
//! same place: the start is moved back by a growing share of one period's travel, spread evenly by
//! the golden ratio, so that means over n touches shrink as those of a uniform distribution.

use std::num::NonZeroU32;

use metrology::sample::TestKind;

use super::Cycle;
use super::program::{Path, Program};
use super::touch::single;
use crate::error::CycleError;
use crate::file::{Latch, MachineFile};

/// Least number of different feeds.
const LEAST_FEEDS: usize = 2;
/// Feeds closer than this share of the larger are the same feed.
const SAME_FEED: f64 = 1e-6;
/// Fractional part of the golden ratio: its multiples fill the unit interval most evenly.
const GOLDEN: f64 = 0.618_033_988_749_895;

/// Touches `feature` (`<block>.x|y|z` or a plane) `repeats` times at each feed.
///
/// # Errors
/// Fewer than two feeds, equal, zero, negative or non-finite feeds, feeds that the stand-off or the
/// overtravel does not allow, unknown features, touches outside the travel.
pub fn latency(
    file: &MachineFile,
    feature: &str,
    feeds_mm_min: &[f64],
    repeats: NonZeroU32,
) -> Result<Cycle, CycleError> {
    check_feeds(feeds_mm_min)?;
    let mut ascending = feeds_mm_min.to_vec();
    ascending.sort_by(f64::total_cmp);
    let mut program = Program::new(file)?;
    program.name_feature(feature);
    let mut path = Path::Over;
    for pass in 0..repeats.get() {
        let phase = match file.control.latch {
            Latch::Hardware => 0.0,
            Latch::Polled => (f64::from(pass) * GOLDEN).fract(),
        };
        for index in 0..ascending.len() {
            let index = if pass % 2 == 0 {
                index
            } else {
                ascending.len() - 1 - index
            };
            let mut touch = single(file, feature)?;
            touch.feed_mm_min = ascending[index];
            let period_travel_mm = ascending[index] / 60.0 * file.control.servo_period_ms / 1e3;
            touch.extra_standoff_mm = phase * period_travel_mm;
            program.touch(touch, path)?;
            path = Path::Straight;
        }
    }
    Ok(program.finish(TestKind::Latency))
}

fn check_feeds(feeds_mm_min: &[f64]) -> Result<(), CycleError> {
    for (index, &feed_mm_min) in feeds_mm_min.iter().enumerate() {
        if !(feed_mm_min.is_finite() && feed_mm_min > 0.0) {
            return Err(CycleError::FeedNotPositive { index, feed_mm_min });
        }
    }
    if feeds_mm_min.len() < LEAST_FEEDS {
        return Err(CycleError::TooFewFeeds {
            n: feeds_mm_min.len(),
            least: LEAST_FEEDS,
        });
    }
    for (second, &feed_mm_min) in feeds_mm_min.iter().enumerate() {
        let same = |other: &f64| (other - feed_mm_min).abs() <= SAME_FEED * other.max(feed_mm_min);
        if let Some(first) = feeds_mm_min[..second].iter().position(same) {
            return Err(CycleError::EqualFeeds {
                first,
                second,
                feed_mm_min,
            });
        }
    }
    Ok(())
}
