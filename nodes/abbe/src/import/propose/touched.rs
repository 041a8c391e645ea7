//! Three columns of positions, as a list of touches has them.

use anyhow::{Result, bail};
use metrology::Axis;

use super::super::recognise::{Known, Recognised, Role, parts};
use super::super::units::{Kind, Unit};
use super::super::vocabulary::words;
use super::Text;

/// Words of a name of a position beside the letter of its axis.
const BESIDE_LETTERS: &[&str] = &[
    "axis",
    "achse",
    "pos",
    "position",
    "coord",
    "coordinate",
    "koordinate",
    "probe",
    "probed",
    "touch",
    "point",
    "punkt",
    "machine",
    "actual",
    "ist",
    "measured",
    "value",
    "wert",
    "contact",
    "trigger",
];
/// Begins of words of a column that names what was touched.
const OF_FEATURES: &[&str] = &[
    "feature", "element", "merkmal", "artefact", "artifact", "sphere", "kugel",
];
/// Lengths with times are positions and no displacements where they spread so far, or lie so far from zero, mm.
const FAR_APART_MM: f64 = 1.0;
const FAR_OFF_MM: f64 = 10.0;

/// Columns of X, Y and Z; `None` of any other table, such as a log of three sensors.
pub(super) fn columns(found: &Recognised) -> Option<[&Known; 3]> {
    let of = |axis: Axis| {
        let mut own = found
            .columns
            .iter()
            .filter(|column| axis_of(&column.name) == Some(axis));
        let first = own.next().filter(|column| !column.numbers.is_empty())?;
        own.next().is_none().then_some(first)
    };
    let all = [of(Axis::X)?, of(Axis::Y)?, of(Axis::Z)?];
    let is_small = |column: &&Known| matches!(column.unit, Some(Unit::Um | Unit::Nm | Unit::Uin));
    let is_other = |column: &&Known| column.unit.is_some_and(|unit| unit.kind() != Kind::Length);
    let has_time = found.first(Role::Time).is_some();
    if all
        .iter()
        .any(|column| is_small(column) || is_other(column))
        || has_time && !are_far(&all)
    {
        return None;
    }
    Some(all)
}

/// The axis whose letter a name of a position has.
fn axis_of(name: &str) -> Option<Axis> {
    let (all, note) = parts(name);
    let note = note.filter(|note| Unit::of_word(note).is_none());
    let all = all
        .into_iter()
        .chain(note.iter().flat_map(|note| words(note)));
    let mut axis = None;
    for word in all {
        let letter = ["pos", "position"]
            .iter()
            .fold(word.as_str(), |word, part| {
                word.strip_prefix(part)
                    .or_else(|| word.strip_suffix(part))
                    .filter(|rest| rest.len() == 1)
                    .unwrap_or(word)
            });
        match (letter, axis) {
            ("x", None) => axis = Some(Axis::X),
            ("y", None) => axis = Some(Axis::Y),
            ("z", None) => axis = Some(Axis::Z),
            (other, _) if BESIDE_LETTERS.contains(&other) => {}
            _ => return None,
        }
    }
    axis
}

fn are_far(columns: &[&Known; 3]) -> bool {
    columns.iter().any(|column| {
        let mm = column.unit.map_or(1.0, Unit::size);
        let ends = column
            .numbers
            .iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], one| {
                [low.min(one * mm), high.max(one * mm)]
            });
        let [low, high] = ends;
        high - low > FAR_APART_MM || low > FAR_OFF_MM || high < -FAR_OFF_MM
    })
}

impl Text<'_> {
    /// The map of a list of touches.
    pub(super) fn touches(&mut self, axes: [&Known; 3]) -> Result<()> {
        let found = self.found;
        self.test.push_str("  touches:\n");
        let [first, others @ ..] = axes;
        if let Some(other) = others.into_iter().find(|other| other.unit != first.unit) {
            let unit = |column: &Known| column.unit.map_or("no unit", Unit::name);
            bail!(
                "columns \"{}\" ({}) and \"{}\" ({}): the axes of a list of touches have one unit: correct the names, or write a map",
                first.name,
                unit(first),
                other.name,
                unit(other)
            );
        }
        for (key, column) in ["x_mm", "y_mm", "z_mm"].into_iter().zip(axes) {
            self.column(key, column);
            if column.unit.is_some() || column.unknown.is_some() {
                self.unit(column, Unit::Mm, None)?;
            }
        }
        if first.unit.is_none() {
            self.needed.push(format!(
                "column \"{}\" and those of Y and Z: no unit, read in mm; where they are inches state it in units of a map",
                first.name
            ));
        }
        if let Some(run) = found.first(Role::Run) {
            self.column("run", run);
        }
        let is_of_features = |column: &&Known| {
            let own = words(&column.name);
            let is_one = |word: &String| OF_FEATURES.iter().any(|begin| word.starts_with(begin));
            own.iter().any(is_one) && column.role != Some(Role::Run)
        };
        if let Some(feature) = found.columns.iter().find(is_of_features) {
            self.column("feature", feature);
        }
        if let Some(time) = found.first(Role::Time) {
            self.column("time_s", time);
            if let Some(dates) = &found.date_column {
                self.used.push(dates.clone());
            }
            match super::epochs::of_first(time)? {
                Some(first_s) => self.start_s = first_s,
                None => self.time_unit(time)?,
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::recognise::of_text;
    use super::*;

    #[test]
    fn three_columns_of_positions_are_touches_and_sensors_of_drift_are_none() {
        let rows = "150.1,20.2,-45.3\n150.2,20.4,-45.1\n150.0,20.1,-45.2\n";
        for head in [
            "x,y,z",
            "X,Y,Z",
            "x_mm,y_mm,z_mm",
            "X [mm],Y [mm],Z [mm]",
            "X pos,Y pos,Z pos",
            "posX,posY,posZ",
            "X (inch),Y (inch),Z (inch)",
            "Achse X,Achse Y,Achse Z",
            "X Position,Y Position,Z Position",
        ] {
            let found = of_text(&format!("{head}\n{rows}")).unwrap().unwrap();
            assert!(columns(&found).is_some(), "{head}");
        }
        for text in [
            format!("x_um,y_um,z_um\n{rows}"),
            format!("x,y\n{}", rows.replace(",-45", "\n")),
            format!("x,y,z speed\n{rows}"),
            "time_s,x_mm,y_mm,z_mm\n0,0.001,0.002,0.003\n60,0.002,0.003,0.005\n120,0.003,0.004,0.009\n".to_owned(),
        ] {
            let found = of_text(&text).unwrap();
            assert!(found.is_none_or(|found| columns(&found).is_none()), "{text}");
        }
        let timed: String = (0..3)
            .map(|k| format!("{k},150.1,20.{k},-45.3\n"))
            .collect();
        let found = of_text(&format!("time_s,x_mm,y_mm,z_mm\n{timed}"))
            .unwrap()
            .unwrap();
        assert!(columns(&found).is_some());
    }

    #[test]
    fn two_units_are_refused_with_both_columns() {
        let home = tempfile::tempdir().expect("a folder");
        let path = home.path().join("a.csv");
        std::fs::write(&path, "x_mm,y_inch,z_mm\n1,2,3\n2,3,4\n3,4,5\n").expect("a file");
        let said = format!("{:#}", super::super::of(&path).expect_err("two units"));
        assert!(
            said.contains("\"x_mm\" (mm) and \"y_inch\" (inch)"),
            "{said}"
        );
    }
}
