//! Drives a node as a runner does, and watches what each step takes.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::time::{Duration, Instant};

use metrology::stamp::{Host, Span, Stamp};
use node_runtime::Node;
use node_runtime::node::{Emission, Event, GoalStatus};

/// A node under way.
pub struct Driver {
    pub node: Box<dyn Node>,
    pub now: Stamp<Host>,
    due: Vec<Stamp<Host>>,
    out: Vec<Emission>,
    /// Messages by publication.
    pub published: BTreeMap<usize, u64>,
    /// Goals and requests that it sent, and is not answered yet: (port, number).
    pub sent_goals: Vec<(usize, u64)>,
    pub calls: Vec<(usize, u64)>,
    /// Goals that it took: (port, number).
    pub taken: Vec<(usize, u64)>,
    pub answered: u64,
    pub refused: u64,
    pub faults: u64,
    pub stopped: bool,
    pub watch: Watch,
}

/// What its steps took.
#[derive(Clone, Copy, Debug, Default)]
pub struct Watch {
    pub longest: Duration,
    /// Most that was held during one step, beyond what was held before it.
    pub largest_step_bytes: u64,
    /// What it holds more than at its start, now and at most.
    pub held_bytes: i64,
    pub most_held_bytes: i64,
}

/// One step may take so long: what is promised of every node, on a busy computer too.
const LONGEST: Duration = Duration::from_secs(5);
/// And hold so much while it computes.
const LARGEST_STEP_BYTES: u64 = 512 << 20;

impl Driver {
    pub fn new(node: Box<dyn Node>, now: Stamp<Host>) -> Self {
        let due = node
            .ports()
            .timers
            .iter()
            .map(|period| now + *period)
            .collect();
        Self {
            node,
            now,
            due,
            out: Vec::new(),
            published: BTreeMap::new(),
            sent_goals: Vec::new(),
            calls: Vec::new(),
            taken: Vec::new(),
            answered: 0,
            refused: 0,
            faults: 0,
            stopped: false,
            watch: Watch::default(),
        }
    }

    /// Lets time pass and fires every timer that is due.
    pub fn advance(&mut self, to: Stamp<Host>) {
        loop {
            let next = self
                .due
                .iter()
                .copied()
                .enumerate()
                .min_by_key(|(_, due)| *due);
            let Some((timer, due)) = next.filter(|(_, due)| *due <= to) else {
                break;
            };
            self.now = self.now.max(due);
            self.due[timer] = due + self.node.ports().timers[timer].max(Span::from_nanos(1_000));
            self.hand(Event::Timer { timer });
        }
        self.now = self.now.max(to);
    }

    /// Hands an event over and looks at what came of it.
    pub fn hand(&mut self, event: Event<'_>) {
        let kept = event.clone();
        let since = Instant::now();
        let mut failed = false;
        let handled = catch_unwind(AssertUnwindSafe(|| {
            allocation_counter::measure(|| {
                failed = self.node.handle(self.now, event, &mut self.out).is_err();
                self.take_out();
            })
        }));
        let took = since.elapsed();
        let used = handled.unwrap_or_else(|panic| {
            eprintln!("{}: {}", self.node.name(), self.in_words(&kept));
            resume_unwind(panic)
        });
        self.faults += u64::from(failed);
        let watch = &mut self.watch;
        watch.longest = watch.longest.max(took);
        watch.largest_step_bytes = watch.largest_step_bytes.max(used.bytes_max);
        watch.held_bytes += used.bytes_current;
        watch.most_held_bytes = watch.most_held_bytes.max(watch.held_bytes);
        let is_bounded = took < LONGEST && used.bytes_max < LARGEST_STEP_BYTES;
        assert!(
            is_bounded,
            "{}: {took:?}, {} MiB for {}",
            self.node.name(),
            used.bytes_max >> 20,
            self.in_words(&kept)
        );
    }

    fn in_words(&self, event: &Event<'_>) -> String {
        let ports = self.node.ports();
        let (name, bytes) = match event {
            Event::Message {
                subscription,
                bytes,
            } => (ports.subscriptions[*subscription].topic.as_str(), *bytes),
            Event::Goal { bytes, .. } => ("goal", *bytes),
            Event::Request { bytes, .. } => ("request", *bytes),
            other => return format!("{other:?}").chars().take(400).collect(),
        };
        let shown = bytes[..bytes.len().min(600)].escape_ascii();
        format!("{name}: {} bytes {shown}", bytes.len())
    }

    fn take_out(&mut self) {
        for emission in self.out.drain(..) {
            match emission {
                Emission::Publish { publication, .. } => {
                    *self.published.entry(publication).or_default() += 1;
                }
                Emission::Respond { .. } => self.answered += 1,
                Emission::Call { client, id, .. } => keep(&mut self.calls, (client, id)),
                Emission::SendGoal { client, id, .. } => keep(&mut self.sent_goals, (client, id)),
                Emission::AcceptGoal { server, id } => {
                    self.answered += 1;
                    keep(&mut self.taken, (server, id));
                }
                Emission::RejectGoal { .. } => {
                    self.answered += 1;
                    self.refused += 1;
                }
                Emission::FinishGoal { server, id, .. } => {
                    self.taken.retain(|taken| *taken != (server, id));
                }
                Emission::Stopped => self.stopped = true,
                Emission::Feedback { .. }
                | Emission::CancelGoal { .. }
                | Emission::Diagnostic(_) => {}
            }
        }
    }

    /// Every goal of the node is taken and comes to its end, and every call is answered by nobody.
    pub fn serve(&mut self) {
        for (client, id) in std::mem::take(&mut self.calls) {
            self.hand(Event::Response {
                client,
                id,
                bytes: None,
            });
        }
        for (client, id) in std::mem::take(&mut self.sent_goals) {
            self.hand(Event::GoalAnswer {
                client,
                id,
                accepted: true,
            });
            let status = GoalStatus::Aborted;
            self.hand(Event::GoalResult {
                client,
                id,
                status,
                bytes: None,
            });
        }
    }
}

/// The last few are remembered.
fn keep(list: &mut Vec<(usize, u64)>, entry: (usize, u64)) {
    if list.len() >= 64 {
        list.remove(0);
    }
    list.push(entry);
}
