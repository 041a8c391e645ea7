//! The node's conditions as `/diagnostics` shows them, and what of them is logged.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::time::Duration;

use abbe_msgs::diagnostic_msgs::msg::{DiagnosticArray, DiagnosticStatus, KeyValue};
use abbe_msgs::std_msgs::msg::Header;
use metrology::Stamp;
use metrology::stamp::Host;
use tokio::time::Instant;

use crate::clock;
use crate::diagnostic::{Diagnostic, Level};

/// A condition that goes on is logged again after this time.
const LOG_AGAIN: Duration = Duration::from_secs(10);

/// A condition that the runtime itself saw is over when it has not come back for this long.
const OVER_AFTER: Duration = Duration::from_secs(10);

struct Standing {
    diagnostic: Diagnostic,
    logged: Instant,
    /// Since when it has not been seen; only for what the runtime itself reports.
    expires: Option<Instant>,
    silenced: u64,
    /// Whether it has been published.
    shown: bool,
}

/// Conditions that may stand at once: some have the name of a feature in theirs, which anybody on the network may choose.
const MOST_STANDING: usize = 500;
const TOO_MANY: &str = "too_many_conditions";

/// All standing conditions and counters of one node.
pub(super) struct Board {
    node: String,
    state: &'static str,
    standing: BTreeMap<Cow<'static, str>, Standing>,
    counters: BTreeMap<String, u64>,
    /// `Ok` and shown all the same.
    figures: BTreeMap<Cow<'static, str>, Diagnostic>,
    /// Began and ended since the last publication, so that it is seen all the same.
    passing: BTreeMap<Cow<'static, str>, Diagnostic>,
    /// Reported `Ok` since the last publication, so that the end of a condition is seen.
    ended: Vec<Diagnostic>,
    changed: bool,
}

impl Board {
    pub fn new(node: &str) -> Self {
        Self {
            node: node.to_owned(),
            state: "running",
            standing: BTreeMap::new(),
            counters: BTreeMap::new(),
            figures: BTreeMap::new(),
            passing: BTreeMap::new(),
            ended: Vec::new(),
            changed: true,
        }
    }

    pub fn stopping(&mut self) {
        self.state = "stopping";
        self.changed = true;
    }

    pub fn count(&mut self, counter: impl Into<String>, by: u64) {
        *self.counters.entry(counter.into()).or_default() += by;
    }

    /// Sets a counter that is kept elsewhere.
    pub fn set(&mut self, counter: String, to: u64) {
        self.counters.insert(counter, to);
    }

    /// Takes in what the node reports.
    pub fn report(&mut self, diagnostic: Diagnostic, now: Instant) {
        self.put(diagnostic, now, None);
    }

    /// Takes in what the runtime saw; it is over when it is not seen again.
    pub fn notice(&mut self, diagnostic: Diagnostic, now: Instant) {
        self.put(diagnostic, now, Some(now + OVER_AFTER));
    }

    fn put(&mut self, diagnostic: Diagnostic, now: Instant, expires: Option<Instant>) {
        let name = diagnostic.name.clone();
        if diagnostic.stays && diagnostic.level == Level::Ok {
            self.figures.insert(name.clone(), diagnostic.clone());
        } else {
            self.figures.remove(&name);
        }
        if diagnostic.level == Level::Ok {
            if let Some(standing) = self.standing.remove(&name) {
                if !standing.shown {
                    self.passing.insert(name, standing.diagnostic);
                }
                tracing::info!(condition = &*diagnostic.name, "{}", diagnostic.message);
                if !diagnostic.stays {
                    self.ended.retain(|ended| ended.name != diagnostic.name);
                    self.ended.push(diagnostic);
                }
                self.changed = true;
            }
            return;
        }
        let held = self.standing.len();
        if held >= MOST_STANDING && name != TOO_MANY && !self.standing.contains_key(&name) {
            self.count("conditions not shown", 1);
            let message = format!(
                "{held} conditions stand, the most that are shown; the newest is not: {name}"
            );
            let too_many = Diagnostic::new(Level::Error, TOO_MANY, message);
            return self.put(too_many, now, Some(now + OVER_AFTER));
        }
        match self.standing.get_mut(&name) {
            Some(standing) if standing.diagnostic.level == diagnostic.level => {
                standing.diagnostic = diagnostic;
                standing.expires = expires;
                standing.silenced += 1;
                if now.duration_since(standing.logged) >= LOG_AGAIN {
                    log(&standing.diagnostic, standing.silenced);
                    standing.logged = now;
                    standing.silenced = 0;
                }
            }
            _ => {
                log(&diagnostic, 0);
                self.changed = true;
                let standing = Standing {
                    diagnostic,
                    logged: now,
                    expires,
                    silenced: 0,
                    shown: false,
                };
                self.standing.insert(name, standing);
            }
        }
    }

    /// Lets what the runtime has not seen again come to its end.
    pub fn expire(&mut self, now: Instant) {
        let over: Vec<_> = self
            .standing
            .iter()
            .filter(|(_, standing)| standing.expires.is_some_and(|at| at <= now))
            .map(|(name, standing)| (name.clone(), standing.diagnostic.message.clone()))
            .collect();
        for (name, was) in over {
            let message = format!("over for {} s: {was}", OVER_AFTER.as_secs());
            self.put(Diagnostic::new(Level::Ok, name, message), now, None);
        }
    }

    /// Whether something began or ended since the last publication.
    pub const fn has_changed(&self) -> bool {
        self.changed
    }

