//! Why a touch or a whole calibration is not used.

use metrology::number::number;

/// Why one touch is not used.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum TouchFault {
    /// A latched position, the approach or a logged position is no finite number.
    #[error("a position or the approach is not finite")]
    NotFinite,
    /// The log has too few positions before the latch, so that the feed is not known.
    #[error("{n} logged positions in the {window_s} s before the latch, {least} are needed", window_s = number(*window_s))]
    FeedUnknown {
        /// Positions in the window.
        n: usize,
        /// Positions that are needed.
        least: usize,
        /// Window, s.
        window_s: f64,
    },
    /// The log leaves a part of the window out.
    #[error(
        "{gap_s} s of the {window_s} s before the latch are not logged, at most {limit_s} s may be between positions", gap_s = number(*gap_s), limit_s = number(*limit_s), window_s = number(*window_s))]
    LogGap {
        /// Longest time without a position, s.
        gap_s: f64,
        /// Longest one allowed, s.
        limit_s: f64,
        /// Window, s.
        window_s: f64,
    },
    /// The feed at contact is not above zero.
    #[error("feed at contact is {feed_mm_s} mm/s, must be above 0", feed_mm_s = number(*feed_mm_s))]
    FeedNotPositive {
        /// Feed, mm/s.
        feed_mm_s: f64,
    },
    /// The feed still changed: the stand-off was too short, or the control already braked.
    #[error(
        "feed changed by {change_mm_s} mm/s over the {window_s} s before the latch at {feed_mm_s} mm/s, limit is {limit_mm_s} mm/s: stand-off or overtravel too short", feed_mm_s = number(*feed_mm_s), change_mm_s = number(*change_mm_s), limit_mm_s = number(*limit_mm_s), window_s = number(*window_s))]
    FeedNotSteady {
        /// Feed, mm/s.
        feed_mm_s: f64,
        /// Its change, mm/s.
        change_mm_s: f64,
        /// Largest change allowed, mm/s.
        limit_mm_s: f64,
        /// Window, s.
        window_s: f64,
    },
    /// The approach differs from that of the feature's first touch.
    #[error("approach differs from the first touch, cosine {cosine}", cosine = number(*cosine))]
    OtherApproach {
        /// Cosine between the two.
        cosine: f64,
    },
    /// The controller's stamps ran backwards.
    #[error("controller time went back")]
    ClockWentBack,
}

/// Why something is refused; `Display` says it in one line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// One touch.
    #[error("touch {sequence} of {feature} not used: {fault}")]
    Touch {
        /// Feature.
        feature: String,
        /// Number of the touch.
        sequence: u32,
        /// Why.
        fault: TouchFault,
    },
    /// A touch was told again, or after a later one.
    #[error("touch {sequence} was told before, or a later one before it; not used")]
    ToldBefore {
        /// Number of the touch.
        sequence: u32,
    },
    /// A run of more touches than are held.
    #[error(
        "run {run}: {held} touches are held already, the most there may be; touch {sequence} is not used"
    )]
    TooManyTouches {
        /// Run.
        run: u32,
        /// Touches that are held.
        held: usize,
        /// Number of the touch.
        sequence: u32,
    },
    /// All touches came at one feed.
    #[error(
        "{feature}: feeds at contact from {least_mm_s:.4} to {greatest_mm_s:.4} mm/s are within {share} of each other: latency needs different feeds", share = number(*share))]
    EqualFeeds {
        /// Feature.
        feature: String,
        /// Least feed, mm/s.
        least_mm_s: f64,
        /// Greatest feed, mm/s.
        greatest_mm_s: f64,
        /// Share below which feeds are the same.
        share: f64,
    },
    /// Too few touches are left.
    #[error("{feature}: {n} usable touches of {made}, at least {least} are needed")]
    TooFewTouches {
        /// Feature.
        feature: String,
        /// Usable touches.
        n: usize,
        /// Touches made.
        made: usize,
        /// Touches that are needed.
        least: usize,
    },
    /// The contact lies before the window in which the feed was taken.
    #[error(
        "{feature}: latency {latency_s} s with a standard uncertainty of {standard_uncertainty_s} s does not fit into the window of {window_s} s before the latch in which the feed was taken; not published", latency_s = number(*latency_s), standard_uncertainty_s = number(*standard_uncertainty_s), window_s = number(*window_s))]
    WindowTooShort {
        /// Feature.
        feature: String,
        /// Latency, s.
        latency_s: f64,
        /// Its standard uncertainty, s.
        standard_uncertainty_s: f64,
        /// Window, s.
        window_s: f64,
    },
    /// Nothing was touched.
    #[error("run {run}: nothing was touched")]
    NothingTouched {
        /// Run.
        run: u32,
    },
    /// The run was broken off.
    #[error("run {run} was broken off after {made} touches; it is not evaluated")]
    NotCompleted {
        /// Run.
        run: u32,
        /// Touches made.
        made: usize,
    },
    /// A run began before the last one ended.
    #[error("run {run} did not end before run {next} began; it is not evaluated")]
    NotEnded {
        /// The run that was open.
        run: u32,
        /// The run that began.
        next: u32,
    },
    /// A run ended that had not begun.
    #[error("run {run} ended, but its begin was not seen; it is not evaluated")]
    NotBegun {
        /// The run.
        run: u32,
    },
    /// The estimate is published, but positions are not linear in feed.
    #[error(
        "{feature}: p = {p} for positions linear in feed, limit {limit}; latency depends on feed", p = number(*p), limit = number(*limit))]
    LackOfFit {
        /// Feature.
        feature: String,
        /// p value.
        p: f64,
        /// Limit.
        limit: f64,
    },
    /// The estimate is published, but is below zero.
    #[error(
        "{feature}: latency is {latency_s} s, below zero: stamps in the future or approach of the wrong sign", latency_s = number(*latency_s))]
    Negative {
        /// Feature.
        feature: String,
        /// Signed latency, s.
        latency_s: f64,
    },
}
