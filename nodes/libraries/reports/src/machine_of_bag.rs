//! The machine file that a bag holds, as reports and pages read it.

use anyhow::{Result, anyhow};
use machine::MachineFile;
use metrology::text::{self, Comments};
use recorder::{Bag, MACHINE_FILE};

/// The machine file with its text; `None` where the bag has none.
///
/// # Errors
/// When it is absent though it was recorded, is not the recorded one, or cannot be read.
pub fn of(bag: &Bag) -> Result<Option<(MachineFile, String)>> {
    let Some(attached) = bag.attachment(MACHINE_FILE)? else {
        return Ok(None);
    };
    let text = text::decode(&attached.data, Comments::Yaml)
        .map_err(|wrong| anyhow!("{MACHINE_FILE}:{wrong}"))?;
    let machine = MachineFile::parse(&text, "machine.yaml of the bag")?;
    Ok(Some((machine, text)))
}
