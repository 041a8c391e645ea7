//! What goes wrong with a recording while it goes on: on the terminal at once, and on `/diagnostics` for whoever watches.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use abbe_msgs::builtin_interfaces::msg::Time;
use abbe_msgs::diagnostic_msgs::msg::{DiagnosticArray, DiagnosticStatus};
use abbe_msgs::std_msgs::msg::Header;
use abbe_msgs::{Message as _, to_cdr, topics};
use metrology::stamp::{Host, NANOS_PER_S, Stamp};
use node_runtime::RawPublisher;
use node_runtime::complain;
use node_runtime::environment::Environment;
use node_runtime::names::NodeNames;
use node_runtime::node::TopicPort;

/// The condition's name.
const CONDITION: &str = "recording";
/// Interval between two publications: subscribers find the new publisher within a second.
const AGAIN: Duration = Duration::from_millis(250);
/// Least number of publications.
const TIMES: u32 = 12;

/// The message for `/diagnostics`: `node` cannot record any more.
pub fn message(node: &str, reason: &str, at: Stamp<Host>) -> Vec<u8> {
    array(vec![recording(node, reason)], at)
}

/// The condition of a node that cannot record any more.
fn recording(node: &str, reason: &str) -> DiagnosticStatus {
    DiagnosticStatus {
        level: DiagnosticStatus::ERROR,
        name: format!("/{node}: {CONDITION}"),
        message: reason.to_owned(),
        ..DiagnosticStatus::default()
    }
}

/// Conditions as a message for `/diagnostics`.
fn array(status: Vec<DiagnosticStatus>, at: Stamp<Host>) -> Vec<u8> {
    let sec = i32::try_from(at.nanos().div_euclid(NANOS_PER_S)).unwrap_or(0);
    let nanosec = u32::try_from(at.nanos().rem_euclid(NANOS_PER_S)).unwrap_or(0);
    to_cdr(&DiagnosticArray {
        header: Header {
            stamp: Time { sec, nanosec },
            frame_id: String::new(),
        },
        status,
    })
}

/// An alarm that is being published on the network.
pub struct Alarm {
    over: Arc<AtomicBool>,
    telling: Option<JoinHandle<()>>,
}

impl Alarm {
    /// Says on the terminal and, in a thread of its own, on `/diagnostics` that `node` cannot record any more.
    pub fn raise(environment: &Environment, node: &str, reason: &str) -> Self {
        complain!("abbe: {reason}");
        let over = Arc::new(AtomicBool::new(false));
        let (environment, node, reason) = (environment.clone(), node.to_owned(), reason.to_owned());
        let until = Arc::clone(&over);
        let tell = move || {
            let conditions = [recording(&node, &reason)];
            if let Err(error) = tell(&environment, &node, &conditions, &until) {
                complain!("abbe: /diagnostics does not tell it: {error:#}");
            }
        };
        let telling = std::thread::Builder::new()
            .name("alarm".to_owned())
            .spawn(tell);
        Self {
            over,
            telling: telling.ok(),
        }
    }

    /// Ends the alarm, once it has the least number of publications.
    pub fn end(mut self) {
        self.over.store(true, Ordering::Relaxed);
        if let Some(telling) = self.telling.take() {
            let _ = telling.join();
        }
    }
}

/// Publishes conditions of `node` on `/diagnostics` for [`TIMES`] times [`AGAIN`], so that whoever watches finds them.
///
/// # Errors
/// When there is no network.
pub fn publish(
    environment: &Environment,
    node: &str,
    conditions: &[DiagnosticStatus],
) -> anyhow::Result<()> {
    tell(environment, node, conditions, &AtomicBool::new(true))
}

/// Publishes conditions again and again, [`TIMES`] times at least and then until the alarm is over.
fn tell(
    environment: &Environment,
    node: &str,
    conditions: &[DiagnosticStatus],
    over: &AtomicBool,
) -> anyhow::Result<()> {
    let port = TopicPort {
        topic: topics::DIAGNOSTICS.name.to_owned(),
        type_name: DiagnosticArray::TYPE_NAME,
        type_hash: DiagnosticArray::TYPE_HASH,
        definition: DiagnosticArray::DEFINITION,
        qos: topics::DIAGNOSTICS.qos,
    };
    let names = NodeNames::new(&format!("{node}_alarm"), &[])?;
    let mut publisher = RawPublisher::start(environment, &names, &[port], 16, AGAIN)?;
    let mut told = 0;
    while told < TIMES || !over.load(Ordering::Relaxed) {
        let bytes = array(conditions.to_vec(), RawPublisher::now());
        publisher.publish(0, None, bytes.into());
        std::thread::sleep(AGAIN);
        told += 1;
    }
    publisher.stop()?;
    Ok(())
}
