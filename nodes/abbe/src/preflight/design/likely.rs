//! The file of effects that are likelier than others: `--likely effects.yaml`.
//!
//! ```yaml
//! likely:
//!   - {effect: backlash, axis: X, size: 3.0, weight: 5.0}
//!   - {effect: spindle_growth}
//! ```

use std::path::Path;

use anyhow::{Context, Result, anyhow, bail};
use gap_diagnosis::design::{Likely, MOST_WEIGHT, size_limits};
use metrology::number::number;
use metrology::yaml;
use node_runtime::text_file;
use serde::Deserialize;
use twin::effects::CATALOGUE;

/// Weight of an effect that is listed without one; others count 1.
const USUAL_WEIGHT: f64 = 3.0;
/// Most entries.
const MOST_ENTRIES: usize = 1000;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    likely: Vec<Entry>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    /// Id in the catalogue.
    effect: String,
    /// What it acts on; absent: everything that it can act on.
    #[serde(default)]
    axis: Option<String>,
    /// The size to be named, in the unit of the effect's first parameter; absent: its typical one.
    #[serde(default)]
    size: Option<f64>,
    /// How much it counts.
    #[serde(default = "usual_weight")]
    weight: f64,
}

const fn usual_weight() -> f64 {
    USUAL_WEIGHT
}

/// Reads the file.
///
/// # Errors
/// With file, place, value and limit.
pub fn read(path: &Path) -> Result<Vec<Likely>> {
    let text = text_file::yaml(path).context("likely effects")?;
    let place = path.display().to_string();
    of_text(&text).map_err(|error| {
        let message = format!("{error:#}");
        anyhow!("likely effects {}", yaml::placed(&place, &text, &message))
    })
}

fn of_text(text: &str) -> Result<Vec<Likely>> {
    let file: File = yaml::read_letters(text)?;
    if file.likely.len() > MOST_ENTRIES {
        bail!(
            "likely: {} entries: at most {MOST_ENTRIES}",
            file.likely.len()
        );
    }
    for (k, entry) in file.likely.iter().enumerate() {
        if !CATALOGUE.iter().any(|kind| kind.id == entry.effect) {
            let ids: Vec<&str> = CATALOGUE.iter().map(|kind| kind.id).collect();
            bail!(
                "likely[{k}].effect = \"{}\": the catalogue has no such effect, but {}",
                entry.effect,
                ids.join(", ")
            );
        }
        let is_same = |other: &Entry| other.effect == entry.effect && other.axis == entry.axis;
        if let Some(first) = file.likely[..k].iter().position(is_same) {
            bail!(
                "likely[{k}]: {}{} is given twice, first as likely[{first}]: give it once",
                entry.effect,
                entry
                    .axis
                    .iter()
                    .map(|axis| format!(" {axis}"))
                    .collect::<String>()
            );
        }
        if !(0.0..=MOST_WEIGHT).contains(&entry.weight) {
            bail!(
                "likely[{k}].weight = {}: must be from 0 to {}",
                number(entry.weight),
                number(MOST_WEIGHT)
            );
        }
        if let (Some(size), Some([least, greatest])) = (entry.size, size_limits(&entry.effect))
            && !(least..=greatest).contains(&size)
        {
            bail!(
                "likely[{k}].size = {}: must be from {} to {}, the sizes of {}; leave it out for its usual size",
                number(size),
                number(least),
                number(greatest),
                entry.effect
            );
        }
    }
    let likely = file.likely.into_iter().map(|entry| Likely {
        effect: entry.effect,
        axis: entry.axis,
        size: entry.size,
        weight: entry.weight,
    });
    Ok(likely.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_entry_that_means_nothing_is_named_with_its_place() {
        let of = |entry: &str| of_text(&format!("likely:\n  - {entry}\n"));
        let all = of("{effect: backlash, axis: X, size: 3.0}").unwrap();
        assert_eq!(all[0].size, Some(3.0));
        assert!((all[0].weight - USUAL_WEIGHT).abs() < 1e-12);
        for (entry, words) in [
            (
                "{effect: rust}",
                "likely[0].effect = \"rust\": the catalogue",
            ),
            ("{effect: backlash, weight: 200.0}", "from 0 to 100"),
            ("{effect: backlash, size: -1.0}", "likely[0].size"),
            (
                "{effect: backlash, axis: X, size: 3.0}\n  - {effect: backlash, axis: X}",
                "likely[1]: backlash X is given twice, first as likely[0]",
            ),
            (
                "{effect: backlash}\n  - {effect: backlash, weight: 1.0}",
                "likely[1]: backlash is given twice",
            ),
            ("{effect: backlash, width: 1.0}", "width"),
        ] {
            let error = format!("{:#}", of(entry).unwrap_err());
            assert!(error.contains(words), "{entry}: {error}");
        }
        for size in ["0.0", "-3.0", ".nan", ".inf", "1e25", "1e-300"] {
            for kind in CATALOGUE.iter() {
                let entry = format!("{{effect: {}, size: {size}}}", kind.id);
                let error = format!("{:#}", of(&entry).unwrap_err());
                assert!(error.starts_with("likely[0].size = "), "{entry}: {error}");
                assert!(error.contains("must be from "), "{entry}: {error}");
            }
        }
    }

    #[test]
    fn a_file_is_named_with_line_and_column() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("likely.yaml");
        let text = "likely:\n  - {effect: spindle_growth}\n  - {effect: backlash, size: 1e25}\n";
        std::fs::write(&path, text).unwrap();
        let error = format!("{:#}", read(&path).unwrap_err());
        assert!(error.contains("likely.yaml:3:"), "{error}");
        assert!(
            error.contains("likely[1].size = 1e25: must be from "),
            "{error}"
        );
    }
}
