//! Timers: on the computer's clock from a thread of their own, on simulated time from `/clock`.
#![expect(
    clippy::disallowed_methods,
    reason = "a monotonic clock schedules the timers"
)]

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use metrology::Stamp;
use metrology::stamp::{Host, Span};
use tokio::sync::mpsc::Sender;

use super::incoming::Incoming;

/// Ticks of one timer wait for the node at most so long, by its period. Further ones are missed and counted: a node whose
/// ticks take longer than their period would answer and stop only after all of them.
const MOST_WAITING: Duration = Duration::from_millis(300);
/// Ticks that may wait in any case.
const LEAST_WAITING: usize = 2;

/// Ticks of a timer of this period that may wait for the node.
fn most_waiting(period: Duration) -> usize {
    let ticks = MOST_WAITING.as_nanos() / period.as_nanos().max(1);
    usize::try_from(ticks)
        .unwrap_or(usize::MAX)
        .max(LEAST_WAITING)
}

/// Timers on the computer's clock. Tokio's own timers are a millisecond coarse, which at a servo's
/// 1 kHz is a whole period; a parked thread is late by the kernel's timer slack, 50 µs by default.
pub(super) struct HostTimers {
    stop: Arc<AtomicBool>,
    /// Ticks of each timer that the node has not taken yet.
    waiting: Arc<[AtomicUsize]>,
    thread: JoinHandle<()>,
}

impl HostTimers {
    /// Starts them; `None` when there are none.
    pub fn start(periods: &[Span], queue: Sender<Incoming>) -> std::io::Result<Option<Self>> {
        if periods.is_empty() {
            return Ok(None);
        }
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let waiting: Arc<[AtomicUsize]> = periods.iter().map(|_| AtomicUsize::new(0)).collect();
        let waits = Arc::clone(&waiting);
        let periods: Vec<_> = periods.iter().map(|period| duration(*period)).collect();
        let thread = std::thread::Builder::new()
            .name("timers".to_owned())
            .spawn(move || run(&periods, &waits, &queue, &stopped))?;
        Ok(Some(Self {
            stop,
            waiting,
            thread,
        }))
    }

    /// The node has taken a tick of a timer.
    pub fn taken(&self, timer: usize) {
        if let Some(waiting) = self.waiting.get(timer) {
            waiting.fetch_sub(1, Ordering::Relaxed);
        }
    }

    /// Stops them; the thread ends on its own.
    pub fn stop(self) {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.thread().unpark();
    }
}

fn duration(period: Span) -> Duration {
    Duration::from_nanos(u64::try_from(period.nanos()).unwrap_or(0).max(1))
}

fn run(
    periods: &[Duration],
    waiting: &[AtomicUsize],
    queue: &Sender<Incoming>,
    stopped: &AtomicBool,
) {
    let start = Instant::now();
    // Periods that were missed since the last tick of each timer.
    let mut missed = vec![0_u64; periods.len()];
    let mut due: Vec<Instant> = periods.iter().map(|period| start + *period).collect();
    while !stopped.load(Ordering::Relaxed) {
        let Some((timer, at)) = due.iter().copied().enumerate().min_by_key(|(_, at)| *at) else {
            return;
        };
        let now = Instant::now();
        if now < at {
            std::thread::park_timeout(at - now);
            continue;
        }
        let periods_late = (now - at).as_nanos() / periods[timer].as_nanos();
        let late = u32::try_from(periods_late).unwrap_or(u32::MAX);
        due[timer] = at + periods[timer] * late.saturating_add(1);
        let missed = &mut missed[timer];
        *missed = missed.saturating_add(late.into());
        if waiting[timer].load(Ordering::Relaxed) >= most_waiting(periods[timer]) {
            *missed = missed.saturating_add(1);
            continue;
        }
        waiting[timer].fetch_add(1, Ordering::Relaxed);
        let tick = Incoming::Timer {
            timer,
            missed: std::mem::take(missed),
        };
        if queue.blocking_send(tick).is_err() {
            return;
        }
    }
}

/// Timers on simulated time.
#[derive(Debug)]
pub(super) struct SimulatedTimers {
    periods: Vec<Span>,
    /// Next instants; `None` before the first `/clock`.
    due: Option<Vec<Stamp<Host>>>,
}

