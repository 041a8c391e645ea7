//! How a tap ends: what was sent before it was asked to end is handed over, or counted.
//!
//! On a busy computer samples wait in a reader, and on their way to it, for seconds. All samples of a writer have come as
//! soon as one comes that it sent after the end was asked for. A writer that has fallen silent sends none: then the tap
//! waits for [`QUIET`] without a sample of the writers that it waits for. A writer whose stamps are of another time, as
//! when a bag is played, is waited for until the reader is empty. After [`LONGEST`] the rest is counted.

use std::collections::BTreeMap;
use std::future::Future;
use std::sync::Arc;
use std::time::Duration;

use futures::FutureExt;
use metrology::stamp::{Host, Span, Stamp};
use tokio::sync::{mpsc, watch};
use tokio::time::Instant;

use super::{TapEvent, Tapped, TappedTopic};
use crate::live::incoming::GapCounter;
use crate::network::{Guid, Sample};

/// After this time without a sample, none is on its way.
const QUIET: Duration = Duration::from_millis(250);
/// The longest delay of the end.
pub(super) const LONGEST: Duration = Duration::from_secs(3);
/// A stamp that is older than this was made by another clock.
const OF_THIS_CLOCK: Span = Span::from_nanos(60_000_000_000);
/// A reader that was not empty for this time has fallen behind.
const FULL: Duration = Duration::from_millis(100);
/// When the delay of samples shrinks by this much, the reader was catching up; a difference of two clocks stays.
const MADE_UP: Span = Span::from_nanos(250_000_000);

/// The end that was asked for.
#[derive(Clone, Copy, Debug)]
pub(super) struct End {
    /// When it was asked for, by the clock that samples are stamped with.
    pub asked: Stamp<Host>,
    /// When it comes at the latest.
    pub latest: Instant,
}

/// Where samples come from; the network's readers, and those of tests.
pub(super) trait Samples {
    /// The next sample; an error is one that cannot be read.
    fn next(&self) -> impl Future<Output = Result<Sample, String>> + Send;
}

impl Samples for crate::network::Reader {
    async fn next(&self) -> Result<Sample, String> {
        Self::next(self).await
    }
}

/// What is known of one writer.
#[derive(Clone, Copy, Debug)]
struct Heard {
    /// When its last sample was sent, by its own clock, where it has one.
    sent: Option<Stamp<Host>>,
    /// Delay of the first and of the last sample after the end was asked for.
    delays: Option<(Span, Span)>,
}

impl Heard {
    /// When its last sample was sent, where that was before the end and by this computer's clock.
    fn sent_before(&self, end: End) -> Option<Stamp<Host>> {
        let sent = self.sent.filter(|sent| *sent < end.asked);
        sent.filter(|sent| end.asked - *sent < OF_THIS_CLOCK)
    }

    /// Whether a sample may be on its way that was sent before the end.
    fn is_awaited(&self, end: End, has_been_empty: bool) -> bool {
        let is_of_this_clock = |sent: Stamp<Host>| end.asked - sent < OF_THIS_CLOCK;
        if self.sent.is_some_and(is_of_this_clock) {
            self.sent_before(end).is_some()
        } else {
            !has_been_empty
        }
    }
}

/// One topic that is read.
pub(super) struct Reading {
    pub topic: Arc<TappedTopic>,
    pub queue: mpsc::Sender<TapEvent>,
    pub end: watch::Receiver<Option<End>>,
    gaps: GapCounter,
    writers: BTreeMap<Guid, Heard>,
}

/// Writers of a topic that are kept apart; a network with more of them is under attack.
const MAX_ENDING_WRITERS: usize = 1024;
/// Samples that are counted when time is over; a writer that floods the reader never stops.
const MOST_COUNTED: u64 = 1_000_000;

