//! `abbe import-map SOURCE`: what an MTConnect agent or an OPC UA server has, as a mapping to go over by hand.

use std::path::Path;
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use clap::Args;
use mtconnect_bridge::document::{self, Answer};
use mtconnect_bridge::{io, proposal};
use node_runtime::{complain, text_file};

use crate::tell::tell;

/// What to name as the source.
const PROBE: &str = "name the agent's probe document, http://HOST:PORT/probe, or a file of it";

/// Arguments of `abbe import-map`.
#[derive(Args)]
pub struct ImportMap {
    /// The agent's answer to `probe`: `http://host:port/probe`, or a file that holds it; or an OPC UA server:
    /// `opc.tcp://host:port`.
    source: String,
    /// Device among those of the agent: its name; needed where there are several.
    #[arg(long)]
    device: Option<String>,
}

/// Refuses an address that is not read here; a password in it is not printed.
fn check_address(source: &str) -> Result<()> {
    let Some((scheme, rest)) = source.split_once("://") else {
        return Ok(());
    };
    let host = rest.split('/').next().unwrap_or_default();
    if host.contains('@') {
        bail!("{scheme}://...@...: a user name in the address is not sent: {PROBE}");
    }
    if scheme != "http" {
        bail!(
            "{source}: {scheme}:// is not read, but http:// and opc.tcp:// are: save the answer to `probe` by another program, and \
             name its file"
        );
    }
    Ok(())
}

impl ImportMap {
    /// Prints the mapping.
    ///
    /// # Errors
    /// When nobody answers, the file cannot be read, the answer is not one to `probe`, or it has several devices.
    pub fn execute(self) -> Result<ExitCode> {
        if self.source.starts_with("opc.tcp://") {
            return self.of_server();
        }
        check_address(&self.source)?;
        let text = if self.source.starts_with("http://") {
            io::http::fetch(&self.source)?
        } else {
            text_file::bytes(Path::new(&self.source)).context("probe")?
        };
        let answer = document::read(&text)
            .with_context(|| format!("{}: is no MTConnect document; {PROBE}", self.source))?;
        let Answer::Devices { devices, items, .. } = answer else {
            bail!(
                "{}: is an MTConnect document, but no answer to `probe` (MTConnectDevices); {PROBE}",
                self.source
            );
        };
        let items = proposal::of_device(&devices, &items, self.device.as_deref())
            .with_context(|| format!("probe {}", self.source))?;
        let proposal = proposal::propose(&items);
        let text = proposal::text_of(&proposal).context("mapping")?;
        tell!("{}", text.trim_end_matches('\n'));
        let (ignored, left_out) = (proposal.ignored.len(), proposal.left_out.len());
        complain!(
            "{}: {} of {} data items have a meaning here, {ignored} are ignored and {left_out} left out (listed at the end); names and units are to be gone over",
            self.source,
            proposal.map.values.len() - ignored,
            items.len(),
        );
        Ok(ExitCode::SUCCESS)
    }

    /// Prints the mapping of an OPC UA server.
    ///
    /// # Errors
    /// When a device is named, the server does not answer or let us in, or the program was built without OPC UA.
    fn of_server(&self) -> Result<ExitCode> {
        if self.device.is_some() {
            bail!("--device: belongs to an MTConnect agent; an OPC UA server has no devices");
        }
        let survey = opcua_bridge::io::survey(&self.source)?;
        let proposal = opcua_bridge::proposal::propose(&survey);
        let text = opcua_bridge::proposal::text_of(&proposal).context("mapping")?;
        tell!("{}", text.trim_end_matches('\n'));
        let stopped = survey.stopped.as_ref();
        let stopped = stopped.map_or_else(String::new, |why| {
            format!("; the search ended before all was seen: {why}")
        });
        complain!(
            "{}: {} of {} variables have a meaning here, {} are left out (listed at the end); names, units and axes are to be gone over{stopped}",
            self.source,
            proposal.map.values.len(),
            survey.variables.len(),
            proposal.left_out.len(),
        );
        Ok(ExitCode::SUCCESS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_that_are_not_read_are_refused_and_passwords_not_printed() {
        for (source, words) in [
            (
                "https://host/probe",
                "https:// is not read, but http:// and opc.tcp:// are",
            ),
            ("ftp://x", "ftp:// is not read"),
            (
                "http://user:secret@host:1/probe",
                "a user name in the address",
            ),
            ("https://user:secret@host", "a user name in the address"),
        ] {
            let refused = check_address(source).unwrap_err().to_string();
            assert!(refused.contains(words), "{refused}");
            assert!(!refused.contains("secret"), "{refused}");
        }
        for source in [
            "http://host:5000/probe",
            "probe.xml",
            "http://host/a@b",
            "./a:b",
        ] {
            assert!(check_address(source).is_ok(), "{source}");
        }
    }
}
