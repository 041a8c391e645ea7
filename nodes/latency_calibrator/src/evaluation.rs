//! Both estimates from the touches of one feature, and which of them is used.
//!
//! With three different feeds or more the line is used, with two the published two-feed value, of the
//! means where there are several touches at each. A two-feed value is a norm and has no sign; what is
//! published carries the sign of the signed estimate, and the bare norm stands beside it.

use metrology::sample::{LatencyMethod, ProbeLatency};
use metrology::{Host, Stamp};
use nalgebra::Vector3;

use crate::config::LatencyCalibratorConfig;
use crate::diagnostic::Refusal;
use crate::line::{self, LineLatency, LineTouch};
use crate::two_feed::{self, AtFeed};

/// Least number of different feeds for the line.
const LINE_FEEDS: usize = 3;
/// Of the uncertainty of a latency that must fit into the window.
const WINDOW_COVERAGE_FACTOR: f64 = 2.0;
/// Least number of touches.
const LEAST_TOUCHES: usize = 2;

/// One usable touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FeedTouch {
    /// Feed at contact, mm/s.
    pub feed_mm_s: f64,
    /// Ball centre as latched, workpiece frame, mm.
    pub ball_mm: Vector3<f64>,
    /// Approach, workpiece frame.
    pub approach: Vector3<f64>,
}

/// What the evaluation needs to know of the machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TouchNoise {
    /// Repeatability of one touch, mm.
    pub repeatability_mm: f64,
    /// Servo period where the latch is polled, else zero, s.
    pub poll_period_s: f64,
    /// Effective radius of the stylus ball, mm.
    pub ball_radius_mm: f64,
    /// Coarsest resolution of the latched positions, mm.
    pub resolution_mm: f64,
}

impl TouchNoise {
    /// Standard uncertainty of one touch at a feed, mm.
    #[must_use]
    pub fn standard_uncertainty_mm(&self, feed_mm_s: f64) -> f64 {
        self.repeatability_mm
            .hypot(feed_mm_s * self.poll_period_s / 12_f64.sqrt())
    }
}

/// Every value that the touches of one feature give.
#[derive(Clone, Debug, PartialEq)]
pub struct LatencyEvaluation {
    /// Feature.
    pub feature: String,
    /// What is published.
    pub latency: ProbeLatency,
    /// |Pa - Pb|/|fa - fb| of the first touch at the least and the greatest feed, s.
    pub single_s: f64,
    /// The same of the means, s.
    pub of_means_s: f64,
    /// Mean of the norms of pairs, s.
    pub mean_of_norms_s: f64,
    /// Signed two-feed value of the means, s.
    pub signed_s: f64,
    /// The signed line over all feeds.
    pub line: LineLatency,
}

/// Evaluates the touches of one feature, in the order in which they were made.
///
/// # Errors
/// Too few touches or one feed only.
pub fn evaluate(
    feature: &str,
    at: Stamp<Host>,
    touches: &[FeedTouch],
    made: usize,
    noise: &TouchNoise,
    config: &LatencyCalibratorConfig,
) -> Result<LatencyEvaluation, Refusal> {
    let too_few = || Refusal::TooFewTouches {
        feature: feature.to_owned(),
        n: touches.len(),
        made,
        least: LEAST_TOUCHES,
    };
    let first = touches.first().ok_or_else(too_few)?;
    if touches.len() < LEAST_TOUCHES {
        return Err(too_few());
    }
    let (level_of, levels) = levels(touches, config.same_feed_share);
    let [slow, .., fast] = &levels[..] else {
        return Err(equal_feeds(feature, touches, config.same_feed_share));
    };
    let line = line::estimate(&line_touches(touches, &level_of, noise)).map_err(|_| too_few())?;
    let two = TwoFeeds::new(slow, fast, &first.approach, noise);
    let is_line = levels.len() >= LINE_FEEDS;
    let (method, latency_s, standard_uncertainty_s) = if is_line {
        let method = LatencyMethod::WeightedLeastSquares;
        (method, line.latency_s, line.standard_uncertainty_s)
    } else {
        let latency_s = two.published_s.copysign(two.signed_s);
        (two.method, latency_s, two.standard_uncertainty_s)
    };
    check_window(feature, latency_s, standard_uncertainty_s, config)?;
    Ok(LatencyEvaluation {
        feature: feature.to_owned(),
        latency: ProbeLatency {
            at,
            method,
            latency_s,
            standard_uncertainty_s,
            two_feed_latency_s: two.published_s,
            least_squares_latency_s: if is_line { line.latency_s } else { f64::NAN },
            feeds_mm_s: levels.iter().map(|level| level.feed_mm_s).collect(),
            n: u32::try_from(touches.len()).unwrap_or(u32::MAX),
            intercept_mm: line.intercept_mm + noise.ball_radius_mm,
            intercept_uncertainty_mm: line.intercept_uncertainty_mm,
            lack_of_fit_p: line.lack_of_fit_p,
            negative: latency_s < 0.0,
        },
        single_s: two.single_s,
        of_means_s: two.of_means_s,
        mean_of_norms_s: two_feed::mean_of_norms_s(slow, fast),
        signed_s: two.signed_s,
        line,
    })
}

