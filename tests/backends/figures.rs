//! What the archive's bag tells of the links, and what the nodes used.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use abbe_msgs::topics;
use abbe_tests::hosts::bag;
use metrology::Stamp;
use metrology::stamp::Host;

/// A time, ns since 1970 by the one clock of this computer.
#[derive(Clone, Copy, Debug)]
pub struct Window {
    pub from: i64,
    pub until: i64,
}

impl Window {
    pub fn holds(&self, at: Stamp<Host>) -> bool {
        (self.from..self.until).contains(&at.nanos())
    }

    pub fn lasted_s(&self) -> f64 {
        (Stamp::<Host>::from_nanos(self.until) - Stamp::from_nanos(self.from)).as_secs_f64()
    }
}

/// Memory and CPU of the cell's five processes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Use {
    pub resident_mib: f64,
    pub cpu_s: f64,
}

impl Use {
    /// Of the processes as they are now.
    pub fn of(processes: impl Iterator<Item = u32>) -> Self {
        /// Linux's USER_HZ, and its pages, on every computer that this runs on.
        const TICKS_PER_S: f64 = 100.0;
        const PAGES_PER_MIB: f64 = 256.0;
        let mut all = Self::default();
        for id in processes {
            let read = |file: &str| std::fs::read_to_string(format!("/proc/{id}/{file}")).unwrap();
            let stat = read("stat");
            let fields: Vec<&str> = stat
                .rsplit_once(')')
                .unwrap()
                .1
                .split_whitespace()
                .collect();
            let ticks = |place: usize| fields[place].parse::<f64>().unwrap();
            all.cpu_s += (ticks(11) + ticks(12)) / TICKS_PER_S;
            let memory = read("statm");
            let pages: f64 = memory.split_whitespace().nth(1).unwrap().parse().unwrap();
            all.resident_mib += pages / PAGES_PER_MIB;
        }
        all
    }

    /// What was used between two looks, as a share of one core.
    pub fn since(&self, before: &Self, time: Duration) -> Self {
        Self {
            resident_mib: self.resident_mib,
            cpu_s: (self.cpu_s - before.cpu_s) / time.as_secs_f64(),
        }
    }
}

/// Delays from the controller's stamp to the archive, ms.
#[derive(Clone, Copy, Debug)]
struct Delays {
    p50: f64,
    p99: f64,
    most: f64,
}

/// What became of states that were said while a link was cut.
#[derive(Clone, Copy, Debug)]
pub struct After {
    /// From the link's return to the first sample that is fresh; `None`: there was none.
    pub recovery_s: Option<f64>,
    /// Recorded afterwards, and missing.
    pub kept: u64,
    pub missed: u64,
}

#[derive(Debug)]
pub struct Figures {
    free: Delays,
    lossy: Delays,
    /// Samples and missing numbers while the links were free or lossy.
    sent: u64,
    lost: u64,
    after: After,
    used: Use,
}

/// A sample younger than this is fresh, s.
const FRESH_S: f64 = 0.1;

pub struct State {
    came: Stamp<Host>,
    sent: Stamp<Host>,
    number: u32,
}

impl State {
    fn delay_s(&self) -> f64 {
        (self.came - self.sent).as_secs_f64()
    }
}

/// Each state of the axes with its number, as it came.
pub fn states(bag: &Path) -> Vec<State> {
    let numbers = bag::numbers(bag, topics::AXES_STATE.name);
    let messages = bag::messages(bag, &topics::AXES_STATE);
    let both = messages.into_iter().zip(numbers);
    both.map(|((came, state), number)| State {
        came,
        sent: state.received_at,
        number,
    })
    .collect()
}

fn delays(states: &[State], window: Window) -> Delays {
    let within = states.iter().filter(|state| window.holds(state.sent));
    let mut all: Vec<f64> = within.map(|state| state.delay_s() * 1e3).collect();
    all.sort_by(f64::total_cmp);
    assert!(!all.is_empty(), "nothing came in {window:?}");
    Delays {
        p50: bag::quantile(&all, 0.5),
        p99: bag::quantile(&all, 0.99),
        most: bag::quantile(&all, 1.0),
    }
}

