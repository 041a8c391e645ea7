//! `abbe record -o DIR [TOPICS…]`: the network into a bag, until SIGINT.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};
use machine::MachineFile;
use node_runtime::arguments::Arguments;
use node_runtime::complain;
use node_runtime::environment::Environment;
use node_runtime::tap::Selection;
use node_runtime::text_file;
use node_runtime::{Interruption, Setup};
use recorder::{ChunkCompression, NodeConfig, RecorderConfig, RecorderError, RingConfig};
use recorder_node::{Capture, Time};
use reports::loss;

use crate::alarm::Alarm;
use crate::tell::tell;
use crate::usage::{refused, topics};

/// Compression inside the bag's chunks.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Compression {
    None,
    Lz4,
    Zstd,
}

/// Arguments of `abbe record`.
#[derive(Args)]
pub struct Record {
    /// Folder of the bag, which must not exist; with --ring the folder in which bags are saved.
    #[arg(short, long)]
    output: PathBuf,
    /// Compression inside the chunks.
    #[arg(long, value_enum, default_value = "zstd")]
    compression: Compression,
    /// A new file is begun at this size, bytes; 0: one file.
    #[arg(long, default_value_t = 0)]
    max_file_bytes: u64,
    /// A new file is begun when this one spans so much time, s; 0: one file.
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    max_file_s: f64,
    /// Absolute name of topics that are left out, `*` stands for any run of characters; may be given several times.
    #[arg(long, value_name = "TOPIC", value_parser = topics)]
    exclude: Vec<String>,
    /// Machine file that goes into every bag.
    #[arg(long)]
    machine: Option<PathBuf>,
    /// Keep the last seconds in memory, and save them when `recorder/save` is called.
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    ring: Option<f64>,
    /// Most bytes that the ring keeps.
    #[arg(long, default_value_t = 256 << 20, requires = "ring")]
    ring_bytes: u64,
    /// Save the ring when an error begins on `/diagnostics` too.
    #[arg(long, requires = "ring")]
    save_on_error: bool,
    /// Stamp messages by `/clock`, as of a simulation or of `abbe play`, and not by this computer's clock.
    #[arg(long)]
    use_sim_time: bool,
    /// Absolute names of topics, `*` stands for any run of characters; none: every topic.
    #[arg(value_parser = topics)]
    topics: Vec<String>,
}

/// The recorder's own name on the graph.
const RECORDER_NAME: &str = "abbe_record";
/// The name of a recorder that keeps, before which its services stand.
const KEEPER: &str = "recorder";
/// Between two looks at whether it is over or the disk is full; a signal wakes it at once.
const DISK_PERIOD: Duration = Duration::from_millis(500);
/// After so many looks without a `/clock` a person is warned.
const LOOKS_FOR_CLOCK: u32 = 10;

impl Record {
    /// Records until SIGINT or SIGTERM; exit code 3 when the bag lost something.
    ///
    /// # Errors
    /// When a number is out of its range (exit code 2), the bag cannot be begun, or there is no network.
    pub fn execute(self) -> Result<ExitCode> {
        let interruption = Interruption::listen("the bag is being closed")?;
        let config = self.config()?;
        let machine = self.machine.as_ref().map(|path| {
            let file = text_file::yaml_file(path).context("--machine")?;
            // A bag with a text that is no machine file is refused by every verb that reads it.
            MachineFile::parse(&file.text, &file.path.display().to_string())?;
            anyhow::Ok(file.text)
        });
        let machine = machine.transpose()?;
        if config.ring.is_some() {
            return keep(&config, machine, &interruption);
        }
        let time = Time::simulated(self.use_sim_time);
        let capture = recorder_node::record(&config, machine, RECORDER_NAME, time)?;
        let bag = &config.bag;
        complain!("Recording into {bag}; Ctrl-C ends it.");
        let alarm = watch(&capture, &interruption)?;
        let captured = capture.finish()?;
        alarm.into_iter().for_each(Alarm::end);
        for word in captured.unrecorded.iter().chain(&captured.unmatched) {
            complain!("abbe: {word}");
        }
        let lost = captured.stats.messages_lost + captured.lost_on_network;
        tell!(
            "{bag}: {} messages, {lost} lost",
            captured.stats.messages_written
        );
        let mut is_whole = lost == 0;
        match captured.bag {
            Err(error @ RecorderError::Undescribed { .. }) => {
                complain!("abbe: {error}");
                is_whole = false;
            }
            bag => drop(bag?),
        }
        match node_runtime::deafness() {
            Some(reason) => bail!("the recording has ended: {reason}"),
            None => Ok(loss::exit_code(is_whole)),
        }
    }

    /// The recorder's parameters, each in its range.
    fn config(&self) -> Result<NodeConfig> {
        let bag = self.output.to_str().context("--output: must be UTF-8")?;
        let ring = self.ring.map(|window_s| RingConfig {
            window_s,
            limit_bytes: self.ring_bytes,
            save_on_error: self.save_on_error,
        });
        let writing = RecorderConfig {
            compression: match self.compression {
                Compression::None => ChunkCompression::None,
                Compression::Lz4 => ChunkCompression::Lz4,
                Compression::Zstd => ChunkCompression::Zstd,
            },
            max_file_bytes: self.max_file_bytes,
            max_file_s: self.max_file_s,
            ..RecorderConfig::default()
        };
        let ranges = ring.map_or(Ok(()), |ring| ring.checked());
        let ranges = ranges.and_then(|()| writing.checked());
        ranges.map_err(|error| refused("record", error))?;
        let topics = if self.topics.is_empty() {
            vec!["*".to_owned()]
        } else {
            self.topics.clone()
        };
        if Selection::leaves_nothing(&topics, &self.exclude) {
            let reason = format!(
                "--exclude {}: leaves out every topic of {}, so that nothing would be recorded: exclude less",
                self.exclude.join(" --exclude "),
                topics.join(", ")
            );
            return Err(refused("record", reason));
        }
        let config = NodeConfig {
            bag: bag.to_owned(),
            bag_per_start: false,
            exclude: self.exclude.clone(),
            machine_file: String::new(),
            ring,
            topics,
            writing,
        };
        let clock = recorder_node::check_clock(&config, &Time::simulated(self.use_sim_time));
        clock.map_err(|error| refused("record", error))?;
        Ok(config)
    }
}

