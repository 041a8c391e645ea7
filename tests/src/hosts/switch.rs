//! A network switch whose links delay, jitter, lose, reorder and break as a test says.
//!
//! Frames come from taps, one per host. What a link does to each frame is drawn from the test's seed, per direction: so a
//! kernel needs taps alone, and the truth of every delay is the test's own. As with netem, a frame that is drawn to be
//! reordered is not delayed and overtakes those before it, and so do frames whose jitter is less.

use std::collections::{BTreeMap, BinaryHeap};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use tun_rs::SyncDevice;

/// What happens to frames on one direction of a host's link.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Way {
    /// Least delay, s.
    pub delay_s: f64,
    /// What is added to it, evenly between 0 and this, s.
    pub jitter_s: f64,
    /// Share of frames that vanish.
    pub loss: f64,
    /// Share of frames that are not delayed.
    pub reorder: f64,
}

/// Both directions between a host and the switch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Link {
    /// From the host.
    pub up: Way,
    /// To the host.
    pub down: Way,
    /// Nothing passes.
    pub is_cut: bool,
}

impl Link {
    /// The same both ways.
    pub const fn even(way: Way) -> Self {
        Self {
            up: way,
            down: way,
            is_cut: false,
        }
    }
}

/// What the switch did so far.
#[derive(Clone, Copy, Debug, Default)]
pub struct Counts {
    /// Frames that went on.
    pub forwarded: u64,
    /// Frames that vanished.
    pub lost: u64,
    /// Frames that were overtaken by one that came later.
    pub overtaken: u64,
    /// Frames that met a cut link.
    pub cut: u64,
}

/// A frame on its way; the heap gives the earliest first.
struct Frame {
    due: Instant,
    number: u64,
    to: usize,
    bytes: Vec<u8>,
}

impl Frame {
    const fn order(&self) -> (std::cmp::Reverse<Instant>, std::cmp::Reverse<u64>) {
        (std::cmp::Reverse(self.due), std::cmp::Reverse(self.number))
    }
}

impl PartialEq for Frame {
    fn eq(&self, other: &Self) -> bool {
        self.order() == other.order()
    }
}
impl Eq for Frame {}
impl PartialOrd for Frame {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Frame {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.order().cmp(&other.order())
    }
}

struct State {
    links: Vec<Link>,
    /// Where a hardware address was seen last.
    places: BTreeMap<[u8; 6], usize>,
    waiting: BinaryHeap<Frame>,
    /// The newest frame that has left, by destination.
    left: Vec<u64>,
    number: u64,
    rng: Pcg64Mcg,
    counts: Counts,
    /// Frames to a group of hosts go nowhere.
    drops_multicast: bool,
}

struct Shared {
    state: Mutex<State>,
    changed: Condvar,
    stop: AtomicBool,
}

impl Shared {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Between two looks whether it is over.
const LOOK: Duration = Duration::from_millis(50);
const LONGEST_FRAME: usize = 65_536;

/// The switch; it ends with its value.
pub struct Switch {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

impl Switch {
    /// Connects `taps`, by their places, with links that do nothing yet.
    pub fn start(taps: Vec<SyncDevice>, seed: u64) -> Self {
        let taps: Arc<[SyncDevice]> = Arc::from(taps);
        let shared = Arc::new(Shared {
            state: Mutex::new(State {
                links: vec![Link::default(); taps.len()],
                places: BTreeMap::new(),
                waiting: BinaryHeap::new(),
                left: vec![0; taps.len()],
                number: 0,
                rng: Pcg64Mcg::seed_from_u64(seed),
                counts: Counts::default(),
                drops_multicast: false,
            }),
            changed: Condvar::new(),
            stop: AtomicBool::new(false),
        });
        let mut threads = Vec::new();
        for place in 0..taps.len() {
            let (taps, shared) = (Arc::clone(&taps), Arc::clone(&shared));
            threads.push(std::thread::spawn(move || {
                take_in(&taps[place], place, &shared);
            }));
        }
        let (own, going_out) = (Arc::clone(&shared), Arc::clone(&taps));
        threads.push(std::thread::spawn(move || give_out(&going_out, &own)));
        Self { shared, threads }
    }

    /// What becomes of a host's frames, by the place of its tap.
    pub fn set(&self, place: usize, link: Link) {
        self.shared.state().links[place] = link;
    }

