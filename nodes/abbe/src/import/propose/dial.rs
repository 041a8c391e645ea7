//! Readings of a dial gauge at positions: deviations, whatever their column is called.

use std::fmt::Write as _;

use super::super::recognise::{Known, Recognised, Role};
use super::super::stated::quoted;
use super::super::units::Unit;
use super::super::vocabulary::words;
use super::Text;

/// Readings below this share of the range of the targets are deviations and no positions.
const SMALL_SHARE: f64 = 0.01;
/// Words for a gauge.
const OF_GAUGES: &[&str] = &[
    "dial",
    "gauge",
    "gage",
    "indicator",
    "messuhr",
    "taster",
    "comparator",
    "comparateur",
    "probe",
];

/// The column of a dial beside targets: one of that name, or readings that are small beside the positions.
pub(super) fn column(found: &Recognised) -> Option<&Known> {
    let target = found.first(Role::Target)?;
    let is_other = found.first(Role::Time).is_some()
        || found.first(Role::Deviation).is_some()
        || !found.passes().is_empty();
    if is_other {
        return None;
    }
    let is_gauge = |column: &&Known| {
        let mut words = words(&column.name).into_iter();
        words.any(|word| OF_GAUGES.contains(&word.as_str()))
    };
    let named = found.all(Role::Displacement).find(is_gauge);
    let measured = found.first(Role::Measured);
    measured.or(named).filter(|read| is_small(read, target))
}

/// Whether all readings are small beside the range of the targets, which has readings far from zero.
fn is_small(read: &Known, target: &Known) -> bool {
    let size = |column: &Known, default: Unit| column.unit.unwrap_or(default).size();
    let most = |column: &Known| {
        column
            .numbers
            .iter()
            .fold(0.0_f64, |most, n| most.max(n.abs()))
    };
    let least = target.numbers.iter().copied().fold(f64::INFINITY, f64::min);
    let greatest = target
        .numbers
        .iter()
        .copied()
        .fold(f64::NEG_INFINITY, f64::max);
    let of_target = size(target, Unit::Mm);
    let of_read = size(read, target.unit.unwrap_or(Unit::Mm));
    let range = (greatest - least) * of_target;
    !read.numbers.is_empty() && range > 0.0 && most(read) * of_read < SMALL_SHARE * range
}

impl Text<'_> {
    /// Names the column of a dial as that of the deviations.
    pub(super) fn dial(&mut self, key: &str, read: &Known) {
        let _ = writeln!(self.test, "    {key}: {}", quoted(&read.name));
        self.note(key, read);
        self.needed.push(format!(
            "column \"{}\": its readings are small beside the positions, and are read as deviations, as a dial shows them: where they count \
             against the axis turn their sign",
            read.name
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::super::of;

    fn proposed(text: &str) -> Result<(String, String), String> {
        let home = tempfile::tempdir().expect("a folder");
        let path = home.path().join("a.csv");
        std::fs::write(&path, text).expect("a file");
        let proposal = of(&path).map_err(|error| format!("{error:#}"))?;
        Ok((proposal.map, proposal.needed.join("\n")))
    }

    #[test]
    fn readings_of_a_dial_are_deviations_and_measured_positions_stay_so() {
        for (head, separator) in [
            ("Position mm,Reading mm", ','),
            ("Position mm;Dial um", ';'),
            ("Position mm,Gauge [mm]", ','),
        ] {
            let rows = [(0, "0.00"), (50, "0.01"), (100, "0.02"), (150, "0.02")];
            let rows = rows.map(|(mm, reading)| format!("{mm}{separator}{reading}\n"));
            let (map, needed) = proposed(&format!("{head}\n{}", rows.concat())).expect(head);
            assert!(map.contains("    deviation_um: "), "{map}");
            assert!(needed.contains("small beside the positions"), "{needed}");
        }
        let (map, _) = proposed("Position mm,Reading mm\n0,0.001\n50,50.002\n100,100.001\n")
            .expect("positions");
        assert!(map.contains("    measured_mm: "), "{map}");
    }
}