/// Waits for the end. A recording that cannot go on ends by itself, and an alarm reports it on the graph too where the
/// process can still speak.
fn watch(capture: &Capture, interruption: &Interruption) -> Result<Option<Alarm>> {
    let mut trouble = None;
    let mut undecoded = node_runtime::Undecoded::default();
    let mut looks_early = 0;
    while !interruption.wait(DISK_PERIOD) {
        let early = capture.early();
        looks_early = if early > 0 { looks_early + 1 } else { 0 };
        if looks_early == LOOKS_FOR_CLOCK {
            complain!("abbe: no /clock has come yet: {early} messages wait for it");
        }
        if let Some(news) = undecoded.news() {
            complain!("abbe: {news}");
        }
        let stats = capture.stats();
        if node_runtime::deafness().is_some() {
            break;
        }
        if let Some(reason) = stats.failure {
            let reason = format!("the recording ends, since it cannot be written: {reason}");
            return Ok(Some(Alarm::raise(
                &Environment::read()?,
                RECORDER_NAME,
                &reason,
            )));
        }
        if trouble.is_none() && stats.trouble.is_some() {
            trouble = stats.trouble;
            trouble.iter().for_each(|word| complain!("abbe: {word}"));
        }
    }
    Ok(None)
}

/// Keeps the last minutes as the node `recorder`, whose services save them.
fn keep(
    config: &NodeConfig,
    machine: Option<String>,
    interruption: &Interruption,
) -> Result<ExitCode> {
    let setup = Setup::new(KEEPER, &Arguments::parse(Vec::new())?)?;
    let node = recorder_node::listen(&setup, config, machine)?;
    let running = node_runtime::launch(&Environment::read()?, vec![(setup, node)])?;
    let words = "ros2 service call /recorder/save std_srvs/srv/Trigger";
    complain!(
        "Keeping what is said; `{words}` saves it below {}; Ctrl-C ends it.",
        config.bag
    );
    running.until(interruption)?;
    Ok(ExitCode::SUCCESS)
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct CommandLine {
        #[command(flatten)]
        record: Record,
    }

    #[test]
    fn an_option_takes_one_topic_and_the_arguments_behind_it_are_topics_to_record() {
        let line = [
            "record",
            "-o",
            "bag",
            "--exclude",
            "/a",
            "/b",
            "--exclude",
            "/c*",
            "*",
        ];
        let record = CommandLine::parse_from(line).record;
        assert_eq!(record.exclude, ["/a", "/c*"]);
        assert_eq!(record.topics, ["/b", "*"]);
    }

    #[test]
    fn simulated_time_needs_its_clock_among_the_topics() {
        let of = |words: &[&str]| {
            let line = ["record", "-o", "bag", "--use-sim-time"]
                .iter()
                .chain(words);
            CommandLine::try_parse_from(line).unwrap().record.config()
        };
        for good in [&[][..], &["/axes/state", "/clock"], &["/c*"]] {
            assert!(of(good).is_ok(), "{good:?}");
        }
        for (bad, word) in [
            (&["/axes/state"][..], "add it to topics"),
            (&["--exclude", "/clock"], "add it to topics"),
            (&["--ring", "60"], "real time"),
        ] {
            let said = of(bad).unwrap_err().to_string();
            assert!(said.contains(word), "{bad:?}: {said}");
        }
    }

    #[test]
    fn a_recording_of_nothing_is_refused_and_one_of_a_part_is_not() {
        let of = |words: &[&str]| {
            let line = ["record", "-o", "bag"].iter().chain(words);
            CommandLine::try_parse_from(line).unwrap().record.config()
        };
        for nothing in [
            &["/foo", "--exclude", "/foo"][..],
            &["/foo", "--exclude", "/f*"],
            &["--exclude", "/*"],
            &["--exclude", "*"],
            &["/a/*", "/b", "--exclude", "/a*", "--exclude", "/b"],
        ] {
            let said = of(nothing).unwrap_err().to_string();
            assert!(
                said.contains("nothing would be recorded"),
                "{nothing:?}: {said}"
            );
        }
        for part in [
            &["/foo"][..],
            &["/foo", "/bar", "--exclude", "/foo"],
            &["--exclude", "/foo"],
            &["/f*", "--exclude", "/foo"],
            &["--exclude", "/*/b"],
        ] {
            assert!(of(part).is_ok(), "{part:?}");
        }
    }

    #[test]
    fn a_relative_name_is_a_matter_of_usage() {
        for wrong in [&["axes/state"][..], &["--exclude", "rosout"]] {
            let line = ["record", "-o", "bag"].iter().chain(wrong);
            let refused = CommandLine::try_parse_from(line).err().unwrap();
            assert_eq!(refused.exit_code(), 2);
            let said = refused.to_string();
            assert!(said.contains(wrong[wrong.len() - 1]), "{said}");
            assert!(said.contains("must begin with /"), "{said}");
        }
    }
}
