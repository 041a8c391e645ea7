//! A machine file with effects added, its comments and its order kept where that is possible.

use anyhow::{Context, Result};
use machine::MachineFile;
use machine::file::EffectEntry;
use twin::effects;

/// The text of a machine file with more known effects.
///
/// # Errors
/// When the text is no machine file, or the catalogue does not know an effect.
pub fn with_effects(text: &str, name: &str, added: &[EffectEntry]) -> Result<String> {
    let mut wanted = MachineFile::parse(text, name)?;
    let added: Vec<EffectEntry> = added.iter().map(rounded).collect();
    wanted.effects.extend(added.iter().cloned());
    effects::known(&wanted)?;
    let edited = edited(text, &added);
    if MachineFile::parse(&edited, name).is_ok_and(|read| read == wanted) {
        return Ok(edited);
    }
    serde_saphyr::to_string(&wanted).context("machine file")
}

/// An entry with values of five digits, far below what they are known to.
fn rounded(effect: &EffectEntry) -> EffectEntry {
    let mut rounded = effect.clone();
    for value in rounded.parameters.values_mut() {
        *value = format!("{value:.4e}").parse().unwrap_or(*value);
    }
    rounded
}

/// The text with entries behind those of its list.
fn edited(text: &str, added: &[EffectEntry]) -> String {
    let entries: Vec<String> = added.iter().map(entry).collect();
    if entries.is_empty() {
        return text.to_owned();
    }
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    match lines.iter().position(|line| line.starts_with("effects:")) {
        None => {
            lines.push("effects:".to_owned());
            lines.extend(entries);
        }
        Some(at) => {
            let is_empty = lines[at].trim_end().ends_with("[]");
            if is_empty {
                "effects:".clone_into(&mut lines[at]);
            }
            let belongs = |line: &&String| line.starts_with([' ', '-', '#']) && !is_empty;
            let n = lines[at + 1..].iter().take_while(belongs).count();
            lines.splice(at + 1 + n..at + 1 + n, entries);
        }
    }
    lines.join("\n") + "\n"
}

fn entry(effect: &EffectEntry) -> String {
    let axis = effect.axis.iter().map(|axis| format!(", axis: {axis}"));
    let values = effect.parameters.iter();
    let values = values.map(|(name, value)| format!(", {name}: {value:?}"));
    let rest: String = axis.chain(values).collect();
    format!("  - {{kind: {}{rest}}}", effect.kind)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MACHINE: &str = include_str!("../../../../launch_configs/gap_first/machine.yaml");

    fn backlash(width_um: f64) -> EffectEntry {
        EffectEntry {
            kind: "backlash".to_owned(),
            axis: Some("X".to_owned()),
            parameters: [("width_um".to_owned(), width_um)].into(),
        }
    }

    #[test]
    fn effects_are_added_and_comments_stay() {
        let once = with_effects(MACHINE, "m", &[backlash(5.9)]).expect("a file");
        let twice = with_effects(&once, "m", &[backlash(-1.0)]).expect("a file");
        assert!(twice.starts_with("# Three-axis"));
        let read = MachineFile::parse(&twice, "m").expect("a machine");
        let mut wanted = MachineFile::parse(MACHINE, "m").expect("a machine").effects;
        wanted.extend([backlash(5.9), backlash(-1.0)]);
        assert_eq!(read.effects, wanted);
    }

    #[test]
    fn an_effect_that_the_catalogue_does_not_know_is_refused() {
        let mut unknown = backlash(1.0);
        "play".clone_into(&mut unknown.kind);
        assert!(with_effects(MACHINE, "m", &[unknown]).is_err());
    }
}
