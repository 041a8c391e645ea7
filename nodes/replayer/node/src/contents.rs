//! What of a bag is played, and as what its topics are offered.

use abbe_msgs::{Durability, Qos, Reliability, topics};
use anyhow::Result;
use metrology::stamp::{Host, Stamp};
use node_runtime::names::NodeNames;
use node_runtime::tap::{Selection, TappedTopic};
use recorder::{Bag, TopicInfo, qos_from_yaml};
use replayer::{Playback, PlaybackConfig, PlaybackError, Reason};

/// Least depth of a topic whose history nobody asks for: more than is sent between two looks at acknowledgements.
const LEAST_DEPTH: u32 = 1_000;

/// What is played.
pub struct Contents {
    /// What each topic is offered as; `/clock` last where the player has its own.
    pub offered: Vec<TappedTopic>,
    /// What is done with each topic of the bag.
    pub plans: Vec<Plan>,
    /// Time of the bag's first message.
    pub first: Stamp<Host>,
    /// First time that is played.
    pub from: Stamp<Host>,
    /// Last time that is played.
    pub to: Stamp<Host>,
    /// Place of the player's own `/clock`.
    pub clock: Option<usize>,
}

/// What is done with a topic of the bag.
pub enum Plan {
    /// It is not picked.
    Aside,
    /// It is published; its place among what is offered.
    Play(usize),
    /// It is picked and cannot be published.
    LeftOut(Reason, String),
}

/// Why a topic cannot be published; `None`: it can.
fn unplayable(info: &TopicInfo, names: &NodeNames) -> Option<(Reason, String)> {
    if !["", "cdr"].contains(&info.message_encoding.as_str()) {
        let what = format!(
            "its messages are {}, cdr alone is sent",
            info.message_encoding
        );
        return Some((Reason::Encoding, what));
    }
    if info
        .type_name
        .split('/')
        .filter(|part| !part.is_empty())
        .count()
        != 3
    {
        let what = format!(
            "its type is {:?}, not of the form package/msg/Name",
            info.type_name
        );
        return Some((Reason::NotSent, what));
    }
    let name = names.resolve(&info.topic).err();
    name.map(|error| (Reason::NotSent, error.to_string()))
}

impl Contents {
    /// What of `bag` the parameters pick, for the node `names`.
    ///
    /// # Errors
    /// When nothing is left.
    pub fn of(
        bag: &Bag,
        config: &PlaybackConfig,
        playback: &Playback,
        names: &NodeNames,
    ) -> Result<Self> {
        let selection = Selection::Matching(config.topics.clone());
        let mut offered = Vec::new();
        let mut plans = Vec::new();
        for info in bag.topics() {
            let own_clock = config.clock && info.topic == topics::CLOCK.name;
            if !selection.takes(&info.topic) || own_clock {
                plans.push(Plan::Aside);
                continue;
            }
            let unplayable = unplayable(info, names);
            let unplayable = unplayable.map_or_else(|| qos_of(info), Err);
            plans.push(match unplayable {
                Ok(qos) => {
                    offered.push(TappedTopic {
                        name: info.topic.clone(),
                        type_name: info.type_name.clone(),
                        type_hash: Some(info.type_hash.clone()).filter(|hash| !hash.is_empty()),
                        qos,
                    });
                    Plan::Play(offered.len() - 1)
                }
                Err((reason, what)) => Plan::LeftOut(reason, what),
            });
        }
        let (first, last) = bag.log_times_nanos().unwrap_or_default();
        // A message of a later time is left out when its turn comes.
        let stamp = |nanos: u64| Stamp::from_nanos(i64::try_from(nanos).unwrap_or(i64::MAX));
        let (first, last) = (stamp(first), stamp(last));
        let from = first + playback.from;
        let is_picked = plans.iter().any(|plan| !matches!(plan, Plan::Aside));
        if !is_picked || from > last {
            return Err(PlaybackError::Nothing {
                bag: config.bag.clone(),
                topics: config.topics.clone(),
                from_s: config.from_s,
                held: bag.topics().iter().map(|t| t.topic.clone()).collect(),
            }
            .into());
        }
        let clock = config.clock.then(|| {
            offered.push(TappedTopic {
                name: topics::CLOCK.name.to_owned(),
                type_name: "rosgraph_msgs/msg/Clock".to_owned(),
                type_hash: None,
                qos: topics::CLOCK.qos,
            });
            offered.len() - 1
        });
        Ok(Self {
            offered,
            plans,
            first,
            from,
            to: playback.to.map_or(last, |to| first + to),
            clock,
        })
    }
}

/// What every recorded publisher offered; where they differed, what most subscribers can take.
fn qos_of(info: &TopicInfo) -> Result<Qos, (Reason, String)> {
    let profiles = qos_from_yaml(&info.qos_yaml).map_err(|error| {
        let what = format!("its recorded quality of service cannot be read: {error}");
        (Reason::NotSent, what)
    })?;
    let latched = |p: &recorder::QosProfile| p.durability == recorder::Durability::TransientLocal;
    let best_effort = |p: &recorder::QosProfile| p.reliability == recorder::Reliability::BestEffort;
    let is_latched = !profiles.is_empty() && profiles.iter().all(latched);
    let deepest = profiles.iter().map(|p| p.depth).max().unwrap_or_default();
    let depth = u32::try_from(deepest).unwrap_or(0).max(1);
    Ok(Qos {
        reliability: if !profiles.is_empty() && profiles.iter().all(best_effort) {
            Reliability::BestEffort
        } else {
            Reliability::Reliable
        },
        durability: if is_latched {
            Durability::TransientLocal
        } else {
            Durability::Volatile
        },
        depth: if is_latched {
            depth
        } else {
            depth.max(LEAST_DEPTH)
        },
    })
}
