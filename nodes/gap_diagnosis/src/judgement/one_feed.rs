//! What one feed cannot tell apart, and what only shows where an axis turns round.
//!
//! # Model
//!
//! A lost motion that depends on the feed has some size at each feed. Where every run that shows a play was driven at one feed v,
//!
//! ```text
//!   max v / min v <= 1.2,   v the speed along the path that nine tenths of its moving ticks do not exceed        (1)
//! ```
//!
//! its law is free, and it reads as the play does, whatever form both have along the axis. So it is listed with the play.
//!
//! A lost motion that depends on the feed by exp(-v/v_s), and is nearly gone at the slowest of these feeds,
//!
//! ```text
//!   exp(-min v / v_s) < 0.05                                              (2)
//! ```
//!
//! is read just where the axis turns round, where its model does not hold: it is listed with the spike of a reversal.
//!
//! A wind-up grows with the distance from the bearing. With f its signature and U unit columns that span the play, with its corner and
//! its forms along the axis,
//!
//! ```text
//!   |U'f| / |f| >= 0.95                                                   (3)
//! ```
//!
//! it reads as a play that wears along the axis, with which it is listed, and at one feed with a lost motion that depends on it.
//!
//! # Holds when
//! Feeds are steady between the turns. Of readings at rest (1) takes the feed at which the axis came there, (2) zero.

use metrology::Axis;
use twin::Motion;
use twin::effects::{self, Parameter, Role, Target};

use crate::judgement::cause::Member;
use crate::judgement::unresolved;
use crate::noise::stack::Stack;
use crate::report::Status;
use crate::search::nuisance::orthonormal;
use crate::search::rows::count;
use crate::search::signature::{Instance, Library};

const PLAY: &str = "backlash";
const FEED_LOST_MOTION: &str = "feed_lost_motion";
const SPIKE: &str = "reversal_spike";
const WIND_UP: &str = "friction_windup";
/// The parameter v_s of (2).
const SPEED: &str = "speed_mm_s";
/// Greatest ratio (1) of what is one feed.
const ONE_FEED: f64 = 1.2;
/// Share of the moving ticks of a run whose speed does not exceed its feed.
const SHARE_BELOW: f64 = 0.9;
/// (3).
const MIN_COSINE_OF_PLAY: f64 = 0.95;
/// (2).
const GONE: f64 = 0.05;
/// A block in which a signature has a smaller size over noise does not show it.
const MIN_D_SHOWN: f64 = 2.0;
/// Below this share of its feed an axis comes to rest.
const STANDS: f64 = 0.05;
/// Below this speed an axis stands, mm/s.
const STANDS_MM_S: f64 = 1e-3;

/// Lists what a recording cannot tell from a play, or from a lost motion that depends on the feed, by its feeds.
pub(crate) fn list(stack: &Stack<'_>, signatures: &Library, members: &mut [Member]) {
    for member in members {
        let instance = &signatures.instances[signatures.forms[member.form].instance];
        let Target::Axis(axis) = instance.target else {
            continue;
        };
        if member.status() == Status::Surrogate {
            continue;
        }
        let values = &member.estimate.values;
        let has_one_feed = || is_of_one_feed(stack, instance, values);
        let rivals = match instance.kind.id {
            PLAY if has_one_feed() => vec![(FEED_LOST_MOTION, 1.0)],
            FEED_LOST_MOTION if is_gone_between_turns(stack, instance, values) => {
                vec![(SPIKE, 1.0)]
            }
            WIND_UP => match cosine_of_play(stack, instance, values) {
                Some(cos) if has_one_feed() => vec![(FEED_LOST_MOTION, cos), (PLAY, cos)],
                Some(cos) => vec![(PLAY, cos)],
                None => vec![],
            },
            _ => vec![],
        };
        for (rival, cos) in rivals {
            unresolved::list(member, rival, &axis.to_string(), cos);
        }
    }
}

