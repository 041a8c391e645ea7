//! `abbe run --serve`: a live view of the run.

use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;
use live_view::{DEFAULT_ADDRESS, LiveViewConfig};
use live_view_node::{Feed, Given, Slot, View, limits_of};
use node_runtime::arguments::Arguments;
use node_runtime::harness::Published;
use node_runtime::{Harness, HostTime, Setup, complain, text_file};

use crate::scenario::Scenario;

/// Arguments of a live view.
#[derive(Args)]
pub struct Served {
    /// Serve a live view of the run, at `http://127.0.0.1:8642/` or at another address and port, by number.
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, require_equals = true, default_missing_value = DEFAULT_ADDRESS)]
    serve: Option<String>,
    /// File with the token that browsers must have; required where other computers reach the address.
    #[arg(long, value_name = "FILE", requires = "serve")]
    token_file: Option<PathBuf>,
}

impl Served {
    /// The page, where one is wanted; where it is, is told.
    ///
    /// # Errors
    /// When the address or the token is wrong, or the program was built without the server.
    pub fn open(&self, scenario: &Scenario) -> Result<Option<View>> {
        let Some(address) = &self.serve else {
            return Ok(None);
        };
        let mut config = LiveViewConfig {
            address: address.clone(),
            ..LiveViewConfig::default()
        };
        let mut given = Given::default();
        if let Some(path) = &self.token_file {
            let file = path.display().to_string();
            let text = text_file::yaml(path).context("--token-file")?;
            config.token_file.clone_from(&file);
            given.token = Some((file, text));
        }
        for launched in &scenario.nodes {
            if launched.exec == "axis_compensation" {
                let arguments = Arguments::parse(launched.ros_args())?;
                let setup = Setup::new(&launched.exec, &arguments)?;
                given.limits_um = limits_of(&setup)?;
            }
        }
        let view = View::open(&config, given).context("--serve")?;
        complain!("abbe: {}", view.sentence());
        Ok(Some(view))
    }
}

/// Shows what nodes in simulated time say; nothing of it comes back to them.
pub fn feed(harness: &mut Harness, feed: &Feed) {
    let topics = harness.topics();
    let slots: Vec<Option<Slot>> = topics.map(|port| Feed::slot(&port.topic)).collect();
    let (feed, time) = (feed.clone(), HostTime::default());
    harness.observe(Box::new(move |published: Published<'_>| {
        if let Some(Some(slot)) = slots.get(published.topic) {
            feed.take(slot, time.now(), published.bytes);
        }
    }));
}
