//! What one writer said, in its order again: what is missing is asked for in pieces, and later samples wait for it.
//!
//! Zenoh's own reader asks for all of a gap at once, holds everything back until the answer has ended, and
//! takes an answer without samples for a loss. After a link was cut that is wrong twice: the first samples may
//! come before the network knows again who can answer, and 20,000 samples in one go fill the links of all others.

use std::collections::BTreeMap;

use tokio::time::{Duration, Instant};

/// Samples that are asked for at once: two or three of Zenoh's batches, which no link has to wait for.
const PIECE: i64 = 1000;
/// After an answer without samples the next question waits so long.
pub(super) const AGAIN: Duration = Duration::from_millis(100);
/// A question of which nothing came for so long was lost with a link, and is asked again.
const SILENCE: Duration = Duration::from_millis(500);
/// A writer says something at least twice a second; one that was not heard for so long was cut off.
const CUT_OFF: Duration = Duration::from_secs(1);
/// So long nobody may have an answer before the samples count as lost.
const LOSS_TIMEOUT: Duration = Duration::from_secs(2);
/// A writer that is heard and does not answer at all is busy, or its answers wait behind those of other topics.
const BUSY_TIMEOUT: Duration = Duration::from_secs(6);

/// A question that is open, by the numbers of the first and last sample.
struct Asked {
    first: i64,
    last: i64,
    /// Tells it from others that were asked.
    id: u64,
    /// Something of it came.
    is_answered: bool,
    /// When it was asked, or something of it came.
    heard_at: Instant,
}

/// What is to be asked for, by the numbers of the first and last sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Question {
    pub id: u64,
    pub first: u32,
    pub last: u32,
}

/// Puts samples in order. Numbers are those of Zenoh (32 bits that wrap), counted on.
pub(super) struct Order<T> {
    /// Number of what is handed on next; none before anything was heard.
    next: Option<i64>,
    newest: i64,
    /// What a writer keeps.
    depth: i64,
    waiting: BTreeMap<i64, T>,
    asked: Option<Asked>,
    questions: u64,
    again_at: Option<Instant>,
    /// Since when answers have ended without samples, and since when questions have had no answer at all.
    unanswered_since: Option<Instant>,
    silent_since: Option<Instant>,
    /// When the writer last said something new.
    heard_at: Option<Instant>,
    /// What can be handed on, in order.
    pub ready: Vec<T>,
}

fn wrapped(number: i64) -> u32 {
    u32::try_from(number.rem_euclid(1 << 32)).unwrap_or_default()
}

impl<T> Order<T> {
    pub fn new(depth: u32) -> Self {
        Self {
            next: None,
            newest: 0,
            depth: i64::from(depth.max(1)),
            waiting: BTreeMap::new(),
            asked: None,
            questions: 0,
            again_at: None,
            unanswered_since: None,
            silent_since: None,
            heard_at: None,
            ready: Vec::new(),
        }
    }

    fn counted_on(&mut self, number: u32) -> i64 {
        if self.next.is_none() {
            return i64::from(number);
        }
        let ahead = number.wrapping_sub(wrapped(self.newest));
        self.newest + i64::from(ahead.cast_signed())
    }

    /// The writer is up to this number. Who was cut off is heard again: patience with its answers begins anew.
    fn heard(&mut self, number: i64, now: Instant) {
        if number <= self.newest && self.heard_at.is_some() {
            return;
        }
        self.newest = self.newest.max(number);
        let before = self.heard_at.replace(now);
        if before.is_some_and(|before| now.duration_since(before) > CUT_OFF) {
            self.has_patience();
        }
    }

    /// A sample came, by itself or as an answer.
    pub fn take(&mut self, number: u32, sample: T, now: Instant) {
        let number = self.counted_on(number);
        let next = *self.next.get_or_insert(number);
        self.heard(number, now);
        if number < next {
            return;
        }
        if let Some(asked) = &mut self.asked
            && (asked.first..=asked.last).contains(&number)
        {
            (asked.is_answered, asked.heard_at) = (true, now);
        }
        self.waiting.insert(number, sample);
        if self.waiting.len() > usize::try_from(self.depth).unwrap_or(usize::MAX) {
            self.skip_gap();
        }
        self.hand_on();
    }

    /// The writer says up to which number it has spoken. Nothing is owed from before it was first heard.
    pub fn told(&mut self, number: u32, now: Instant) {
        let number = self.counted_on(number);
        self.next.get_or_insert(number + 1);
        self.heard(number, now);
    }

    fn hand_on(&mut self) {
        let Some(next) = &mut self.next else { return };
        while let Some(sample) = self.waiting.remove(next) {
            self.ready.push(sample);
            *next += 1;
        }
        if !self.has_gap() {
            self.has_patience();
        }
    }

