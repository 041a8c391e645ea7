//! Whether a bag may be played among those who are on the graph.

use std::time::{Duration, Instant};

use node_runtime::tap::Rival;

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

    /// What is waited before the first message, in pieces after each of which the graph is looked at: `delay`, and long
    /// enough to meet who is there.
    pub fn waits(&self, delay: Duration) -> Vec<Duration> {
        if self.is_off {
            return vec![delay];
        }
        let pieces = delay.max(MEETING).as_nanos() / LOOK_PERIOD.as_nanos() + 1;
        vec![LOOK_PERIOD; usize::try_from(pieces).unwrap_or(usize::MAX)]
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
            self.reason = reason(&rivals(), sent);
        }
        self.reason.is_some()
    }

    /// Why the bag was not played, or no further.
    pub fn into_reason(self) -> Option<String> {
        self.reason
    }
}

fn reason(rivals: &[Rival], sent: u64) -> Option<String> {
    if rivals.is_empty() {
        return None;
    }
    let shown: Vec<String> = rivals.iter().take(SHOWN).map(Rival::to_string).collect();
    let more = match rivals.len().saturating_sub(SHOWN) {
        0 => String::new(),
        n => format!(", and {n} more"),
    };
    Some(format!(
        "it is not played among nodes at work: {}{more}; {sent} messages were sent; end these nodes, play on another ROS_DOMAIN_ID, leave these topics out (--topics), or ask for it (--onto-a-running-graph)",
        shown.join(", ")
    ))
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
    fn the_graph_is_met_before_the_first_message_however_short_the_delay() {
        let whole = |is_off, delay_s| {
            let waits = GraphWatch::new(is_off).waits(Duration::from_secs_f64(delay_s));
            waits.iter().sum::<Duration>().as_secs_f64()
        };
        assert!(whole(true, 0.0) < 1e-9);
        assert!(whole(false, 0.0) >= 1.0);
        assert!((8.0..8.3).contains(&whole(false, 8.0)));
    }
}