impl Reading {
    pub fn new(
        topic: Arc<TappedTopic>,
        queue: mpsc::Sender<TapEvent>,
        end: watch::Receiver<Option<End>>,
    ) -> Self {
        Self {
            topic,
            queue,
            end,
            gaps: GapCounter::default(),
            writers: BTreeMap::new(),
        }
    }

    /// Hands over what comes, until the end.
    pub async fn run(mut self, reader: impl Samples, now: impl Fn() -> Stamp<Host>) {
        let end = loop {
            let next = tokio::select! {
                biased;
                asked = self.end.wait_for(Option::is_some) => {
                    break asked.ok().and_then(|end| *end);
                }
                next = reader.next() => next,
            };
            if !self.hand_over(next, None).await {
                return;
            }
        };
        if let Some(end) = end {
            self.rest(&reader, end, now).await;
        }
    }

    /// Hands over one sample; false when the receiver is gone.
    async fn hand_over(&mut self, next: Result<Sample, String>, delay: Option<Span>) -> bool {
        let topic = Arc::clone(&self.topic);
        let event = match next {
            Ok(sample) => {
                self.hear(&sample, delay);
                TapEvent::Sample(Tapped {
                    topic,
                    source: sample.source,
                    received: sample.received,
                    sequence: sample.sequence,
                    lost: self.gaps.count(sample.writer, sample.sequence),
                    bytes: sample.bytes,
                })
            }
            Err(reason) => TapEvent::Unreadable { topic, reason },
        };
        self.queue.send(event).await.is_ok()
    }

    fn hear(&mut self, sample: &Sample, delay: Option<Span>) {
        if self.writers.len() >= MAX_ENDING_WRITERS && !self.writers.contains_key(&sample.writer) {
            self.writers.clear();
        }
        let heard = self.writers.entry(sample.writer).or_insert(Heard {
            sent: None,
            delays: None,
        });
        heard.sent = sample.source;
        heard.delays = match (heard.delays, delay) {
            (Some((first, _)), Some(last)) => Some((first, last)),
            (before, None) => before,
            (None, Some(first)) => Some((first, first)),
        };
    }

    /// Hands over what was sent before the end was asked for.
    async fn rest(&mut self, reader: &impl Samples, end: End, now: impl Fn() -> Stamp<Host>) {
        let begun = Instant::now();
        let (mut quiet_at, mut empty_at, mut has_been_empty) = (begun + QUIET, begun, false);
        while Instant::now() < end.latest {
            let next = match reader.next().now_or_never() {
                Some(next) => next,
                None => {
                    (empty_at, has_been_empty) = (Instant::now(), true);
                    if self.is_complete(end, has_been_empty) {
                        return;
                    }
                    let until = quiet_at.min(end.latest);
                    let Ok(next) = tokio::time::timeout_at(until, reader.next()).await else {
                        break;
                    };
                    next
                }
            };
            // Samples of a writer that is complete do not delay the end.
            let of = next.as_ref().ok().map(|sample| sample.writer);
            let was_awaited = of
                .and_then(|writer| self.writers.get(&writer))
                .is_none_or(|heard| heard.is_awaited(end, has_been_empty));
            let sent = next.as_ref().ok().and_then(|sample| sample.source);
            let delay = sent.map(|sent| now() - sent);
            if !self.hand_over(next, delay).await {
                return;
            }
            if was_awaited {
                quiet_at = Instant::now() + QUIET;
            }
            if self.is_complete(end, has_been_empty) {
                return;
            }
        }
        if Instant::now() >= end.latest {
            let is_full = end.latest - empty_at > FULL;
            self.count_rest(reader, end, is_full).await;
        }
    }

    /// Whether all samples of the known writers that were sent before the end have come.
    fn is_complete(&self, end: End, has_been_empty: bool) -> bool {
        let is_awaited = |heard: &Heard| heard.is_awaited(end, has_been_empty);
        !self.writers.is_empty() && !self.writers.values().any(is_awaited)
    }