    /// The waiting time for missing samples begins anew.
    fn has_patience(&mut self) {
        (self.again_at, self.unanswered_since, self.silent_since) = (None, None, None);
    }

    fn skip_to(&mut self, number: i64) {
        self.next = self.next.map(|next| next.max(number));
        self.waiting = self.waiting.split_off(&number);
        self.hand_on();
    }

    /// Gives up what is missing before the first sample that waits.
    fn skip_gap(&mut self) {
        let first = self.waiting.first_key_value().map(|(number, _)| *number);
        self.has_patience();
        self.skip_to(first.unwrap_or(self.newest + 1));
    }

    /// The first and last missing number before the first sample that waits.
    fn gap(&self) -> Option<(i64, i64)> {
        let next = self.next?;
        let last = match self.waiting.first_key_value() {
            Some((number, _)) => number - 1,
            None => self.newest,
        };
        (next <= last).then_some((next, last))
    }

    pub fn has_gap(&self) -> bool {
        self.gap().is_some()
    }

    /// What is to be asked for now.
    pub fn question(&mut self, now: Instant) -> Option<Question> {
        if let Some(asked) = &self.asked {
            if now.duration_since(asked.heard_at) < SILENCE {
                return None;
            }
            let id = asked.id;
            let since = *self.silent_since.get_or_insert(asked.heard_at);
            self.is_over(id, now, now.duration_since(since) >= BUSY_TIMEOUT);
        }
        if self.again_at.is_some_and(|at| now < at) {
            return None;
        }
        let oldest_kept = self.newest + 1 - self.depth;
        if self.gap().is_some_and(|(first, _)| first < oldest_kept) {
            self.skip_to(oldest_kept);
        }
        let (first, last) = self.gap()?;
        let last = last.min(first + PIECE - 1);
        self.questions += 1;
        self.asked = Some(Asked {
            first,
            last,
            id: self.questions,
            is_answered: false,
            heard_at: now,
        });
        Some(Question {
            id: self.questions,
            first: wrapped(first),
            last: wrapped(last),
        })
    }

    /// Nothing more is to come of a question.
    pub fn ended(&mut self, id: u64, now: Instant) {
        let is_empty = |asked: &Asked| asked.id == id && !asked.is_answered;
        let mut is_lost = false;
        if self.asked.as_ref().is_some_and(is_empty) {
            let since = *self.unanswered_since.get_or_insert(now);
            is_lost = now.duration_since(since) >= LOSS_TIMEOUT;
        }
        self.is_over(id, now, is_lost);
    }