/// How many numbers are there between the first and the last sample that was said from `from` until `until`, and how many
/// are missing.
fn counted(states: &[State], window: Window) -> (u64, u64) {
    let said: BTreeMap<u32, ()> = states
        .iter()
        .filter(|state| window.holds(state.sent))
        .map(|state| (state.number, ()))
        .collect();
    let (Some((first, ())), Some((last, ()))) = (said.first_key_value(), said.last_key_value())
    else {
        return (0, 0);
    };
    let there = u64::try_from(said.len()).unwrap();
    (there, u64::from(last - first) + 1 - there)
}

/// What became of states that were said in `cut`.
pub fn after(states: &[State], cut: Window) -> After {
    let back = Stamp::<Host>::from_nanos(cut.until);
    let fresh = states
        .iter()
        .find(|state| state.came > back && state.sent > back && state.delay_s() < FRESH_S);
    let said_from = |until| {
        let late = Window {
            from: cut.from,
            until,
        };
        let came = states.iter().filter(|state| late.holds(state.sent)).count();
        u64::try_from(came).unwrap()
    };
    let Some(fresh) = fresh else {
        return After {
            recovery_s: None,
            kept: said_from(cut.until),
            missed: 0,
        };
    };
    // Every number from the last before the cut to the first fresh one was said at 1 kHz.
    let before = states.iter().filter(|state| state.sent.nanos() < cut.from);
    let last = before.map(|state| state.number).max().unwrap();
    let kept = said_from(fresh.sent.nanos());
    After {
        recovery_s: Some((fresh.came - back).as_secs_f64()),
        kept,
        missed: u64::from(fresh.number - last - 1).saturating_sub(kept),
    }
}

impl Figures {
    pub fn of(bag: &Path, windows: [Window; 3], used: Use) -> Self {
        let [free, lossy, cut] = windows;
        let states = states(bag);
        let calm = Window {
            from: free.from,
            until: lossy.until,
        };
        let (sent, lost) = counted(&states, calm);
        Self {
            free: delays(&states, free),
            lossy: delays(&states, lossy),
            sent,
            lost,
            after: after(&states, cut),
            used,
        }
    }

    /// Prints a column of the table.
    pub fn tell(&self, name: &str) {
        let words = |Delays { p50, p99, most }: Delays| {
            format!("p50 {p50:.2}, p99 {p99:.2}, most {most:.1} ms")
        };
        eprintln!("{name}");
        eprintln!("  delay, free links: {}", words(self.free));
        eprintln!("  delay, 5 ms, 1 % loss: {}", words(self.lossy));
        eprintln!(
            "  lost of {} at 1 kHz: {}",
            self.sent + self.lost,
            self.lost
        );
        match self.after.recovery_s {
            Some(recovery_s) => eprintln!(
                "  after the cut: fresh again after {recovery_s:.2} s; of what was said meanwhile {} came late, {} are missing",
                self.after.kept, self.after.missed
            ),
            None => eprintln!(
                "  after the cut: not fresh again, {} came late",
                self.after.kept
            ),
        }
        eprintln!(
            "  five processes: {:.0} MiB resident, {:.0} % of a core",
            self.used.resident_mib,
            self.used.cpu_s * 100.0
        );
    }

    /// Whether nothing was lost, then or while the link was cut for less than a deep topic keeps, and the cut was over in time.
    pub fn is_well(&self, recovery_s: f64) -> bool {
        let is_whole = self.lost + self.after.missed == 0 && self.sent > 5_000;
        let is_back = self
            .after
            .recovery_s
            .is_some_and(|seen_s| seen_s < recovery_s);
        if !is_whole || !is_back {
            eprintln!("NOT AS WANTED: nothing lost, fresh within {recovery_s} s: {self:?}");
        }
        is_whole && is_back
    }
}
