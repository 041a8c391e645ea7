//! What of a bag is played, and as what its topics are offered.

use abbe_msgs::{Durability, Qos, Reliability, topics};
use anyhow::{Context, Result};
use metrology::stamp::{Host, Stamp};
use node_runtime::tap::{Selection, TappedTopic};
use recorder::{Bag, TopicInfo, qos_from_yaml};
use replayer::{Playback, PlaybackConfig, PlaybackError};

/// Least depth of a topic whose history nobody asks for: more than is sent between two looks at acknowledgements.
const LEAST_DEPTH: u32 = 1_000;

/// What is played.
pub struct Contents {
    /// What each topic is offered as; `/clock` last where the player has its own.
    pub offered: Vec<TappedTopic>,
    /// For each topic of the bag its place among those, if it is played.
    pub places: Vec<Option<usize>>,
    /// First time that is played.
    pub from: Stamp<Host>,
    /// Last time that is played.
    pub to: Stamp<Host>,
    /// Place of the player's own `/clock`.
    pub clock: Option<usize>,
}

impl Contents {
    /// What of `bag` the parameters pick.
    ///
    /// # Errors
    /// When nothing is left, or the recorded quality of service of a topic cannot be read.
    pub fn of(bag: &Bag, config: &PlaybackConfig, playback: &Playback) -> Result<Self> {
        let selection = Selection::Matching(config.topics.clone());
        let mut offered = Vec::new();
        let mut places = Vec::new();
        for info in bag.topics() {
            let own_clock = config.clock && info.topic == topics::CLOCK.name;
            if selection.takes(&info.topic) && !own_clock {
                places.push(Some(offered.len()));
                offered.push(TappedTopic {
                    name: info.topic.clone(),
                    type_name: info.type_name.clone(),
                    qos: qos_of(info)?,
                });
            } else {
                places.push(None);
            }
        }
        let (first, last) = bag.log_times_nanos().unwrap_or_default();
        let stamp = |nanos: u64| i64::try_from(nanos).map(Stamp::from_nanos);
        let first = stamp(first).context("the bag's first time does not fit 64 bits")?;
        let last = stamp(last).context("the bag's last time does not fit 64 bits")?;
        let from = first + playback.from;
        if offered.is_empty() || from > last {
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
                qos: topics::CLOCK.qos,
            });
            offered.len() - 1
        });
        Ok(Self {
            offered,
            places,
            from,
            to: playback.to.map_or(last, |to| first + to),
            clock,
        })
    }
}

/// What every recorded publisher offered; where they differed, what most subscribers can take.
fn qos_of(info: &TopicInfo) -> Result<Qos> {
    let profiles = qos_from_yaml(&info.qos_yaml)
        .with_context(|| format!("topic {}: recorded quality of service", info.topic))?;
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