fn equal_feeds(feature: &str, touches: &[FeedTouch], share: f64) -> Refusal {
    let feeds = || touches.iter().map(|touch| touch.feed_mm_s);
    Refusal::EqualFeeds {
        feature: feature.to_owned(),
        least_mm_s: feeds().fold(f64::INFINITY, f64::min),
        greatest_mm_s: feeds().fold(f64::NEG_INFINITY, f64::max),
        share,
    }
}

/// The feed is that of the contact only if the contact lies inside the window before the latch.
fn check_window(
    feature: &str,
    latency_s: f64,
    standard_uncertainty_s: f64,
    config: &LatencyCalibratorConfig,
) -> Result<(), Refusal> {
    let window_s = config.feed_window().as_secs_f64();
    if latency_s + WINDOW_COVERAGE_FACTOR * standard_uncertainty_s <= window_s {
        return Ok(());
    }
    Err(Refusal::WindowTooShort {
        feature: feature.to_owned(),
        latency_s,
        standard_uncertainty_s,
        window_s,
    })
}

/// Two-feed values from the least and the greatest feed.
struct TwoFeeds {
    method: LatencyMethod,
    /// The published method's value: of the means where there are several touches.
    published_s: f64,
    standard_uncertainty_s: f64,
    single_s: f64,
    of_means_s: f64,
    signed_s: f64,
}

impl TwoFeeds {
    fn new(slow: &AtFeed, fast: &AtFeed, approach: &Vector3<f64>, noise: &TouchNoise) -> Self {
        let (fa_mm_s, fb_mm_s) = (slow.feed_mm_s, fast.feed_mm_s);
        let single_s = two_feed::single_s(&slow.points_mm[0], &fast.points_mm[0], fa_mm_s, fb_mm_s);
        let of_means_s = two_feed::of_means_s(slow, fast);
        let (method, published_s) = if slow.points_mm.len() > 1 || fast.points_mm.len() > 1 {
            (LatencyMethod::TwoFeedMulti, of_means_s)
        } else {
            (LatencyMethod::TwoFeedSingle, single_s)
        };
        let u_mm = [fa_mm_s, fb_mm_s].map(|feed_mm_s| noise.standard_uncertainty_mm(feed_mm_s));
        let seen = two_feed::scatter_factor(slow, fast, approach, (u_mm[0], u_mm[1]));
        let resolution_s = two_feed::resolution_s(slow, fast, noise.resolution_mm);
        Self {
            method,
            published_s,
            standard_uncertainty_s: (seen
                * two_feed::standard_uncertainty_s(slow, fast, u_mm[0], u_mm[1]))
            .hypot(resolution_s),
            single_s,
            of_means_s,
            signed_s: two_feed::signed_s(slow, fast, approach),
        }
    }
}

fn line_touches(touches: &[FeedTouch], level_of: &[usize], noise: &TouchNoise) -> Vec<LineTouch> {
    touches
        .iter()
        .zip(level_of)
        .map(|(touch, &level)| LineTouch {
            feed_mm_s: touch.feed_mm_s,
            along_mm: touch.ball_mm.dot(&touch.approach),
            standard_uncertainty_mm: noise.standard_uncertainty_mm(touch.feed_mm_s),
            level,
        })
        .collect()
}

/// Level of each touch, and the levels in ascending order of feed with their points.
fn levels(touches: &[FeedTouch], same_feed_share: f64) -> (Vec<usize>, Vec<AtFeed>) {
    let mut order: Vec<usize> = (0..touches.len()).collect();
    order.sort_by(|&i, &j| touches[i].feed_mm_s.total_cmp(&touches[j].feed_mm_s));
    let mut level_of = vec![0; touches.len()];
    let mut n_levels = 0;
    let mut last_mm_s: Option<f64> = None;
    for index in order {
        let feed_mm_s = touches[index].feed_mm_s;
        if last_mm_s.is_none_or(|last| feed_mm_s - last > same_feed_share * last) {
            n_levels += 1;
        }
        level_of[index] = n_levels - 1;
        last_mm_s = Some(feed_mm_s);
    }
    let levels = (0..n_levels)
        .map(|level| {
            let members = || {
                let pairs = touches.iter().zip(&level_of);
                pairs.filter(move |(_, of)| **of == level).map(|(t, _)| t)
            };
            AtFeed {
                feed_mm_s: members().map(|t| t.feed_mm_s).sum::<f64>() / members().count() as f64,
                points_mm: members().map(|t| t.ball_mm).collect(),
            }
        })
        .collect();
    (level_of, levels)
}