    /// A question is no longer waited for; where nothing of it came it is asked again, or the missing samples are given up.
    fn is_over(&mut self, id: u64, now: Instant, is_lost: bool) {
        let Some(asked) = self.asked.take_if(|asked| asked.id == id) else {
            return;
        };
        if asked.is_answered {
            self.has_patience();
            return;
        }
        self.again_at = Some(now + AGAIN);
        if is_lost {
            self.skip_gap();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn now() -> Instant {
        Instant::now()
    }

    /// One that has handed on `first`.
    fn begun(first: u32, depth: u32) -> Order<u32> {
        let mut order = Order::new(depth);
        order.take(first, first, now());
        assert_eq!(std::mem::take(&mut order.ready), [first]);
        order
    }

    fn asks(order: &mut Order<u32>, now: Instant) -> Option<(u32, u32)> {
        let question = order.question(now);
        question.map(|Question { first, last, .. }| (first, last))
    }

    fn ends(order: &mut Order<u32>, now: Instant) {
        order.ended(order.questions, now);
    }

    #[test]
    fn what_is_missing_is_asked_for_in_pieces_and_handed_on_first() {
        let mut order = begun(7, 20_000);
        order.take(2_508, 2_508, now());
        assert!(order.has_gap() && order.ready.is_empty());
        let mut handed_on = Vec::new();
        for wanted in [(8, 1_007), (1_008, 2_007), (2_008, 2_507)] {
            assert_eq!(asks(&mut order, now()), Some(wanted));
            assert_eq!(asks(&mut order, now()), None, "one question at a time");
            for number in wanted.0..=wanted.1 {
                order.take(number, number, now());
            }
            ends(&mut order, now());
            handed_on.append(&mut order.ready);
        }
        assert_eq!(handed_on, (8..=2_508).collect::<Vec<_>>());
        assert!(!order.has_gap());
    }

    #[test]
    fn an_answer_without_samples_is_asked_for_again_before_it_counts_as_a_loss() {
        let mut order = begun(1, 100);
        order.take(3, 3, now());
        let begin = now();
        assert_eq!(asks(&mut order, begin), Some((2, 2)));
        ends(&mut order, begin);
        assert_eq!(asks(&mut order, begin), None, "not at once");
        assert_eq!(asks(&mut order, begin + AGAIN), Some((2, 2)));
        ends(&mut order, begin + AGAIN);
        assert!(order.ready.is_empty(), "3 waits for 2");
        assert_eq!(asks(&mut order, begin + LOSS_TIMEOUT), Some((2, 2)));
        ends(&mut order, begin + LOSS_TIMEOUT);
        assert_eq!(order.ready, [3]);
    }

    #[test]
    fn a_question_that_was_lost_with_a_link_is_asked_again() {
        let mut order = begun(1, 100);
        order.take(4, 4, now());
        let begin = now();
        let lost = order.question(begin).unwrap();
        assert_eq!(asks(&mut order, begin + SILENCE / 2), None);
        assert_eq!(asks(&mut order, begin + SILENCE), None, "not at once");
        let again = begin + SILENCE + AGAIN;
        assert_eq!(asks(&mut order, again), Some((2, 3)));
        order.ended(lost.id, again);
        assert_eq!(asks(&mut order, again), None, "the new one is open");
        order.take(2, 2, again);
        assert_eq!(asks(&mut order, again + SILENCE), Some((3, 3)));
    }

    #[test]
    fn a_busy_writer_is_waited_for_longer_than_one_that_has_nothing() {
        let mut order = begun(1, 100);
        order.take(4, 4, now());
        let begin = now();
        let mut at = begin;
        let mut asked = vec![];
        // Heard all the time, and no answer: silence is no loss yet.
        while at < begin + 2 * LOSS_TIMEOUT {
            asked.extend(asks(&mut order, at));
            order.told(4, at);
            at += AGAIN;
        }
        assert!(asked.len() > 4, "{asked:?}");
        assert!(asked.iter().all(|one| *one == (2, 3)), "{asked:?}");
        assert!(order.ready.is_empty());
        order.take(2, 2, at);
        order.take(3, 3, at);
        assert_eq!(std::mem::take(&mut order.ready), [2, 3, 4]);
        // Nor is it for ever.
        order.take(6, 6, at);
        let begin = at;
        while order.ready.is_empty() && at < begin + 3 * BUSY_TIMEOUT {
            asks(&mut order, at);
            at += AGAIN;
        }
        assert_eq!(order.ready, [6]);
        assert!(at >= begin + BUSY_TIMEOUT);
    }

    #[test]
    fn each_gap_has_the_whole_patience() {
        let mut order = begun(1, 100);
        order.take(3, 3, now());
        let begin = now();
        asks(&mut order, begin);
        ends(&mut order, begin);
        order.take(2, 2, now());
        assert_eq!(std::mem::take(&mut order.ready), [2, 3]);
        order.take(5, 5, now());
        let later = begin + 2 * LOSS_TIMEOUT;
        assert_eq!(asks(&mut order, later), Some((4, 4)));
        ends(&mut order, later);
        assert!(order.has_gap() && order.ready.is_empty());
    }

    #[test]
    fn patience_begins_when_a_writer_is_heard_again() {
        let mut order = begun(1, 100);
        let begin = now();
        order.told(2, begin);
        asks(&mut order, begin);
        ends(&mut order, begin);
        let back = begin + LOSS_TIMEOUT;
        order.take(50, 50, back);
        assert_eq!(asks(&mut order, back), Some((2, 49)));
        ends(&mut order, back);
        assert!(order.has_gap() && order.ready.is_empty());
    }

    #[test]
    fn the_last_samples_are_missed_by_what_the_writer_says_of_itself() {
        let mut order = begun(1, 100);
        order.told(1, now());
        assert!(!order.has_gap());
        order.told(3, now());
        assert_eq!(asks(&mut order, now()), Some((2, 3)));
        let mut late = Order::<u32>::new(100);
        late.told(50, now());
        assert!(!late.has_gap(), "nothing is owed from before");
        late.take(51, 51, now());
        assert_eq!(late.ready, [51]);
    }

    #[test]
    fn what_no_writer_keeps_is_not_asked_for() {
        let mut order = begun(1, 10);
        order.take(100, 100, now());
        assert_eq!(asks(&mut order, now()), Some((91, 99)));
        order.take(91, 91, now());
        assert_eq!(order.ready, [91]);
    }

    #[test]
    fn numbers_wrap_and_what_came_twice_is_handed_on_once() {
        let mut order = begun(u32::MAX - 1, 10);
        for number in [u32::MAX, 0, u32::MAX, 2, 0] {
            order.take(number, number, now());
        }
        assert_eq!(asks(&mut order, now()), Some((1, 1)));
        order.take(1, 1, now());
        assert_eq!(order.ready, [u32::MAX, 0, 1, 2]);
    }

    #[test]
    fn no_more_waits_than_a_writer_keeps() {
        let mut order = begun(1, 3);
        for number in 3..=6 {
            order.take(number, number, now());
        }
        assert_eq!(order.ready, [3, 4, 5, 6]);
    }
}
