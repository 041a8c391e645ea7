//! `abbe keystore FOLDER --scenario …`: credentials of DDS Security for the nodes of scenarios, in the layout of SROS 2.
//!
//! ```text
//! FOLDER/public/ca.cert.pem           whom all trust; identity_ca and permissions_ca are links to it
//! FOLDER/private/ca.key.pem           what makes it: keep it off the shop floor
//! FOLDER/enclaves/governance.p7s      what is protected, and how
//! FOLDER/enclaves/probe/…             key, certificate and signed permissions of the node /probe
//! ```
//!
//! A node may write and read what its ports are and nothing else ([`node_runtime::access::Access`]); `/operator` may listen to everything and
//! call every service, `/viewer` only listen. `--play BAG` adds `/replayer`, who may write the topics of that bag, the compensation too if it
//! is recorded: for a graph of its own, not for one with a machine. The authority of a keystore that `ros2 security create_keystore` made is used
//! as it is, its governance replaced by ours (why: `keystore/documents.rs`).

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Result;
use clap::Args;

#[cfg(feature = "security")]
use crate::tell::tell;

#[cfg(feature = "security")]
mod authority;
#[cfg(feature = "security")]
mod documents;
#[cfg(feature = "security")]
mod enclaves;

/// Arguments of `abbe keystore`.
#[derive(Args)]
pub struct Keystore {
    /// Folder of the keystore; it is made where there is none, and what it holds is kept.
    folder: PathBuf,
    /// Scenario whose nodes get credentials; may be given again.
    #[arg(long, required_unless_present = "play")]
    scenario: Vec<PathBuf>,
    /// Bag that `abbe play` may publish whole, `/compensation` too: not for a graph with a machine; may be given again.
    #[arg(long, value_name = "BAG")]
    play: Vec<PathBuf>,
    /// Days for which the credentials are valid.
    #[arg(long, default_value_t = 365, value_parser = clap::value_parser!(u32).range(1..=3650))]
    days: u32,
}

#[cfg(not(feature = "security"))]
impl Keystore {
    /// Says what is missing.
    ///
    /// # Errors
    /// Always: this program has no DDS Security.
    pub fn execute(self) -> Result<ExitCode> {
        anyhow::bail!(
            "keystore {} for {} scenarios, {} bags and {} days: {}",
            self.folder.display(),
            self.scenario.len(),
            self.play.len(),
            self.days,
            node_runtime::environment::EnvironmentError::NoSecurity
        )
    }
}

#[cfg(feature = "security")]
impl Keystore {
    /// Makes the keystore and the enclaves that it lacks; says which.
    ///
    /// # Errors
    /// When a scenario cannot be read or a file not be written.
    pub fn execute(self) -> Result<ExitCode> {
        use authority::{Authority, Validity};

        use reports::whole_file::WholeFolder;

        let wanted = enclaves::of(&self.scenario, &self.play)?;
        let validity = Validity::from_now(chrono::Utc::now(), self.days)?;
        let is_new = match std::fs::read_dir(&self.folder) {
            Ok(mut entries) => entries.next().is_none(),
            Err(_) => !self.folder.exists(),
        };
        // A new keystore is there whole or not at all.
        let new = is_new.then(|| WholeFolder::begin(&self.folder));
        let new = new.transpose()?;
        let keystore = new
            .as_ref()
            .map_or(self.folder.as_path(), WholeFolder::path)
            .to_owned();
        let authority = Authority::open_or_make(&keystore, &validity)?;
        let mut lines = vec![];
        for enclave in &wanted {
            let folder = authority.enclave(enclave, &validity)?;
            let folder = folder.strip_prefix(&keystore).unwrap_or(&folder);
            lines.push(format!(
                "{:32} writes {:3} topics, reads {:3}: {}",
                enclave.name,
                enclave.access.publish.len(),
                enclave.access.subscribe.len(),
                self.folder.join(folder).display()
            ));
        }
        if let Some(new) = new {
            new.finish()?;
        }
        for line in lines {
            tell!("{line}");
        }
        tell!(
            "Valid until {}. The nodes use it with\n  export ROS_SECURITY_ENABLE=true ROS_SECURITY_STRATEGY=Enforce ROS_SECURITY_KEYSTORE={}",
            validity.until.format("%Y-%m-%d"),
            std::fs::canonicalize(&self.folder)?.display()
        );
        tell!("and `ros2` besides with ROS_SECURITY_ENCLAVE_OVERRIDE=/operator (or /viewer).");
        Ok(ExitCode::SUCCESS)
    }
}
