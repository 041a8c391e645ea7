//! Shows a composed run on DDS, so that a person can watch it with `ros2`.
//!
//! The run goes a thousand times faster than real time and does not wait for the network: what comes
//! at a high rate and finds the queue half full is not shown, and counted. What is latched or rare
//! has the other half for itself. `/clock` follows the run ten times a second, so that a node with
//! `use_sim_time` follows too.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant};

use abbe_msgs::rosgraph_msgs::msg::Clock;
use abbe_msgs::{Durability, Message, Reliability, to_cdr, topics};
use anyhow::{Context, Result};
use metrology::stamp::{Host, Stamp};
use node_runtime::complain;
use node_runtime::environment::Environment;
use node_runtime::harness::Published;
use node_runtime::names::NodeNames;
use node_runtime::node::TopicPort;
use node_runtime::{Harness, RawPublisher};

/// The mirror's name on the graph.
const RUN_NAME: &str = "abbe_run";
/// Messages between the run and the network.
const QUEUE_LEN: usize = 4_096;
/// What is rare waits so long for a full queue at most; the network never lets it wait so long.
const QUEUE_TIMEOUT: Duration = Duration::from_millis(100);
/// Wall time between two `/clock`.
const CLOCK_PERIOD: Duration = Duration::from_millis(100);
/// Topics that are this deep are meant for a message at every servo tick.
const DEEP: u32 = abbe_msgs::Qos::RELIABLE_DEEP.depth;

/// Publishes what the harness publishes.
pub struct Mirror(Rc<RefCell<Showing>>);

struct Showing {
    publisher: RawPublisher,
    frequent: Vec<bool>,
    clock: usize,
    clock_at: Option<Instant>,
    offered: u64,
    left_out: u64,
}

/// Whether a topic may be left out when the network is slow.
fn is_frequent(port: &TopicPort) -> bool {
    let qos = port.qos;
    let latched = qos.durability == Durability::TransientLocal;
    // tf is as shallow as everybody's and comes with every joint state.
    let is_tf = port.topic == topics::TF.name;
    !latched && (is_tf || qos.reliability == Reliability::BestEffort || qos.depth >= DEEP)
}

fn clock_port() -> TopicPort {
    TopicPort {
        topic: topics::CLOCK.name.to_owned(),
        type_name: Clock::TYPE_NAME,
        type_hash: Clock::TYPE_HASH,
        definition: Clock::DEFINITION,
        qos: topics::CLOCK.qos,
    }
}

impl Mirror {
    /// Begins; `None`, with a word, where there is no network to publish on.
    ///
    /// # Errors
    /// When one of ROS's variables has a value that it cannot have.
    pub fn start(harness: &mut Harness) -> Result<Option<Self>> {
        let environment = Environment::read()?;
        let mut ports: Vec<TopicPort> = harness.topics().cloned().collect();
        let frequent = ports.iter().map(is_frequent).collect();
        let clock = ports.len();
        ports.push(clock_port());
        let names = NodeNames::new(RUN_NAME, &[])?;
        let started = RawPublisher::start(&environment, &names, &ports, QUEUE_LEN, QUEUE_TIMEOUT);
        let publisher = match started {
            Ok(publisher) => publisher,
            Err(error) => {
                complain!("abbe: nothing is shown on DDS: {error:#}");
                return Ok(None);
            }
        };
        let showing = Rc::new(RefCell::new(Showing {
            publisher,
            frequent,
            clock,
            clock_at: None,
            offered: 0,
            left_out: 0,
        }));
        let shown = Rc::clone(&showing);
        harness.observe(Box::new(move |published| {
            shown.borrow_mut().show(published);
        }));
        Ok(Some(Self(showing)))
    }

    /// Ends, when the harness is gone, and says what was not shown.
    ///
    /// # Errors
    /// When the publishing thread panicked.
    pub fn finish(self) -> Result<()> {
        let showing = Rc::into_inner(self.0).context("an observer outlived its harness")?;
        let shown = showing.into_inner();
        let report = shown.publisher.stop()?;
        let missed = shown.left_out + report.dropped + report.refused;
        if missed > 0 {
            complain!(
                "abbe: {} of {} messages, the clock among them, were shown on DDS; the bag has every one of the topics that it records",
                shown.offered - missed,
                shown.offered
            );
        }
        Ok(())
    }
}

impl Showing {
    fn show(&mut self, published: Published<'_>) {
        let now = Instant::now();
        if self.clock_at.is_none_or(|at| now - at >= CLOCK_PERIOD) {
            self.clock_at = Some(now);
            let bytes = Arc::from(to_cdr(&clock(published.at)));
            self.offer(self.clock, bytes);
        }
        if self.frequent[published.topic] && self.publisher.room() < QUEUE_LEN / 2 {
            self.offered += 1;
            self.left_out += 1;
        } else {
            self.offer(published.topic, Arc::clone(published.bytes));
        }
    }

    fn offer(&mut self, place: usize, bytes: Arc<[u8]>) {
        self.offered += 1;
        // What finds no room even so is counted by the publisher.
        let _ = self.publisher.publish(place, None, bytes);
    }
}

/// Simulated time for `/clock`.
fn clock(at: Stamp<Host>) -> Clock {
    Clock {
        clock: abbe_msgs::time(at),
    }
}
