//! Whether a bag may be played among those who are on the graph.

use std::time::{Duration, Instant};

use anyhow::{Result, anyhow};
use node_runtime::RawPublisher;
use node_runtime::environment::Environment;
use node_runtime::names::NodeNames;
use node_runtime::tap::Rival;
use replayer::PlaybackConfig;

use crate::contents::Contents;
use crate::player::{PATIENCE, QUEUE_LEN};

/// Until everybody who was there before has been met.
const MEETING: Duration = Duration::from_secs(1);
/// Between two looks at the graph.
const LOOK_PERIOD: Duration = Duration::from_millis(100);
/// Rivals that a message names.
const SHOWN: usize = 3;

/// Looks at the graph, unless the bag is to be played in any case.
#[derive(Debug)]
pub struct GraphWatch {
    is_off: bool,
    looked: Option<Instant>,
    reason: Option<String>,
}

impl GraphWatch {
    /// `is_off`: others do not matter.
    pub const fn new(is_off: bool) -> Self {
        Self {
            is_off,
            looked: None,
            reason: None,
        }
    }

    /// The delay before the first message, in pieces after each of which the graph is looked at.
    pub fn waits(&self, delay: Duration) -> Vec<Duration> {
        let longest = if self.is_off { delay } else { LOOK_PERIOD };
        let (mut waits, mut left) = (vec![], delay);
        while !left.is_zero() {
            let wait = left.min(longest);
            waits.push(wait);
            left -= wait;
        }
        waits
    }

    /// Whether somebody else is there; `sent`: how many messages went out until now.
    #[expect(
        clippy::disallowed_methods,
        reason = "the graph is looked at now and then"
    )]
    pub fn is_disturbed(&mut self, sent: u64, rivals: impl FnOnce() -> Vec<Rival>) -> bool {
        let is_due = self.looked.is_none_or(|at| at.elapsed() >= LOOK_PERIOD);
        if !self.is_off && self.reason.is_none() && is_due {
            self.looked = Some(Instant::now());
            let rivals = rivals();
            self.reason = (!rivals.is_empty()).then(|| refusal(&rivals, sent));
        }
        self.reason.is_some()
    }

    /// Why the bag was not played, or no further.
    pub fn into_reason(self) -> Option<String> {
        self.reason
    }
}

/// Joins the network to speak on the topics of the bag, where it may.
///
/// # Errors
/// When there is no network, or others use the topics.
pub fn voice(
    environment: &Environment,
    names: &NodeNames,
    contents: &Contents,
    config: &PlaybackConfig,
) -> Result<RawPublisher> {
    let topics = &contents.offered;
    if config.onto_a_running_graph {
        return RawPublisher::of_found(environment, names, topics, QUEUE_LEN, PATIENCE);
    }
    let how = (QUEUE_LEN, PATIENCE);
    RawPublisher::where_alone(environment, names, topics, how, MEETING)?
        .map_err(|rivals| anyhow!("{}: {}", config.bag, refusal(&rivals, 0)))
}

/// Why a bag is not played among these, of which so many messages `sent` went out.
fn refusal(rivals: &[Rival], sent: u64) -> String {
    let shown: Vec<String> = rivals.iter().take(SHOWN).map(Rival::to_string).collect();
    let more = match rivals.len().saturating_sub(SHOWN) {
        0 => String::new(),
        n => format!(", and {n} more"),
    };
    format!(
        "it is not played among nodes at work: {}{more}; {sent} messages were sent; end these nodes, play on another ROS_DOMAIN_ID, leave these topics out (--topics), or ask for it (--onto-a-running-graph)",
        shown.join(", ")
    )
}

#[cfg(test)]
mod tests {
    use node_runtime::tap::Use;

    use super::*;

    fn rivals(n: usize) -> Vec<Rival> {
        let rival = |k| Rival {
            topic: format!("/topic_{k}"),
            uses: Use::Publishes,
            node: "/cell".to_owned(),
        };
        (0..n).map(rival).collect()
    }

    #[test]
    fn who_is_there_is_named_and_the_reason_stays() {
        for n in [1, 3, 4, 40] {
            let mut watch = GraphWatch::new(false);
            assert!(watch.is_disturbed(7, || rivals(n)));
            assert!(watch.is_disturbed(8, || panic!("it is known already")));
            let reason = watch.into_reason().unwrap();
            assert!(reason.contains("/cell publishes /topic_0"), "{reason}");
            assert!(reason.contains("7 messages were sent"), "{reason}");
            let more = format!("and {} more", n.saturating_sub(SHOWN));
            assert_eq!(reason.contains(&more), n > SHOWN, "{reason}");
        }
    }

    #[test]
    fn nobody_there_or_nobody_asked_for_disturbs_nothing() {
        let mut alone = GraphWatch::new(false);
        assert!(!alone.is_disturbed(0, Vec::new));
        assert_eq!(alone.into_reason(), None);
        let mut asked = GraphWatch::new(true);
        assert!(!asked.is_disturbed(0, || rivals(2)));
        assert_eq!(asked.into_reason(), None);
    }

    #[test]
    fn the_delay_is_waited_in_pieces_that_are_short_where_the_graph_is_watched() {
        for (delay_ms, pieces) in [(0, 0), (40, 1), (100, 1), (250, 3), (8_000, 80)] {
            let delay = Duration::from_millis(delay_ms);
            for (is_off, pieces) in [(true, pieces.min(1)), (false, pieces)] {
                let waits = GraphWatch::new(is_off).waits(delay);
                assert_eq!(waits.iter().sum::<Duration>(), delay);
                assert_eq!(waits.len(), pieces, "{delay_ms} ms");
            }
        }
    }
}
