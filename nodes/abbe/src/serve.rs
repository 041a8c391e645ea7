//! `abbe serve`: a live view of a cell, as a node of its own on the graph.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result};
use clap::Args;
use live_view::DEFAULT_ADDRESS;
use node_runtime::Composition;
use serde_json::json;

/// The node, by the name of its folder.
const LIVE_VIEW: &str = "live_view";

/// Arguments of `abbe serve`.
#[derive(Args)]
pub struct Serve {
    /// IP address and port of the page; port 0: any free port.
    #[arg(long, default_value = DEFAULT_ADDRESS)]
    address: String,
    /// File with the token that browsers need; required for addresses other than loopback.
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,
    /// Host name of the page, beside `localhost` and IP addresses; repeatable.
    #[arg(long = "host-name", value_name = "NAME")]
    host_names: Vec<String>,
    /// Parameter file of axis_compensation with the limits to show.
    #[arg(long, value_name = "FILE")]
    compensation_file: Option<PathBuf>,
    /// Namespace of the cell's topics, such as `/mill_3`.
    #[arg(long, default_value = "/")]
    namespace: String,
}

impl Serve {
    /// Arguments of the node.
    fn arguments(&self) -> Vec<String> {
        let path = |path: &Option<PathBuf>| path.as_ref().map(|path| path.display().to_string());
        let mut given = vec![("address", json!(self.address))];
        for (key, path) in [
            ("token_file", path(&self.token_file)),
            ("compensation_file", path(&self.compensation_file)),
        ] {
            given.extend(path.map(|path| (key, json!(path))));
        }
        if !self.host_names.is_empty() {
            given.push(("host_names", json!(self.host_names)));
        }
        let mut arguments = vec!["--ros-args".to_owned()];
        for (key, value) in given {
            arguments.extend(["-p".to_owned(), format!("{key}:={value}")]);
        }
        if self.namespace != "/" {
            arguments.extend(["-r".to_owned(), format!("__ns:={}", self.namespace)]);
        }
        arguments
    }

    /// Serves until stopped.
    ///
    /// # Errors
    /// When the program has no such node.
    pub fn execute(self) -> Result<ExitCode> {
        let build = crate::node::builder(LIVE_VIEW).context(LIVE_VIEW)?;
        Ok(node_runtime::run_composed(vec![Composition {
            name: LIVE_VIEW.to_owned(),
            arguments: self.arguments(),
            build: Box::new(build),
        }]))
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use live_view::LiveViewConfig;
    use node_runtime::Setup;
    use node_runtime::arguments::Arguments;

    use super::*;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        serve: Serve,
    }

    #[test]
    fn options_reach_the_node_as_its_parameters() {
        let words = "abbe --address [::1]:0 --token-file token --host-name mill --host-name cell --namespace /mill_3";
        let line = Line::parse_from(words.split(' '));
        let arguments = Arguments::parse(line.serve.arguments()).unwrap();
        let setup = Setup::new(LIVE_VIEW, &arguments).unwrap();
        let expected = LiveViewConfig {
            address: "[::1]:0".to_owned(),
            token_file: "token".to_owned(),
            host_names: vec!["mill".to_owned(), "cell".to_owned()],
            ..LiveViewConfig::default()
        };
        assert_eq!(setup.config::<LiveViewConfig>().unwrap(), expected);
        assert_eq!(setup.namespace(), "/mill_3");
    }
}
