//! Meeting again after a link was cut for longer than a lease.
//!
//! RustDDS tells of a participant every 10 s. Whom a lease (50 s) has let go is met again only then, and so only up to 10 s after
//! the link is back. But it answers a newcomer at once, for everybody to hear. So while somebody is missed, a newcomer of ours
//! shows up every two seconds and leaves again.

use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use rustdds::{
    DomainParticipant, DomainParticipantStatusEvent, GUID, LostReason, RTPSEntity, StatusEvented,
};
use tokio::time::Instant;

use super::builder;
use crate::environment::Environment;

/// Between two newcomers of this process.
const AGAIN: Duration = Duration::from_millis(1_900);
/// How long a newcomer stays: it is answered 10 ms after it was heard.
const STAY: Duration = Duration::from_millis(600);
/// How long somebody is missed; a process that was killed never comes back.
const PATIENCE: Duration = Duration::from_secs(600);

/// When this process sent its last newcomer.
static LAST: Mutex<Option<Instant>> = Mutex::new(None);

/// Those whose lease is over.
#[derive(Debug, Default)]
pub(super) struct Missed(Vec<(GUID, Instant)>);

impl Missed {
    /// Learns who was lost and who is back; whether anybody is missed.
    pub fn look(&mut self, participant: &DomainParticipant, now: Instant) -> bool {
        let listener = participant.status_listener();
        while let Some(event) = listener.try_recv_status() {
            match event {
                DomainParticipantStatusEvent::ParticipantLost { id, reason } => {
                    // Every participant has the same number within its prefix.
                    let guid = GUID {
                        prefix: id,
                        ..participant.guid()
                    };
                    self.lost(guid, matches!(reason, LostReason::Timeout { .. }), now);
                }
                DomainParticipantStatusEvent::ParticipantDiscovered { dpd } => {
                    self.found(dpd.guid);
                }
                _ => {}
            }
        }
        self.0
            .retain(|(_, since)| now.duration_since(*since) < PATIENCE);
        !self.0.is_empty()
    }

    /// Who took leave is not missed.
    fn lost(&mut self, guid: GUID, is_over_time: bool, now: Instant) {
        self.found(guid);
        if is_over_time {
            self.0.push((guid, now));
        }
    }

    fn found(&mut self, guid: GUID) {
        self.0.retain(|(missed, _)| *missed != guid);
    }
}

/// Lets a newcomer show up, unless one of this process did a moment ago.
pub(super) fn show_newcomer(environment: &Environment, now: Instant) {
    let mut last = LAST.lock().unwrap_or_else(PoisonError::into_inner);
    if last.is_some_and(|last| now.duration_since(last) < AGAIN) {
        return;
    }
    *last = Some(now);
    let environment = environment.clone();
    std::thread::spawn(move || match builder(&environment).build() {
        Ok(newcomer) => {
            std::thread::park_timeout(STAY);
            drop(newcomer);
        }
        Err(error) => tracing::debug!("no newcomer: {error}"),
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_did_not_take_leave_is_missed_until_back() {
        let now = Instant::now();
        let of = |bytes| GUID::from_bytes([bytes; 16]);
        let mut missed = Missed::default();
        missed.lost(of(1), true, now);
        missed.lost(of(2), true, now);
        missed.lost(of(3), false, now);
        assert_eq!(missed.0.len(), 2);
        missed.found(of(1));
        assert_eq!(missed.0, [(of(2), now)]);
        missed.lost(of(2), false, now);
        assert!(missed.0.is_empty());
    }
}
