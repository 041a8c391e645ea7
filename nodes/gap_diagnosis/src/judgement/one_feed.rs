//! Whether a lost motion may be one that depends on the feed.
//!
//! At one feed every law of the feed gives one width: a constant lost motion and one that depends on the feed are the same
//! readings. A certain law (the catalogue's) may fit less well within a circle, where the speed of an axis changes; that another
//! one fits is not excluded. So a constant lost motion is listed with the other one, unless two feeds were run whose ratio is at
//! least [`LEAST_RATIO`], or stops beside motion.

use metrology::sample::TestKind;
use nalgebra::DVector;
use twin::effects::Target;

use crate::judgement::cause::Member;
use crate::judgement::confidence::ODDS;
use crate::judgement::{Check, CheckId};
use crate::noise::stack::Stack;
use crate::report::{Confusable, Status};
use crate::search::signature::Library;

const CONSTANT: &str = "backlash";
const BY_FEED: &str = "feed_lost_motion";
/// Feeds that differ by less are one.
const LEAST_RATIO: f64 = 1.2;
/// Runs with less than this share of the square of a signature say nothing of it.
const LEAST_SHARE: f64 = 1e-3;

/// Lists the lost motion by feed with a constant one that was read at one feed.
pub(crate) fn list_by_feed(stack: &Stack<'_>, signatures: &Library, members: &mut [Member]) {
    for member in members {
        let instance = &signatures.instances[signatures.forms[member.form].instance];
        let Target::Axis(axis) = instance.target else {
            continue;
        };
        if instance.kind.id != CONSTANT
            || !axis.is_linear()
            || member.status() == Status::Surrogate
            || member
                .confusable
                .iter()
                .any(|other| other.effect == BY_FEED && !other.excluded)
        {
            continue;
        }
        let read = stack.signature(&*instance.effect(&member.estimate.values));
        if !is_one(&feeds_mm_s(stack, &read)) {
            continue;
        }
        member.confusable.retain(|other| other.effect != BY_FEED);
        member.confusable.insert(
            0,
            Confusable {
                effect: BY_FEED.to_owned(),
                axis: instance.target.to_string(),
                cos: 1.0,
                excluded: false,
            },
        );
        let limit = 2.0 * ODDS.ln();
        member.put(Check::new(CheckId::NoRival, false).with(0.0, limit));
    }
}

/// Feeds of the runs that say something of a signature, mm/s; 0 where an axis stood while it was read.
fn feeds_mm_s(stack: &Stack<'_>, read: &DVector<f64>) -> Vec<f64> {
    let whole = read.norm_squared();
    let blocks = stack.rows.blocks.iter();
    let feeds = blocks.filter_map(|block| {
        let part: f64 = block.range().map(|place| read[place] * read[place]).sum();
        let run = &stack.session.runs[block.run];
        let stands = matches!(run.segment.kind, TestKind::Positioning | TestKind::Diagonal)
            || run.segment.stations > 0;
        let feed_mm_s = if stands { 0.0 } else { run.segment.feed_mm_s };
        (part > LEAST_SHARE * whole).then_some(feed_mm_s)
    });
    feeds.collect()
}

fn is_one(feeds_mm_s: &[f64]) -> bool {
    let least = feeds_mm_s.iter().copied().fold(f64::INFINITY, f64::min);
    let greatest = feeds_mm_s.iter().copied().fold(0.0, f64::max);
    !feeds_mm_s.is_empty() && greatest <= LEAST_RATIO * least
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn feeds_are_one_within_a_fifth() {
        for (feeds, wanted) in [
            (vec![], false),
            (vec![16.7], true),
            (vec![16.7, 17.5, 16.7], true),
            (vec![16.7, 50.0], false),
            (vec![0.0, 16.7], false),
            (vec![0.0, 0.0], true),
        ] {
            assert_eq!(is_one(&feeds), wanted, "{feeds:?}");
        }
    }
}
