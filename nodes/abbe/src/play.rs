//! `abbe play BAG`: a bag's messages on the network again, with `/clock`, at any rate.

use std::io::IsTerminal;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::{Context, Result, bail};
use clap::Args;
use metrology::epoch::utc_of_nanos;
use node_runtime::arguments::Arguments;
use node_runtime::complain;
use node_runtime::environment::Environment;
use node_runtime::tap::Selection;
use node_runtime::{Interruption, Setup};
use recorder::Bag;
use replayer::PlaybackConfig;
use replayer_node::{Desk, Played};
use reports::loss;

use crate::tell::tell;
use crate::usage::{refused, topics};

/// Arguments of `abbe play`.
#[derive(Args)]
pub struct Play {
    /// Folder of the bag, or one .mcap file.
    bag: PathBuf,
    /// Time of the bag over time, 0.001 to 1000; 0: as fast as subscribers acknowledge.
    #[arg(long, default_value_t = 1.0, allow_negative_numbers = true)]
    rate: f64,
    /// Absolute name of topics, `*` stands for any run of characters; may be given several times; none: every topic.
    #[arg(long, value_name = "TOPIC", value_parser = topics)]
    topics: Vec<String>,
    /// Leave out what comes before, s from the bag's first message; of latched topics the last ones are sent first.
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    from: f64,
    /// Leave out what comes after, s from the bag's first message.
    #[arg(long, allow_negative_numbers = true)]
    to: Option<f64>,
    /// Begin again at the end, until Ctrl-C.
    #[arg(long = "loop")]
    repeat: bool,
    /// Wait for the service `replayer/resume` or `replayer/step` before the first message.
    #[arg(long)]
    paused: bool,
    /// Time for subscribers to find the topics before the first message, s.
    #[arg(long, default_value_t = 0.5, allow_negative_numbers = true)]
    delay: f64,
    /// Do not publish `/clock`; one that was recorded is played as it is.
    #[arg(long)]
    no_clock: bool,
    /// Play also where other nodes publish the same topics, or a controller follows the bag's offsets.
    #[arg(long)]
    onto_a_running_graph: bool,
    /// Rules as of any ROS 2 node: `--ros-args -r FROM:=TO …`.
    #[arg(last = true)]
    ros: Vec<String>,
}

/// The player's name on the graph.
pub const PLAYER_NAME: &str = "replayer";
/// Between two looks at how far it is.
const PROGRESS_PERIOD: Duration = Duration::from_millis(100);
impl Play {
    /// Plays to the end or to SIGINT; exit code 3 when something was lost, 1 where others use the topics.
    ///
    /// # Errors
    /// When a number is out of its range (exit code 2), the bag cannot be opened, holds nothing of what is asked for, or there is no network.
    pub fn execute(self) -> Result<ExitCode> {
        let interruption = Interruption::listen("what was sent is being acknowledged")?;
        let bag = self.bag.to_str().context("BAG: must be UTF-8")?;
        let config = PlaybackConfig {
            rate: self.rate,
            from_s: self.from,
            to_s: self.to,
            repeat: self.repeat,
            start_paused: self.paused,
            delay_s: self.delay,
            clock: !self.no_clock,
            onto_a_running_graph: self.onto_a_running_graph,
            topics: if self.topics.is_empty() {
                vec!["*".to_owned()]
            } else {
                self.topics.clone()
            },
            ..PlaybackConfig::whole(bag.to_owned())
        };
        config.checked().map_err(|error| refused("play", error))?;
        let rules = Arguments::parse(self.ros.clone());
        let rules = rules.map_err(|error| refused("play", error))?;
        let setup = Setup::new(PLAYER_NAME, &rules)?;
        if let Some((name, _)) = setup.tree().leaves().first() {
            let reason = format!(
                "parameter `{name}`: does nothing here, the options of `abbe play` say how a bag is played"
            );
            return Err(refused("play", reason));
        }
        for line in self.without_effect()? {
            complain!("abbe: {line}");
        }
        let (node, desk) = replayer_node::play(&setup, &config)?;
        let mut running = node_runtime::launch(&Environment::read()?, vec![(setup, node)])?;
        complain!("Playing {bag}; Ctrl-C ends it.");
        let mut shown = Shown::new();
        while desk.progress().over.is_none() && !interruption.wait(PROGRESS_PERIOD) {
            if let Some(error) = running.ended() {
                return Err(error);
            }
            shown.show(&desk);
        }
        running.stop_unless_forced(&interruption)?;
        shown.end();
        ended(&desk, bag)
    }
}

impl Play {
    /// Names of topics that no topic of the bag has.
    fn without_effect(&self) -> Result<Vec<String>> {
        if self.topics.is_empty() {
            return Ok(vec![]);
        }
        let bag = Bag::open(&self.bag)?;
        let fits = |pattern: &String| {
            let selection = Selection::Matching(vec![pattern.clone()]);
            bag.topics()
                .iter()
                .any(|topic| selection.takes(&topic.topic))
        };
        let unfit = self.topics.iter().filter(|pattern| !fits(pattern));
        let line = |pattern: &String| {
            format!("--topics {pattern} has no effect: the bag has no such topic")
        };
        Ok(unfit.map(line).collect())
    }
}

fn ended(desk: &Desk, bag: &str) -> Result<ExitCode> {
    let played: Played = match desk.progress().over {
        Some(Ok(played)) => played,
        Some(Err(reason)) => bail!("{bag}: {reason}"),
        None => bail!("{bag}: the player has left without a word"),
    };
    for loss in &played.losses {
        complain!("abbe: {loss}");
    }
    tell!("{bag}: {} messages, {} lost", played.messages, played.lost);
    let is_whole = played.lost == 0 && played.losses.is_empty();
    Ok(loss::exit_code(is_whole))
}

/// The line on a terminal.
struct Shown {
    bar: Option<indicatif::ProgressBar>,
    /// Number of pauses printed so far.
    pauses: usize,
}

impl Shown {
    fn new() -> Self {
        let terminal = std::io::stderr().is_terminal();
        Self {
            bar: terminal.then(indicatif::ProgressBar::new_spinner),
            pauses: 0,
        }
    }

    fn show(&mut self, desk: &Desk) {
        let progress = desk.progress();
        if let Some((begun, pause)) = progress.pause
            && begun > self.pauses
        {
            self.pauses = begun;
            let word = || complain!("abbe: {pause}");
            match &self.bar {
                Some(bar) => bar.suspend(word),
                None => word(),
            }
        }
        let Some(bar) = &self.bar else {
            return;
        };
        let state = if progress.paused { "paused at" } else { "at" };
        let at = utc_of_nanos(progress.at.nanos(), 3);
        bar.set_message(format!("{state} {at}, {} messages", progress.sent));
        bar.tick();
    }

    fn end(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct CommandLine {
        #[command(flatten)]
        play: Play,
    }

    #[test]
    fn an_option_takes_one_topic_and_the_argument_behind_it_is_the_bag() {
        let line = ["play", "--topics", "/a", "bag", "--topics", "/b/*"];
        let play = CommandLine::parse_from(line).play;
        assert_eq!(play.topics, ["/a", "/b/*"]);
        assert_eq!(play.bag, PathBuf::from("bag"));
    }
}