/// (1).
fn is_of_one_feed(stack: &Stack<'_>, instance: &Instance, values: &[f64]) -> bool {
    // Where an axis stands while it is read the whole run says how it came there.
    let feeds = feeds_mm_s(stack, instance, values, whole_feed_mm_s);
    feeds.is_some_and(|[slowest, fastest]| fastest <= ONE_FEED * slowest)
}

/// (2).
fn is_gone_between_turns(stack: &Stack<'_>, instance: &Instance, values: &[f64]) -> bool {
    let mut parameters = instance.kind.parameters.iter().zip(values);
    let speed = parameters.find_map(|(own, value)| (own.name == SPEED).then_some(*value));
    let feeds = feeds_mm_s(stack, instance, values, |_| Some(0.0));
    let is_gone = |([slowest, _], speed): ([f64; 2], f64)| (-slowest / speed).exp() < GONE;
    feeds.zip(speed).is_some_and(is_gone)
}

/// (3), where it holds.
fn cosine_of_play(stack: &Stack<'_>, instance: &Instance, values: &[f64]) -> Option<f64> {
    let play = effects::kind(PLAY)?;
    let own = stack.signature(&*instance.effect(values));
    let all: Vec<&Parameter> = play.parameters.iter().chain(play.free).collect();
    let sizes = (0..all.len()).filter(|place| all[*place].role == Role::Amplitude);
    let columns = sizes.map(|place| {
        let mut values = vec![0.0; all.len()];
        values[place] = 1.0;
        stack.signature(&*(play.build)(instance.target.clone(), &values))
    });
    let columns = columns.filter(|column| column.norm() > 1e-6);
    let basis = orthonormal(own.len(), columns);
    let cos = basis.tr_mul(&own).norm() / own.norm().max(f64::MIN_POSITIVE);
    (cos >= MIN_COSINE_OF_PLAY).then_some(cos)
}

/// Slowest and fastest feed of the runs that show an effect, `at_rest` of those that are read where their axes stand.
fn feeds_mm_s(
    stack: &Stack<'_>,
    instance: &Instance,
    values: &[f64],
    at_rest: impl Fn(&Motion) -> Option<f64>,
) -> Option<[f64; 2]> {
    let signature = stack.signature(&*instance.effect(values));
    let blocks = stack.rows.blocks.iter().filter(|block| {
        let rows = signature.rows(block.start, block.rows.len());
        rows.norm() >= MIN_D_SHOWN
    });
    let feeds = blocks.filter_map(|block| {
        let motion = &stack.session.runs[block.run].motion;
        let read = block.rows.iter().filter_map(|row| row.tick);
        let stands_mm_s = STANDS * whole_feed_mm_s(motion)?;
        feed_mm_s(motion, read, stands_mm_s).or_else(|| at_rest(motion))
    });
    feeds.fold(None, |range, feed| {
        let [low, high] = range.unwrap_or([feed, feed]);
        Some([feed.min(low), feed.max(high)])
    })
}

/// The feed of a run, (1), by all of its ticks.
fn whole_feed_mm_s(motion: &Motion) -> Option<f64> {
    feed_mm_s(motion, 0..motion.time_s.len(), STANDS_MM_S)
}

/// The feed of a run, (1), by some of its ticks; slower than `stands_mm_s` it stands.
fn feed_mm_s(motion: &Motion, ticks: impl Iterator<Item = usize>, stands_mm_s: f64) -> Option<f64> {
    let speed = |tick: usize| -> f64 {
        let along = Axis::LINEAR.iter();
        let along = along.filter_map(|axis| motion.velocity[*axis].get(tick));
        along.map(|speed| speed.powi(2)).sum::<f64>().sqrt()
    };
    let mut speeds: Vec<f64> = ticks
        .map(speed)
        .filter(|speed| *speed > stands_mm_s)
        .collect();
    speeds.sort_by(f64::total_cmp);
    let last = speeds.len().checked_sub(1)?;
    let place = (SHARE_BELOW * count(last)) as usize;
    speeds.get(place).copied()
}