    /// The message for `/diagnostics`.
    pub fn message(&mut self, at: Stamp<Host>) -> DiagnosticArray {
        self.changed = false;
        let worst = self
            .standing
            .values()
            .map(|s| s.diagnostic.level)
            .max()
            .unwrap_or(Level::Ok);
        let values = self
            .counters
            .iter()
            .map(|(key, count)| KeyValue {
                key: key.clone(),
                value: count.to_string(),
            })
            .collect();
        let state = DiagnosticStatus {
            level: worst as u8,
            name: self.node.clone(),
            message: self.state.to_owned(),
            hardware_id: String::new(),
            values,
        };
        for standing in self.standing.values_mut() {
            standing.shown = true;
        }
        let standing = self.standing.values().map(|standing| &standing.diagnostic);
        let passing = std::mem::take(&mut self.passing);
        let ended = std::mem::take(&mut self.ended);
        // The last word on each is how it is now.
        let conditions = passing
            .values()
            .chain(&ended)
            .chain(standing)
            .chain(self.figures.values())
            .map(|diagnostic| diagnostic.status(&self.node));
        DiagnosticArray {
            status: std::iter::once(state).chain(conditions).collect(),
            header: Header {
                stamp: clock::ros_time(at),
                frame_id: String::new(),
            },
        }
    }
}

fn log(diagnostic: &Diagnostic, silenced: u64) {
    let Diagnostic {
        level,
        name,
        message,
        ..
    } = diagnostic;
    match level {
        Level::Ok => tracing::info!(condition = &**name, "{message}"),
        Level::Warn | Level::Stale => tracing::warn!(condition = &**name, silenced, "{message}"),
        Level::Error => tracing::error!(condition = &**name, silenced, "{message}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(board: &mut Board) -> Vec<(String, u8)> {
        let message = board.message(Stamp::from_nanos(0));
        message
            .status
            .into_iter()
            .map(|status| (status.name, status.level))
            .collect()
    }

    #[test]
    fn conditions_without_end_are_not_held_and_it_is_said() {
        let mut board = Board::new("/probe");
        let now = Instant::now();
        for n in 0..3 * MOST_STANDING {
            let name = format!("shape_not_evaluated/{n}");
            board.report(Diagnostic::new(Level::Error, name, "no".into()), now);
        }
        assert_eq!(board.standing.len(), MOST_STANDING + 1);
        let shown = names(&mut board);
        assert!(shown.iter().any(|(name, _)| name.ends_with(TOO_MANY)));
    }

    #[test]
    fn a_condition_stands_until_it_is_reported_ok() {
        let mut board = Board::new("/probe");
        let now = Instant::now();
        board.report(
            Diagnostic::new(Level::Warn, "model_stale", "old".into()),
            now,
        );
        let stands = [
            ("/probe".to_owned(), 1),
            ("/probe: model_stale".to_owned(), 1),
        ];
        assert_eq!(names(&mut board), stands);
        assert!(!board.has_changed());
        board.report(
            Diagnostic::new(Level::Warn, "model_stale", "older".into()),
            now,
        );
        assert!(!board.has_changed(), "the same level is no news");
        board.report(
            Diagnostic::new(Level::Ok, "model_stale", "fresh".into()),
            now,
        );
        assert!(board.has_changed());
        assert_eq!(names(&mut board)[1], ("/probe: model_stale".to_owned(), 0));
        assert_eq!(names(&mut board).len(), 1);
    }

    #[test]
    fn a_figure_that_stays_is_shown_while_it_is_ok_and_gives_way_to_its_condition() {
        let mut board = Board::new("/probe");
        let told = |level| Diagnostic::new(level, "clock", "3 us".into()).staying();
        board.report(told(Level::Ok), Instant::now());
        for _ in 0..2 {
            assert_eq!(names(&mut board)[1], ("/probe: clock".to_owned(), 0));
        }
        board.report(told(Level::Warn), Instant::now());
        let stands = [("/probe".to_owned(), 1), ("/probe: clock".to_owned(), 1)];
        assert_eq!(names(&mut board), stands);
        board.report(told(Level::Ok), Instant::now());
        assert_eq!(names(&mut board)[1..], [("/probe: clock".to_owned(), 0)]);
    }

    #[test]
    fn what_the_runtime_saw_ends_by_itself() {
        let mut board = Board::new("/probe");
        let now = Instant::now();
        board.notice(
            Diagnostic::new(Level::Error, "samples_lost", "3".into()),
            now,
        );
        board.expire(now + Duration::from_secs(9));
        assert_eq!(names(&mut board).len(), 2);
        board.expire(now + Duration::from_secs(11));
        let over = board.message(Stamp::from_nanos(0)).status.swap_remove(1);
        assert_eq!((over.level, over.message.as_str()), (0, "over for 10 s: 3"));
        assert_eq!(names(&mut board).len(), 1);
    }

    #[test]
    fn a_condition_that_is_over_before_it_was_published_is_seen_once_all_the_same() {
        let mut board = Board::new("/fake_cnc");
        let now = Instant::now();
        let say = |board: &mut Board, level| {
            board.report(Diagnostic::new(level, "time", "jumped".into()), now);
        };
        for _ in 0..3 {
            say(&mut board, Level::Warn);
            say(&mut board, Level::Ok);
        }
        assert!(board.has_changed());
        let time = "/fake_cnc: time".to_owned();
        let seen = [("/fake_cnc".to_owned(), 0), (time.clone(), 1), (time, 0)];
        assert_eq!(names(&mut board), seen);
        assert_eq!(names(&mut board).len(), 1);
    }
}
