//! `abbe run --serve`: a live view of the run.

use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;
use live_view::{DEFAULT_ADDRESS, LiveViewConfig};
use live_view_node::{Feed, Slot, View, ViewOptions, limits_of};
use node_runtime::harness::Published;
use node_runtime::{Harness, HostTime, complain, text_file};

use crate::scenario::Scenario;

/// Arguments of a live view.
#[derive(Args)]
pub struct ServeOptions {
    /// Serve a live view of the run, at `http://127.0.0.1:8642/` or at another IP address and port.
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, require_equals = true, default_missing_value = DEFAULT_ADDRESS)]
    serve: Option<String>,
    /// File with the token that browsers need; required for addresses other than loopback.
    #[arg(long, value_name = "FILE", requires = "serve")]
    token_file: Option<PathBuf>,
}

impl ServeOptions {
    /// Serves the page if asked for, and prints its address.
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
        let mut options = ViewOptions::default();
        if let Some(path) = &self.token_file {
            let file = path.display().to_string();
            let text = text_file::yaml(path).context("--token-file")?;
            config.token_file.clone_from(&file);
            options.token = Some((file, text));
        }
        for launched in &scenario.nodes {
            if launched.exec == "axis_compensation" {
                options.limits_um = limits_of(&launched.setup()?)?;
            }
        }
        let view = View::open(&config, options).context("--serve")?;
        complain!("abbe: {}", view.sentence());
        Ok(Some(view))
    }
}

/// Feeds the messages of a simulated run; nothing returns to the nodes.
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
