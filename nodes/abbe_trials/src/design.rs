//! `abbe preflight --design` of the same build, as a process that is given a machine file and minutes alone.
//!
//! The same input gives the same programme: a folder keeps what was designed, by build, machine file and minutes.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};
use node_runtime::text_file;
use sequencer::Plan;
use sha2::{Digest, Sha256};
use trials::designed::Programme;

/// Instruments that are at hand.
const AT_HAND: &str = "grid,laser,probe,thermometers";
/// Bytes of a hash that name a design.
const NAMED_BY: usize = 8;

/// The programme for a machine file, in a series' folder.
///
/// # Errors
/// When none can be designed, with what the process says, or it cannot be read.
pub fn programme(out: &Path, machine_text: &str, minutes: f64) -> Result<Programme> {
    let key = Sha256::digest(format!("{} {minutes} {machine_text}", abbe::COMMIT));
    let name: String = key
        .iter()
        .take(NAMED_BY)
        .map(|byte| format!("{byte:02x}"))
        .collect();
    let home = out.join("designs").join(name);
    let folder = home.join("designed");
    // A folder is there as a whole or not at all.
    if !folder.exists() {
        std::fs::create_dir_all(&home).with_context(|| format!("{}", home.display()))?;
        std::fs::write(home.join("drawn.yaml"), machine_text)?;
        design(&home, minutes)?;
    }
    read(&folder)
}

fn design(home: &Path, minutes: f64) -> Result<()> {
    let program = std::env::current_exe().context("path of this program")?;
    let output = Command::new(program)
        .args(["preflight", "--design", "--machine", "drawn.yaml"])
        .args(["--minutes", &minutes.to_string(), "--with", AT_HAND])
        .args(["-o", "designed", "--json"])
        .current_dir(home)
        .stdin(Stdio::null())
        .output()
        .context("abbe preflight --design")?;
    if !output.status.success() {
        let told = String::from_utf8_lossy(&output.stderr);
        bail!(
            "abbe preflight --design: {}: {}",
            output.status,
            told.trim()
        );
    }
    Ok(())
}

/// Plan and part programs of a folder.
///
/// # Errors
/// When one cannot be read.
pub fn read(folder: &Path) -> Result<Programme> {
    let plan = Plan::from_yaml(&text_file::yaml(&folder.join("plan.yaml"))?)?;
    let entries = std::fs::read_dir(folder).with_context(|| format!("{}", folder.display()))?;
    let mut programs = BTreeMap::new();
    for entry in entries {
        let path = entry?.path();
        if path.extension().is_some_and(|ending| ending == "ngc") {
            let text = text_file::read(&path, text_file::Comments::Gcode)?;
            let name = path.file_name().unwrap_or_default();
            let _ = programs.insert(name.to_string_lossy().into_owned(), text);
        }
    }
    Ok(Programme { plan, programs })
}