    /// Cuts a host's link, or mends it.
    pub fn cut(&self, place: usize, is_cut: bool) {
        self.shared.state().links[place].is_cut = is_cut;
    }

    /// Drops frames to groups of hosts from now on; those to all hosts, which ask for addresses, go on.
    pub fn drop_multicast(&self) {
        self.shared.state().drops_multicast = true;
    }

    /// What it did so far.
    #[must_use]
    pub fn counts(&self) -> Counts {
        self.shared.state().counts
    }
}

impl Drop for Switch {
    fn drop(&mut self) {
        self.shared.stop.store(true, Ordering::Relaxed);
        self.shared.changed.notify_all();
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

/// Reads what a host sends, until the end.
fn take_in(tap: &SyncDevice, place: usize, shared: &Shared) {
    let mut buffer = vec![0; LONGEST_FRAME];
    let look = PollTimeout::try_from(LOOK).unwrap();
    while !shared.stop.load(Ordering::Relaxed) {
        use std::os::fd::AsFd as _;
        let mut ready = [PollFd::new(tap.as_fd(), PollFlags::POLLIN)];
        if !matches!(poll(&mut ready, look), Ok(1..)) {
            continue;
        }
        // A tap whose network was taken away has nothing more to say.
        let Ok(len) = tap.recv(&mut buffer) else {
            std::thread::sleep(LOOK);
            continue;
        };
        let now = Instant::now();
        if shared.state().enter(&buffer[..len], place, now) {
            shared.changed.notify_one();
        }
    }
}

impl State {
    /// Puts a frame on its way; false: it goes nowhere.
    fn enter(&mut self, frame: &[u8], from: usize, now: Instant) -> bool {
        let (Some(to), Some(source)) = (frame.get(..6), frame.get(6..12)) else {
            return false;
        };
        let is_to_group = to[0] & 1 == 1 && *to != [0xff; 6];
        if self.drops_multicast && is_to_group {
            self.counts.lost += 1;
            return false;
        }
        let address = |bytes: &[u8]| <[u8; 6]>::try_from(bytes).unwrap();
        self.places.insert(address(source), from);
        let known = self.places.get(&address(to)).copied();
        let all: Vec<usize> = match known {
            Some(place) => vec![place],
            None => (0..self.links.len()).collect(),
        };
        let mut is_new = false;
        for to in all.into_iter().filter(|to| *to != from) {
            let (up, down) = (self.links[from], self.links[to]);
            if up.is_cut || down.is_cut {
                self.counts.cut += 1;
                continue;
            }
            let (Some(first), Some(second)) = (self.pass(up.up), self.pass(down.down)) else {
                self.counts.lost += 1;
                continue;
            };
            self.number += 1;
            self.waiting.push(Frame {
                due: now + first + second,
                number: self.number,
                to,
                bytes: frame.to_vec(),
            });
            is_new = true;
        }
        is_new
    }

    /// How long a frame takes on a way; `None`: it vanishes.
    fn pass(&mut self, way: Way) -> Option<Duration> {
        if self.rng.random_bool(way.loss) {
            return None;
        }
        let overtakes = self.rng.random_bool(way.reorder);
        let jitter: f64 = self.rng.random_range(0.0..=1.0);
        let delay_s = if overtakes {
            0.0
        } else {
            way.delay_s + jitter * way.jitter_s
        };
        Some(Duration::from_secs_f64(delay_s))
    }
}

/// Sends frames when they are due, until the end.
fn give_out(taps: &[SyncDevice], shared: &Shared) {
    let mut state = shared.state();
    while !shared.stop.load(Ordering::Relaxed) {
        let now = Instant::now();
        match state.waiting.peek().map(|frame| frame.due) {
            Some(due) if due <= now => {
                let Some(frame) = state.waiting.pop() else {
                    continue;
                };
                state.counts.forwarded += 1;
                let newest = state.left[frame.to].max(frame.number);
                state.counts.overtaken += u64::from(newest > frame.number);
                state.left[frame.to] = newest;
                drop(state);
                // A host whose network is gone hears nothing more.
                let _ = taps[frame.to].send(&frame.bytes);
                state = shared.state();
            }
            next => {
                let wait = next.map_or(LOOK, |due| due.saturating_duration_since(now).min(LOOK));
                let waited = shared.changed.wait_timeout(state, wait);
                state = waited.unwrap_or_else(PoisonError::into_inner).0;
            }
        }
    }
}