    /// Counts the samples that still wait when time is over, up to [`MOST_COUNTED`]; `is_full`: the reader was never empty.
    async fn count_rest(&mut self, reader: &impl Samples, end: End, is_full: bool) {
        let mut samples = 0;
        while samples < MOST_COUNTED
            && let Some(next) = reader.next().now_or_never()
        {
            let is_of_before = next.as_ref().map_or(true, |sample| {
                sample.source.is_none_or(|sent| sent < end.asked)
            });
            if !is_of_before {
                break;
            }
            samples += 1;
        }
        let behind = self.writers.values().filter_map(|heard| {
            let sent = heard.sent_before(end)?;
            let (first, last) = heard.delays?;
            let made_up = first.nanos().saturating_sub(last.nanos());
            let is_behind = (is_full && samples > 0) || made_up > MADE_UP.nanos();
            is_behind.then(|| end.asked - sent)
        });
        if let Some(behind) = behind.max() {
            let topic = Arc::clone(&self.topic);
            let left = TapEvent::Left {
                topic,
                samples,
                behind,
            };
            let _ = self.queue.send(left).await;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;
    use std::sync::Mutex;

    use abbe_msgs::Qos;

    use super::*;

    const ASKED: i64 = 1_767_600_000_000_000_000;
    const MS: i64 = 1_000_000;

    /// Samples that wait, each until its instant: writer, number, ms after the end was asked for at which it was sent.
    struct Waiting {
        #[expect(clippy::type_complexity, reason = "the line above names the parts")]
        samples: Mutex<VecDeque<(Instant, u8, i64, Option<i64>)>>,
    }

    impl Samples for Waiting {
        async fn next(&self) -> Result<Sample, String> {
            let (_, writer, sequence, sent_ms) = loop {
                let first = self.samples.lock().unwrap().front().copied();
                match first {
                    Some(first) if first.0 <= Instant::now() => break first,
                    Some(first) => tokio::time::sleep_until(first.0).await,
                    None => std::future::pending().await,
                }
            };
            self.samples.lock().unwrap().pop_front();
            Ok(Sample {
                bytes: Arc::from([0, 1, 0, 0].as_slice()),
                writer: [writer; 16],
                sequence,
                source: sent_ms.map(|ms| Stamp::from_nanos(ASKED + ms * MS)),
                received: Stamp::from_nanos(ASKED),
                related: None,
            })
        }
    }

    /// What a tap gives of samples (ms after the end was asked for at which they come, writer, number, ms at which they
    /// were sent): how many, how many of these are counted as lost, how many are left, and how long the end took, ms.
    fn ended(samples: &[(u64, u8, i64, Option<i64>)]) -> (usize, u64, Option<u64>, u128) {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_time()
            .build()
            .unwrap();
        runtime.block_on(async {
            let start = Instant::now();
            let at = |ms: u64| start + Duration::from_millis(ms);
            let samples = samples.iter().map(|(came_ms, writer, number, sent_ms)| {
                (at(*came_ms), *writer, *number, *sent_ms)
            });
            let waiting = Waiting {
                samples: Mutex::new(samples.collect()),
            };
            let topic = Arc::new(TappedTopic {
                name: "/t".to_owned(),
                type_name: "t".to_owned(),
                type_hash: None,
                qos: Qos::RELIABLE,
            });
            let (queue, mut events) = mpsc::channel(100_000);
            let (ending, end) = watch::channel(None);
            let asked = Stamp::from_nanos(ASKED);
            let reading = Reading::new(topic, queue, end);
            ending.send_replace(Some(End {
                asked,
                latest: start + LONGEST,
            }));
            let now = || asked + Span::from_secs_f64(start.elapsed().as_secs_f64());
            reading.run(waiting, now).await;
            let took = start.elapsed().as_millis();
            let (mut n, mut lost, mut left) = (0, 0, None);
            while let Ok(event) = events.try_recv() {
                match event {
                    TapEvent::Sample(sample) => {
                        n += 1;
                        lost += sample.lost;
                    }
                    TapEvent::Left { samples, .. } => left = Some(samples),
                    _ => {}
                }
            }
            (n, lost, left, took)
        })
    }

    /// Samples of one writer, one each 2 ms, of which `behind_ms` wait when the end is asked for, and that come `every` ms.
    fn backlog(behind_ms: i64, every_us: u64) -> Vec<(u64, u8, i64, Option<i64>)> {
        (0..20_000)
            .map(|k| {
                let sent_ms = 2 * k - behind_ms;
                let came_ms = (u64::try_from(k).unwrap() * every_us / 1000)
                    .max(u64::try_from(sent_ms).unwrap_or(0));
                (came_ms, 1, k + 1, Some(sent_ms))
            })
            .collect()
    }

    #[test]
    fn what_was_sent_before_the_end_is_handed_over_however_late_it_comes() {
        for (behind_ms, every_us) in [
            (0, 10),
            (10, 10),
            (1000, 100),
            (2900, 500),
            (2900, 1000),
            (20_000, 100),
        ] {
            let (n, lost, left, took_ms) = ended(&backlog(behind_ms, every_us));
            let before = usize::try_from(behind_ms / 2).unwrap();
            assert!(n > before, "{behind_ms} ms: {n}");
            assert_eq!((lost, left), (0, None), "{behind_ms} ms");
            assert!(took_ms < 5000, "{behind_ms} ms: {took_ms} ms");
        }
    }

    #[test]
    fn what_comes_too_late_is_counted() {
        // It comes more slowly than it was sent, or hardly faster.
        for (behind_ms, every_us) in [(10_000, 1_000), (30_000, 500)] {
            let (n, lost, left, took_ms) = ended(&backlog(behind_ms, every_us));
            assert!(n > 0 && lost == 0);
            assert!(left.is_some(), "{behind_ms} ms, {every_us} us");
            assert!(took_ms >= 3000, "{took_ms} ms");
        }
        // What waits when the time is over is counted one by one.
        let mut late = backlog(30_000, 1_000);
        late.truncate(15_000);
        for sample in late.iter_mut().skip(3000) {
            sample.0 = 3000;
        }
        let (n, _, left, _) = ended(&late);
        assert_eq!(n as u64 + left.unwrap_or(0), 15_000);
    }

    #[test]
    fn gaps_in_what_waits_are_counted_and_silence_ends_it() {
        let gap = [
            (0, 1, 5, Some(-20)),
            (1, 1, 9, Some(-10)),
            (2, 1, 10, Some(1)),
        ];
        let (n, lost, left, _) = ended(&gap);
        assert_eq!((n, lost, left), (3, 3, None));
        // Nobody speaks; one spoke last long ago; one of two goes on and the other does not.
        let (n, lost, left, took_ms) = ended(&[]);
        assert_eq!((n, lost, left), (0, 0, None));
        assert!(took_ms >= 250);
        let (n, lost, left, _) = ended(&[(0, 1, 1, Some(-9000))]);
        assert_eq!((n, lost, left), (1, 0, None));
        let mut two = backlog(100, 10);
        two.insert(0, (0, 2, 1, Some(-5000)));
        let (_, lost, left, took_ms) = ended(&two);
        assert_eq!((lost, left), (0, None));
        assert!(took_ms < 3000, "{took_ms} ms");
        // A writer without stamps, and one whose clock is an hour behind: no loss is made up.
        let unstamped: Vec<_> = (0..2000).map(|k| (2 * k, 1, k as i64 + 1, None)).collect();
        assert_eq!(ended(&unstamped).2, None);
        let other: Vec<_> = (0..2000)
            .map(|k| (2 * k, 1, k as i64 + 1, Some(2 * k as i64 - 3_600_000)))
            .collect();
        assert_eq!(ended(&other).2, None);
    }
}
