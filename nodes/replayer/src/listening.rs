//! What the nodes of a replay say: kept until it is compared, or summed up where the bag has no such topic.

use std::cell::RefCell;
use std::collections::{BTreeMap, VecDeque};
use std::rc::Rc;

use metrology::stamp::{Host, Stamp};
use node_runtime::harness::Published;
use node_runtime::{Bytes, Harness};
use serde::Serialize;
use sha2::{Digest, Sha256};

/// What was computed on a topic that the bag does not have.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct NotInBag {
    /// Messages.
    pub messages: u64,
    /// SHA-256, in hexadecimal digits, of each message in its order: its time as a little-endian i64 of nanoseconds,
    /// its length as a little-endian u64, its bytes.
    pub sha256: String,
}

/// A message that is to be compared.
pub(crate) struct Said {
    pub route: usize,
    pub at: Stamp<Host>,
    pub bytes: Bytes,
}

/// What is done with what is said on a topic.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Ear {
    Deaf,
    Compare,
    SumUp,
}

#[derive(Default)]
struct Heard {
    said: VecDeque<Said>,
    sums: BTreeMap<usize, (u64, Sha256)>,
}

/// What the nodes have said; goes on when another harness takes over.
pub(crate) struct Listening {
    ears: Rc<[Ear]>,
    heard: Rc<RefCell<Heard>>,
}

impl Listening {
    /// `ears` is by topic of the harness.
    pub fn new(ears: Vec<Ear>) -> Self {
        Self {
            ears: ears.into(),
            heard: Rc::default(),
        }
    }

    pub fn attend(&self, harness: &mut Harness) {
        let (ears, heard) = (Rc::clone(&self.ears), Rc::clone(&self.heard));
        harness.observe(Box::new(move |published: Published<'_>| {
            let Published {
                topic, at, bytes, ..
            } = published;
            match ears[topic] {
                Ear::Deaf => {}
                Ear::Compare => heard.borrow_mut().said.push_back(Said {
                    route: topic,
                    at,
                    bytes: bytes.clone(),
                }),
                Ear::SumUp => {
                    let mut heard = heard.borrow_mut();
                    let (messages, sum) = heard.sums.entry(topic).or_default();
                    *messages += 1;
                    sum.update(at.nanos().to_le_bytes());
                    sum.update((bytes.len() as u64).to_le_bytes());
                    sum.update(bytes);
                }
            }
        }));
    }

    /// Takes the first message of a topic, and tells its place among those that wait.
    pub fn take(&self, route: usize) -> Option<(usize, Said)> {
        let said = &mut self.heard.borrow_mut().said;
        let place = said.iter().position(|said| said.route == route)?;
        Some((place, said.remove(place)?))
    }

    /// Takes what has waited longest.
    pub fn take_next(&self) -> Option<Said> {
        self.heard.borrow_mut().said.pop_front()
    }

    /// What was summed up, by topic of the harness.
    pub fn sums(&self) -> Vec<(usize, NotInBag)> {
        let heard = self.heard.borrow();
        let sums = heard.sums.iter().map(|(route, (messages, sum))| {
            let digits = sum.clone().finalize();
            let sha256 = digits.iter().map(|byte| format!("{byte:02x}")).collect();
            let messages = *messages;
            (*route, NotInBag { messages, sha256 })
        });
        sums.collect()
    }
}
