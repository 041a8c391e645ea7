//! `abbe record -o DIR [TOPICS…]`: the network into a bag, until SIGINT.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use node_runtime::Interruption;
use recorder::{ChunkCompression, NodeConfig, RecorderConfig};

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
    /// Folder of the bag; it must not exist.
    #[arg(short, long)]
    output: PathBuf,
    /// Compression inside the chunks.
    #[arg(long, value_enum, default_value = "zstd")]
    compression: Compression,
    /// A new file is begun at this size, bytes; 0: one file.
    #[arg(long, default_value_t = 0)]
    max_file_bytes: u64,
    /// Absolute names of topics, `*` stands for any run of characters; none: every topic.
    topics: Vec<String>,
}

/// The recorder's own name on the graph.
const NAME: &str = "abbe_record";
/// Between two looks at whether it is over; a signal wakes it at once.
const A_WHILE: Duration = Duration::from_secs(60);
/// Exit code for a bag that has not all that was said.
const DONE_WITH_LOSS: u8 = 3;

impl Record {
    /// Records until SIGINT or SIGTERM; exit code 3 when the bag lost something.
    ///
    /// # Errors
    /// When the bag cannot be begun, or there is no network.
    pub fn execute(self) -> Result<ExitCode> {
        let interruption = Interruption::listen("the bag is being closed")?;
        let bag = self.output.to_str().context("--output: must be UTF-8")?;
        let config = NodeConfig {
            bag: bag.to_owned(),
            topics: if self.topics.is_empty() {
                vec!["*".to_owned()]
            } else {
                self.topics
            },
            writing: RecorderConfig {
                compression: match self.compression {
                    Compression::None => ChunkCompression::None,
                    Compression::Lz4 => ChunkCompression::Lz4,
                    Compression::Zstd => ChunkCompression::Zstd,
                },
                max_file_bytes: self.max_file_bytes,
                ..RecorderConfig::default()
            },
        };
        let capture = recorder_node::record(&config, NAME)?;
        eprintln!("Recording into {bag}; Ctrl-C ends it.");
        while !interruption.wait(A_WHILE) {}
        let captured = capture.finish()?;
        for word in &captured.unrecorded {
            eprintln!("abbe: {word}");
        }
        let lost = captured.stats.messages_lost + captured.lost_on_network;
        println!(
            "{bag}: {} messages, {lost} lost",
            captured.stats.messages_written
        );
        captured.bag?;
        Ok(if lost == 0 {
            ExitCode::SUCCESS
        } else {
            ExitCode::from(DONE_WITH_LOSS)
        })
    }
}