/// Ticks that one step of `/clock` may set off; a greater step skips the rest.
const MOST_TICKS: usize = 100_000;

impl SimulatedTimers {
    pub fn new(periods: &[Span]) -> Self {
        Self {
            periods: periods.to_vec(),
            due: None,
        }
    }

    /// Arms all timers anew from `now`.
    pub fn arm(&mut self, now: Stamp<Host>) {
        self.due = Some(self.periods.iter().map(|period| now + *period).collect());
    }

    /// The next tick up to `now`, in order of time, then of the timers.
    pub fn next(&mut self, now: Stamp<Host>) -> Option<(Stamp<Host>, usize)> {
        let due = self.due.as_mut()?;
        let (timer, at) = due
            .iter()
            .copied()
            .enumerate()
            .min_by_key(|(timer, at)| (*at, *timer))?;
        if at > now {
            return None;
        }
        due[timer] = at + self.periods[timer];
        Some((at, timer))
    }

    /// Skips what is still due at `now`; the number of ticks skipped.
    pub fn skip(&mut self, now: Stamp<Host>) -> u64 {
        let mut skipped = 0;
        for (due, period) in self.due.iter_mut().flatten().zip(&self.periods) {
            if *due <= now {
                let ticks = (now - *due).nanos() / period.nanos().max(1) + 1;
                *due += Span::from_nanos(ticks.saturating_mul(period.nanos()));
                skipped += u64::try_from(ticks).unwrap_or(0);
            }
        }
        skipped
    }

    pub const fn most_ticks() -> usize {
        MOST_TICKS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(nanos: i64) -> Stamp<Host> {
        Stamp::from_nanos(nanos)
    }

    #[test]
    fn simulated_ticks_come_in_order_and_only_when_due() {
        let mut timers = SimulatedTimers::new(&[Span::from_nanos(10), Span::from_nanos(25)]);
        assert_eq!(timers.next(at(1_000)), None, "not before the first clock");
        timers.arm(at(100));
        let ticks: Vec<_> = std::iter::from_fn(|| timers.next(at(130)))
            .map(|(at, timer)| (at.nanos(), timer))
            .collect();
        assert_eq!(ticks, [(110, 0), (120, 0), (125, 1), (130, 0)]);
        assert_eq!(timers.skip(at(161)), 4);
        assert_eq!(timers.next(at(170)).unwrap().0, at(170));
    }

    #[test]
    fn host_ticks_keep_their_rate() {
        let (queue, mut ticks) = tokio::sync::mpsc::channel(1_000);
        let started = Instant::now();
        let timers = HostTimers::start(&[Span::from_nanos(1_000_000)], queue)
            .unwrap()
            .unwrap();
        let mut periods = 0;
        while periods < 200 {
            if let Some(Incoming::Timer { timer, missed }) = ticks.blocking_recv() {
                timers.taken(timer);
                periods += 1 + missed;
            }
        }
        let elapsed_ms = started.elapsed().as_secs_f64() * 1e3;
        timers.stop();
        assert!(
            (199.0..260.0).contains(&elapsed_ms),
            "200 periods of 1 ms took {elapsed_ms} ms"
        );
    }

    #[test]
    fn ticks_wait_for_a_node_by_their_period() {
        let waiting = |nanos: u64| most_waiting(Duration::from_nanos(nanos));
        assert_eq!(waiting(1_000_000), 300);
        assert_eq!(waiting(10_000_000), 30);
        assert_eq!(waiting(1_000_000_000), LEAST_WAITING);
    }

    /// The node takes nothing until as many ticks wait as may.
    #[test]
    fn ticks_that_a_node_does_not_take_are_missed_and_counted() {
        let (queue, mut ticks) = tokio::sync::mpsc::channel(1_000);
        let timers = HostTimers::start(&[Span::from_nanos(10_000_000)], queue)
            .unwrap()
            .unwrap();
        while ticks.len() < 30 {
            std::thread::sleep(Duration::from_millis(5));
        }
        std::thread::sleep(Duration::from_millis(100));
        assert_eq!(ticks.len(), 30);
        loop {
            let Some(Incoming::Timer { timer, missed }) = ticks.blocking_recv() else {
                panic!("no tick");
            };
            timers.taken(timer);
            if missed > 0 {
                break;
            }
        }
        timers.stop();
    }
}
