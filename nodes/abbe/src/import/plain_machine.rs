//! A machine of which nothing is stated but what a table shows: axes, travels, thermometers.

use std::fmt::Write;

use metrology::Axis;

use super::map::{Map, Test};

/// Name of the machine that a table is evaluated on where none is stated.
pub const NO_MACHINE: &str = "not_stated";

/// Travel that holds any table, mm.
const ANY_TRAVEL_MM: [f64; 2] = [-100_000.0, 100_000.0];

/// Words in names of thermometers, with the place that they are at; the first row with one of them counts.
const PLACES_BY_WORD: [(&[&str], &str); 4] = [
    (
        &[
            "column", "ständer", "staender", "säule", "saeule", "montant",
        ],
        "column",
    ),
    (
        &["bed", "base", "table", "bett", "tisch", "gestell", "bati"],
        "bed",
    ),
    (
        &[
            "spindle",
            "spindel",
            "nose",
            "headstock",
            "head",
            "spindelkopf",
            "bearing",
            "lager",
            "spindellager",
            "broche",
        ],
        "spindle_front",
    ),
    (
        &[
            "ambient", "air", "room", "hall", "shop", "umgebung", "luft", "raum", "halle",
            "ambiante",
        ],
        "ambient",
    ),
];
/// Words for the rear end of a spindle.
const REAR: [&str; 6] = ["rear", "back", "hinten", "hinteres", "hinterer", "hintere"];
/// Words for the nut or the screw of an axis.
const NUTS: [&str; 4] = ["nut", "screw", "mutter", "spindelmutter"];
/// The place of a thermometer whose name has none: no effect of the catalogue goes with it in a log, but the shift with that thermometer.
pub const UNKNOWN_PLACE: &str = "nut_x";
/// The place that stands for any where nothing goes by it.
const ANY_PLACE: &str = "ambient";

/// Such a machine.
pub struct PlainMachine {
    /// Its name.
    pub name: &'static str,
    /// Travels of X, Y and Z, mm.
    pub travels_mm: [[f64; 2]; 3],
    /// Rotary axes, whose tables lie on one another, the first below.
    pub rotary: Vec<Axis>,
    /// Thermometers with the places that they are at.
    pub sensors: Vec<(String, &'static str)>,
}

impl PlainMachine {
    /// One that is wide enough for any table that a map describes.
    pub fn of_map(map: &Map) -> Self {
        let (axis, sensors) = match &map.test {
            Test::Positioning { axis, .. } => (*axis, vec![]),
            Test::Circle { .. } | Test::Touches { .. } => (Axis::X, vec![]),
            Test::Log {
                axis,
                temperature_degc,
                ..
            } => (*axis, temperature_degc.keys().cloned().collect()),
        };
        Self {
            name: NO_MACHINE,
            travels_mm: [ANY_TRAVEL_MM; 3],
            rotary: Some(axis)
                .filter(|axis| !axis.is_linear())
                .into_iter()
                .collect(),
            sensors: { sensors.into_iter() }
                .map(|id: String| (id, ANY_PLACE))
                .collect(),
        }
    }

    /// Its machine file.
    pub fn text(&self) -> String {
        let rotary = "{travel_deg: [-3600.0, 3600.0], feed_limit_deg_min: 1000000.0, acceleration_limit_deg_s2: 1000.0, position_gain_per_s: 40.0, velocity_feedforward: 0.98, encoder_resolution_arcsec: 0.1}";
        let tables: String = self
            .rotary
            .iter()
            .rev()
            .map(|axis| format!(" {axis}'"))
            .collect();
        let mut text = format!(
            "name: {}\nchain: \"[w{tables} X' Y' b Z t]\"\naxes:\n",
            self.name
        );
        // Writing to a String never fails.
        for (axis, [least, greatest]) in Axis::LINEAR.iter().zip(self.travels_mm) {
            let _ = writeln!(
                text,
                "  {axis}: {{travel_mm: [{least:?}, {greatest:?}], feed_limit_mm_min: 1000000.0}}"
            );
        }
        for axis in &self.rotary {
            let _ = writeln!(text, "  {axis}: {rotary}");
        }
        if !self.rotary.is_empty() {
            text.push_str("rotary:\n  origin_mm:\n");
        }
        for axis in &self.rotary {
            let _ = writeln!(text, "    {axis}: [0.0, 0.0, 0.0]");
        }
        if !self.sensors.is_empty() {
            text.push_str("temperature_sensors:\n");
        }
        for (id, place) in &self.sensors {
            let _ = writeln!(text, "  - {{id: {id}, place: {place}, period_s: 10.0}}");
        }
        text
    }
}

/// The place in a thermometer's name, by its words; `None`: none.
pub fn place_in_name(id: &str) -> Option<&'static str> {
    let id = id.to_lowercase();
    let words: Vec<&str> = id.split(|letter: char| !letter.is_alphanumeric()).collect();
    let has = |all: &[&str]| words.iter().any(|word| all.contains(word));
    if has(&NUTS) {
        return [("x", "nut_x"), ("y", "nut_y"), ("z", "nut_z")]
            .into_iter()
            .find_map(|(letter, place)| has(&[letter]).then_some(place));
    }
    let known = PLACES_BY_WORD.iter().find(|(all, _)| has(all));
    let place = known.map(|(_, place)| *place);
    match place {
        Some("spindle_front") if has(&REAR) => Some("spindle_rear"),
        place => place,
    }
}

#[cfg(test)]
mod tests {
    use machine::MachineFile;

    use super::*;

    #[test]
    fn a_plain_machine_is_a_machine_file_with_its_axes_and_thermometers() {
        let plain = PlainMachine {
            name: "mill",
            travels_mm: [[-10.0, 510.0], [-250.0, 250.0], [0.0, 400.0]],
            rotary: vec![Axis::A, Axis::C],
            sensors: vec![("rear_bearing".to_owned(), "spindle_rear")],
        };
        let machine = MachineFile::parse(&plain.text(), "machine.yaml").unwrap();
        assert_eq!(machine.axes.len(), 5);
        let travel_mm = machine.linear(Axis::X).unwrap().travel_mm;
        assert_eq!(format!("{travel_mm:?}"), "[-10.0, 510.0]");
        assert_eq!(machine.temperature_sensors[0].id, "rear_bearing");
    }

    #[test]
    fn a_thermometer_is_at_the_place_in_its_name() {
        for (id, place) in [
            ("spindle_front", Some("spindle_front")),
            ("Spindle rear", Some("spindle_rear")),
            ("rear_bearing", Some("spindle_rear")),
            ("Spindellager hinten", Some("spindle_rear")),
            ("spindel_c", Some("spindle_front")),
            ("T_column", Some("column")),
            ("rear_column", Some("column")),
            ("nut_y", Some("nut_y")),
            ("x_nut", Some("nut_x")),
            ("screw-Z", Some("nut_z")),
            ("nut", None),
            ("ambient_2", Some("ambient")),
            ("Umgebung", Some("ambient")),
            ("stable", None),
            ("overhead", None),
            ("rear", None),
            ("T7", None),
            ("spindle_1_no_2", Some("spindle_front")),
        ] {
            assert_eq!(place_in_name(id), place, "{id}");
        }
    }
}
