//! Distributes the parts of the page to browsers.
//!
//! Nothing waits for a browser. Each has the version it received last; when its connection accepts more, it gets the
//! latest of the parts that changed since. A browser that stalls skips the versions between.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use futures::Stream;
use futures::stream::unfold;
use tokio::sync::{OwnedSemaphorePermit, watch};

use crate::stage::Output;

#[derive(Default)]
struct Board {
    now_ms: i64,
    version: u64,
    parts: BTreeMap<&'static str, (u64, Arc<str>)>,
}

/// The parts, and the signal to browsers.
pub(super) struct Hub {
    board: Mutex<Board>,
    period_ms: u128,
    beat: watch::Sender<u64>,
}

impl Hub {
    pub fn new(period_ms: u128) -> Self {
        Self {
            board: Mutex::default(),
            period_ms,
            beat: watch::Sender::new(0),
        }
    }

    fn board(&self) -> MutexGuard<'_, Board> {
        self.board.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Stores changed parts and the time; `is_beat`: sends an event even without a change.
    pub fn publish(&self, now_ms: i64, changed: Vec<Output>, is_beat: bool) {
        let is_new = !changed.is_empty();
        let mut board = self.board();
        board.now_ms = now_ms;
        board.version += u64::from(is_new);
        let version = board.version;
        for Output::Changed { part, json } in changed {
            board.parts.insert(part, (version, json.into()));
        }
        drop(board);
        if is_new || is_beat {
            self.beat.send_modify(|beat| *beat = beat.wrapping_add(1));
        }
    }

    /// The parts newer than version `seen` as one JSON object, and their version.
    pub fn since(&self, seen: Option<u64>) -> (u64, String) {
        let (now_ms, version, parts) = {
            let board = self.board();
            let is_new = |version: u64| seen.is_none_or(|seen| version > seen);
            let parts = board.parts.iter().filter(|(_, (at, _))| is_new(*at));
            let parts: Vec<_> = parts
                .map(|(part, (_, json))| (*part, Arc::clone(json)))
                .collect();
            (board.now_ms, board.version, parts)
        };
        let period_ms = self.period_ms;
        let mut text = format!("{{\"now_ms\":{now_ms},\"period_ms\":{period_ms},\"parts\":{{");
        for (n, (part, json)) in parts.iter().enumerate() {
            let comma = if n > 0 { "," } else { "" };
            text.push_str(&format!("{comma}\"{part}\":{json}"));
        }
        text.push_str("}}");
        (version, text)
    }

    /// Server-sent events for one browser; its place is free when they end.
    pub fn events(
        self: &Arc<Self>,
        place: OwnedSemaphorePermit,
    ) -> impl Stream<Item = Result<String, Infallible>> + Send + 'static {
        let begin = (Arc::clone(self), self.beat.subscribe(), None, place);
        unfold(begin, |(hub, mut beat, seen, place)| async move {
            if seen.is_some() && beat.changed().await.is_err() {
                return None;
            }
            beat.borrow_and_update();
            let (seen, json) = hub.since(seen);
            let event = format!("data: {json}\n\n");
            Some((Ok(event), (hub, beat, Some(seen), place)))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn changed(part: &'static str, json: &str) -> Output {
        let json = json.to_owned();
        Output::Changed { part, json }
    }

    #[test]
    fn a_browser_gets_the_latest_of_what_it_has_not_seen() {
        let hub = Hub::new(200);
        hub.publish(
            1,
            vec![changed("axes", "1"), changed("plan", "\"a\"")],
            false,
        );
        let (seen, first) = hub.since(None);
        assert_eq!(
            first,
            r#"{"now_ms":1,"period_ms":200,"parts":{"axes":1,"plan":"a"}}"#
        );
        hub.publish(2, vec![changed("axes", "2")], false);
        hub.publish(3, vec![changed("axes", "3")], false);
        let (seen, later) = hub.since(Some(seen));
        assert_eq!(later, r#"{"now_ms":3,"period_ms":200,"parts":{"axes":3}}"#);
        hub.publish(4, Vec::new(), true);
        let nothing = r#"{"now_ms":4,"period_ms":200,"parts":{}}"#;
        assert_eq!(hub.since(Some(seen)).1, nothing);
    }
}
