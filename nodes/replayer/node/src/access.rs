//! What a player must be allowed to do on a secured graph.

use std::path::Path;

use abbe_msgs::topics;
use anyhow::Result;
use node_runtime::access::Access;
use node_runtime::names::NodeNames;
use node_runtime::node::Ports;
use recorder::Bag;
use replayer::PlaybackConfig;

use crate::contents::Contents;

/// Name of the second participant of the node `names`, which sends what the bag holds.
pub fn voice(names: &NodeNames) -> NodeNames {
    let mut names = names.clone();
    names.name.push_str("_voice");
    names
}

/// What each participant of the player `names` of a whole bag may do: the node answers its services, its voice
/// writes the bag's topics and the time.
///
/// # Errors
/// When the bag cannot be opened or a topic has no name of ROS.
pub fn access(names: &NodeNames, config: &PlaybackConfig) -> Result<[(String, Access); 2]> {
    let bag = Bag::open(Path::new(&config.bag))?;
    let contents = Contents::of(&bag, config, &config.checked()?, names)?;
    let mut node = Access::of(names, &Ports::default())?;
    for service in [
        topics::PAUSE_PLAYING.name,
        topics::RESUME_PLAYING.name,
        topics::STEP_PLAYING.name,
    ] {
        node.serves(&names.resolve(service)?);
    }
    let mut sent = Access::to_graph();
    for topic in &contents.offered {
        sent.writes(&topic.name);
    }
    Ok([
        (names.fully_qualified(), node),
        (voice(names).fully_qualified(), sent),
    ])
}
