//! Why a bag cannot be replayed or played.

use metrology::bound::BoundError;
use metrology::number::number;
use node_runtime::harness::{ComposeError, SnapshotError};

/// Why a bag cannot be replayed.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "fields are named in the messages")]
pub enum ReplayError {
    #[error(
        "the bag does not say what ran (metadata record \"abbe.run\"): no composed run recorded it"
    )]
    NoRun,
    #[error(
        "the bag's messages stand as they reached the recorder: when each node got them is not in it; only bags of runs in simulated time are recomputed"
    )]
    Arrival,
    #[error("the bag does not name the nodes that ran (metadata record \"abbe.nodes\")")]
    NoNodes,
    #[error(
        "start of the run {nanos} ns: must be from 0 to 4294967295999999999 ns since 1970 (to 2106-02-07)"
    )]
    Start { nanos: u64 },
    #[error(
        "resumed after {after_messages} messages: the bag has {messages}, so nothing would be resumed"
    )]
    ResumedAfterEnd { after_messages: u64, messages: u64 },
    #[error(
        "resumed after {after_messages} messages: no input of the bag follows, so nothing would be resumed: name fewer messages"
    )]
    ResumedAfterInputs { after_messages: u64 },
    #[error(transparent)]
    Compose(#[from] ComposeError),
    #[error(transparent)]
    Snapshot(#[from] SnapshotError),
}

/// Why a bag cannot be played.
#[derive(Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "fields are named in the messages")]
pub enum PlaybackError {
    #[error(transparent)]
    Parameter(#[from] BoundError),
    #[error("rate = {rate}: must be 0, or {least} to 1000", rate = number(*rate), least = number(*least))]
    Slow { rate: f64, least: f64 },
    #[error("to_s = {to_s} s is before from_s = {from_s} s: nothing would be played", from_s = number(*from_s), to_s = number(*to_s))]
    EmptyRange { from_s: f64, to_s: f64 },
    #[error("{bag}: no message of {topics:?} between {from_s} s and its end; it holds {held:?}", from_s = number(*from_s))]
    Nothing {
        bag: String,
        topics: Vec<String>,
        from_s: f64,
        held: Vec<String>,
    },
}
